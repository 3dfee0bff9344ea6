// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/show_panel.h"

#include <imgui.h>

#include <array>
#include <cmath>
#include <string>

#include "tools/studio/shortcuts.h"
#include "tools/studio/studio_state.h"

namespace sinew::tools {
namespace {

ImU32 encoded(const std::array<float, 3>& linear) {
  const auto byte = [](float x) { return std::pow(x, 1 / 2.2F); };
  return ImGui::GetColorU32(ImVec4(byte(linear[0]), byte(linear[1]), byte(linear[2]), 1));
}

}  // namespace

void ShowPanel::draw(double frame_seconds, const PlayColors& colors, Widgets& widgets, Play& play, Shown& shown) {
  heading("Show");
  const float half = ImGui::GetContentRegionAvail().x / 2;
  widgets.checkbox("Physical mesh", shown.physical);
  tip(Command::physical);
  ImGui::SameLine(half);
  widgets.checkbox("Clusters", shown.clusters);
  tip(Command::clusters);
  widgets.checkbox("Held vertices", shown.pinned);
  ImGui::SameLine(half);
  widgets.checkbox("Contacts", shown.contacts);
  if (ImGui::IsItemHovered())
    ImGui::SetTooltip("Where it touches the ground, a collider, another body or itself: %s",
                      nameWithKeys(Command::contacts).c_str());
  std::string color = playColorNames()[std::size_t(shown.color)];
  if (widgets.combo("Colours", color, playColorNames())) {
    for (std::size_t k = 0; k < playColorNames().size(); ++k) {
      if (playColorNames()[k] == color) shown.color = PlayColor(k);
    }
  }
  if (shown.color != PlayColor::model) scale(colors, shown.color);
  section(widgets, shown.section);
  measured(frame_seconds, play);
}

void ShowPanel::scale(const PlayColors& colors, PlayColor what) {
  const bool diverges = what == PlayColor::stretch || what == PlayColor::volume;
  constexpr int kSteps = 24;
  const ImVec2 low = ImGui::GetCursorScreenPos();
  const float width = ImGui::GetContentRegionAvail().x;
  const float height = ImGui::GetTextLineHeight() * 0.6F;
  for (int i = 0; i < kSteps; ++i) {
    const float t = (float(i) + 0.5F) / kSteps;
    const auto color = diverges ? divergingColor(2 * t - 1) : heatColor(double(t));
    ImGui::GetWindowDrawList()->AddRectFilled({low.x + width * float(i) / kSteps, low.y},
                                              {low.x + width * float(i + 1) / kSteps, low.y + height}, encoded(color));
  }
  ImGui::Dummy({width, height});
  const auto text = [&](const std::string& words, float at) {
    const float room = ImGui::CalcTextSize(words.c_str()).x;
    ImGui::SameLine(0, 0);
    ImGui::SetCursorPosX(ImGui::GetWindowContentRegionMin().x + at * (width - room));
    ImGui::TextDisabled("%s", words.c_str());
  };
  ImGui::Dummy({0, 0});
  text(colors.scale().low, 0);
  text(colors.scale().middle, 0.5F);
  text(colors.scale().high, 1);
}

void ShowPanel::section(Widgets& widgets, Section& section) {
  heading("Tetrahedra");
  widgets.checkbox("Cut open", section.shown);
  tip(Command::section);
  if (!section.shown) return;
  for (int axis = 0; axis < 3; ++axis) {
    ImGui::SameLine();
    if (widgets.radio(std::array{"x", "y", "z"}[std::size_t(axis)], section.axis == axis)) section.axis = axis;
  }
  widgets.slider("Plane", section.at, 0, 1, "%.2f", false);
  widgets.checkbox("Other side", section.flip);
}

void ShowPanel::measured(double frame_seconds, const Play& play) {
  heading("Measured");
  const formats::PackageView& package = play.package();
  const float column = ImGui::GetContentRegionAvail().x * 0.5F;
  const auto row = [&](const char* what, const char* format, auto... values) {
    ImGui::TextDisabled("%s", what);
    ImGui::SameLine(column);
    ImGui::Text(format, values...);
  };
  row("frames", "%.0f /s", frame_seconds > 0 ? 1 / frame_seconds : 0.0);
  row("a step", "%.3f ms", play.times.step);
  row("surface", "%.3f ms", play.times.surface);
  row("colours, marks", "%.3f ms", play.times.colors);
  row("drawing", "%.3f ms", play.times.draw);
  row("panels", "%.3f ms", play.times.panels);
  row("kept to go back", "%.1f s, %.1f MB",
      play.timeline()[play.timeline().size() - 1].state.time() - play.timeline()[0].state.time(),
      double(play.timeline().bytes()) / 1048576.0);
  row("triangles", "%zu", package.visualTriangles().size());
  row("visual vertices", "%zu", play.shape().body_vertices);
  row("physical vertices", "%zu", play.shape().physical.size());
  row("tetrahedra", "%zu", package.tetrahedra().size());
  row("clusters", "%zu", package.clusters().size());
}

}  // namespace sinew::tools

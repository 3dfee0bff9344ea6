// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/channels_panel.h"

#include <imgui.h>

#include <array>
#include <cstdio>
#include <optional>
#include <span>

#include "tools/author/recipe_commands.h"

namespace sinew::tools {
namespace {

std::optional<std::uint32_t> channelNamed(const formats::PackageView& package, const std::string& name) {
  for (std::uint32_t c = 0; c < package.channels().size(); ++c) {
    if (package.text(package.channels()[c].name) == name) return c;
  }
  return std::nullopt;
}

}  // namespace

void ChannelsPanel::draw(Widgets& widgets, Play& play) {
  const formats::PackageView& package = play.package();
  ImGui::Spacing();
  widgets.text("Find", filter_, "part of a name");
  bool any_held = false;
  const std::span<const float> inputs = play.scene().channelInputs();
  for (std::uint32_t c = 0; c < inputs.size(); ++c) any_held |= play.scene().isHeld(c);
  if (widgets.button("Let all go", -1, any_held)) {
    for (std::uint32_t c = 0; c < inputs.size(); ++c) play.scene().holdChannel(c, std::nullopt);
  }
  widgets.checkbox("Both sides", both_sides_);
  ImGui::Separator();
  ImGui::BeginChild("##channels");
  for (std::uint32_t c = 0; c < inputs.size(); ++c) {
    const std::string name(package.text(package.channels()[c].name));
    if (name.find(filter_) == std::string::npos) continue;
    float input = inputs[c];
    const bool held = play.scene().isHeld(c);
    // Name and value above the slider: names are long, and the grab would cover them.
    const ImU32 color = ImGui::GetColorU32(held ? ImGuiCol_Text : ImGuiCol_TextDisabled);
    ImGui::PushStyleColor(ImGuiCol_Text, color);
    ImGui::TextUnformatted(name.c_str());
    std::array<char, 16> value = {};
    if (held || input > 0) std::snprintf(value.data(), value.size(), "%.2f", static_cast<double>(input));
    ImGui::SameLine();
    ImGui::SetCursorPosX(ImGui::GetContentRegionMax().x - ImGui::CalcTextSize(value.data()).x);
    ImGui::TextUnformatted(value.data());
    ImGui::PopStyleColor();
    ImGui::PushID(static_cast<int>(c));
    ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {ImGui::GetStyle().FramePadding.x, 0});
    ImGui::SetNextItemWidth(-1);
    const bool changed = ImGui::SliderFloat("##input", &input, 0, 1, "", ImGuiSliderFlags_AlwaysClamp);
    ImGui::PopStyleVar();
    widgets.mark("channel " + name);
    if (changed) {
      play.scene().holdChannel(c, input);
      if (const auto other = channelNamed(package, otherSide(name)); both_sides_ && other)
        play.scene().holdChannel(*other, input);
    }
    if (ImGui::IsItemHovered()) {
      if (ImGui::IsMouseClicked(ImGuiMouseButton_Right)) play.scene().holdChannel(c, std::nullopt);
      ImGui::SetTooltip("%s\nDrag: it stays there. Right click: the scene drives it again.", name.c_str());
    }
    ImGui::PopID();
  }
  ImGui::EndChild();
}

}  // namespace sinew::tools

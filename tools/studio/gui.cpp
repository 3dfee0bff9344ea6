// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_panel.h"

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <cmath>
#include <cstdio>
#include <optional>
#include <span>
#include <string>

#include "tools/author/recipe_commands.h"
#include "tools/render/text.h"

namespace sinew::tools {
namespace {

void styleGui(float scale) {
  ImGui::StyleColorsDark();
  ImGuiStyle& style = ImGui::GetStyle();
  style.WindowRounding = 0;
  style.FrameRounding = 4;
  style.GrabRounding = 4;
  style.PopupRounding = 4;
  style.WindowBorderSize = 0;
  style.FramePadding = {8, 5};
  style.ItemSpacing = {8, 7};
  style.WindowPadding = {16, 14};
  style.GrabMinSize = 12;
  const auto set = [&](ImGuiCol slot, float r, float g, float b, float a = 1) { style.Colors[slot] = {r, g, b, a}; };
  set(ImGuiCol_WindowBg, 0.125F, 0.137F, 0.161F);
  set(ImGuiCol_PopupBg, 0.15F, 0.165F, 0.19F);
  set(ImGuiCol_Text, 0.90F, 0.91F, 0.93F);
  set(ImGuiCol_TextDisabled, 0.58F, 0.61F, 0.66F);
  set(ImGuiCol_FrameBg, 0.20F, 0.22F, 0.255F);
  set(ImGuiCol_FrameBgHovered, 0.25F, 0.275F, 0.32F);
  set(ImGuiCol_FrameBgActive, 0.28F, 0.31F, 0.36F);
  set(ImGuiCol_Button, 0.23F, 0.26F, 0.31F);
  set(ImGuiCol_ButtonHovered, 0.30F, 0.35F, 0.43F);
  set(ImGuiCol_ButtonActive, 0.22F, 0.45F, 0.72F);
  set(ImGuiCol_Header, 0.24F, 0.36F, 0.52F);
  set(ImGuiCol_HeaderHovered, 0.28F, 0.42F, 0.60F);
  set(ImGuiCol_HeaderActive, 0.28F, 0.45F, 0.66F);
  set(ImGuiCol_SliderGrab, 0.36F, 0.60F, 0.88F);
  set(ImGuiCol_SliderGrabActive, 0.46F, 0.70F, 0.96F);
  set(ImGuiCol_CheckMark, 0.46F, 0.72F, 1.0F);
  set(ImGuiCol_Separator, 0.24F, 0.26F, 0.30F);
  style.ScaleAllSizes(scale);
}

std::optional<std::uint32_t> channelNamed(const formats::PackageView& package, const std::string& name) {
  for (std::uint32_t c = 0; c < package.channels().size(); ++c) {
    if (package.text(package.channels()[c].name) == name) return c;
  }
  return std::nullopt;
}

}  // namespace

Gui::Gui(GLFWwindow* window, float scale) {
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;
  styleGui(scale);
  ImFontConfig config;
  config.FontDataOwnedByAtlas = false;
  config.OversampleH = 3;
  const auto font = fontBytes();
  static constexpr std::array<ImWchar, 9> kRanges = {0x20, 0x17f, 0x386, 0x3ce, 0x400, 0x45f, 0x2013, 0x2265, 0};
  io.Fonts->AddFontFromMemoryTTF(const_cast<unsigned char*>(font.data()), static_cast<int>(font.size()),
                                 std::round(16 * scale), &config, kRanges.data());
  ImGui_ImplGlfw_InitForOpenGL(window, true);
  ImGui_ImplOpenGL3_Init("#version 330 core");
}
Gui::~Gui() {
  ImGui_ImplOpenGL3_Shutdown();
  ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
}

void beginPanel(const ViewLayout& layout, int height) {
  const float width = static_cast<float>(layout.panel) / layout.pixels_per_unit;
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize({width, static_cast<float>(height)});
  ImGui::Begin("##panel", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoNav);
}

void ViewPanel::draw(const ViewLayout& layout, int height, double frame_seconds, Widgets& widgets, Play& play,
                     Shown& shown) {
  const float width = static_cast<float>(layout.panel) / layout.pixels_per_unit;
  beginPanel(layout, height);
  const formats::PackageView& package = play.package();
  const std::string name(package.text(package.info().name));
  ImGui::TextUnformatted(name.empty() ? play.options().file.c_str() : name.c_str());

  if (package.channels().empty()) {
    sceneControls(width, frame_seconds, widgets, play, shown);
  } else if (ImGui::BeginTabBar("##tabs")) {
    if (ImGui::BeginTabItem("Scene")) {
      sceneControls(width, frame_seconds, widgets, play, shown);
      ImGui::EndTabItem();
    }
    if (ImGui::BeginTabItem("Channels")) {
      channels(widgets, play);
      ImGui::EndTabItem();
    }
    ImGui::EndTabBar();
  }
  ImGui::End();
}

// A slider for each input of the package: what a game would drive.
void ViewPanel::channels(Widgets& widgets, Play& play) {
  const formats::PackageView& package = play.package();
  ImGui::Spacing();
  ImGui::SetNextItemWidth(-1);
  ImGui::InputTextWithHint("##filter", "find", filter_.data(), filter_.size());
  bool any_held = false;
  const std::span<const float> inputs = play.scene().channelInputs();
  for (std::uint32_t c = 0; c < inputs.size(); ++c) any_held |= play.scene().isHeld(c);
  ImGui::BeginDisabled(!any_held);
  if (ImGui::Button("Let all go", {-1, 0})) {
    for (std::uint32_t c = 0; c < inputs.size(); ++c) play.scene().holdChannel(c, std::nullopt);
  }
  ImGui::EndDisabled();
  ImGui::Checkbox("Both sides", &both_sides_);
  ImGui::Separator();
  ImGui::BeginChild("##channels");
  for (std::uint32_t c = 0; c < inputs.size(); ++c) {
    const std::string name(package.text(package.channels()[c].name));
    if (name.find(filter_.data()) == std::string::npos) continue;
    float input = inputs[c];
    ImGui::PushID(static_cast<int>(c));
    const bool held = play.scene().isHeld(c);
    ImGui::SetNextItemWidth(-1);
    const bool changed = ImGui::SliderFloat("##input", &input, 0, 1, "", ImGuiSliderFlags_AlwaysClamp);
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
    // Name and value lie on the slider: names are long.
    const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
    const ImVec2 inner = ImGui::GetStyle().FramePadding;
    const ImU32 color = ImGui::GetColorU32(held ? ImGuiCol_Text : ImGuiCol_TextDisabled);
    std::array<char, 16> value = {};
    if (held || input > 0) std::snprintf(value.data(), value.size(), "%.2f", static_cast<double>(input));
    const float value_at = high.x - inner.x - ImGui::CalcTextSize(value.data()).x;
    ImDrawList& draw = *ImGui::GetWindowDrawList();
    draw.AddText({value_at, low.y + inner.y}, color, value.data());
    draw.PushClipRect(low, {value_at - inner.x, high.y}, true);
    draw.AddText({low.x + inner.x + ImGui::GetStyle().GrabMinSize, low.y + inner.y}, color, name.c_str());
    draw.PopClipRect();
    ImGui::PopID();
  }
  ImGui::EndChild();
}

void ViewPanel::sceneControls(float width, double frame_seconds, Widgets& widgets, Play& play, Shown& shown) {
  const formats::PackageView& package = play.package();
  heading("Scene");
  ImGui::SetNextItemWidth(-1);
  const SceneChoice scene = play.scene().options().scene;
  const bool open = ImGui::BeginCombo("##scene", scene.name().c_str());
  widgets.mark("Scene choice");
  if (open) {
    if (play.options().scene.script &&
        ImGui::Selectable(play.options().scene.name().c_str(), scene.script != nullptr)) {
      play.start(play.options().scene);
    }
    for (std::size_t k = 0; k < sceneNames().size(); ++k) {
      const SceneChoice other = static_cast<SceneKind>(k);
      if (widgets.selectable(std::string(sceneNames()[k]), scene == other)) play.start(other);
    }
    ImGui::EndCombo();
  }
  const float third = (ImGui::GetContentRegionAvail().x - 2 * ImGui::GetStyle().ItemSpacing.x) / 3;
  if (widgets.button(play.playing ? "Pause" : "Play", third)) play.playing = !play.playing;
  ImGui::SameLine();
  if (widgets.button("Step", third)) play.stepPaused();
  ImGui::SameLine();
  if (widgets.button("Reset", third)) play.restart();

  heading("Show");
  widgets.checkbox("Physical mesh", shown.physical);
  widgets.checkbox("Clusters", shown.clusters);
  widgets.checkbox("Held vertices", shown.pinned);

  heading("Settings");
  ImGui::PushItemWidth(ImGui::GetContentRegionAvail().x * 0.5F);
  bool changed = ImGui::SliderFloat("gravity", &play.settings.gravity, 0, 3, "%.2f x");
  changed |= ImGui::SliderInt("iterations", &play.settings.iterations, 1, 16);
  changed |= ImGui::SliderFloat("air damping", &play.settings.damping, 0, 10, "%.2f /s", ImGuiSliderFlags_Logarithmic);
  changed |= ImGui::SliderFloat("inner friction", &play.settings.deformation_damping, 0, 1, "%.2f of critical");
  if (changed) play.applySettings();
  ImGui::SliderFloat("stiffness", &play.settings.stiffness, 0.05F, 20, "%.2f x", ImGuiSliderFlags_Logarithmic);
  if (ImGui::IsItemDeactivatedAfterEdit()) play.restart();
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("Multiplies every cluster's frequencies; the scene starts again.");
  ImGui::PopItemWidth();

  heading("Measured");
  const auto row = [&](const char* what, const char* format, auto... values) {
    ImGui::TextDisabled("%s", what);
    ImGui::SameLine(width * 0.5F);
    ImGui::Text(format, values...);
  };
  row("frames", "%.0f /s", frame_seconds > 0 ? 1 / frame_seconds : 0.0);
  row("step", "%.3f ms", play.stepMilliseconds());
  row("time", "%.2f s", play.scene().time());
  row("triangles", "%zu", package.visualTriangles().size());
  row("visual vertices", "%zu", play.shape().body_vertices);
  row("physical vertices", "%zu", play.shape().physical.size());
  row("tetrahedra", "%zu", package.tetrahedra().size());
  row("clusters", "%zu", package.clusters().size());
}

void drawHelp(const ViewLayout& layout, int width, int height, const char* text) {
  const auto window_width = static_cast<float>(width), window_height = static_cast<float>(height);
  const float left = static_cast<float>(layout.panel) / layout.pixels_per_unit;
  ImGui::SetNextWindowPos({left, window_height}, ImGuiCond_Always, {0, 1});
  ImGui::SetNextWindowSize({window_width - left, 0});
  ImGui::SetNextWindowBgAlpha(0.55F);
  ImGui::Begin("##help", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoInputs | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoFocusOnAppearing | ImGuiWindowFlags_NoNav);
  ImGui::PushTextWrapPos(0);
  ImGui::TextUnformatted(text);
  ImGui::PopTextWrapPos();
  ImGui::End();
}

void drawViewHelp(const ViewLayout& layout, int width, int height) {
  drawHelp(layout, width, height,
           "Drag the body: pull it.  Beside it, or right button: orbit.  Middle or Shift: pan.  Wheel: zoom.\n"
           "Space: play   N: step   R: reset   L: lock the pull   U: let all go   F: fit   P: physical mesh   C: "
           "clusters   1-9: scenes");
}

}  // namespace sinew::tools

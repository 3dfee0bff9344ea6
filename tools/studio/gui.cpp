// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/gui.h"

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <cmath>

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
                   ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoNav | ImGuiWindowFlags_MenuBar);
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

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/camera_mouse.h"

#include <imgui.h>

#include <Eigen/Geometry>
#include <array>

#include "tools/studio/orbit.h"

namespace sinew::tools {
namespace {

constexpr float kZoomPixels = 30;  // of a drag, as one notch of the wheel

}  // namespace

std::span<const std::string_view> navigationNames() {
  static constexpr std::array<std::string_view, 3> names = {"Sinew", "Blender", "Maya"};
  return names;
}

std::span<const std::pair<const char*, const char*>> navigationHelp(Navigation navigation) {
  using Row = std::pair<const char*, const char*>;
  static constexpr std::array<Row, 4> usual = {Row{"Orbit", "right button, or left beside the model"},
                                               {"Pan", "middle button, or Shift and left"},
                                               {"Zoom", "wheel, or Ctrl and right"},
                                               {"Tool", "left on the model"}};
  static constexpr std::array<Row, 4> blender = {Row{"Orbit", "middle button"},
                                                 {"Pan", "Shift and middle"},
                                                 {"Zoom", "wheel, or Ctrl and middle"},
                                                 {"Tool", "left"}};
  static constexpr std::array<Row, 4> maya = {
      Row{"Orbit", "Alt and left"}, {"Pan", "Alt and middle"}, {"Zoom", "wheel, or Alt and right"}, {"Tool", "left"}};
  return navigation == Navigation::usual ? usual : navigation == Navigation::blender ? blender : maya;
}

CameraDrag dragOf(Navigation navigation, int button, bool shift, bool control, bool alt) {
  switch (navigation) {
    case Navigation::blender:
      if (button != 2) return CameraDrag::none;
      return shift ? CameraDrag::pan : control ? CameraDrag::zoom : CameraDrag::orbit;
    case Navigation::maya:
      if (!alt) return CameraDrag::none;
      return button == 0 ? CameraDrag::orbit : button == 1 ? CameraDrag::zoom : CameraDrag::pan;
    case Navigation::usual:
      break;
  }
  if (button == 2 || shift) return CameraDrag::pan;
  if (button == 1) return control ? CameraDrag::zoom : CameraDrag::orbit;
  return CameraDrag::none;
}

bool CameraMouse::begin(Navigation navigation, bool over_view) {
  const ImGuiIO& io = ImGui::GetIO();
  navigation_ = navigation;
  bool any = false;
  for (int button = 0; button < 3; ++button) any = any || ImGui::IsMouseDown(button);
  if (!any) drag_ = CameraDrag::none;
  bool takes_left = false;
  for (int button = 0; button < 3 && over_view; ++button) {
    if (!ImGui::IsMouseClicked(button)) continue;
    drag_ = dragOf(navigation, button, io.KeyShift, io.KeyCtrl, io.KeyAlt);
    takes_left = takes_left || (button == 0 && drag_ != CameraDrag::none);
  }
  return takes_left;
}

void CameraMouse::leaveLeft() {
  if (navigation_ == Navigation::usual) drag_ = CameraDrag::orbit;
}

void CameraMouse::frame(const ViewLayout& layout, bool is_held, bool over_view, Camera& camera) {
  const ImGuiIO& io = ImGui::GetIO();
  if (is_held) return;
  if (drag_ == CameraDrag::orbit) {
    orbitCamera(camera, io.MouseDelta.x / layout.scale, io.MouseDelta.y / layout.scale);
  } else if (drag_ == CameraDrag::pan) {
    panCamera(camera, io.MouseDelta.x * layout.pixels_per_unit, io.MouseDelta.y * layout.pixels_per_unit,
              static_cast<float>(layout.height()));
  } else if (drag_ == CameraDrag::zoom) {
    zoomCamera(camera, (io.MouseDelta.x - io.MouseDelta.y) / (kZoomPixels * layout.scale));
  }
  if (over_view && io.MouseWheel != 0) zoomCamera(camera, io.MouseWheel);
}

Eigen::Vector2f onScreen(const ViewLayout& layout, const Camera& camera, const Eigen::Vector3f& place) {
  const Eigen::Vector4f clip = camera.projection(layout.aspect()) * camera.view() * place.homogeneous();
  const float x = (clip.x() / clip.w() * 0.5F + 0.5F) * float(layout.width()) + float(layout.panel);
  const float y = (0.5F - clip.y() / clip.w() * 0.5F) * float(layout.height());
  return {x / layout.pixels_per_unit, y / layout.pixels_per_unit};
}

Eigen::Vector3f mouseRay(const ViewLayout& layout, const Camera& camera) {
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  return camera.ray(mouse.x * layout.pixels_per_unit - static_cast<float>(layout.panel),
                    mouse.y * layout.pixels_per_unit, static_cast<float>(layout.width()),
                    static_cast<float>(layout.height()));
}

}  // namespace sinew::tools

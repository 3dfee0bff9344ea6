// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_input.h"

#define GLFW_INCLUDE_NONE  // epoxy declares OpenGL
#include <GLFW/glfw3.h>
#include <imgui.h>
#include <algorithm>

#include <utility>

#include "tools/studio/orbit.h"

namespace sinew::tools {

Keys::Keys(GLFWwindow* window) : window_(window) {
  glfwSetWindowUserPointer(window, this);
  // A tap shorter than a frame would be lost if keys were only looked at once a frame.
  glfwSetKeyCallback(window, [](GLFWwindow* from, int key, int, int action, int mods) {
    auto* keys = static_cast<Keys*>(glfwGetWindowUserPointer(from));
    if (keys == nullptr || action == GLFW_RELEASE || (action == GLFW_REPEAT && key != GLFW_KEY_N)) return;
    keys->press({key, (mods & GLFW_MOD_CONTROL) != 0, (mods & GLFW_MOD_SHIFT) != 0});
  });
}
Keys::~Keys() { glfwSetWindowUserPointer(window_, nullptr); }

Eigen::Vector3f mouseRay(const ViewLayout& layout, const Camera& camera) {
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  return camera.ray(mouse.x * layout.pixels_per_unit - static_cast<float>(layout.panel),
                    mouse.y * layout.pixels_per_unit, static_cast<float>(layout.width()),
                    static_cast<float>(layout.height()));
}

void moveCamera(const ViewLayout& layout, CameraDrag drag, bool over_view, Camera& camera) {
  const ImGuiIO& io = ImGui::GetIO();
  if (drag == CameraDrag::orbit) {
    orbitCamera(camera, io.MouseDelta.x / layout.scale, io.MouseDelta.y / layout.scale);
  } else if (drag == CameraDrag::pan) {
    panCamera(camera, io.MouseDelta.x * layout.pixels_per_unit, io.MouseDelta.y * layout.pixels_per_unit,
              static_cast<float>(layout.height()));
  }
  if (over_view && io.MouseWheel != 0) zoomCamera(camera, io.MouseWheel);
}

void ViewInput::frame(const ViewLayout& layout, std::span<const Keys::Press> pressed, Play& play, Shown& shown) {
  keys(layout, pressed, play, shown);
  if (std::exchange(play.is_new, false)) fit(layout, play);
  mouse(layout, play);
}

void ViewInput::fit(const ViewLayout& layout, const Play& play) {
  std::vector<Eigen::Vector3f> points;
  for (const Eigen::Vector3f& p : std::span(play.shape().positions).first(play.shape().body_vertices)) {
    points.push_back(p / play.diagonal());
    if (play.scene().hasGround())
      points.emplace_back(p.x() / play.diagonal(), play.scene().groundHeight() / play.diagonal(),
                          p.z() / play.diagonal());
  }
  camera_ = viewCamera(ViewName::three_quarter);
  const SceneChoice& scene = play.scene().options().scene;
  const bool framed = scene.script && scene.script->view && lookAsScene(camera_, *scene.script->view, play.package());
  if (!framed) fitCamera(camera_, points, layout.aspect(), 0.25F);
}

void ViewInput::keys(const ViewLayout& layout, std::span<const Keys::Press> pressed, Play& play, Shown& shown) {
  for (const auto& [key, control, shift] : pressed) {
    if (ImGui::GetIO().WantTextInput || control) continue;  // typed into a field, or a command
    switch (key) {
      case GLFW_KEY_SPACE:
        play.playing = !play.playing;
        break;
      case GLFW_KEY_N:
        play.stepPaused();
        break;
      case GLFW_KEY_R:
        play.restart();
        break;
      case GLFW_KEY_F:
        fit(layout, play);
        break;
      case GLFW_KEY_L:
        play.lock();
        break;
      case GLFW_KEY_U:
        play.releaseAll();
        break;
      case GLFW_KEY_P:
        shown.physical = !shown.physical;
        break;
      case GLFW_KEY_C:
        shown.clusters = !shown.clusters;
        break;
      default:
        if (key >= GLFW_KEY_1 && key < GLFW_KEY_1 + std::min(9, static_cast<int>(sceneNames().size()))) {
          play.start(static_cast<SceneKind>(key - GLFW_KEY_1));
        }
    }
  }
}

void ViewInput::mouse(const ViewLayout& layout, Play& play) {
  const ImGuiIO& io = ImGui::GetIO();
  const bool over_view = !io.WantCaptureMouse;
  const Eigen::Vector3f ray = mouseRay(layout, camera_);
  if (over_view && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
    if (!grab(ray, play)) drag_ = io.KeyShift ? CameraDrag::pan : CameraDrag::orbit;
  }
  if (over_view && ImGui::IsMouseClicked(ImGuiMouseButton_Right))
    drag_ = io.KeyShift ? CameraDrag::pan : CameraDrag::orbit;
  if (over_view && ImGui::IsMouseClicked(ImGuiMouseButton_Middle)) drag_ = CameraDrag::pan;
  const bool left = ImGui::IsMouseDown(ImGuiMouseButton_Left);
  if (!left) play.release();
  if (!left && !ImGui::IsMouseDown(ImGuiMouseButton_Right) && !ImGui::IsMouseDown(ImGuiMouseButton_Middle))
    drag_ = CameraDrag::none;
  if (play.grabbed()) {
    play.moveGrab(play.grabbed()->start + dragOffset(camera_, grab_hit_, ray) * play.diagonal());
  }
  moveCamera(layout, play.grabbed() ? CameraDrag::none : drag_, over_view, camera_);
}

bool ViewInput::grab(const Eigen::Vector3f& ray, Play& play) {
  if (play.regrab(camera_.eye() * play.diagonal(), ray)) {
    grab_hit_ = play.grabbed()->start / play.diagonal();
    return true;
  }
  const auto triangles = play.package().visualTriangles();
  const auto hit = hitTriangles(play.shape().positions, triangles, camera_.eye() * play.diagonal(), ray);
  if (!hit) return false;
  grab_hit_ = hit->point / play.diagonal();
  play.grab(hit->vertex);
  return true;
}

}  // namespace sinew::tools

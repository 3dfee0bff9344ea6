// SPDX-License-Identifier: GPL-3.0-or-later
//
// What keys and mouse do in the window of `sinew view`.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "tools/render/camera.h"
#include "tools/studio/view_play.h"

struct GLFWwindow;

namespace sinew::tools {

/// Where things are in the window; in pixels of the framebuffer, but where it says otherwise.
struct ViewLayout {
  float scale = 1;            ///< of text and panels
  float pixels_per_unit = 1;  ///< of window coordinates
  int framebuffer_width = 0, framebuffer_height = 0;
  int panel = 0;  ///< width, at the left
  int width() const { return framebuffer_width - panel; }
  int height() const { return framebuffer_height; }
  float aspect() const { return static_cast<float>(width()) / static_cast<float>(height()); }
};

/// What of the physics is drawn.
struct Shown {
  bool physical = false, clusters = false, pinned = true;
};

/// Keys that went down since the last look.
class Keys {
 public:
  struct Press {
    int key = 0;           ///< GLFW_KEY_...
    bool control = false;  ///< held down with it
    bool shift = false;
  };
  /// Must be called before Dear ImGui installs its own callbacks, which pass events on; and outlive the window's use.
  explicit Keys(GLFWwindow* window);
  ~Keys();
  Keys(const Keys&) = delete;
  Keys& operator=(const Keys&) = delete;
  void press(const Press& key) { presses_.push_back(key); }
  std::vector<Press> take() { return std::exchange(presses_, {}); }

 private:
  GLFWwindow* window_;
  std::vector<Press> presses_;
};

enum class CameraDrag : std::uint8_t { none, orbit, pan };
/// Turns or moves a camera by the mouse's motion in this frame; the wheel zooms.
void moveCamera(const ViewLayout& layout, CameraDrag drag, bool over_view, Camera& camera);
/// The mouse in pixels of the drawn view, and its ray.
Eigen::Vector3f mouseRay(const ViewLayout& layout, const Camera& camera);

class ViewInput {
 public:
  /// Does what was pressed and moved since the last frame; fits the camera to a new scene.
  void frame(const ViewLayout& layout, std::span<const Keys::Press> pressed, Play& play, Shown& shown);
  Camera& camera() { return camera_; }

 private:
  void keys(const ViewLayout& layout, std::span<const Keys::Press> pressed, Play& play, Shown& shown);
  void mouse(const ViewLayout& layout, Play& play);
  bool grab(const Eigen::Vector3f& ray, Play& play);
  void fit(const ViewLayout& layout, const Play& play);

  Camera camera_;
  CameraDrag drag_ = CameraDrag::none;
  Eigen::Vector3f grab_hit_ = Eigen::Vector3f::Zero();  // drawing units
};

}  // namespace sinew::tools

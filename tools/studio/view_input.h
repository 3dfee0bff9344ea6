// SPDX-License-Identifier: GPL-3.0-or-later
//
// What keys and mouse do in the window of `sinew view`.
#pragma once

#include <array>
#include <cstdint>
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

class ViewInput {
 public:
  /// Must be called before Dear ImGui installs its own callbacks, which pass events on; and outlive the window's use.
  explicit ViewInput(GLFWwindow* window);
  ~ViewInput();
  ViewInput(const ViewInput&) = delete;
  ViewInput& operator=(const ViewInput&) = delete;

  /// Does what was pressed and moved since the last frame; fits the camera to a new scene.
  void frame(const ViewLayout& layout, Play& play, Shown& shown);
  Camera& camera() { return camera_; }

 private:
  void keys(const ViewLayout& layout, Play& play, Shown& shown);
  void mouse(const ViewLayout& layout, Play& play);
  bool grab(const Eigen::Vector3f& ray, Play& play);
  void fit(const ViewLayout& layout, const Play& play);

  enum class Drag { none, orbit, pan };

  GLFWwindow* window_;
  Camera camera_;
  std::vector<int> key_presses_;
  Drag drag_ = Drag::none;
  Eigen::Vector3f grab_hit_ = Eigen::Vector3f::Zero();  // drawing units
};

}  // namespace sinew::tools

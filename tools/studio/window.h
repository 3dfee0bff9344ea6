// SPDX-License-Identifier: GPL-3.0-or-later
//
// A window with OpenGL.
#pragma once

#include <string>

#include "tools/studio/view_input.h"

struct GLFWwindow;

namespace sinew::tools {

/// GLFW from start to end. Throws ToolError(system) that names `sinew render`.
class Glfw {
 public:
  Glfw();
  ~Glfw();
  Glfw(const Glfw&) = delete;
  Glfw& operator=(const Glfw&) = delete;
};

class Window {
 public:
  /// Throws ToolError(system) where no window with OpenGL 3.3 can be had.
  explicit Window(const std::string& title);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;
  GLFWwindow* get() const { return window_; }
  /// Of text and panels, 1..4.
  float scale() const;
  /// Its sizes now. \param panel_width of the panel at the left, at 100 % scale. \return false where it is minimized.
  bool measure(float panel_width, ViewLayout& layout, int& window_width, int& window_height) const;

 private:
  GLFWwindow* window_ = nullptr;
};

/// Writes what is drawn in the window's back buffer as a PNG. Throws ToolError(system).
void writeScreenshot(const ViewLayout& layout, const std::string& png);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/window.h"

#define GLFW_INCLUDE_NONE  // epoxy declares OpenGL
#include <GLFW/glfw3.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <vector>

#include "tools/core/error.h"
#include "tools/render/image.h"

namespace sinew::tools {
namespace {

constexpr int kWindowWidth = 1280;
constexpr int kWindowHeight = 800;

std::array<char, 256>& lastError() {  // the C callback has no user pointer
  static std::array<char, 256> text = {"no reason given"};
  return text;
}

}  // namespace

Glfw::Glfw() {
  glfwSetErrorCallback(
      [](int, const char* text) { std::snprintf(lastError().data(), lastError().size(), "%s", text); });
  if (glfwInit() != GLFW_TRUE)
    throw ToolError(ExitCode::system, "", std::string("no window can be opened (") + lastError().data() + ")",
                    "Draw without one: sinew render PACKAGE -o picture.png.");
}
Glfw::~Glfw() { glfwTerminate(); }

Window::Window(const std::string& title) {
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
  glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
  glfwWindowHint(GLFW_DEPTH_BITS, 0);  // the renderer brings its own target
  window_ = glfwCreateWindow(kWindowWidth, kWindowHeight, title.c_str(), nullptr, nullptr);
  if (window_ == nullptr) {
    throw ToolError(ExitCode::system, "",
                    std::string("no window with OpenGL 3.3 can be opened (") + lastError().data() + ")",
                    "Update the graphics driver, or draw without a window: sinew render PACKAGE -o picture.png.");
  }
  glfwMakeContextCurrent(window_);
  glfwSwapInterval(1);
  glfwSetWindowSizeLimits(window_, 640, 420, GLFW_DONT_CARE, GLFW_DONT_CARE);
}
Window::~Window() { glfwDestroyWindow(window_); }

float Window::scale() const {
  float scale_x = 1;
  float scale_y = 1;
  glfwGetWindowContentScale(window_, &scale_x, &scale_y);
  int framebuffer_width = 0;
  int window_width = 0;
  glfwGetFramebufferSize(window_, &framebuffer_width, nullptr);
  glfwGetWindowSize(window_, &window_width, nullptr);
  // Where window units are pixels (X11) the content scale enlarges text and panels; elsewhere the system does.
  return std::clamp(framebuffer_width > window_width ? 1.0F : scale_x, 1.0F, 4.0F);
}

bool Window::measure(float panel_width, ViewLayout& layout, int& window_width, int& window_height) const {
  glfwGetFramebufferSize(window_, &layout.framebuffer_width, &layout.framebuffer_height);
  glfwGetWindowSize(window_, &window_width, &window_height);
  if (layout.framebuffer_width <= 0 || layout.framebuffer_height <= 0) return false;
  layout.pixels_per_unit = static_cast<float>(layout.framebuffer_width) / static_cast<float>(std::max(window_width, 1));
  layout.panel =
      std::min(static_cast<int>(panel_width * layout.scale * layout.pixels_per_unit), layout.framebuffer_width / 2);
  return true;
}

void writeScreenshot(const ViewLayout& layout, const std::string& png) {
  std::vector<std::uint8_t> rgba(static_cast<std::size_t>(layout.framebuffer_width) *
                                 static_cast<std::size_t>(layout.framebuffer_height) * 4);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, 0);
  glReadBuffer(GL_BACK);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, layout.framebuffer_width, layout.framebuffer_height, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
  Image image(layout.framebuffer_width, layout.framebuffer_height);
  const auto row = static_cast<std::size_t>(layout.framebuffer_width);
  for (std::size_t y = 0; y < static_cast<std::size_t>(layout.framebuffer_height); ++y) {
    const std::uint8_t* from = &rgba[(static_cast<std::size_t>(layout.framebuffer_height) - 1 - y) * row * 4];
    for (std::size_t x = 0; x < row; ++x) std::memcpy(&image.rgb[(y * row + x) * 3], from + 4 * x, 3);
  }
  writePng(image, png);
}

}  // namespace sinew::tools

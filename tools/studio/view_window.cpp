// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_window.h"

#define GLFW_INCLUDE_NONE  // epoxy declares OpenGL
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <epoxy/gl.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "tools/core/command_line.h"
#include "tools/core/error.h"
#include "tools/render/renderer.h"
#include "tools/studio/view_input.h"
#include "tools/studio/view_log.h"
#include "tools/studio/view_panel.h"
#include "tools/studio/view_play.h"

namespace sinew::tools {

namespace {

using Clock = std::chrono::steady_clock;

constexpr int kWindowWidth = 1280;
constexpr int kWindowHeight = 800;
constexpr float kPanelWidth = 290;  // at 100 % scale
constexpr std::uint32_t kScreenshotFrames = 60;
constexpr Rgba8 kPickColor = {255, 140, 0, 255};

// GLFW from start to end of the window.
class Glfw {
 public:
  Glfw() {
    glfwSetErrorCallback(
        [](int, const char* text) { std::snprintf(last_error_.data(), last_error_.size(), "%s", text); });
    if (glfwInit() != GLFW_TRUE)
      throw ToolError(ExitCode::system, "", "no window can be opened (" + error() + ")",
                      "Draw without one: sinew render PACKAGE -o picture.png.");
  }
  ~Glfw() { glfwTerminate(); }
  Glfw(const Glfw&) = delete;
  Glfw& operator=(const Glfw&) = delete;
  static std::string error() { return last_error_.data(); }

 private:
  static inline std::array<char, 256> last_error_ = {"no reason given"};  // the C callback has no user pointer
};

class Window {
 public:
  explicit Window(const std::string& title) {
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
    glfwWindowHint(GLFW_DEPTH_BITS, 0);  // the renderer brings its own target
    window_ = glfwCreateWindow(kWindowWidth, kWindowHeight, title.c_str(), nullptr, nullptr);
    if (window_ == nullptr) {
      throw ToolError(ExitCode::system, "", "no window with OpenGL 3.3 can be opened (" + Glfw::error() + ")",
                      "Update the graphics driver, or draw without a window: sinew render PACKAGE -o picture.png.");
    }
    glfwMakeContextCurrent(window_);
    glfwSwapInterval(1);
    glfwSetWindowSizeLimits(window_, 640, 420, GLFW_DONT_CARE, GLFW_DONT_CARE);
  }
  ~Window() { glfwDestroyWindow(window_); }
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;
  GLFWwindow* get() const { return window_; }

 private:
  GLFWwindow* window_ = nullptr;
};

// The frames of the window.
class View {
 public:
  View(GLFWwindow* window, ViewInput& input, const std::shared_ptr<const Asset>& asset, const ViewOptions& options,
       float scale)
      : window_(window), input_(input), play_(asset, options), log_(options.state_log) {
    layout_.scale = scale;
  }

  void run() {
    const std::uint32_t last_frame = play_.options().frames > 0           ? play_.options().frames
                                     : play_.options().screenshot.empty() ? 0
                                                                          : kScreenshotFrames;
    auto before = Clock::now();
    while (glfwWindowShouldClose(window_) == GLFW_FALSE) {
      glfwPollEvents();
      const auto now = Clock::now();
      const double elapsed = std::chrono::duration<double>(now - before).count();
      before = now;
      frame_seconds_ += (elapsed - frame_seconds_) * 0.1;
      ++frame_;
      glfwGetFramebufferSize(window_, &layout_.framebuffer_width, &layout_.framebuffer_height);
      int window_width = 0;
      int window_height = 0;
      glfwGetWindowSize(window_, &window_width, &window_height);
      if (layout_.framebuffer_width <= 0 || layout_.framebuffer_height <= 0) {  // minimized
        glfwWaitEventsTimeout(0.1);
        continue;
      }
      layout_.pixels_per_unit =
          static_cast<float>(layout_.framebuffer_width) / static_cast<float>(std::max(window_width, 1));
      layout_.panel = std::min(static_cast<int>(kPanelWidth * layout_.scale * layout_.pixels_per_unit),
                               layout_.framebuffer_width / 2);

      ImGui_ImplOpenGL3_NewFrame();
      ImGui_ImplGlfw_NewFrame();
      ImGui::NewFrame();
      panel_.draw(layout_, window_height, frame_seconds_, play_, shown_);
      drawViewHelp(layout_, window_width, window_height);
      input_.frame(layout_, play_, shown_);
      play_.advance(elapsed);
      drawScene();
      ImGui::Render();
      ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
      log_.write(frame_, layout_, input_.camera(), play_, shown_);
      const bool last = last_frame > 0 && frame_ >= last_frame;
      if (last && !play_.options().screenshot.empty()) screenshot();
      glfwSwapBuffers(window_);
      if (last) break;
    }
  }

 private:
  void drawScene() {
    Camera& camera = input_.camera();
    if (!play_.shape().isLike(drawn_)) {
      drawn_ = play_.shape();
      renderer_.reset();
      renderer_.emplace(modelOf(play_.shape(), play_.diagonal()));
    }
    showShape(*renderer_, play_.shape());
    Annotation annotation;
    if (const auto& grabbed = play_.grabbed()) {
      annotation.points = {play_.shape().positions[grabbed->vertex], grabbed->target};
      annotation.lines = {{0, 1, kPickColor}};
      annotation.dots = {{0, kPickColor}, {1, kPickColor}};
      annotation.line_width = 2.5F * layout_.scale * layout_.pixels_per_unit;
      annotation.hidden_opacity = 0.6F;
    }
    renderer_->setAnnotation(annotation);
    DrawSettings settings;
    settings.physical = shown_.physical;
    settings.clusters = shown_.clusters;
    settings.pinned = shown_.pinned;
    settings.ground = play_.scene().hasGround();
    settings.ground_height = play_.scene().groundHeight() / play_.diagonal();
    settings.line_width = 1.1F * layout_.scale * layout_.pixels_per_unit;
    settings.dot_size = 8 * layout_.scale * layout_.pixels_per_unit;
    Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::infinity());
    Eigen::Vector3f high = -low;
    for (const Eigen::Vector3f& p : play_.shape().positions) {
      if (!p.allFinite()) continue;
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    if (low.allFinite() && high.allFinite()) {
      settings.shadow_center = (low + high) / (2 * play_.diagonal());
      // In steps, so that the shadow's texels keep their size while the body wobbles.
      const float radius = std::max((high - low).norm() / (2 * play_.diagonal()), 0.05F);
      settings.shadow_radius = std::pow(1.25F, std::ceil(std::log(radius) / std::log(1.25F)));
    }
    camera.near_plane = std::max(camera.distance * 0.02F, 1e-3F);
    camera.far_plane = camera.distance + 40;
    renderer_->draw(camera, settings, layout_.width(), layout_.height());
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    glViewport(0, 0, layout_.framebuffer_width, layout_.framebuffer_height);
    glClearColor(0.125F, 0.137F, 0.161F, 1);
    glClear(GL_COLOR_BUFFER_BIT);
    renderer_->present(layout_.panel, 0, layout_.width(), layout_.height());
  }

  void screenshot() const {
    std::vector<std::uint8_t> rgba(static_cast<std::size_t>(layout_.framebuffer_width) *
                                   static_cast<std::size_t>(layout_.framebuffer_height) * 4);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, 0);
    glReadBuffer(GL_BACK);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, layout_.framebuffer_width, layout_.framebuffer_height, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
    Image image(layout_.framebuffer_width, layout_.framebuffer_height);
    const auto row = static_cast<std::size_t>(layout_.framebuffer_width);
    for (std::size_t y = 0; y < static_cast<std::size_t>(layout_.framebuffer_height); ++y) {
      const std::uint8_t* from = &rgba[(static_cast<std::size_t>(layout_.framebuffer_height) - 1 - y) * row * 4];
      for (std::size_t x = 0; x < row; ++x) std::memcpy(&image.rgb[(y * row + x) * 3], from + 4 * x, 3);
    }
    writePng(image, play_.options().screenshot);
  }

  GLFWwindow* window_;
  ViewInput& input_;
  Play play_;
  std::optional<Renderer> renderer_;
  Shape drawn_;  // by the renderer
  ViewLog log_;
  ViewPanel panel_;
  Shown shown_;
  ViewLayout layout_;
  double frame_seconds_ = 1.0 / 60;
  std::uint32_t frame_ = 0;
};

}  // namespace

void requireDisplay(const std::string& package) {
  const auto given = [](const char* name) {
    const char* value = std::getenv(name);
    return value != nullptr && *value != '\0';
  };
  if (given("DISPLAY")) return;
  const std::string cure =
      "Draw without a window instead: " + commandLine({"sinew", "render", package, "-o", "picture.png"}) + ".";
  if (given("WAYLAND_DISPLAY"))
    throw ToolError(ExitCode::system, "", "the window needs an X display (DISPLAY is not set; Xwayland gives one)",
                    cure);
  throw ToolError(ExitCode::system, "", "there is no display to open a window on (DISPLAY is not set)", cure);
}

void runViewWindow(const std::shared_ptr<const Asset>& asset, const ViewOptions& options) {
  if (asset->package().visualTriangles().empty()) {
    throw ToolError(ExitCode::bad_input, options.file, "the package has no visual mesh to draw",
                    "Bake it from a source with faces.");
  }
  requireDisplay(options.file);
  const Glfw glfw;
  const Window window("Sinew - " + options.file);
  float scale_x = 1;
  float scale_y = 1;
  glfwGetWindowContentScale(window.get(), &scale_x, &scale_y);
  int framebuffer_width = 0;
  int window_width = 0;
  glfwGetFramebufferSize(window.get(), &framebuffer_width, nullptr);
  glfwGetWindowSize(window.get(), &window_width, nullptr);
  // Where window units are pixels (X11) the content scale enlarges text and panels; elsewhere the system does.
  const float scale = std::clamp(framebuffer_width > window_width ? 1.0F : scale_x, 1.0F, 4.0F);
  ViewInput input(window.get());
  const Gui gui(window.get(), scale);
  View view(window.get(), input, asset, options, scale);
  view.run();
}

}  // namespace sinew::tools

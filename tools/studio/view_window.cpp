// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_window.h"

#define GLFW_INCLUDE_NONE  // epoxy declares OpenGL
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <epoxy/gl.h>
#include <imgui.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "tools/author/recipe_commands.h"
#include "tools/core/error.h"
#include "tools/render/picture.h"
#include "tools/render/renderer.h"
#include "tools/render/text.h"
#include "tools/studio/orbit.h"

namespace sinew::tools {

namespace {

using Clock = std::chrono::steady_clock;

constexpr int kWindowWidth = 1280;
constexpr int kWindowHeight = 800;
constexpr float kPanelWidth = 290;  // at 100 % scale
constexpr double kStepSeconds = 1.0 / 60;
constexpr int kMostStepsPerFrame = 4;  // a slow machine shows slow motion instead of falling ever further behind
constexpr std::uint32_t kScreenshotFrames = 60;
constexpr float kPickHz = 10;
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

class Gui {
 public:
  Gui(GLFWwindow* window, float scale) {
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
  ~Gui() {
    ImGui_ImplOpenGL3_Shutdown();
    ImGui_ImplGlfw_Shutdown();
    ImGui::DestroyContext();
  }
  Gui(const Gui&) = delete;
  Gui& operator=(const Gui&) = delete;
};

struct LogFile {
  explicit LogFile(const std::string& name) : file(name.empty() ? nullptr : std::fopen(name.c_str(), "w")) {
    if (!name.empty() && file == nullptr)
      throw ToolError(ExitCode::system, name, "cannot be written", "Check the folder.");
  }
  ~LogFile() {
    if (file != nullptr) std::fclose(file);
  }
  LogFile(const LogFile&) = delete;
  LogFile& operator=(const LogFile&) = delete;
  std::FILE* file;
};

class View {
 public:
  // A tap shorter than a frame would be lost if keys were only looked at once a frame. Installed before Dear ImGui's
  // own callbacks, which pass events on.
  static void listenForKeys(GLFWwindow* window) {
    glfwSetKeyCallback(window, [](GLFWwindow* from, int key, int, int action, int) {
      auto* view = static_cast<View*>(glfwGetWindowUserPointer(from));
      if (view == nullptr || action == GLFW_RELEASE || (action == GLFW_REPEAT && key != GLFW_KEY_N)) return;
      view->key_presses_.push_back(key);
    });
  }

  View(GLFWwindow* window, std::shared_ptr<const Asset> asset, const ViewOptions& options, float scale)
      : window_(window),
        asset_(std::move(asset)),
        options_(options),
        scale_(scale),
        diagonal_(asset_->package().info().diagonal),
        triangles_(asset_->package().visualTriangles().begin(), asset_->package().visualTriangles().end()),
        renderer_(makeDrawModel(asset_->package())),
        log_(options.state_log) {
    startScene(options.scene);
    glfwSetWindowUserPointer(window_, this);
  }
  ~View() { glfwSetWindowUserPointer(window_, nullptr); }
  View(const View&) = delete;
  View& operator=(const View&) = delete;

  void run() {
    const std::uint32_t last_frame = options_.frames > 0           ? options_.frames
                                     : options_.screenshot.empty() ? 0
                                                                   : kScreenshotFrames;
    auto before = Clock::now();
    while (glfwWindowShouldClose(window_) == GLFW_FALSE) {
      glfwPollEvents();
      const auto now = Clock::now();
      const double elapsed = std::chrono::duration<double>(now - before).count();
      before = now;
      frame_seconds_ += (elapsed - frame_seconds_) * 0.1;
      ++frame_;
      glfwGetFramebufferSize(window_, &framebuffer_width_, &framebuffer_height_);
      int window_width = 0;
      int window_height = 0;
      glfwGetWindowSize(window_, &window_width, &window_height);
      if (framebuffer_width_ <= 0 || framebuffer_height_ <= 0) {  // minimized
        glfwWaitEventsTimeout(0.1);
        continue;
      }
      pixels_per_unit_ = static_cast<float>(framebuffer_width_) / static_cast<float>(std::max(window_width, 1));
      panel_pixels_ = std::min(static_cast<int>(kPanelWidth * scale_ * pixels_per_unit_), framebuffer_width_ / 2);
      view_width_ = framebuffer_width_ - panel_pixels_;
      view_height_ = framebuffer_height_;

      ImGui_ImplOpenGL3_NewFrame();
      ImGui_ImplGlfw_NewFrame();
      ImGui::NewFrame();
      drawPanel(static_cast<float>(panel_pixels_) / pixels_per_unit_, static_cast<float>(window_height));
      drawHelp(static_cast<float>(window_width), static_cast<float>(window_height));
      keys();
      mouse();
      advance(elapsed);
      drawScene();
      ImGui::Render();
      ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
      writeLog();
      const bool last = last_frame > 0 && frame_ >= last_frame;
      if (last && !options_.screenshot.empty()) screenshot();
      glfwSwapBuffers(window_);
      if (last) break;
    }
  }

 private:
  void startScene(const SceneChoice& scene) {
    release();
    const bool same = scene_.has_value() && scene_->options().scene == scene;
    SceneOptions options;
    options.scene = scene;
    options.solver = options_.solver;
    options.step_seconds = static_cast<float>(kStepSeconds);
    options.stiffness_scale = stiffness_;
    std::vector<std::optional<float>> held;  // by hand: that outlives a scene
    if (scene_.has_value()) {
      for (std::uint32_t c = 0; c < scene_->channelInputs().size(); ++c) {
        held.push_back(scene_->isHeld(c) ? std::optional(scene_->channelInputs()[c]) : std::nullopt);
      }
    }
    scene_.emplace(asset_, options);
    for (std::uint32_t c = 0; c < held.size(); ++c) scene_->holdChannel(c, held[c]);
    base_gravity_ = scene_->world().settings().gravity;
    if (!same) {
      const WorldSettings& world = scene_->world().settings();
      iterations_ = static_cast<int>(world.iterations);
      damping_ = world.damping;
      deformation_damping_ = world.deformation_damping_ratio;
      gravity_ = 1;
    }
    applySettings();
    owed_seconds_ = 0;
    captureShape(*scene_, shape_);
    if (!same) fit();
  }

  void applySettings() {
    WorldSettings& world = scene_->world().settings();
    for (std::size_t k = 0; k < 3; ++k) world.gravity[k] = base_gravity_[k] * gravity_;
    world.iterations = static_cast<std::uint32_t>(iterations_);
    world.damping = damping_;
    world.deformation_damping_ratio = deformation_damping_;
  }

  void fit() {
    std::vector<Eigen::Vector3f> points;
    for (const Eigen::Vector3f& p : shape_.positions) {
      points.push_back(p / diagonal_);
      if (scene_->hasGround()) points.emplace_back(p.x() / diagonal_, 0.0F, p.z() / diagonal_);
    }
    camera_ = viewCamera(ViewName::three_quarter);
    const float aspect = view_height_ > 0 ? static_cast<float>(view_width_) / static_cast<float>(view_height_) : 1.25F;
    const SceneChoice& scene = scene_->options().scene;
    const bool framed =
        scene.script && scene.script->view && lookAsScene(camera_, *scene.script->view, asset_->package());
    if (!framed) fitCamera(camera_, points, aspect, 0.25F);
  }

  void stepOnce() {
    const auto start = Clock::now();
    scene_->step();
    const double ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    step_milliseconds_ += (ms - step_milliseconds_) * 0.1;
    ++steps_;
  }

  void advance(double elapsed) {
    for (; single_steps_ > 0; --single_steps_) stepOnce();
    if (playing_) {
      owed_seconds_ = std::min(owed_seconds_ + elapsed, kMostStepsPerFrame * kStepSeconds);
      while (owed_seconds_ >= kStepSeconds) {
        stepOnce();
        owed_seconds_ -= kStepSeconds;
      }
    }
    captureShape(*scene_, shape_);
  }

  void keys() {
    for (const int key : std::exchange(key_presses_, {})) {
      if (ImGui::GetIO().WantTextInput) continue;  // it was typed into a field
      switch (key) {
        case GLFW_KEY_SPACE:
          playing_ = !playing_;
          break;
        case GLFW_KEY_N:
          stepPaused();
          break;
        case GLFW_KEY_R:
          startScene(SceneChoice(scene_->options().scene));
          break;
        case GLFW_KEY_F:
          fit();
          break;
        case GLFW_KEY_P:
          show_physical_ = !show_physical_;
          break;
        case GLFW_KEY_C:
          show_clusters_ = !show_clusters_;
          break;
        default:
          if (key >= GLFW_KEY_1 && key < GLFW_KEY_1 + static_cast<int>(sceneNames().size())) {
            startScene(static_cast<SceneKind>(key - GLFW_KEY_1));
          }
      }
    }
  }

  void stepPaused() {
    playing_ = false;
    ++single_steps_;
  }

  // The mouse in pixels of the drawn view.
  Eigen::Vector2f mouseInView() const {
    const ImVec2 at = ImGui::GetIO().MousePos;
    return {at.x * pixels_per_unit_ - static_cast<float>(panel_pixels_), at.y * pixels_per_unit_};
  }

  Eigen::Vector3f rayAt(const Eigen::Vector2f& at) const {
    return camera_.ray(at.x(), at.y(), static_cast<float>(view_width_), static_cast<float>(view_height_));
  }

  void mouse() {
    ImGuiIO& io = ImGui::GetIO();
    const bool over_view = !io.WantCaptureMouse;
    const Eigen::Vector2f at = mouseInView();
    if (over_view && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
      if (!grab(at)) drag_ = io.KeyShift ? Drag::pan : Drag::orbit;
    }
    if (over_view && ImGui::IsMouseClicked(ImGuiMouseButton_Right)) drag_ = io.KeyShift ? Drag::pan : Drag::orbit;
    if (over_view && ImGui::IsMouseClicked(ImGuiMouseButton_Middle)) drag_ = Drag::pan;
    const bool left = ImGui::IsMouseDown(ImGuiMouseButton_Left);
    if (!left) release();
    if (!left && !ImGui::IsMouseDown(ImGuiMouseButton_Right) && !ImGui::IsMouseDown(ImGuiMouseButton_Middle))
      drag_ = Drag::none;
    if (grabbed_) {
      grab_target_ = grab_start_ + dragOffset(camera_, grab_hit_, rayAt(at)) * diagonal_;
      scene_->world().movePick(pick_, {grab_target_.x(), grab_target_.y(), grab_target_.z()});
    } else if (drag_ == Drag::orbit) {
      orbitCamera(camera_, io.MouseDelta.x / scale_, io.MouseDelta.y / scale_);
    } else if (drag_ == Drag::pan) {
      panCamera(camera_, io.MouseDelta.x * pixels_per_unit_, io.MouseDelta.y * pixels_per_unit_,
                static_cast<float>(view_height_));
    }
    if (over_view && io.MouseWheel != 0) zoomCamera(camera_, io.MouseWheel);
  }

  bool grab(const Eigen::Vector2f& at) {
    const auto hit = hitTriangles(shape_.positions, triangles_, camera_.eye() * diagonal_, rayAt(at));
    if (!hit) return false;
    grabbed_ = hit->vertex;
    grab_hit_ = hit->point / diagonal_;
    grab_start_ = grab_target_ = shape_.positions[hit->vertex];
    pick_ =
        scene_->world().pick(scene_->body(), hit->vertex, {grab_start_.x(), grab_start_.y(), grab_start_.z()}, kPickHz);
    return true;
  }

  void release() {
    if (grabbed_) scene_->world().releasePick(pick_);
    grabbed_.reset();
  }

  void drawScene() {
    showShape(renderer_, shape_);
    Annotation annotation;
    if (grabbed_) {
      annotation.points = {shape_.positions[*grabbed_], grab_target_};
      annotation.lines = {{0, 1, kPickColor}};
      annotation.dots = {{0, kPickColor}, {1, kPickColor}};
      annotation.line_width = 2.5F * scale_ * pixels_per_unit_;
      annotation.hidden_opacity = 0.6F;
    }
    renderer_.setAnnotation(annotation);
    DrawSettings settings;
    settings.physical = show_physical_;
    settings.clusters = show_clusters_;
    settings.pinned = show_pinned_;
    settings.ground = scene_->hasGround();
    settings.line_width = 1.1F * scale_ * pixels_per_unit_;
    settings.dot_size = 8 * scale_ * pixels_per_unit_;
    Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::infinity());
    Eigen::Vector3f high = -low;
    for (const Eigen::Vector3f& p : shape_.positions) {
      if (!p.allFinite()) continue;
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    if (low.allFinite() && high.allFinite()) {
      settings.shadow_center = (low + high) / (2 * diagonal_);
      // In steps, so that the shadow's texels keep their size while the body wobbles.
      const float radius = std::max((high - low).norm() / (2 * diagonal_), 0.05F);
      settings.shadow_radius = std::pow(1.25F, std::ceil(std::log(radius) / std::log(1.25F)));
    }
    camera_.near_plane = std::max(camera_.distance * 0.02F, 1e-3F);
    camera_.far_plane = camera_.distance + 40;
    renderer_.draw(camera_, settings, view_width_, view_height_);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    glViewport(0, 0, framebuffer_width_, framebuffer_height_);
    glClearColor(0.125F, 0.137F, 0.161F, 1);
    glClear(GL_COLOR_BUFFER_BIT);
    renderer_.present(panel_pixels_, 0, view_width_, view_height_);
  }

  static void heading(const char* text) {
    ImGui::Spacing();
    ImGui::TextDisabled("%s", text);
    ImGui::Separator();
  }

  void drawPanel(float width, float height) {
    ImGui::SetNextWindowPos({0, 0});
    ImGui::SetNextWindowSize({width, height});
    ImGui::Begin("##panel", nullptr,
                 ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoNav);
    const formats::PackageView& package = asset_->package();
    const std::string name(package.text(package.info().name));
    ImGui::TextUnformatted(name.empty() ? options_.file.c_str() : name.c_str());

    if (package.channels().empty()) {
      drawSceneControls(width);
    } else if (ImGui::BeginTabBar("##tabs")) {
      if (ImGui::BeginTabItem("Scene")) {
        drawSceneControls(width);
        ImGui::EndTabItem();
      }
      if (ImGui::BeginTabItem("Channels")) {
        drawChannels();
        ImGui::EndTabItem();
      }
      ImGui::EndTabBar();
    }
    ImGui::End();
  }

  std::optional<std::uint32_t> channelNamed(const std::string& name) const {
    const formats::PackageView& package = asset_->package();
    for (std::uint32_t c = 0; c < package.channels().size(); ++c) {
      if (package.text(package.channels()[c].name) == name) return c;
    }
    return std::nullopt;
  }

  // A slider for each input of the package: what a game would drive.
  void drawChannels() {
    const formats::PackageView& package = asset_->package();
    ImGui::Spacing();
    ImGui::SetNextItemWidth(-1);
    ImGui::InputTextWithHint("##filter", "find", channel_filter_.data(), channel_filter_.size());
    bool any_held = false;
    const std::span<const float> inputs = scene_->channelInputs();
    for (std::uint32_t c = 0; c < inputs.size(); ++c) any_held |= scene_->isHeld(c);
    ImGui::BeginDisabled(!any_held);
    if (ImGui::Button("Let all go", {-1, 0})) {
      for (std::uint32_t c = 0; c < inputs.size(); ++c) scene_->holdChannel(c, std::nullopt);
    }
    ImGui::EndDisabled();
    ImGui::Checkbox("Both sides", &both_sides_);
    ImGui::Separator();
    ImGui::BeginChild("##channels");
    for (std::uint32_t c = 0; c < inputs.size(); ++c) {
      const std::string name(package.text(package.channels()[c].name));
      if (name.find(channel_filter_.data()) == std::string::npos) continue;
      float input = inputs[c];
      ImGui::PushID(static_cast<int>(c));
      const bool held = scene_->isHeld(c);
      ImGui::SetNextItemWidth(-1);
      if (ImGui::SliderFloat("##input", &input, 0, 1, "", ImGuiSliderFlags_AlwaysClamp)) {
        scene_->holdChannel(c, input);
        if (const auto other = channelNamed(otherSide(name)); both_sides_ && other) scene_->holdChannel(*other, input);
      }
      if (ImGui::IsItemHovered()) {
        if (ImGui::IsMouseClicked(ImGuiMouseButton_Right)) scene_->holdChannel(c, std::nullopt);
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

  void drawSceneControls(float width) {
    const formats::PackageView& package = asset_->package();
    heading("Scene");
    ImGui::SetNextItemWidth(-1);
    const SceneChoice scene = scene_->options().scene;
    if (ImGui::BeginCombo("##scene", scene.name().c_str())) {
      if (options_.scene.script && ImGui::Selectable(options_.scene.name().c_str(), scene.script != nullptr)) {
        startScene(options_.scene);
      }
      for (std::size_t k = 0; k < sceneNames().size(); ++k) {
        const SceneChoice other = static_cast<SceneKind>(k);
        if (ImGui::Selectable(sceneNames()[k].data(), scene == other)) startScene(other);
      }
      ImGui::EndCombo();
    }
    const float third = (ImGui::GetContentRegionAvail().x - 2 * ImGui::GetStyle().ItemSpacing.x) / 3;
    if (ImGui::Button(playing_ ? "Pause" : "Play", {third, 0})) playing_ = !playing_;
    ImGui::SameLine();
    if (ImGui::Button("Step", {third, 0})) stepPaused();
    ImGui::SameLine();
    if (ImGui::Button("Reset", {third, 0})) startScene(SceneChoice(scene_->options().scene));

    heading("Show");
    ImGui::Checkbox("Physical mesh", &show_physical_);
    ImGui::Checkbox("Clusters", &show_clusters_);
    ImGui::Checkbox("Held vertices", &show_pinned_);

    heading("Settings");
    ImGui::PushItemWidth(ImGui::GetContentRegionAvail().x * 0.5F);
    bool changed = ImGui::SliderFloat("gravity", &gravity_, 0, 3, "%.2f x");
    changed |= ImGui::SliderInt("iterations", &iterations_, 1, 16);
    changed |= ImGui::SliderFloat("air damping", &damping_, 0, 10, "%.2f /s", ImGuiSliderFlags_Logarithmic);
    changed |= ImGui::SliderFloat("inner friction", &deformation_damping_, 0, 1, "%.2f of critical");
    if (changed) applySettings();
    ImGui::SliderFloat("stiffness", &stiffness_, 0.05F, 20, "%.2f x", ImGuiSliderFlags_Logarithmic);
    if (ImGui::IsItemDeactivatedAfterEdit()) startScene(SceneChoice(scene_->options().scene));
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("Multiplies every cluster's frequencies; the scene starts again.");
    ImGui::PopItemWidth();

    heading("Measured");
    const auto row = [&](const char* what, const char* format, auto... values) {
      ImGui::TextDisabled("%s", what);
      ImGui::SameLine(width * 0.5F);
      ImGui::Text(format, values...);
    };
    row("frames", "%.0f /s", frame_seconds_ > 0 ? 1 / frame_seconds_ : 0.0);
    row("step", "%.3f ms", step_milliseconds_);
    row("time", "%.2f s", scene_->time());
    row("triangles", "%zu", triangles_.size());
    row("visual vertices", "%zu", shape_.positions.size());
    row("physical vertices", "%zu", shape_.physical.size());
    row("tetrahedra", "%zu", package.tetrahedra().size());
    row("clusters", "%zu", package.clusters().size());
  }

  // One line along the lower edge of the view.
  void drawHelp(float window_width, float window_height) const {
    const float left = static_cast<float>(panel_pixels_) / pixels_per_unit_;
    ImGui::SetNextWindowPos({left, window_height}, ImGuiCond_Always, {0, 1});
    ImGui::SetNextWindowSize({window_width - left, 0});
    ImGui::SetNextWindowBgAlpha(0.55F);
    ImGui::Begin("##help", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoInputs | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_NoFocusOnAppearing | ImGuiWindowFlags_NoNav);
    ImGui::PushTextWrapPos(0);
    ImGui::TextUnformatted(
        "Drag the body: pull it.  Beside it, or right button: orbit.  Middle or Shift: pan.  Wheel: zoom.\n"
        "Space: play   N: step   R: reset   F: fit   P: physical mesh   C: clusters   1-5: scenes");
    ImGui::PopTextWrapPos();
    ImGui::End();
  }

  void screenshot() const {
    std::vector<std::uint8_t> rgba(static_cast<std::size_t>(framebuffer_width_) *
                                   static_cast<std::size_t>(framebuffer_height_) * 4);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, 0);
    glReadBuffer(GL_BACK);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, framebuffer_width_, framebuffer_height_, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
    Image image(framebuffer_width_, framebuffer_height_);
    const auto row = static_cast<std::size_t>(framebuffer_width_);
    for (std::size_t y = 0; y < static_cast<std::size_t>(framebuffer_height_); ++y) {
      const std::uint8_t* from = &rgba[(static_cast<std::size_t>(framebuffer_height_) - 1 - y) * row * 4];
      for (std::size_t x = 0; x < row; ++x) std::memcpy(&image.rgb[(y * row + x) * 3], from + 4 * x, 3);
    }
    writePng(image, options_.screenshot);
  }

  // Window coordinates of a point given in metres.
  Eigen::Vector2f onScreen(const Eigen::Vector3f& p) const {
    const Eigen::Matrix4f m =
        camera_.projection(static_cast<float>(view_width_) / static_cast<float>(view_height_)) * camera_.view();
    const Eigen::Vector4f clip = m * (p / diagonal_).homogeneous();
    const float x =
        (clip.x() / clip.w() * 0.5F + 0.5F) * static_cast<float>(view_width_) + static_cast<float>(panel_pixels_);
    const float y = (0.5F - clip.y() / clip.w() * 0.5F) * static_cast<float>(view_height_);
    return {x / pixels_per_unit_, y / pixels_per_unit_};
  }

  void writeLog() {
    if (log_.file == nullptr) return;
    Eigen::Vector3f center = Eigen::Vector3f::Zero();
    for (const Eigen::Vector3f& p : shape_.physical) center += p / static_cast<float>(shape_.physical.size());
    const Eigen::Vector2f center_at = onScreen(center);
    std::fprintf(
        log_.file,
        "{\"frame\":%u,\"time\":%.4f,\"steps\":%u,\"scene\":\"%s\",\"playing\":%s,\"physical\":%s,\"clusters\":%s,",
        frame_, scene_->time(), steps_, scene_->options().scene.name().c_str(), playing_ ? "true" : "false",
        show_physical_ ? "true" : "false", show_clusters_ ? "true" : "false");
    std::size_t held_channels = 0;
    double inputs = 0;
    for (std::uint32_t c = 0; c < scene_->channelInputs().size(); ++c) {
      held_channels += scene_->isHeld(c) ? 1U : 0U;
      inputs += static_cast<double>(scene_->channelInputs()[c]);
    }
    std::fprintf(log_.file, "\"held_channels\":%zu,\"inputs\":%.4f,", held_channels, inputs);
    std::fprintf(log_.file, "\"diagonal\":%.6g,\"camera\":{\"yaw\":%.5f,\"pitch\":%.5f,\"distance\":%.5f},",
                 static_cast<double>(diagonal_), static_cast<double>(camera_.yaw), static_cast<double>(camera_.pitch),
                 static_cast<double>(camera_.distance));
    std::fprintf(log_.file, "\"center\":[%.6g,%.6g,%.6g],\"center_at\":[%.1f,%.1f],", static_cast<double>(center.x()),
                 static_cast<double>(center.y()), static_cast<double>(center.z()), static_cast<double>(center_at.x()),
                 static_cast<double>(center_at.y()));
    if (grabbed_) {
      const Eigen::Vector2f vertex_at = onScreen(shape_.positions[*grabbed_]);
      const Eigen::Vector2f target_at = onScreen(grab_target_);
      std::fprintf(log_.file, "\"grabbed\":%u,\"vertex_at\":[%.1f,%.1f],\"target_at\":[%.1f,%.1f]}\n", *grabbed_,
                   static_cast<double>(vertex_at.x()), static_cast<double>(vertex_at.y()),
                   static_cast<double>(target_at.x()), static_cast<double>(target_at.y()));
    } else {
      std::fprintf(log_.file, "\"grabbed\":null}\n");
    }
    std::fflush(log_.file);
  }

  enum class Drag { none, orbit, pan };

  GLFWwindow* window_;
  std::shared_ptr<const Asset> asset_;
  ViewOptions options_;
  float scale_;
  float diagonal_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  Renderer renderer_;
  LogFile log_;
  std::optional<Scene> scene_;
  Shape shape_;
  Camera camera_;
  Vec3 base_gravity_{};

  bool playing_ = true;
  int single_steps_ = 0;
  bool show_physical_ = false, show_clusters_ = false, show_pinned_ = true;
  float gravity_ = 1, damping_ = 0, deformation_damping_ = 0, stiffness_ = 1;
  int iterations_ = 1;
  double owed_seconds_ = 0, frame_seconds_ = 1.0 / 60, step_milliseconds_ = 0;
  std::uint32_t frame_ = 0, steps_ = 0;

  int framebuffer_width_ = 0, framebuffer_height_ = 0, panel_pixels_ = 0, view_width_ = 0, view_height_ = 0;
  float pixels_per_unit_ = 1;
  std::vector<int> key_presses_;
  Drag drag_ = Drag::none;
  std::array<char, 64> channel_filter_ = {};
  bool both_sides_ = true;
  std::optional<std::uint32_t> grabbed_;  // visual vertex
  PickId pick_;
  Eigen::Vector3f grab_hit_ = Eigen::Vector3f::Zero();                                            // drawing units
  Eigen::Vector3f grab_start_ = Eigen::Vector3f::Zero(), grab_target_ = Eigen::Vector3f::Zero();  // metres
};

}  // namespace

void requireDisplay(const std::string& package) {
  const auto given = [](const char* name) {
    const char* value = std::getenv(name);
    return value != nullptr && *value != '\0';
  };
  if (given("DISPLAY")) return;
  const std::string cure = "Draw without a window instead: sinew render " + package + " -o picture.png.";
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
  View::listenForKeys(window.get());
  const Gui gui(window.get(), scale);
  View view(window.get(), asset, options, scale);
  view.run();
}

}  // namespace sinew::tools

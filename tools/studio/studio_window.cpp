// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/studio_window.h"

#define GLFW_INCLUDE_NONE  // epoxy declares OpenGL
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <epoxy/gl.h>
#include <imgui.h>

#include <chrono>
#include <thread>
#include <utility>

namespace sinew::tools {
namespace {

using Clock = std::chrono::steady_clock;

constexpr float kViewPanel = 290, kStudioPanel = 384;  // at 100 % scale
constexpr std::uint32_t kScreenshotFrames = 60;
constexpr std::uint32_t kAfterReplay = 4;
constexpr std::uint32_t kReplayDrawn = 30;  // one frame of so many

}  // namespace

StudioWindow::StudioWindow(const std::shared_ptr<const Asset>& asset, Document* document, const StudioOptions& options)
    : document_(document),
      options_(options),
      window_((document == nullptr ? "Sinew - " : "Sinew studio - ") + options.view.file),
      keys_(window_.get()),
      gui_(window_.get(), window_.scale()),
      log_(options.view.state_log) {
  layout_.scale = window_.scale();
  if (asset != nullptr) {
    play_.emplace(asset, options_.view);
    state_.tool = Tool::play;
  }
  if (!options.replay.empty()) replay_.emplace(options.replay);
}

void StudioWindow::run() {
  auto before = Clock::now();
  constexpr auto kReplayFrame = std::chrono::milliseconds(8);
  while (glfwWindowShouldClose(window_.get()) == GLFW_FALSE) {
    glfwPollEvents();
    if (replay_) std::this_thread::sleep_until(before + kReplayFrame);  // waits are for others
    const auto now = Clock::now();
    const double elapsed = std::chrono::duration<double>(now - before).count();
    before = now;
    frame_seconds_ += (elapsed - frame_seconds_) * 0.1;
    seconds_ += elapsed;
    ++frame_;
    if (!window_.measure(document_ == nullptr ? kViewPanel : kStudioPanel, layout_, width_, height_)) {
      glfwWaitEventsTimeout(0.1);  // minimized
      continue;
    }
    frame(elapsed);
    const bool last = isLast();
    if (last && !options_.view.screenshot.empty()) writeScreenshot(layout_, options_.view.screenshot);
    if (!screenshot_.empty()) writeScreenshot(layout_, std::exchange(screenshot_, ""));
    glfwSwapBuffers(window_.get());
    if (last) break;
  }
}

bool StudioWindow::isLast() const {
  const ViewOptions& view = options_.view;
  if (replay_) return last_frames_ >= std::max(view.frames, kAfterReplay);
  const std::uint32_t last = view.frames > 0 ? view.frames : view.screenshot.empty() ? 0 : kScreenshotFrames;
  return last > 0 && frame_ >= last;
}

void StudioWindow::replayFrame() {
  if (replay_->isDone()) ++last_frames_;
  Replay::Window seen{widgets_,
                      keys_,
                      [this](const Eigen::Vector3d& place) -> std::optional<Eigen::Vector2f> {
                        if (!author_view_.hasSource()) return std::nullopt;
                        return author_view_.onScreen(layout_, place);
                      },
                      true,
                      true,
                      false,
                      [this](const std::string& png) { screenshot_ = png; }};
  if (document_ != nullptr) {
    seen.is_evaluated = document_->isCurrent() && author_view_.hasSource();
    seen.is_baked = document_->isBaked() && bakes_taken_ == document_->bake().done();
    seen.bake_failed = document_->bake().state() == BakeJob::State::failed;
  }
  replay_->frame(seen);
}

void StudioWindow::frame(double elapsed) {
  if (document_ != nullptr) {
    document_->poll(seconds_);
    takeBake();
  }
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  if (replay_) replayFrame();
  widgets_.beginFrame();
  ImGui::NewFrame();
  const std::vector<Keys::Press> pressed = keys_.take();
  if (document_ == nullptr) {
    view_panel_.draw(layout_, height_, frame_seconds_, widgets_, *play_, shown_);
  } else {
    shortcuts(pressed);
    studioPanel();
    HeaderPanel::drawConflict(*document_, widgets_);
  }
  help();
  if (state_.tool == Tool::play) {
    if (play_) {
      play_input_.frame(layout_, pressed, *play_, shown_);
      play_->advance(replay_ ? 1.0 / 60 : elapsed);
    }
  } else {
    author_view_.frame(layout_, pressed, *document_, state_);
  }
  // Where there is no graphics card, drawing is all the time a replay takes: only what is to be seen is.
  const bool is_seen = !replay_ || frame_ % kReplayDrawn == 0 || !screenshot_.empty() || isLast();
  if (is_seen) draw();
  ImGui::Render();
  if (is_seen) ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  if (play_) log_.write(frame_, layout_, play_input_.camera(), *play_, shown_, bakes_taken_);
}

// The newest body, which goes on where the one before is.
void StudioWindow::takeBake() {
  const BakeJob& bake = document_->bake();
  if (bake.done() == bakes_taken_ || bake.asset()->package().visualTriangles().empty()) return;
  bakes_taken_ = bake.done();
  try {
    if (play_) {
      if (!play_->swap(bake.asset())) document_->say("the body has changed too much to go on: the scene starts again");
    } else {
      ViewOptions options = options_.view;
      options.scene = bake.asset()->package().pinSets().empty() ? SceneKind::drop : SceneKind::rest;
      play_.emplace(bake.asset(), options);
    }
  } catch (const std::exception& error) {
    document_->say(error.what(), true);
  }
}

void StudioWindow::shortcuts(std::span<const Keys::Press> pressed) {
  if (ImGui::GetIO().WantTextInput || author_view_.isStroking()) return;
  for (const Keys::Press& press : pressed) {
    if (!press.control) continue;
    if (press.key == GLFW_KEY_Z) press.shift ? document_->redo() : document_->undo();
    if (press.key == GLFW_KEY_Y) document_->redo();
    if (press.key == GLFW_KEY_B) document_->bakeNow();
  }
}

void StudioWindow::studioPanel() {
  beginPanel(layout_, height_);
  header_panel_.draw(*document_, widgets_);
  tabs();
  ImGui::End();
}

void StudioWindow::tabs() {
  if (!ImGui::BeginTabBar("##tabs")) return;
  const auto tab = [&](const char* label, Tool tool, const auto& content) {
    const bool open = ImGui::BeginTabItem(label);
    widgets_.mark(std::string("tab ") + label);
    if (!open) return;
    state_.tool = tool;
    ImGui::BeginChild("##tab");
    content();
    ImGui::EndChild();
    ImGui::EndTabItem();
  };
  tab("Regions", Tool::regions, [&] { regions_panel_.draw(*document_, state_, widgets_); });
  tab("Paint", Tool::paint, [&] { paint_panel_.draw(*document_, state_, widgets_); });
  tab("Pick", Tool::pick, [&] { pick_panel_.draw(*document_, state_, widgets_); });
  tab("Scene", Tool::play, [&] {
    const float width = static_cast<float>(layout_.panel) / layout_.pixels_per_unit;
    if (play_)
      ViewPanel::sceneControls(width, frame_seconds_, widgets_, *play_, shown_);
    else
      note("There is no body yet: it is being baked.");
  });
  if (play_ && !play_->package().channels().empty())
    tab("Channels", Tool::play, [&] { view_panel_.channels(widgets_, *play_); });
  ImGui::EndTabBar();
}

void StudioWindow::help() const {
  if (state_.tool == Tool::play) {
    drawViewHelp(layout_, width_, height_);
    return;
  }
  const char* text = state_.tool == Tool::paint
                         ? "Drag on the surface: paint.  Beside it, or right button: orbit.  Middle or Shift: pan.  "
                           "Wheel: zoom.\n[ ]: radius   X: symmetric   F: fit   Ctrl+Z: undo   Ctrl+Shift+Z: redo"
                     : state_.tool == Tool::pick
                         ? "Click the surface: a point.  Beside it, or right button: orbit.  Middle or Shift: pan.  "
                           "Wheel: zoom.\nF: fit   Ctrl+Z: undo   Ctrl+Shift+Z: redo   Ctrl+B: bake"
                         : "Drag: orbit.  Middle or Shift: pan.  Wheel: zoom.\n"
                           "F: fit   Ctrl+Z: undo   Ctrl+Shift+Z: redo   Ctrl+B: bake";
  drawHelp(layout_, width_, height_, text);
}

void StudioWindow::draw() {
  Renderer* renderer = nullptr;
  if (state_.tool == Tool::play) {
    if (play_) renderer = &play_view_.draw(layout_, shown_, play_input_.camera(), *play_);
  } else {
    renderer = author_view_.draw(layout_, *document_, state_);
  }
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(0, 0, layout_.framebuffer_width, layout_.framebuffer_height);
  glClearColor(0.125F, 0.137F, 0.161F, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  if (renderer != nullptr) renderer->present(layout_.panel, 0, layout_.width(), layout_.height());
}

}  // namespace sinew::tools

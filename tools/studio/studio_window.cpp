// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/studio_window.h"

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
#include <filesystem>
#include <numbers>
#include <thread>
#include <utility>

#include "tools/author/recipe_values.h"
#include "tools/core/atomic_file.h"
#include "tools/core/text.h"
#include "tools/import/output_files.h"
#include "tools/render/front.h"
#include "tools/scene/scene_text.h"
#include "tools/studio/preferences.h"
#include "tools/studio/scene_panel.h"
#include "tools/studio/show_panel.h"
#include "tools/studio/view_marks.h"

namespace sinew::tools {
namespace {

using Clock = std::chrono::steady_clock;

constexpr float kViewPanel = 320, kStudioPanel = 424;  // at 100 % scale
constexpr std::uint32_t kScreenshotFrames = 60;
constexpr std::uint32_t kAfterReplay = 4;
constexpr std::uint32_t kReplayDrawn = 30;  // one frame of so many

}  // namespace

StudioWindow::StudioWindow(const Opened& opened, const StudioOptions& options)
    : options_(options),
      window_("Sinew"),
      keys_(window_.get()),
      gui_(window_.get(), window_.scale()),
      log_(options.view.state_log) {
  layout_.scale = window_.scale();
  state_.navigation = options.navigation.value_or(readPreferences().navigation);
  take(opened);
  if (!options.replay.empty()) replay_.emplace(options.replay);
}

void StudioWindow::take(const Opened& opened) {
  // Fallible steps come first: what is open stays.
  std::unique_ptr<Document> document;
  std::optional<Play> play;
  if (opened.asset == nullptr) document = std::make_unique<Document>(opened.file);
  if (opened.asset != nullptr) {
    ViewOptions view = options_.view;
    view.file = opened.file;
    view.scene = opened.scene;
    play.emplace(opened.asset, view);
  }
  dialog_.close();
  document_ = std::move(document);
  play_.reset();
  if (play) play_.emplace(std::move(*play));
  file_ = opened.file;
  const Navigation navigation = state_.navigation;
  state_ = {};
  state_.navigation = navigation;
  if (document_ == nullptr) state_.tool = Tool::play;
  play_input_.emplace();
  play_view_.emplace();
  author_view_.emplace();
  bakes_taken_ = 0;
  shown_ = {};
  glfwSetWindowTitle(window_.get(), ((document_ == nullptr ? "Sinew - " : "Sinew studio - ") + file_).c_str());
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
    if (!screenshot_.empty()) screenshot(std::exchange(screenshot_, ""));
    glfwSwapBuffers(window_.get());
    if (last) break;
  }
}

void StudioWindow::say(const std::string& text, bool trouble) {
  if (document_ != nullptr) document_->say(text, trouble);
  if (document_ == nullptr && play_) play_->say(text);
}

void StudioWindow::screenshot(const std::string& png) {
  try {
    writeScreenshot(layout_, png);
    if (!replay_) say("wrote " + png);
  } catch (const std::exception& error) {
    if (replay_) throw;
    say(error.what(), true);
  }
}

std::string StudioWindow::besideIt(const std::string& ending) const {
  return std::filesystem::path(file_).replace_extension(ending).string();
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
                        if (!author_view_->hasSource()) return std::nullopt;
                        return author_view_->onScreen(layout_, place);
                      },
                      true,
                      true,
                      false,
                      [this](const std::string& png) { screenshot_ = png; },
                      film_.isRunning()};
  if (document_ != nullptr) {
    seen.is_evaluated = document_->isCurrent() && author_view_->hasSource();
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
  if (const std::string said = film_.poll(); !said.empty()) say(said, film_.hasFailed());
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  if (replay_) replayFrame();
  widgets_.beginFrame();
  ImGui::NewFrame();
  const auto panels = Clock::now();
  Commands commands = this->commands();
  panel(commands);
  if (document_ != nullptr) HeaderPanel::drawConflict(*document_, widgets_);
  help();
  menus_.drawHelpPage(state_.navigation, widgets_);
  dialog_.draw(widgets_);
  if (play_) FrameTimes::add(play_->times.panels, millisecondsSince(panels));
  for (const Command command : commands) run(command);
  if (!isSource()) {
    if (play_) {
      play_input_->frame(layout_, state_.navigation, commands, *play_, shown_);
      play_->advance(replay_ ? 1.0 / 60 : elapsed);
    }
  } else {
    author_view_->frame(layout_, commands, *document_, state_);
  }
  if (isSource() && author_view_->hasSource()) {
    drawViewMarks(layout_, author_view_->camera(), author_view_->metresPerUnit(), height_);
    for (const Handle& handle : author_view_->handles()) {
      const Eigen::Vector2f at = author_view_->onScreen(layout_, handle.place);
      widgets_.place(handleName(handle.kind), at.x(), at.y());
    }
  } else if (!isSource() && play_) {
    drawViewMarks(layout_, play_input_->camera(), double(play_->diagonal()), height_);
    for (const Handle& handle : play_input_->handles(*play_)) {
      const Eigen::Vector3f drawn = handle.place.cast<float>() / play_->diagonal();
      const Eigen::Vector2f at = onScreen(layout_, play_input_->camera(), drawn);
      widgets_.place(handleName(handle.kind), at.x(), at.y());
    }
  }
  for (const std::string& file : keys_.takeDropped()) open(file);
  // Where there is no graphics card, drawing is all the time a replay takes: only what is to be seen is.
  const bool is_seen = !replay_ || frame_ % kReplayDrawn == 0 || !screenshot_.empty() || isLast();
  if (is_seen) draw();
  ImGui::Render();
  if (is_seen) ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  log_.say(frame_, document_ != nullptr ? document_->message() : play_->message());
  if (play_) log_.write(frame_, layout_, play_input_->camera(), *play_, shown_, bakes_taken_);
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

// Commands by keys; typing into a field is text.
Commands StudioWindow::commands() {
  Commands commands;
  const std::vector<Keys::Press> pressed = keys_.take();
  if (ImGui::GetIO().WantTextInput || author_view_->isStroking()) return commands;
  for (const Keys::Press& press : pressed) {
    if (const auto command = commandOf(press, document_ != nullptr, isSource())) commands.push_back(*command);
  }
  return commands;
}

void StudioWindow::run(Command command) {
  switch (command) {
    case Command::open_file:
      dialog_.open("Open a mesh, a recipe or a package", "Open", file_,
                   [this](const std::string& file) { take(options_.open(file)); });
      break;
    case Command::save_scene:
      saveScene();
      break;
    case Command::film:
    case Command::turntable:
      film(command == Command::turntable);
      break;
    case Command::export_package:
      HeaderPanel::exportPackage(*document_);
      break;
    case Command::screenshot:
      screenshot_ = besideIt(".window.png");
      break;
    case Command::undo:
      document_->undo();
      break;
    case Command::redo:
      document_->redo();
      break;
    case Command::bake:
      document_->bakeNow();
      break;
    case Command::stiffen:
      stiffenRecipe();
      break;
    case Command::help:
      menus_.toggleHelp();
      break;
    default:
      break;  // of a view
  }
}

void StudioWindow::open(const std::string& file) {
  try {
    take(options_.open(file));
    say("opened " + file);
  } catch (const std::exception& error) {
    say(error.what(), true);
  }
}

std::string StudioWindow::sceneToSave() {
  SceneTextOptions options;
  options.picks = saves_picks_;
  options.targets = play_->scriptTargets();
  options.solids = play_->placed().all();
  options.camera = sceneViewOf(play_input_->camera(), play_->package(), play_->scene().placement().position);
  return sceneText(play_->scene(), options);
}

void StudioWindow::saveScene() {
  if (!play_) {
    say("there is no body yet whose pose could be saved", true);
    return;
  }
  const auto save = [this](const std::string& file) {
    requireOutput(Output::scene, file, {file_});
    writeFileAtomically(file, sceneToSave());
    say("wrote " + file);
  };
  dialog_.open("Save what plays as a scene", "Save", besideIt(".scene.json"), save, [this](Widgets& widgets) {
    widgets.checkbox("Locked pulls, not the channels alone", saves_picks_);
    note("sinew view, render and simulate take it: --scene FILE.");
  });
}

void StudioWindow::film(bool turntable) {
  if (!play_) {
    say("there is no body yet that could be filmed", true);
    return;
  }
  const SceneChoice scene = play_->scene().options().scene;
  // A built-in scene's drive is in no scene's file.
  films_as_saved_ = scene.script != nullptr || scene == SceneKind::rest || play_->placed().size() > 0;
  film_seconds_ = float(scene.seconds());
  const auto start = [this, scene, turntable](const std::string& file) {
    FilmOptions options;
    options.package = document_ == nullptr ? file_ : document_->bake().package().string();
    options.turntable = turntable;
    options.seconds = sevenDigits(double(film_seconds_));
    options.step = sevenDigits(double(play_->settings.step_seconds));
    if (films_as_saved_) {
      options.scene_text = sceneToSave();
    } else {
      const SceneScript::View view = sceneViewOf(play_input_->camera(), play_->package(), {});
      const double yaw = std::remainder(view.yaw - double(frontYaw(play_->package())), 2 * std::numbers::pi);
      options.scene = scene.script ? scene.script->text.file() : scene.name();
      options.camera = exactText(sevenDigits(yaw / kDegree)) + "," + exactText(sevenDigits(view.pitch / kDegree));
    }
    film_.start(options, file);
    say("filming " + file);
  };
  dialog_.open(
      turntable ? "Film a turntable" : "Film the scene", "Film", besideIt(turntable ? ".turntable.mp4" : ".mp4"), start,
      [this, scene](Widgets& widgets) {
        if (widgets.radio("As it would be saved: pose, sliders, colliders", films_as_saved_)) films_as_saved_ = true;
        if (widgets.radio("The scene " + scene.name() + " from its start, as it is by itself", !films_as_saved_))
          films_as_saved_ = false;
        widgets.slider("Length", film_seconds_, 0.5F, 30, "%.1f s", false);
      });
}

void StudioWindow::filmPanel() {
  if (!film_.isRunning()) return;
  // Over the view: nothing of the panel moves under the mouse.
  const ImVec2 size = ImGui::GetMainViewport()->Size;
  const float em = ImGui::GetFontSize();
  ImGui::SetNextWindowPos({size.x - em, em}, ImGuiCond_Always, {1, 0});
  ImGui::Begin("##film", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoFocusOnAppearing);
  ImGui::ProgressBar(film_.child().fraction(), {12 * em, ImGui::GetFrameHeight()}, "The video");
  ImGui::SameLine();
  if (widgets_.button("Cancel##the video", 5 * em)) {
    film_.cancel();
    say("the video is given up");
  }
  ImGui::End();
}

void StudioWindow::stiffenRecipe() {
  const float factor = play_ ? play_->settings.stiffness : 1;
  if (factor == 1) {
    say("the slider Stiffness stands at 1: move it first, on the tab Scene");
    return;
  }
  if (!document_->edit([&](RecipeEditor& editor) { stiffen(editor, sevenDigits(double(factor))); })) return;
  play_->settings.stiffness = 1;
}

void StudioWindow::panel(Commands& commands) {
  beginPanel(layout_, height_);
  const Navigation before = state_.navigation;
  menus_.draw(document_ != nullptr, isSource(), widgets_, state_.navigation, commands);
  // Where they cannot be kept, that is no reason to trouble anybody.
  if (state_.navigation != before) writePreferences({state_.navigation});
  if (document_ != nullptr) {
    header_panel_.draw(*document_, widgets_);
  } else {
    const formats::PackageView& package = play_->package();
    const std::string name(package.text(package.info().name));
    ImGui::TextUnformatted(name.empty() ? file_.c_str() : name.c_str());
  }
  tabs();
  ImGui::End();
  filmPanel();
}

void StudioWindow::tabs() {
  ImGui::PushStyleVar(ImGuiStyleVar_FramePadding,
                      {ImGui::GetStyle().FramePadding.x * 0.6F, ImGui::GetStyle().FramePadding.y});
  const bool bar = ImGui::BeginTabBar("##tabs");
  ImGui::PopStyleVar();
  if (!bar) return;
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
  if (document_ != nullptr) {
    tab("Regions", Tool::regions, [&] { regions_panel_.draw(*document_, state_, widgets_); });
    tab("Paint", Tool::paint, [&] { paint_panel_.draw(*document_, state_, widgets_); });
    tab("Pick", Tool::pick, [&] { pick_panel_.draw(*document_, state_, widgets_); });
  }
  const auto played = [&](const auto& content) {
    if (play_)
      content();
    else
      note("There is no body yet: it is being baked.");
  };
  tab("Scene", Tool::play, [&] { played([&] { ScenePanel::draw(widgets_, *play_); }); });
  tab("Show", Tool::play,
      [&] { played([&] { ShowPanel::draw(frame_seconds_, play_view_->colors(), widgets_, *play_, shown_); }); });
  if (play_ && !play_->package().channels().empty())
    tab("Channels", Tool::play, [&] { channels_panel_.draw(widgets_, *play_); });
  ImGui::EndTabBar();
}

void StudioWindow::help() const {
  const char* tool = "Look around";
  switch (state_.tool) {
    case Tool::paint:
      tool = state_.brush.shape == BrushShape::lasso ? "Left: drag a loop around what is to be painted"
                                                     : "Left on the surface: paint";
      break;
    case Tool::pick:
      tool = "Left on the surface: a point";
      break;
    case Tool::play:
      tool = !play_                            ? "The body is being baked"
             : play_->hand == HandTool::push   ? "Left on the body: push it with a ball, the wheel moves it on"
             : play_->hand == HandTool::cut    ? "Left: drag a line, it cuts along it"
             : play_->hand == HandTool::target ? "Left on a target's dot: move it, the wheel turns it"
                                               : "Left on the body: pull it";
      break;
    case Tool::regions:
      break;
  }
  std::string text = tool;
  for (const auto& [what, how] : navigationHelp(state_.navigation).first(3))
    text += std::string(".  ") + what + ": " + how;
  text += ".\n";
  // The rest is on the page of help.
  constexpr std::array kUsual = {Command::play,      Command::step,    Command::step_back,
                                 Command::restart,   Command::smaller, Command::larger,
                                 Command::symmetric, Command::fit,     Command::help};
  for (const Shortcut& shortcut : shortcuts()) {
    const bool usual = std::find(kUsual.begin(), kUsual.end(), shortcut.command) != kUsual.end();
    const bool brush = shortcut.place == Place::source && state_.tool != Tool::paint;
    if (usual && !brush && isPossible(shortcut, document_ != nullptr, isSource()))
      text += keysText(shortcut) + ": " + shortcut.name + "   ";
  }
  drawHelp(layout_, width_, height_, text.c_str());
}

void StudioWindow::draw() {
  Renderer* renderer = nullptr;
  if (!isSource()) {
    if (play_) renderer = &play_view_->draw(layout_, shown_, *play_input_, *play_);
  } else {
    renderer = author_view_->draw(layout_, *document_, state_);
  }
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
  glViewport(0, 0, layout_.framebuffer_width, layout_.framebuffer_height);
  glClearColor(0.125F, 0.137F, 0.161F, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  if (renderer != nullptr) renderer->present(layout_.panel, 0, layout_.width(), layout_.height());
}

}  // namespace sinew::tools

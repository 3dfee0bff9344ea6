// SPDX-License-Identifier: GPL-3.0-or-later
//
// The frames of the one window that `sinew view` and `sinew studio` share.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "tools/studio/author_view.h"
#include "tools/studio/channels_panel.h"
#include "tools/studio/document.h"
#include "tools/studio/film.h"
#include "tools/studio/gui.h"
#include "tools/studio/header_panel.h"
#include "tools/studio/menus.h"
#include "tools/studio/paint_panel.h"
#include "tools/studio/path_dialog.h"
#include "tools/studio/pick_panel.h"
#include "tools/studio/play_view.h"
#include "tools/studio/regions_panel.h"
#include "tools/studio/replay.h"
#include "tools/studio/view_log.h"
#include "tools/studio/view_play.h"
#include "tools/studio/view_window.h"
#include "tools/studio/window.h"

namespace sinew::tools {

class StudioWindow {
 public:
  StudioWindow(const Opened& opened, const StudioOptions& options);
  /// Until it is closed, or as the options say. Throws ToolError.
  void run();

 private:
  void take(const Opened& opened);
  void frame(double elapsed);
  void takeBake();
  Commands commands();
  void run(Command command);
  void open(const std::string& file);
  void panel(Commands& commands);
  void tabs();
  std::string sceneToSave();
  void saveScene();
  void film(bool turntable);
  void filmPanel();
  void stiffenRecipe();
  void screenshot(const std::string& png);
  void help() const;
  void draw();
  void replayFrame();
  bool isLast() const;
  bool isSource() const { return state_.tool != Tool::play; }
  void say(const std::string& text, bool trouble = false);
  /// A name beside what is open, with another ending.
  std::string besideIt(const std::string& ending) const;

  StudioOptions options_;
  Glfw glfw_;
  Window window_;
  ViewLayout layout_;
  Keys keys_;  // before Dear ImGui's own callbacks
  Gui gui_;
  Widgets widgets_;
  Menus menus_;
  PathDialog dialog_;
  bool saves_picks_ = true;
  Film film_;
  bool films_as_saved_ = true;
  float film_seconds_ = 2;
  std::string file_;  // what is open, as the user named it
  std::unique_ptr<Document> document_;
  std::optional<Play> play_;
  std::optional<ViewInput> play_input_;
  std::optional<PlayView> play_view_;
  Shown shown_;
  ViewLog log_;
  std::optional<Replay> replay_;
  StudioState state_;
  std::optional<AuthorView> author_view_;
  ChannelsPanel channels_panel_;
  HeaderPanel header_panel_;
  RegionsPanel regions_panel_;
  PaintPanel paint_panel_;
  PickPanel pick_panel_;
  std::uint32_t bakes_taken_ = 0;

  int width_ = 0, height_ = 0;  // of the window
  double seconds_ = 0, frame_seconds_ = 1.0 / 60;
  std::uint32_t frame_ = 0, last_frames_ = 0;
  std::string screenshot_;  // to be written in this frame
};

}  // namespace sinew::tools

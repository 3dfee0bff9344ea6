// SPDX-License-Identifier: GPL-3.0-or-later
//
// The frames of the one window that `sinew view` and `sinew studio` share.
#pragma once

#include <memory>
#include <optional>

#include "tools/studio/author_view.h"
#include "tools/studio/document.h"
#include "tools/studio/header_panel.h"
#include "tools/studio/paint_panel.h"
#include "tools/studio/pick_panel.h"
#include "tools/studio/play_view.h"
#include "tools/studio/regions_panel.h"
#include "tools/studio/replay.h"
#include "tools/studio/view_log.h"
#include "tools/studio/view_panel.h"
#include "tools/studio/view_play.h"
#include "tools/studio/view_window.h"
#include "tools/studio/window.h"

namespace sinew::tools {

class StudioWindow {
 public:
  /// \param asset what is played; null: what the document bakes. \param document must outlive it; null: nothing is
  /// edited. One of the two is given.
  StudioWindow(const std::shared_ptr<const Asset>& asset, Document* document, const StudioOptions& options);
  /// Until it is closed, or as the options say. Throws ToolError.
  void run();

 private:
  void frame(double elapsed);
  void takeBake();
  void shortcuts(std::span<const Keys::Press> pressed);
  void studioPanel();
  void tabs();
  void help() const;
  void draw();
  void replayFrame();
  bool isLast() const;

  Document* document_;
  StudioOptions options_;
  Glfw glfw_;
  Window window_;
  ViewLayout layout_;
  Keys keys_;  // before Dear ImGui's own callbacks
  Gui gui_;
  Widgets widgets_;
  std::optional<Play> play_;
  ViewInput play_input_;
  PlayView play_view_;
  ViewPanel view_panel_;
  Shown shown_;
  ViewLog log_;
  std::optional<Replay> replay_;
  // Of a document.
  StudioState state_;
  AuthorView author_view_;
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

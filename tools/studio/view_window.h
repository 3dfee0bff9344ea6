// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "tools/scene/scene.h"
#include "tools/studio/camera_mouse.h"

namespace sinew::tools {

struct ViewOptions {
  SceneChoice scene = SceneKind::drop;
  std::vector<std::shared_ptr<const Asset>> others = {};  ///< as in SceneOptions
  const SolverFactory* solver = nullptr;                  ///< null: its fields
  std::string file;          ///< the package as the user named it, for messages and the title
  std::string screenshot;    ///< PNG of the window after `frames` frames; empty = none
  std::uint32_t frames = 0;  ///< end after so many; 0 = when closed (with a screenshot: 60)
  std::string state_log;     ///< a line of JSON each frame: what is grabbed, where it is, the camera; empty = none
};

/// A file that a window shows.
struct Opened {
  std::string file;                     ///< the package, or the recipe, as the user named it
  std::shared_ptr<const Asset> asset;   ///< of a package; null: the file is a recipe
  SceneChoice scene = SceneKind::drop;  ///< that a package plays
};

struct StudioOptions {
  ViewOptions view;    ///< its `frames` count from the replay's end; `file` and `scene` are those of what is opened
  std::string replay;  ///< events instead of mouse and keyboard (replay.h); the window ends after them; empty = none
  std::optional<Navigation> navigation;  ///< nothing: as in the last session
  /// Opens what is dropped on the window or chosen there: a package, a recipe, or a source, whose recipe is made where
  /// there is none. Throws ToolError.
  std::function<Opened(const std::string&)> open;
};

/// Opens the window on a package, to be looked at, or on a recipe, and returns when it is closed. Throws
/// ToolError(system) that says how to go on where the window or OpenGL 3.3 cannot be had, (bad_input) for what is wrong
/// with the file or the replay.
void runStudioWindow(const Opened& opened, const StudioOptions& options);

}  // namespace sinew::tools

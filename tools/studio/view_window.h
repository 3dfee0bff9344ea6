// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "tools/scene/scene.h"

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

struct StudioOptions {
  ViewOptions view;    ///< its `frames` count from the replay's end; `file` is the recipe
  std::string replay;  ///< events instead of mouse and keyboard (replay.h); the window ends after them; empty = none
};

/// Throws ToolError(system) that names `sinew render` where there is no display to open a window on.
void requireDisplay(const std::string& package);

/// Opens the window of `sinew view` and returns when it is closed. Throws ToolError(system) where the window or
/// OpenGL 3.3 cannot be had.
void runViewWindow(const std::shared_ptr<const Asset>& asset, const ViewOptions& options);

/// Opens the window of `sinew studio` on a recipe. Throws ToolError as runViewWindow(), and for what is wrong with the
/// recipe or the replay.
void runStudioWindow(const std::filesystem::path& recipe, const StudioOptions& options);

}  // namespace sinew::tools

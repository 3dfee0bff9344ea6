// SPDX-License-Identifier: GPL-3.0-or-later
//
// What plays, as a scene file that another player can take up.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/scene/scene.h"

namespace sinew::tools {

struct SceneTextOptions {
  bool picks = true;                         ///< locked picks too, not the channels alone
  std::vector<SceneScript::Target> targets;  ///< where they are, in one key each; those that are at rest are left out
  std::optional<SceneScript::View> camera;   ///< in the source's coordinates
};

/// The text of a scene file (docs/scenes.md) that brings a body from rest to the pose of this one and holds it there:
/// its channels' inputs, its locked picks, gravity, iterations. \pre the scene's bodies were not cut
std::string sceneText(const Scene& scene, const SceneTextOptions& options);

}  // namespace sinew::tools

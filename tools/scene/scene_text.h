// SPDX-License-Identifier: GPL-3.0-or-later
//
// The play, as a scene file that another player can take up.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/scene/scene.h"

namespace sinew::tools {

/// A collider that was placed by hand.
struct PlacedSolid {
  ColliderShape shape;        ///< a box, sphere or capsule
  ColliderSettings settings;  ///< its place in the world of the scene, friction, restitution
};
/// "box", "sphere" or "capsule", as a scene file names a shape; empty: none of these.
std::string shapeName(const ColliderShape& shape);

struct SceneTextOptions {
  bool picks = true;                         ///< locked picks too, not the channels alone
  std::vector<SceneScript::Target> targets;  ///< where they are, in one key each; targets at rest are left out
  std::optional<SceneScript::View> camera;   ///< in the source's coordinates
  std::vector<PlacedSolid> solids;           ///< beside those of a scene from a file
};

/// The text of a scene file (docs/scenes.md) that brings a body from rest to the pose of this one and holds it there:
/// its channels' inputs, its locked picks, and plays there by the same settings, ground and colliders. \pre the scene's
/// bodies were not cut
std::string sceneText(const Scene& scene, const SceneTextOptions& options);

}  // namespace sinew::tools

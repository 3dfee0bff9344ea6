// SPDX-License-Identifier: GPL-3.0-or-later
//
// Scene files (docs/scenes.md) as `study error` plays them: what finite elements can do of them, as the package's pins
// and muscles ask for it.
#pragma once

#include <memory>

#include "tools/scene/scene_script.h"
#include "tools/study/motion.h"

namespace sinew::tools {

/// Throws ToolError(bad_input), which names file, line and key, where a file asks for what the reference cannot do.
std::shared_ptr<const SceneScript> errorScript(const std::string& file);

/// The scene on a package: a region for each of its pin sets, which follows its target.
/// Throws ToolError(bad_input) where the package lacks a channel or a target of the file.
MotionScene scriptedScene(const std::shared_ptr<const SceneScript>& script, const formats::PackageView& package);

/// A package's pieces with the materials, holds, tethers and fibres that their fields are made from (docs/method.md
/// §2), on the vertices of the package, as far as they hang together by faces.
MotionBody scriptedBody(const formats::PackageView& package, const MotionScene& scene);

}  // namespace sinew::tools

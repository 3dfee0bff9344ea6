// SPDX-License-Identifier: GPL-3.0-or-later
//
// The verbs' inputs and outputs.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sinew/runtime/asset.h"
#include "tools/import/output_files.h"
#include "tools/scene/scene.h"

namespace sinew::tools {

/// Loads a package or throws ToolError(bad_input).
std::shared_ptr<const Asset> loadPackage(const std::string& file);

/// Loads the packages of `files` for scenes of several bodies. Throws ToolError(usage) where there are some and none of
/// the scenes takes them.
std::vector<std::shared_ptr<const Asset>> loadOthers(const std::vector<std::string>& files,
                                                     std::span<const SceneChoice> scenes);

}  // namespace sinew::tools

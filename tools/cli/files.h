// SPDX-License-Identifier: GPL-3.0-or-later
//
// The verbs' inputs and outputs: under which names, and over which files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sinew/runtime/asset.h"
#include "tools/scene/scene.h"

namespace sinew::tools {

enum class Output : std::uint8_t { package, picture, picture_or_video, mesh, report };

/// Throws ToolError where `file` cannot be written (requireWritable), or its name or the file there shows a mistake: a
/// package or a report named like a mesh or a picture, a picture that does not end in .png, a package
/// over a file that is none. To be called before any work.
void requireOutput(Output what, const std::filesystem::path& file,
                   std::initializer_list<std::filesystem::path> inputs = {});

/// Loads a package or throws ToolError(bad_input).
std::shared_ptr<const Asset> loadPackage(const std::string& file);

/// Loads the packages of `files` for scenes of several bodies. Throws ToolError(usage) where there are some and none of
/// the scenes takes them.
std::vector<std::shared_ptr<const Asset>> loadOthers(const std::vector<std::string>& files,
                                                     std::span<const SceneChoice> scenes);

}  // namespace sinew::tools

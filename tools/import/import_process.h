// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "tools/import/import.h"
#include "tools/import/raw_scene.h"
#include "tools/pictures/decode_picture.h"

namespace sinew::tools {

/// Runs `worker --import-worker FILE FORMAT FD MEGABYTES SECONDS` and takes the scene it writes to FD. The child's
/// bytes are those of a stranger: counts are bounded by options.memory_megabytes before memory is taken, the wait by
/// options.seconds, and the scene is validated. Whatever befalls the child becomes a ToolError.
RawScene readInChild(const std::filesystem::path& file, const std::string& format, const ImportOptions& options,
                     Progress& progress);

/// What decodePicture() makes of each picture, found out by a child of options.worker within options.seconds of
/// processor time and options.memory_megabytes beyond what the codecs take. One that brings the child down is not read.
/// Where the codecs cannot be opened all count as whole: what draws says so. Throws ToolError(system) where the machine
/// fails.
std::vector<PictureState> pictureStates(std::span<const std::span<const std::byte>> pictures,
                                        const ImportOptions& options);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>

#include "tools/import/import.h"
#include "tools/import/raw_scene.h"

namespace sinew::tools {

/// Runs `worker --import-worker FILE FORMAT FD MEGABYTES SECONDS` and takes the scene it writes to FD. The child's
/// bytes are those of a stranger: counts are bounded by options.memory_megabytes before memory is taken, the wait by
/// options.seconds, and the scene is validated. Whatever befalls the child becomes a ToolError.
RawScene readInChild(const std::filesystem::path& file, const std::string& format, const ImportOptions& options,
                     Progress& progress);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace sinew::tools {

/// Reads a whole regular file. Throws ToolError(bad_input) naming it where it is missing, a folder, a pipe or a device
/// (which might never end), larger than `most_megabytes`, or cannot be read.
std::string readWholeFile(const std::filesystem::path& file, std::uint64_t most_megabytes);

}  // namespace sinew::tools

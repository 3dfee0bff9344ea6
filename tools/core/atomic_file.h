// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace sinew::tools {

/// Writes a file whole or not at all: beside its place, synced, then renamed over it. A signal that arrives meanwhile
/// takes effect after the file is whole or gone. Throws ToolError(system) naming the file.
void writeFileAtomically(const std::filesystem::path& file, std::span<const std::byte> bytes);
void writeFileAtomically(const std::filesystem::path& file, std::string_view text);

/// Throws ToolError where `file` could not be written later: its folder is missing, or it is itself a folder.
void requireWritable(const std::filesystem::path& file);

}  // namespace sinew::tools

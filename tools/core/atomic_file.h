// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

namespace sinew::tools {

/// Writes a file whole or not at all: beside its place, synced, then renamed over it. A signal that arrives meanwhile
/// takes effect after the file is whole or gone. A symbolic link stays one: what it leads to is written. Throws
/// ToolError(system) naming the file.
void writeFileAtomically(const std::filesystem::path& file, std::span<const std::byte> bytes);
void writeFileAtomically(const std::filesystem::path& file, std::string_view text);

/// Throws ToolError where `file` could not be written later: it has no name, its folder is missing, it is itself a
/// folder, a pipe or a device, or one of `inputs`, which writing would destroy.
void requireWritable(const std::filesystem::path& file, std::initializer_list<std::filesystem::path> inputs = {});

}  // namespace sinew::tools

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

/// A file beside the place of another, with its extension, for what takes long to write; locked while it lives. Removed
/// with this object unless put in place; what a killed run left for the same place is removed by the next.
class FileBeside {
 public:
  /// Throws ToolError(system) naming `file` where none can be made.
  explicit FileBeside(const std::filesystem::path& file);
  ~FileBeside();
  FileBeside(const FileBeside&) = delete;
  FileBeside& operator=(const FileBeside&) = delete;

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] int descriptor() const { return descriptor_; }
  /// Syncs it and renames it to its place. Throws ToolError(system) where that fails.
  void putInPlace();

 private:
  std::filesystem::path file_;
  std::string path_;  // empty once in place
  int descriptor_ = -1;
};

/// Throws ToolError where `file` could not be written later: it has no name, its folder is missing, it is itself a
/// folder, a pipe or a device, or one of `inputs`, which writing would destroy.
void requireWritable(const std::filesystem::path& file, std::initializer_list<std::filesystem::path> inputs = {});

}  // namespace sinew::tools

// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string>

namespace sinew::internal {

/// A file's bytes, 64-byte aligned. Not owned: release with unmapFile, or as an aligned allocation if not `mapped`.
struct MappedFile {
  void* data = nullptr;
  std::size_t bytes = 0;
  bool mapped = false;
  const char* reason = nullptr;  ///< why there are none, until the next failure; null on success
};

/// Maps a file for reading; reads it into memory where the system has no memory maps.
MappedFile mapFile(const std::string& path);
void unmapFile(void* data, std::size_t bytes);

}  // namespace sinew::internal

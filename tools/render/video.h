// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "tools/render/image.h"

namespace sinew::tools {

/// Writes an mp4 (H.264) whole or not at all: frames go to a file of its own beside the place, finish() puts it there.
/// Ctrl-C and the like while it lives remove that file before they end the program.
class VideoFile {
 public:
  /// \param width,height even, pixels. Throws ToolError(system) where the encoder or the folder is missing.
  VideoFile(std::filesystem::path file, int width, int height, double frames_per_second);
  ~VideoFile();
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  void add(const Image& frame);
  void finish();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// All frames of a video, for tests. Empty where it cannot be read.
std::vector<Image> readVideo(const std::filesystem::path& file);

}  // namespace sinew::tools

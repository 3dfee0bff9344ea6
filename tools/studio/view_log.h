// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>

#include "tools/studio/view_input.h"

namespace sinew::tools {

/// A line of JSON for each frame of `sinew view`: what is grabbed, where it is, the camera.
class ViewLog {
 public:
  /// \param name of the file; empty = nothing is written. Throws ToolError(system).
  explicit ViewLog(const std::string& name);
  ~ViewLog();
  ViewLog(const ViewLog&) = delete;
  ViewLog& operator=(const ViewLog&) = delete;
  /// The window's message, where it differs from the last frame's.
  void say(std::uint32_t frame, const std::string& message);
  /// \param bakes how many bodies have come from a document
  void write(std::uint32_t frame, const ViewLayout& layout, const Camera& camera, const Play& play, const Shown& shown,
             std::uint32_t bakes);

 private:
  std::FILE* file_;
  std::string said_;
};

}  // namespace sinew::tools

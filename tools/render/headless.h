// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace sinew::tools {

/// An OpenGL 3.3 core context without a display (EGL on Mesa's surfaceless platform; a GPU or the software renderer).
/// Current in the calling thread from construction to destruction; pictures go to framebuffer objects.
class HeadlessContext {
 public:
  /// Throws ToolError(system) that says what is missing.
  HeadlessContext();
  ~HeadlessContext();
  HeadlessContext(const HeadlessContext&) = delete;
  HeadlessContext& operator=(const HeadlessContext&) = delete;

 private:
  void* display_ = nullptr;
  void* context_ = nullptr;
};

}  // namespace sinew::tools

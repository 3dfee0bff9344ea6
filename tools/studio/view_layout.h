// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace sinew::tools {

/// Where things are in the window; in pixels of the framebuffer, but where it says otherwise.
struct ViewLayout {
  float scale = 1;            ///< of text and panels
  float pixels_per_unit = 1;  ///< of window coordinates
  int framebuffer_width = 0, framebuffer_height = 0;
  int panel = 0;  ///< width, at the left
  int width() const { return framebuffer_width - panel; }
  int height() const { return framebuffer_height; }
  /// How near the mouse takes hold of a handle, pixels.
  float handleReach() const { return 11 * scale; }
  float aspect() const { return static_cast<float>(width()) / static_cast<float>(height()); }
};

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// A camera under the mouse, by the habits of the program that a person knows.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <utility>

#include "tools/render/camera.h"
#include "tools/studio/view_layout.h"

namespace sinew::tools {

enum class Navigation : std::uint8_t { usual, blender, maya };
/// Names in the order of the enum: "Sinew", "Blender", "Maya".
std::span<const std::string_view> navigationNames();
/// Drags by effect, for the page of help.
std::span<const std::pair<const char*, const char*>> navigationHelp(Navigation navigation);

enum class CameraDrag : std::uint8_t { none, orbit, pan, zoom };
/// Drag begun by a button going down. \param button 0 left, 1 right, 2 middle
CameraDrag dragOf(Navigation navigation, int button, bool shift, bool control, bool alt);

class CameraMouse {
 public:
  /// Looks at the buttons that went down in this frame. \return whether the left one now moves the camera, and is no
  /// tool's
  bool begin(Navigation navigation, bool over_view);
  /// The left button went down, and no tool has taken it.
  void leaveLeft();
  /// Moves the camera by the mouse's motion, unless a tool holds the mouse; the wheel zooms.
  void frame(const ViewLayout& layout, bool is_held, bool over_view, Camera& camera);

 private:
  CameraDrag drag_ = CameraDrag::none;
  Navigation navigation_ = Navigation::usual;
};

/// Where a place of the drawing lies in the window, in its own coordinates.
Eigen::Vector2f onScreen(const ViewLayout& layout, const Camera& camera, const Eigen::Vector3f& place);
/// The ray under the mouse, not unit.
Eigen::Vector3f mouseRay(const ViewLayout& layout, const Camera& camera);

}  // namespace sinew::tools

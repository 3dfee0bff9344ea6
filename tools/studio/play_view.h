// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "tools/render/renderer.h"
#include "tools/studio/view_input.h"

namespace sinew::tools {

/// Draws the scene that is played.
class PlayView {
 public:
  /// Into the renderer's own target: present() what is returned.
  Renderer& draw(const ViewLayout& layout, const Shown& shown, Camera& camera, const Play& play);

 private:
  std::optional<Renderer> renderer_;
  Shape drawn_;  // by the renderer
};

}  // namespace sinew::tools

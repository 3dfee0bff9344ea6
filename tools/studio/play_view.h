// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "tools/render/renderer.h"
#include "tools/studio/section_view.h"
#include "tools/studio/view_input.h"

namespace sinew::tools {

/// Draws the scene that is played.
class PlayView {
 public:
  /// Into the renderer's own target: present() what is returned.
  Renderer& draw(const ViewLayout& layout, const Shown& shown, ViewInput& input, Play& play);
  /// Of the colours that the last draw() showed.
  const PlayColors& colors() const { return colors_; }

 private:
  std::optional<Renderer> renderer_;
  Shape drawn_;  // by the renderer
  PlayColors colors_;
  SectionView section_;
};

}  // namespace sinew::tools

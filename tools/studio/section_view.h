// SPDX-License-Identifier: GPL-3.0-or-later
//
// The tetrahedra of a body, cut open by a plane of the rest shape.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "tools/render/renderer.h"
#include "tools/studio/view_play.h"

namespace sinew::tools {

/// A plane across an axis of the rest shape.
struct Section {
  bool shown = false;
  int axis = 0;       ///< x, y, z
  float at = 0.5F;    ///< of the bounds, 0..1
  bool flip = false;  ///< which side is left out
  bool operator==(const Section&) const = default;
};

class SectionView {
 public:
  /// Draws the first body's tetrahedra on the plane's side into the renderer's own target. Null where there are none.
  Renderer* draw(const Section& section, const Play& play, const Camera& camera, const DrawSettings& settings,
                 int width, int height);

 private:
  void make(const Section& section, const std::shared_ptr<const Asset>& asset);

  // Sources of faces_.
  Section made_;
  std::shared_ptr<const Asset> asset_;
  std::optional<Renderer> renderer_;
  std::vector<std::array<std::uint32_t, 3>> faces_;  // physical vertices, outward
};

/// Faces of the tetrahedra whose middle lies on the shown side, without faces that two share; outward.
std::vector<std::array<std::uint32_t, 3>> sectionFaces(const formats::PackageView& package, const Section& section);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Cuts polygons into triangles. Quads by the shorter diagonal that does not fold them; larger ones by ear clipping in
/// the plane of Newell's normal, best-shaped ear first. Concave, collinear and self-crossing ones give n - 2 triangles
/// too. Ear clipping takes a bounded amount of work over all polygons, after which the rest is cut as fans.
class Triangulator {
 public:
  /// \param corners 3 or more positions around the polygon.
  /// \param triangles appended: corners - 2 triples of corner numbers, same winding.
  void cut(std::span<const Eigen::Vector3d> corners, std::vector<Triangle>& triangles);

 private:
  void cutQuad(std::span<const Eigen::Vector3d> corners, std::vector<Triangle>& triangles) const;
  std::uint64_t work_left_ = 100'000'000;  // about a second
  std::vector<Eigen::Vector2d> flat_;
  std::vector<std::uint32_t> next_;
  std::vector<std::uint32_t> previous_;
};

}  // namespace sinew::tools

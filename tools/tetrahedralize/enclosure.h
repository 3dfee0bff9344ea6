// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/geometry/tet_mesh.h"

namespace sinew::tools {

/// Enclosure of triangles, taken together.
struct Enclosure {
  double area = 0;        ///< m^2
  double volume = 0;      ///< m^3, signed; holes closed by fans about the middle of their edges
  double openness = 0;    ///< |sum of area vectors| / area
  bool balanced = false;  ///< no open edge
  bool encloses = false;  ///< enough to be a solid
};

/// \param triangles over `points`, metres.
Enclosure enclosureOf(std::span<const Eigen::Vector3d> points, std::span<const geometry::Triangle> triangles);

/// Where an edge has three faces, one of them is a wall through the inside or a fin outside. The mean of the winding
/// numbers on its two sides decides: 1/2 at a surface, 1 at a wall, 0 at a fin. They are left out if that leaves no
/// open edge.
std::vector<geometry::Triangle> withoutWallsAndFins(std::span<const Eigen::Vector3d> points,
                                                    std::vector<geometry::Triangle> triangles);

}  // namespace sinew::tools

// SPDX-License-Identifier: MIT
//
// Closure of a cut's two sides: polygons in the plane, triangulated.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "runtime/cut/surface.h"

namespace sinew::cutting {

/// A point of a section that is on no rim.
struct Interior {
  Vector3d at, rest;  ///< m, world; m, at rest
  Hung hung;
};

/// A face of the section: rim nodes, then points inside.
struct Polygon {
  std::vector<std::uint32_t> nodes;
  std::vector<Interior> interior;
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< counter-clockwise seen from above
  double area = 0;                                      ///< m^2, in the plane
  std::uint32_t piece = 0;
  bool plain = true;  ///< a triangulation of loops that do not cross; else ears, which may overlap
};

/// Finds the tetrahedron of a piece that has a place of the plane in it, or of any piece (kNone); none where there is
/// none. Pieces may lie in one another.
using Locate = std::function<std::optional<Interior>(const Vector3d& at, std::uint32_t piece)>;

struct Section {
  std::vector<Polygon> polygons;
  /// Edges that only one face has: bridges over gaps of the surface, and rim edges that join to no loop.
  std::size_t open = 0;
};

/// Joins the rim to loops, over gaps where these are short, and the loops, by containment, to polygons with holes;
/// islands in holes are polygons of their own; all of them within a piece. \param piece_of nodes. \param spacing of
/// points inside, m; 0: the mean length of the rim's edges, or more where the section is large. Infinite: none.
Section closeSection(const Surface& surface, std::span<const std::uint32_t> piece_of, const PlaneFrame& plane,
                     double spacing, const Locate& locate);

}  // namespace sinew::cutting

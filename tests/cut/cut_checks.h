// SPDX-License-Identifier: MIT
//
// What must hold of every cut.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sinew/runtime/cut.h"

namespace sinew::test {

/// What a surface is like: its triangles on welded vertices.
struct SurfaceState {
  std::size_t open = 0;  ///< directed edges without an opposite one
  std::size_t odd = 0;   ///< edges that two triangles do not share
  double volume = 0;     ///< m^3, that its triangles enclose
  double absolute = 0;   ///< of it and the origin's cones, for tolerances
};
SurfaceState surfaceOf(const formats::PackageView& package);

/// How far the parts are from the whole.
struct CutErrors {
  double volume = 0;  ///< of the whole's
  double mass = 0;    ///< of the whole's
  double center = 0;  ///< of mass, of the diagonal
};

/// Held fields: their functions are those of their pin sets on held vertices, and 0 beside. \return what is wrong.
std::string faultOfHolds(const formats::PackageView& package);

/// Closedness, manifoldness, volumes, masses, identity, holds. \return what is wrong; empty: nothing.
/// \param least_parts that there are.
std::string faultOfCut(const Asset& whole, const CutResult& cut, CutErrors& errors, std::size_t least_parts = 2);

/// A plane that meets the box around positions: all directions and depths. \param seed any number.
CutPlane randomPlane(std::span<const Vec3> positions, std::uint64_t seed);

/// The same with an end: a convex quadrilateral, of 0.05 to 0.65 diagonals from its middle.
CutPlane randomSlit(std::span<const Vec3> positions, std::uint64_t seed);

/// Positions at rest.
std::vector<Vec3> restOf(const Asset& asset);

}  // namespace sinew::test

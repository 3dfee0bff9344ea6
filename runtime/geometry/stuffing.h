// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
#include <span>

#include "runtime/geometry/parallel.h"
#include "runtime/geometry/tet_mesh.h"
#include "runtime/geometry/winding_number.h"

namespace sinew::geometry {

/// The solid of a stuffing. Both are called from several threads at once, each with a walk of its own through places
/// that are near one another.
struct StuffingDomain {
  /// 0 or 1 for each point.
  std::function<void(std::span<const Eigen::Vector3d> points, std::span<char> inside, WindingNumber::Walk& walk)>
      inside;
  /// Where the segment from a point inside to one outside leaves the solid, 0..1.
  std::function<double(const Eigen::Vector3d& inside, const Eigen::Vector3d& outside, WindingNumber::Walk& walk)>
      crossing;
};

/// Isosurface stuffing (Labelle & Shewchuk 2007) over a uniform body-centred cubic lattice: lattice points near the
/// surface are warped onto it, the other tetrahedra are cut along it by the stencils of their figure 3.
///
/// Guarantee: every tetrahedron positive; dihedral angles between 10.78 and 164.75 degrees (their table 1, the warp
/// thresholds used here: 0.24999 along cubic edges, 0.41189 along diagonals), for any `inside` and `crossing`.
/// Features thinner than the lattice can vanish or fall apart; the caller looks at components and volume.
/// Differs from the paper: the diagonal of a quadrilateral on the surface, which no neighbour shares, is the one with
/// the larger smallest angle.
///
/// \param bounds of the solid, metres. The lattice covers them with a margin.
/// \param spacing edge of a cubic cell, metres, > 0. Points on both sublattices: two a cell.
TetMesh stuffIsosurface(const StuffingDomain& domain, const Eigen::AlignedBox3d& bounds, double spacing,
                        const ParallelFor& parallel_for = serialFor);

}  // namespace sinew::geometry

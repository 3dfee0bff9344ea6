// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace sinew::tools::field {

/// A vertex that does not move by itself: x = sum_k weight[k] x_vertex[k], weights of an affine map (they sum to 1).
struct Follower {
  std::vector<std::uint32_t> vertex;  ///< none: the vertex moves by itself
  std::vector<double> weight;
};

/// Finds the vertices that would swing freely. Linear tetrahedra that share less than a face turn about the shared edge
/// or vertex without resistance, so sets of tetrahedra joined by faces are taken from large to small, and one whose
/// shared vertices lie on a line is joined: all its vertices (if it has less than 8 tetrahedra or 1 % of the volume) or
/// those of the one tetrahedron at the joint move affinely with a tetrahedron of the larger set there. Vertices of no
/// tetrahedron follow the nearest one.
/// @param volumes of the tetrahedra, m^3; those with 0 do not count
std::vector<Follower> findFollowers(std::span<const Eigen::Vector3d> positions,
                                    std::span<const std::array<std::uint32_t, 4>> tetrahedra,
                                    const std::vector<double>& volumes);

}  // namespace sinew::tools::field

// SPDX-License-Identifier: MIT
//
// One cluster's goals: shape matching (Henriques 2006, 3.1; Müller et al. 2005, shape matching, linear and quadratic
// deformations). Symbols as in docs/report.md.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "runtime/geometry/rotation.h"
#include "runtime/world/body.h"

namespace sinew::internal {

/// Constants of a cluster, made when its body is added.
struct ClusterConstants {
  Square<9> a_qq = Square<9>::Zero();  ///< pseudo-inverse of the moment of the rest shape
  Square<9> root_a_qq = Square<9>::Zero();
  std::array<float, 3> beta = {};  ///< by class of modes, stretch, bend, twist: what a step keeps
  float alpha = 1;                 ///< how much of the way to its goal a vertex goes in a step
  bool encloses_volume = true;     ///< it is no plane and no line
};
ClusterConstants makeConstants(const Body& body, std::uint32_t cluster);

/// A cluster's goal transform: g = center + radius F q~.
struct Goal {
  Vector3 center = Vector3::Zero();
  Columns<9> f = Columns<9>::Zero();
};

/// \param held by physical vertex: 1 + the number of the pin set that holds it, 0 if none does. \param[in,out] rotation
/// the last one, where the search for R starts; R.
Goal match(const Body& body, std::uint32_t cluster, const ClusterConstants& constants,
           std::span<const std::uint32_t> held, geometry::Quaternion& rotation);

/// q~ of a point of the rest shape.
Monomials<9> restCoordinates(const Body& body, std::uint32_t cluster, const Vec3& rest_position);

}  // namespace sinew::internal

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace sinew::tools {

struct Weld {
  std::vector<Eigen::Vector3d> points;  ///< in order of their first position
  std::vector<std::uint32_t> of;        ///< point of each position
};

/// Joins positions that lie within `tolerance` of a point. Positions are taken in order: each joins the nearest point
/// that an earlier position founded, if it is near enough, or founds one. So no chain of near positions grows beyond
/// the tolerance, and the result depends on the order alone. \param tolerance same unit as the positions, 0 or more; 0
/// = exactly equal (0 and -0 are equal).
Weld weldPositions(const std::vector<Eigen::Vector3d>& positions, double tolerance);

}  // namespace sinew::tools

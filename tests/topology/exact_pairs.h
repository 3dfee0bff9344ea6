// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>

namespace sinew::testing {

/// Whether two triangles share more than points and more than pieces of an edge of both: the definition of
/// findSelfIntersections(), by constructing the intersection with exact numbers instead of by signs.
bool pierceExactly(const std::array<Eigen::Vector3d, 3>& a, const std::array<Eigen::Vector3d, 3>& b);

/// Whether the corners lie on one line.
bool collinearExactly(const std::array<Eigen::Vector3d, 3>& t);

}  // namespace sinew::testing

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace sinew::tools {

/// Triangles over points, without anything else.
struct PlainSurface {
  std::vector<Eigen::Vector3d> positions;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Wraps a triangle soup into a closed, manifold surface without self-intersections, `offset` outside of it (Portaneri
/// et al. 2022, CGAL Alpha_wrap_3). It enters every hole wider than `alpha`: the caller must compare volumes. \param
/// alpha, offset metres, > 0. \param reason receives why the result is empty, if it is. Never throws but for lack of
/// memory.
PlainSurface alphaWrap(const PlainSurface& soup, double alpha, double offset, std::string& reason);

}  // namespace sinew::tools

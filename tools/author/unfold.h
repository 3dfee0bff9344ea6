// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "tools/author/surface.h"

namespace sinew::tools {

/// Distance at c of a front that has reached a after da and b after db: from one source in the triangle's plane, on the
/// other side of ab, or straight. Where the way to c does not cross ab, along the edges.
inline double unfoldedDistance(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c, double da,
                               double db, Front front) {
  const double along_edges = std::min(da + (c - a).norm(), db + (c - b).norm());
  const Eigen::Vector3d ab = b - a;
  const double length = ab.norm();
  if (!(length > 0)) return along_edges;
  const Eigen::Vector3d u = ab / length;
  const Eigen::Vector3d ac = c - a;
  const double cx = ac.dot(u);
  const double cy = (ac - cx * u).norm();
  if (front == Front::line) {
    const double gx = (db - da) / length;
    if (!(std::abs(gx) < 1)) return along_edges;
    const double gy = std::sqrt(1 - gx * gx);
    const double from = cx - gx / gy * cy;
    if (from < 0 || from > length) return along_edges;
    return std::min(along_edges, da + gx * cx + gy * cy);
  }
  const double sx = (da * da - db * db + length * length) / (2 * length);
  const double sy2 = da * da - sx * sx;
  if (sy2 < 0) return along_edges;  // no such source: the distances differ by more than the edge
  const double sy = -std::sqrt(sy2);
  if (!(cy - sy > 0)) return along_edges;
  const double crossing = sx + (cx - sx) * (-sy / (cy - sy));
  if (crossing < 0 || crossing > length) return along_edges;
  return std::min(along_edges, std::hypot(cx - sx, cy - sy));
}

}  // namespace sinew::tools

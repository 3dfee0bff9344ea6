// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace sinew::geometry {

/// Part of a triangle: 0..2 a corner, 3..5 the inside of the edge from corner part - 3 to the next, 6 its inside.
using TrianglePart = std::uint32_t;
inline constexpr TrianglePart kTriangleInside = 6;

/// Place of a triangle that is nearest to p (Ericson 2005, 5.1.5). \param[out] part where it lies, if asked for.
inline Eigen::Vector3d closestPointOnTriangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                              const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                              TrianglePart* part = nullptr) {
  using Eigen::Vector3d;
  TrianglePart unwanted = 0, &where = part != nullptr ? *part : unwanted;
  const Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  where = 0;
  if (d1 <= 0 && d2 <= 0) return a;
  const Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  where = 1;
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  where = 3;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return d1 - d3 > 0 ? Vector3d(a + ab * (d1 / (d1 - d3))) : a;
  const Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  where = 2;
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  where = 5;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return d2 - d6 > 0 ? Vector3d(a + ac * (d2 / (d2 - d6))) : a;
  const double va = d3 * d6 - d5 * d4;
  const double along = (d4 - d3) + (d5 - d6);
  where = 4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return along > 0 ? Vector3d(b + (c - b) * ((d4 - d3) / along)) : b;
  const double sum = va + vb + vc;
  where = kTriangleInside;
  return a + ab * (vb / sum) + ac * (vc / sum);
}

}  // namespace sinew::geometry

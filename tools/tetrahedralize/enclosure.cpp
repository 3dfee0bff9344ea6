// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/enclosure.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "runtime/geometry/winding_number.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using geometry::openEdges;
using geometry::Triangle;
using geometry::WindingNumber;

// An open surface whose area vectors add up to more than this fraction of its area has a mouth about as wide as itself
// (a disc 1, a hemisphere 0.5, a cube without a lid 0.2): it encloses nothing.
constexpr double kMostOpen = 0.35;
// Enclosed volume over area^(3/2) (a sphere 0.094, a plate of 1:100 0.003). An open surface must enclose at least that
// much of a plate; of a closed one only rounding is not a solid (both sides of a leaf, back to back).
constexpr double kLeastVolumeOpen = 3e-3;
constexpr double kLeastVolumeClosed = 1e-7;

}  // namespace

Enclosure enclosureOf(std::span<const Vector3d> points, std::span<const Triangle> triangles) {
  Enclosure e;
  const auto open = openEdges(triangles);
  e.balanced = open.empty();
  Vector3d apex = Vector3d::Zero();
  if (!open.empty()) {
    double length = 0;
    for (const auto& edge : open) {
      const Vector3d &a = points[edge[0]], &b = points[edge[1]];
      apex += (b - a).norm() * (a + b) / 2;
      length += (b - a).norm();
    }
    apex = length > 0 ? Vector3d(apex / length) : points[open.front()[0]];
  } else if (!triangles.empty()) {
    apex = points[triangles.front()[0]];
  }
  Vector3d sum = Vector3d::Zero();
  for (const Triangle& t : triangles) {
    const Vector3d a = points[t[0]] - apex, b = points[t[1]] - apex, c = points[t[2]] - apex;
    const Vector3d normal = (b - a).cross(c - a) / 2;
    sum += normal;
    e.area += normal.norm();
    e.volume += a.dot(b.cross(c)) / 6;
  }
  e.openness = e.area > 0 ? sum.norm() / e.area : 1;
  const double least = (e.balanced ? kLeastVolumeClosed : kLeastVolumeOpen) * std::pow(e.area, 1.5);
  e.encloses = e.area > 0 && std::abs(e.volume) > least && (e.balanced || e.openness < kMostOpen);
  return e;
}

std::vector<Triangle> withoutWallsAndFins(std::span<const Vector3d> points, std::vector<Triangle> triangles) {
  const WindingNumber winding(points, triangles);
  std::vector<Triangle> kept;
  for (const Triangle& t : triangles) {
    const Vector3d &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
    const Vector3d cross = (b - a).cross(c - a);
    const double norm = cross.norm();
    if (norm == 0) {
      kept.push_back(t);
      continue;
    }
    const Vector3d step = 1e-3 * std::sqrt(norm) * cross / norm;
    const Vector3d middle = (a + b + c) / 3;
    const double mean = (winding.at(middle + step) + winding.at(middle - step)) / 2;
    if (std::abs(mean - 0.5) < 0.25) kept.push_back(t);
  }
  if (kept.empty() || kept.size() == triangles.size() || !openEdges(kept).empty()) return triangles;
  return kept;
}

}  // namespace sinew::tools

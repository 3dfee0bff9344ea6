// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/suggest_up.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <vector>

namespace sinew::tools {
namespace {

using Eigen::Vector2d, Eigen::Vector3d;

// The foot: vertices this near to the lowest point, as a part of the height.
constexpr double kFoot = 0.01;
// Tilts before a fall, radians: rounding, and a stand (decision 29).
constexpr double kBalances = 0.01, kStands = 0.14;
// Of that, on the other end: a pipe or a box bears more, and may well lie.
constexpr double kOtherEnd = 1.0 / 3;
// Of its height in y: a model thinner in z may hang on a wall.
constexpr double kThin = 0.5;

double cross(const Vector2d& a, const Vector2d& b, const Vector2d& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

// How far a skin of even weight may be tilted before it falls off the hull of its foot, in radians; below 0 it falls by
// itself. \param up 1, or -1: upside down.
double standsBy(const VisualMesh& mesh, int axis, double up) {
  const double low = up > 0 ? mesh.bounds_min[axis] : -mesh.bounds_max[axis];
  const double height = mesh.bounds_max[axis] - mesh.bounds_min[axis];
  const auto seen = [&](const Vector3d& x) { return Vector2d(x[(axis + 1) % 3], x[(axis + 2) % 3]); };
  std::vector<Vector2d> foot;
  Vector3d center = Vector3d::Zero();
  double area = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vector3d &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    const double twice = (b - a).cross(c - a).norm();
    area += twice;
    center += twice / 3 * (a + b + c);
    for (const std::uint32_t v : t) {
      if (up * mesh.positions[v][axis] <= low + kFoot * height) foot.push_back(seen(mesh.positions[v]));
    }
  }
  if (!(area > 0)) return 0;
  center /= area;
  const auto less = [](const Vector2d& a, const Vector2d& b) { return a[0] != b[0] ? a[0] < b[0] : a[1] < b[1]; };
  std::sort(foot.begin(), foot.end(), less);
  foot.erase(std::unique(foot.begin(), foot.end()), foot.end());
  // Its hull, the lower half and the upper (Andrew 1979), counterclockwise.
  std::vector<Vector2d> hull;
  for (int half = 0; half < 2; ++half) {
    const std::size_t first = hull.size();
    for (const Vector2d& x : foot) {
      while (hull.size() >= first + 2 && cross(hull[hull.size() - 2], hull.back(), x) <= 0) hull.pop_back();
      hull.push_back(x);
    }
    hull.pop_back();
    std::reverse(foot.begin(), foot.end());
  }
  double inside = hull.size() < 3 ? 0 : std::numeric_limits<double>::infinity();  // metres
  for (std::size_t i = 0; hull.size() >= 3 && i < hull.size(); ++i) {
    const Vector2d& next = hull[(i + 1) % hull.size()];
    inside = std::min(inside, cross(hull[i], next, seen(center)) / (next - hull[i]).norm());
  }
  return std::atan2(inside, up * center[axis] - low);
}

}  // namespace

std::optional<Finding> suggestUp(const VisualMesh& mesh) {
  if (mesh.up_axis != "y") return std::nullopt;
  const Vector3d size = mesh.bounds_max - mesh.bounds_min;
  if (!(size[2] >= kThin * size[1]) || standsBy(mesh, 1, 1) > kBalances) return std::nullopt;
  const double stands = standsBy(mesh, 2, 1);
  if (!(stands >= kStands) || standsBy(mesh, 2, -1) > kOtherEnd * stands) return std::nullopt;
  char text[200];
  std::snprintf(text, sizeof text,
                "the model seems to lie on its side: with y up it does not stand on what is lowest, with z up it "
                "stands until it is tilted by %.0f degrees",
                stands * 180 / std::numbers::pi);
  return Finding{"lies-on-its-side", Severity::info, text, 1, "", {}, "", "If z is up, say so: import.up=z."};
}

}  // namespace sinew::tools

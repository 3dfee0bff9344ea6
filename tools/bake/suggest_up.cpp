// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/suggest_up.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// A base is what lies this near to the lowest point, of the height, and faces down within 11 degrees.
constexpr double kSlab = 0.005;
constexpr double kDown = 0.98;
// Of the area that is seen from above: a base, and so much more than the other axis has (a ball has 0.02).
constexpr double kBase = 0.1;
constexpr double kMore = 5;
// A body flat at both ends is a beam or a pipe, which may well lie.
constexpr double kEnd = 0.5;
constexpr double kLonger = 1.2;

struct Ends {
  double base = 0, top = 0;  // of the area seen along the axis
};

Ends endsAlong(const VisualMesh& mesh, int axis) {
  const double low = mesh.bounds_min[axis], high = mesh.bounds_max[axis];
  const double slab = kSlab * (high - low);
  Ends ends;
  double seen = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vector3d& a = mesh.positions[t[0]];
    const Vector3d& b = mesh.positions[t[1]];
    const Vector3d& c = mesh.positions[t[2]];
    const Vector3d twice = (b - a).cross(c - a);
    seen += std::abs(twice[axis]) / 2;
    if (!(std::abs(twice[axis]) >= kDown * twice.norm())) continue;
    if (twice[axis] < 0 && std::max({a[axis], b[axis], c[axis]}) <= low + slab) ends.base -= twice[axis];
    if (twice[axis] > 0 && std::min({a[axis], b[axis], c[axis]}) >= high - slab) ends.top += twice[axis];
  }
  // Both sides of what is closed are seen.
  if (seen > 0) ends = {ends.base / seen, ends.top / seen};
  return ends;
}

}  // namespace

std::optional<Finding> suggestUp(const VisualMesh& mesh) {
  if (mesh.up_axis != "y") return std::nullopt;
  const Vector3d size = mesh.bounds_max - mesh.bounds_min;
  if (!(size[2] >= kLonger * size[1])) return std::nullopt;
  const Ends y = endsAlong(mesh, 1);
  const Ends z = endsAlong(mesh, 2);
  if (!(z.base >= kBase) || z.base < kMore * y.base || z.top > kEnd * z.base) return std::nullopt;
  char text[200];
  std::snprintf(text, sizeof text,
                "the model seems to lie on its side: %.0f %% of what is seen along z is a flat base, along y %.0f %%",
                100 * z.base, 100 * y.base);
  return Finding{"lies-on-its-side", Severity::info, text, 1, "", {}, "", "If z is up, say so: import.up=z."};
}

}  // namespace sinew::tools

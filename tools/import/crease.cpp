// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/crease.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "runtime/geometry/sets.h"

namespace sinew::tools {
namespace {

// More faces than this at one edge are looked at in the order of the file only: every pair would take too long.
constexpr std::size_t kMostFaces = 16;

struct Side {
  std::uint32_t low, high;  // welded points
  std::uint32_t corner;     // of the triangle, where the side begins
};

std::uint32_t nextCorner(std::uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

}  // namespace

std::vector<std::uint32_t> smoothFans(const VisualMesh& mesh, double crease_degrees) {
  const std::size_t count = mesh.triangles.size();
  std::vector<Eigen::Vector3d> normals(count);
  std::vector<Side> sides(3 * count);
  tbb::parallel_for(std::size_t(0), count, [&](std::size_t t) {
    const Triangle p = mesh.weldedTriangle(t);
    const Eigen::Vector3d& a = mesh.welded_positions[p[0]];
    normals[t] = (mesh.welded_positions[p[1]] - a).cross(mesh.welded_positions[p[2]] - a).normalized();
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t from = p[k], to = p[(k + 1) % 3];
      sides[3 * t + k] = {std::min(from, to), std::max(from, to), std::uint32_t(3 * t + k)};
    }
  });
  tbb::parallel_sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::tie(a.low, a.high, a.corner) < std::tie(b.low, b.high, b.corner);
  });
  // A triangle without an area has no normal, so no say: its neighbours are compared across their other edges.
  const double least = crease_degrees >= 180 ? -2 : std::cos(crease_degrees * std::numbers::pi / 180);
  const auto is_smooth = [&](std::uint32_t a, std::uint32_t b) {
    const Eigen::Vector3d &m = normals[a / 3], &n = normals[b / 3];
    return m.isZero() || n.isZero() || m.dot(n) >= least;
  };
  geometry::Sets fans(3 * count);
  const auto begin_at = [&](const Side& side, std::uint32_t point) {
    const std::uint32_t t = side.corner / 3;
    return mesh.welded[mesh.triangles[t][side.corner % 3]] == point ? side.corner : nextCorner(side.corner);
  };
  for (std::size_t first = 0; first < sides.size();) {
    std::size_t end = first + 1;
    while (end < sides.size() && sides[end].low == sides[first].low && sides[end].high == sides[first].high) ++end;
    const bool every_pair = end - first <= kMostFaces;
    for (std::size_t i = first; i < end; ++i) {
      for (std::size_t j = i + 1; j < (every_pair ? end : std::min(end, i + 2)); ++j) {
        if (!is_smooth(sides[i].corner, sides[j].corner)) continue;
        for (const std::uint32_t point : {sides[i].low, sides[i].high})
          fans.join(begin_at(sides[i], point), begin_at(sides[j], point));
      }
    }
    first = end;
  }
  std::vector<std::uint32_t> result(3 * count);
  for (std::uint32_t c = 0; c < result.size(); ++c) result[c] = fans.find(c);
  return result;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/distances.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "runtime/geometry/box_tree.h"
#include "runtime/geometry/winding_number.h"
#include "tools/tetrahedralize/crowds.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

/// Cells around the surface's box: contact points are looked at before they are inside.
constexpr double kBorder = 2;
/// Cells of the package's diagonal at most: small pieces take as many as they need of that.
constexpr double kMostCells = 4;

/// Cells across the thickness that a quarter of the surface stays below: with less than one no node may lie inside.
constexpr double kAcross = 1.5, kQuarter = 0.25;
/// Triangles at which the thickness is measured.
constexpr std::size_t kMeasured = 2000;

/// The visual triangles that hang whole on a piece.
std::vector<geometry::Triangle> trianglesOf(const formats::PackageContent& content, const formats::PieceRange& piece) {
  std::vector<geometry::Triangle> result;
  const auto in_piece = [&](std::uint32_t v) {
    const std::uint32_t t = content.barycentric[v].tetrahedron;
    return t >= piece.first_tetrahedron && t - piece.first_tetrahedron < piece.tetrahedron_count;
  };
  for (const auto& triangle : content.visual_triangles) {
    if (std::all_of(triangle.begin(), triangle.end(), in_piece)) result.push_back(triangle);
  }
  return result;
}

/// Where an opening is, inside ends at a lid without triangles, across which distances to triangles would jump. An edge
/// of the grid that leaves the solid and is shorter than its ends are far from triangles crosses one; a lid is as near
/// as its nearest crossing.
void shortenToLids(const formats::DistanceGrid& grid, const std::vector<Vector3d>& nodes,
                   const std::vector<char>& inside, const geometry::WindingNumber& winding,
                   std::vector<double>& distance) {
  std::vector<Vector3d> lids;
  geometry::WindingNumber::Walk walk;
  const std::size_t steps[] = {1, grid.nodes[0], std::size_t(grid.nodes[0]) * grid.nodes[1]};
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t other = i + steps[axis];
      if (i / steps[axis] % grid.nodes[axis] + 1 == grid.nodes[axis] || (inside[i] != 0) == (inside[other] != 0))
        continue;
      if (distance[i] + distance[other] <= (nodes[other] - nodes[i]).norm() * (1 + 1e-9)) continue;
      const Vector3d &in = nodes[inside[i] != 0 ? i : other], &out = nodes[inside[i] != 0 ? other : i];
      lids.push_back(in + winding.crossing(in, out, walk) * (out - in));
    }
  }
  if (lids.empty()) return;
  const auto at = [&](std::uint32_t i) -> Vector3d { return lids[i]; };
  const geometry::BoxTree tree(
      std::uint32_t(lids.size()), [&](std::uint32_t i) { return Eigen::AlignedBox3d(lids[i]); }, at, at, 8);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    double bound = distance[i] * distance[i];
    tree.descendNear(nodes[i], bound, [&](std::uint32_t leaf) {
      bound = std::min(bound, (lids[tree.order()[leaf]] - nodes[i]).squaredNorm());
    });
    distance[i] = std::sqrt(bound);
  }
}

/// How far it is from the surface inwards to the other side where that is nearest: what a quarter of it, by area, stays
/// below. 0: it has no inside.
double thicknessOf(const std::vector<Vector3d>& positions, const std::vector<geometry::Triangle>& triangles,
                   double most) {
  const geometry::TriangleBvh tree(positions, triangles);
  std::vector<std::pair<double, double>> found;  // thickness, area
  std::vector<geometry::TriangleBvh::Crossing> crossings;
  double all = 0;
  for (std::size_t t = 0; t < triangles.size(); t += 1 + triangles.size() / kMeasured) {
    const Vector3d &a = positions[triangles[t][0]], &b = positions[triangles[t][1]], &c = positions[triangles[t][2]];
    const Vector3d normal = (b - a).cross(c - a);
    if (!(normal.norm() > 0)) continue;
    const Vector3d from = (a + b + c) / 3 - 1e-6 * most * normal.normalized(), to = from - most * normal.normalized();
    crossings.clear();
    tree.crossings(from, to, crossings);
    const auto leaves = [](const geometry::TriangleBvh::Crossing& crossing) { return crossing.winding < 0; };
    const auto out = std::find_if(crossings.begin(), crossings.end(), leaves);
    if (out == crossings.end()) continue;
    found.emplace_back(out->parameter * most, normal.norm());
    all += normal.norm();
  }
  std::sort(found.begin(), found.end());
  double sum = 0;
  for (const auto& [thickness, area] : found) {
    sum += area;
    if (sum >= kQuarter * all) return thickness;
  }
  return 0;
}

/// Nodes of a grid of a box along an axis; a whole number, of any size.
double nodesAlong(double length, double spacing) { return std::ceil(length / spacing + 2 * kBorder) + 1; }

/// So that what is thin has an inside, as far as a grid takes no more nodes than that of a cube.
double spacingOf(const Vector3d& size, double thickness, double spacing, std::uint32_t cells) {
  const auto nodesOf = [&size](double s) {
    return nodesAlong(size[0], s) * nodesAlong(size[1], s) * nodesAlong(size[2], s);
  };
  const double most = std::pow(nodesAlong(cells, 1), 3), wanted = thickness / kAcross;
  if (!(thickness > 0) || wanted >= spacing) return spacing;
  double least = wanted;
  while (least < spacing && nodesOf(least) > most) least *= 1.05;
  return std::min(least, spacing);
}

void addGrid(std::uint32_t piece, std::uint32_t cells, const std::vector<Vector3d>& positions,
             const std::vector<geometry::Triangle>& triangles, formats::PackageContent& content, StageCache& cache) {
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const auto& triangle : triangles) {
    for (const std::uint32_t v : triangle) {
      low = low.cwiseMin(positions[v]);
      high = high.cwiseMax(positions[v]);
    }
  }
  const Vector3d size = high - low;
  double spacing = std::max(size.maxCoeff() / cells, double(content.info.diagonal) / (kMostCells * cells));
  if (!(spacing > 0)) return;
  spacing = spacingOf(size, thicknessOf(positions, triangles, size.norm()), spacing, cells);
  formats::DistanceGrid grid = {};
  grid.piece = piece;
  grid.spacing = float(spacing);
  grid.first_value = std::uint32_t(content.distance_values.size());
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const auto at = std::size_t(axis);
    grid.nodes[at] = std::uint32_t(nodesAlong(size[axis], spacing));
    const double middle = 0.5 * (low + high)[axis];
    grid.origin[at] = float(middle - 0.5 * (grid.nodes[at] - 1) * spacing);
  }
  std::vector<Vector3d> nodes;
  for (std::uint32_t z = 0; z < grid.nodes[2]; ++z) {
    for (std::uint32_t y = 0; y < grid.nodes[1]; ++y) {
      for (std::uint32_t x = 0; x < grid.nodes[0]; ++x) {
        nodes.emplace_back(double(grid.origin[0]) + x * double(grid.spacing),
                           double(grid.origin[1]) + y * double(grid.spacing),
                           double(grid.origin[2]) + z * double(grid.spacing));
      }
    }
  }
  StageWriter key;
  key(nodes);
  for (const auto& triangle : triangles) {
    for (const std::uint32_t v : triangle) key.raw(&positions[v], sizeof positions[v]);
  }
  const std::vector<double> distance = cache.get("distances", stageKey(key.take()), [&] {
    const geometry::WindingNumber winding(positions, triangles);
    std::vector<char> inside(nodes.size());
    winding.inside(nodes, inside);
    std::vector<double> made;
    for (const Vector3d& node : nodes) made.push_back(std::sqrt(winding.bvh().closest(node).squared_distance));
    shortenToLids(grid, nodes, inside, winding, made);
    for (std::size_t i = 0; i < nodes.size(); ++i) made[i] = inside[i] != 0 ? -made[i] : made[i];
    return made;
  });
  double largest = spacing;
  for (const double d : distance) largest = std::max(largest, std::abs(d));
  grid.unit = float(largest / std::numeric_limits<std::int16_t>::max());
  for (const double d : distance) content.distance_values.push_back(std::int16_t(std::round(d / double(grid.unit))));
  content.distance_grids.push_back(grid);
}

}  // namespace

void addDistances(std::uint32_t cells, formats::PackageContent& content, StageCache& cache) {
  if (cells == 0 || content.barycentric.empty() || content.field_points.empty()) return;
  std::vector<Vector3d> positions;
  for (const auto& x : content.visual_positions) positions.emplace_back(double(x[0]), double(x[1]), double(x[2]));
  for (std::uint32_t piece = 0; piece < content.pieces.size(); ++piece) {
    const auto triangles = withoutCrowds(positions, trianglesOf(content, content.pieces[piece]));
    if (!triangles.empty()) addGrid(piece, cells, positions, triangles, content, cache);
  }
}

}  // namespace sinew::tools

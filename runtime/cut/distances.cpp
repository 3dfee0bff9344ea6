// SPDX-License-Identifier: MIT
#include "runtime/cut/distances.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "runtime/cut/content.h"
#include "runtime/cut/fields.h"

namespace sinew::cutting {
namespace {

/// Nodes around the part that its grid keeps.
constexpr double kMargin = 1.5;
/// A node counts as inside of a tetrahedron so far outside of it, of its height.
constexpr double kInside = 1e-6;
/// Least slope of a distance, in a material that is pressed flat against the plane.
constexpr double kLeastSlope = 0.05;

using Nodes = std::array<std::uint32_t, 3>;

std::size_t numberOf(const Nodes& nodes, const Nodes& at) {
  return (std::size_t(at[2]) * nodes[1] + at[1]) * nodes[0] + at[0];
}

template <class Visit>
void forEachNode(const Nodes& from, const Nodes& to, const Visit& visit) {
  for (std::uint32_t z = from[2]; z <= to[2]; ++z) {
    for (std::uint32_t y = from[1]; y <= to[1]; ++y) {
      for (std::uint32_t x = from[0]; x <= to[0]; ++x) visit(Nodes{x, y, z});
    }
  }
}

/// Height over the plane by place at rest, as a tetrahedron has it: height = value + slope . X.
struct HeightAtRest {
  Vector3d slope = Vector3d::Zero();
  double value = 0, steepness = 0;  ///< of a distance: the slope's length, or kLeastSlope
};

HeightAtRest heightIn(const Cut& cut, std::uint32_t tetrahedron) {
  const auto& corners = cut.package.tetrahedra()[tetrahedron].vertex;
  const auto rest = [&](std::size_t k) { return asVector(cut.package.physicalVertices()[corners[k]].rest_position); };
  Eigen::Matrix3d edges;
  Vector3d rises;
  for (int k = 0; k < 3; ++k) {
    edges.row(k) = (rest(std::size_t(k)) - rest(3)).transpose();
    rises[k] = cut.sides.heightOf(corners[std::size_t(k)]) - cut.sides.heightOf(corners[3]);
  }
  HeightAtRest height;
  height.slope = edges.inverse() * rises;
  if (!height.slope.allFinite()) height.slope.setZero();
  height.value = cut.sides.heightOf(corners[3]) - height.slope.dot(rest(3));
  height.steepness = std::max(kLeastSlope, height.slope.norm());
  return height;
}

/// The nodes around the part. \return false where there are too few of them to stand for it.
bool findRange(const formats::DistanceGrid& grid, const formats::PackageInfo& info, formats::DistanceGrid& made,
               Nodes& from, Nodes& to) {
  for (std::size_t a = 0; a < 3; ++a) {
    const double most = double(grid.nodes[a]) - 1, spacing = double(grid.spacing), at = double(grid.origin[a]);
    from[a] =
        std::uint32_t(std::clamp(std::floor((double(info.bounds_min[a]) - at) / spacing - kMargin), 0.0, most - 1));
    to[a] = std::uint32_t(
        std::clamp(std::ceil((double(info.bounds_max[a]) - at) / spacing + kMargin), double(from[a]) + 1, most));
    made.nodes[a] = to[a] - from[a] + 1;
    made.origin[a] = grid.origin[a] + grid.spacing * float(from[a]);
    if (made.origin[a] < info.bounds_min[a] - info.diagonal) return false;
  }
  return 2 * grid.spacing <= info.diagonal;
}

void addGrid(const Cut& cut, std::uint32_t part, const PartPiece& piece, std::size_t index,
             formats::PackageContent& content) {
  const formats::DistanceGrid& grid = cut.package.distanceGrids()[index];
  const PartMesh& mesh = cut.partition.parts[part];
  const auto values = cut.package.distanceValues().subspan(grid.first_value,
                                                           std::size_t(grid.nodes[0]) * grid.nodes[1] * grid.nodes[2]);
  formats::DistanceGrid made = grid;
  made.piece = piece.piece;
  made.first_value = std::uint32_t(content.distance_values.size());
  if (cut.piece_is_whole[piece.source] != 0) {
    content.distance_values.insert(content.distance_values.end(), values.begin(), values.end());
    content.distance_grids.push_back(made);
    return;
  }
  Nodes from = {}, to = {};
  // A part smaller than a few cells has none: it does not stand for what touches it.
  if (!findRange(grid, content.info, made, from, to)) return;
  const std::vector<std::uint32_t>& tetrahedra = cut.node_tetrahedra[index];
  // Of a tetrahedron the part has nothing 0, what is below 1, above 2, all 3.
  std::vector<char> has(cut.package.tetrahedra().size(), 0);
  for (const PartTetrahedron& t : mesh.tetrahedra) has[t.source] |= t.side == 0 ? 3 : t.side < 0 ? 1 : 2;
  std::vector<HeightAtRest> heights(has.size());  // of steepness 0: not known yet
  const double unit = double(grid.unit);
  forEachNode(from, to, [&](const Nodes& at) {
    const std::size_t node = numberOf(grid.nodes, at);
    const std::uint32_t t = tetrahedra[node];
    double distance = unit * double(values[node]);
    if (t != formats::kNone) {
      // A slit has no width: to what has both of its sides it is not there.
      const double side = mesh.side != 0 ? mesh.side : has[t] == 1 ? -1 : has[t] == 2 ? 1 : 0;
      if (side != 0) {
        if (heights[t].steepness == 0) heights[t] = heightIn(cut, t);
        const Vector3d place = asVector(grid.origin) + double(grid.spacing) * Vector3d(at[0], at[1], at[2]);
        const double above = (heights[t].value + heights[t].slope.dot(place)) / heights[t].steepness;
        distance = std::max(distance, -side * above);
      }
      // Within another part of this side.
      if (has[t] == 0) distance = std::abs(distance);
    }
    content.distance_values.push_back(std::int16_t(std::clamp(std::lround(distance / unit), -32767L, 32767L)));
  });
  content.distance_grids.push_back(made);
}

}  // namespace

std::vector<std::uint32_t> nodeTetrahedra(const formats::PackageView& package, const Sides& sides,
                                          const formats::DistanceGrid& grid) {
  const Nodes& nodes = grid.nodes;
  const std::array<std::size_t, 3> step = {1, nodes[0], nodes[0] * std::size_t(nodes[1])};
  std::vector<std::uint32_t> of_node(step[2] * nodes[2], formats::kNone);
  std::vector<Nodes> queue;  // in the order in which they got theirs
  queue.reserve(of_node.size());
  const formats::PieceRange& range = package.pieces()[grid.piece];
  for (std::uint32_t t = range.first_tetrahedron; t < range.first_tetrahedron + range.tetrahedron_count; ++t) {
    const auto& corners = package.tetrahedra()[t].vertex;
    if (sides.rider[corners[0]] != formats::kNone) continue;
    std::array<Vector3d, 4> at;
    Vector3d low = Vector3d::Constant(1e300), high = -low;
    for (std::size_t k = 0; k < 4; ++k) {
      at[k] = (asVector(package.physicalVertices()[corners[k]].rest_position) - asVector(grid.origin)) /
              double(grid.spacing);
      low = low.cwiseMin(at[k]);
      high = high.cwiseMax(at[k]);
    }
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = at[std::size_t(k)] - at[3];
    const Eigen::Matrix3d inverse = edges.inverse();
    if (!inverse.allFinite()) continue;
    Nodes from = {}, to = {};
    bool meets = true;
    for (std::size_t a = 0; a < 3; ++a) {
      const double most = double(nodes[a]) - 1;
      const double first = std::ceil(low[int(a)] - kInside), last = std::floor(high[int(a)] + kInside);
      meets = meets && first <= std::min(last, most) && last >= 0;
      from[a] = std::uint32_t(std::clamp(first, 0.0, most));
      to[a] = std::uint32_t(std::clamp(last, 0.0, most));
    }
    if (!meets) continue;
    forEachNode(from, to, [&](const Nodes& node) {
      const std::size_t n = numberOf(nodes, node);
      if (of_node[n] != formats::kNone) return;
      const Vector3d w = inverse * (Vector3d(node[0], node[1], node[2]) - at[3]);
      if (std::min(w.minCoeff(), 1 - w.sum()) < -kInside) return;
      of_node[n] = t;
      queue.push_back(node);
    });
  }
  // Those around take it from their neighbours.
  for (std::size_t next = 0; next < queue.size(); ++next) {
    const Nodes at = queue[next];
    const std::size_t n = numberOf(nodes, at);
    for (std::size_t a = 0; a < 3; ++a) {
      for (const bool up : {false, true}) {
        if (up ? at[a] + 1 == nodes[a] : at[a] == 0) continue;
        const std::size_t other = up ? n + step[a] : n - step[a];
        if (of_node[other] != formats::kNone) continue;
        of_node[other] = of_node[n];
        queue.push_back(at);
        up ? ++queue.back()[a] : --queue.back()[a];
      }
    }
  }
  return of_node;
}

void addDistances(const Cut& cut, std::uint32_t part, const std::vector<PartPiece>& pieces,
                  formats::PackageContent& content) {
  if (content.field_points.empty()) return;
  for (const PartPiece& piece : pieces) {
    for (std::size_t g = 0; g < cut.package.distanceGrids().size(); ++g) {
      if (cut.package.distanceGrids()[g].piece == piece.source) addGrid(cut, part, piece, g, content);
    }
  }
}

}  // namespace sinew::cutting

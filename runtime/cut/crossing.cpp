// SPDX-License-Identifier: MIT
#include "runtime/cut/crossing.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace sinew::cutting {
namespace {

/// A place counts as inside of a tetrahedron so far outside of it, of its height.
constexpr double kInside = 1e-6, kAlmost = 0.05;

double leastOf(const Vector3d& weight) { return std::min(weight.minCoeff(), 1 - weight.sum()); }

}  // namespace

std::uint32_t pieceOf(const formats::PackageView& package, std::uint32_t tetrahedron) {
  const auto pieces = package.pieces();
  const auto behind =
      std::upper_bound(pieces.begin(), pieces.end(), tetrahedron,
                       [](std::uint32_t t, const formats::PieceRange& piece) { return t < piece.first_tetrahedron; });
  return std::uint32_t(behind - pieces.begin()) - 1;
}

struct Crossing::Grid {
  struct Entry {
    std::uint32_t tetrahedron;
    Vector3d last;
    Eigen::Matrix3d inverse;
  };
  std::vector<Entry> entries;
  std::vector<std::vector<std::uint32_t>> cells;
  Eigen::Vector2d low = Eigen::Vector2d::Zero();
  double cell = 1;
  std::ptrdiff_t columns = 0, rows = 0;

  std::ptrdiff_t column(double x) const {
    return std::clamp<std::ptrdiff_t>(std::ptrdiff_t(std::floor((x - low[0]) / cell)), 0, columns - 1);
  }
  std::ptrdiff_t row(double y) const {
    return std::clamp<std::ptrdiff_t>(std::ptrdiff_t(std::floor((y - low[1]) / cell)), 0, rows - 1);
  }
};

Crossing::Crossing(const formats::PackageView& package, const Sides& sides)
    : package_(package), sides_(sides), grid_(std::make_unique<Grid>()) {
  const PlaneFrame& plane = sides.plane;
  std::vector<std::array<Eigen::Vector2d, 2>> boxes;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300), high = -low;
  double size = 0;
  const auto tetrahedra = package.tetrahedra();
  for (std::uint32_t t = 0; t < tetrahedra.size(); ++t) {
    const Corners4& corners = tetrahedra[t].vertex;
    int up = 0, down = 0;
    for (const std::uint32_t v : corners) {
      up += sides.side[v] > 0 ? 1 : 0;
      down += sides.side[v] < 0 ? 1 : 0;
    }
    if (up == 0 || down == 0 || sides.rider[corners[0]] != formats::kNone) continue;
    std::array<Eigen::Vector2d, 2> box = {Eigen::Vector2d::Constant(1e300), Eigen::Vector2d::Constant(-1e300)};
    const auto take = [&](const Vector3d& x) {
      const Eigen::Vector2d p((x - plane.point).dot(plane.right), (x - plane.point).dot(plane.up));
      box[0] = box[0].cwiseMin(p);
      box[1] = box[1].cwiseMax(p);
    };
    for (std::size_t i = 0; i < 4; ++i) {
      const std::uint32_t a = corners[i];
      if (sides.side[a] == 0) take(sides.at[a]);
      for (std::size_t j = i + 1; j < 4; ++j) {
        const std::uint32_t b = corners[j];
        if (sides.side[a] * sides.side[b] >= 0) continue;
        const double share = sides.height[a] / (sides.height[a] - sides.height[b]);
        take(sides.at[a] + share * (sides.at[b] - sides.at[a]));
      }
    }
    Grid::Entry entry;
    entry.tetrahedron = t;
    entry.last = sides.at[corners[3]];
    const Eigen::Matrix3d edges = edgesOf(corners, [&](std::uint32_t v) { return sides.at[v]; });
    entry.inverse = edges.inverse();
    if (!entry.inverse.allFinite()) continue;
    grid_->entries.push_back(entry);
    boxes.push_back(box);
    low = low.cwiseMin(box[0]);
    high = high.cwiseMax(box[1]);
    size += (box[1] - box[0]).maxCoeff();
  }
  if (boxes.empty()) return;
  grid_->low = low;
  const double extent = (high - low).maxCoeff();
  grid_->cell = std::max({0.5 * size / double(boxes.size()), extent / 512, 1e-12});
  grid_->columns = std::ptrdiff_t((high - low)[0] / grid_->cell) + 1;
  grid_->rows = std::ptrdiff_t((high - low)[1] / grid_->cell) + 1;
  grid_->cells.resize(std::size_t(grid_->columns * grid_->rows));
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    for (std::ptrdiff_t r = grid_->row(boxes[i][0][1]); r <= grid_->row(boxes[i][1][1]); ++r) {
      for (std::ptrdiff_t c = grid_->column(boxes[i][0][0]); c <= grid_->column(boxes[i][1][0]); ++c) {
        grid_->cells[std::size_t(r * grid_->columns + c)].push_back(i);
      }
    }
  }
}

Crossing::~Crossing() = default;

std::optional<Interior> Crossing::at(const Vector3d& place, std::uint32_t piece) const {
  if (grid_->cells.empty()) return std::nullopt;
  const auto isOf = [&](std::uint32_t tetrahedron) {
    if (piece == formats::kNone) return true;
    const formats::PieceRange& range = package_.pieces()[piece];
    return tetrahedron - range.first_tetrahedron < range.tetrahedron_count;
  };
  const PlaneFrame& plane = sides_.plane;
  const auto cell = grid_->row((place - plane.point).dot(plane.up)) * grid_->columns +
                    grid_->column((place - plane.point).dot(plane.right));
  double best = -kAlmost;
  std::optional<Interior> found;
  for (const std::uint32_t i : grid_->cells[std::size_t(cell)]) {
    const Grid::Entry& entry = grid_->entries[i];
    if (!isOf(entry.tetrahedron)) continue;
    const Vector3d weight = entry.inverse * (place - entry.last);
    const double least = leastOf(weight);
    if (!(least > best)) continue;
    best = least;
    const Corners4& corners = package_.tetrahedra()[entry.tetrahedron].vertex;
    const auto rest = [&](std::uint32_t v) { return asVector(package_.physicalVertices()[v].rest_position); };
    found = Interior{place,
                     rest(corners[3]) + edgesOf(corners, rest) * weight,
                     {entry.tetrahedron, {weight[0], weight[1], weight[2]}}};
    if (least > -kInside) break;
  }
  return found;
}

std::vector<Hung> Crossing::hang(const Surface& surface) const {
  std::vector<Hung> hung;
  hung.reserve(surface.nodes.size());
  const auto rest = [&](std::uint32_t v) { return asVector(package_.physicalVertices()[v].rest_position); };
  const auto weightIn = [&](std::uint32_t tetrahedron, const Vector3d& at) {
    const Corners4& corners = package_.tetrahedra()[tetrahedron].vertex;
    return Vector3d(edgesOf(corners, rest).inverse() * (at - rest(corners[3])));
  };
  for (const Node& node : surface.nodes) {
    if (node.a == formats::kNone) {
      hung.push_back(node.hung);
      continue;
    }
    const formats::BarycentricAttachment &a = package_.barycentric()[node.a], &b = package_.barycentric()[node.b];
    Hung here;
    if (a.tetrahedron == b.tetrahedron && node.c == formats::kNone) {
      here.tetrahedron = a.tetrahedron;
      for (std::size_t k = 0; k < 3; ++k) {
        here.weight[k] = double(a.weight[k]) + node.t * (double(b.weight[k]) - double(a.weight[k]));
      }
      hung.push_back(here);
      continue;
    }
    // The tetrahedron of its piece that has the place now, with the weights that make its place at rest.
    Vector3d weight = Vector3d::Constant(-1e9);
    if (const std::optional<Interior> found = at(node.at, pieceOf(package_, a.tetrahedron))) {
      weight = weightIn(found->hung.tetrahedron, node.rest);
      here.tetrahedron = found->hung.tetrahedron;
    }
    if (!(leastOf(weight) > -0.5)) {
      for (const std::uint32_t t : {a.tetrahedron, b.tetrahedron}) {
        const Vector3d other = weightIn(t, node.rest);
        if (here.tetrahedron == formats::kNone || leastOf(other) > leastOf(weight))
          here.tetrahedron = t, weight = other;
      }
    }
    for (std::size_t k = 0; k < 3; ++k) here.weight[k] = weight[int(k)];
    hung.push_back(here);
  }
  return hung;
}

}  // namespace sinew::cutting

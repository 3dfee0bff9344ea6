// SPDX-License-Identifier: MIT
#include "runtime/contact/depth_map.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "runtime/clusters/algebra.h"

namespace sinew::internal {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

/// Cells along the longest side, so that one has about as many tetrahedra as a tetrahedron has neighbours.
std::uint32_t cellsAlong(std::size_t tetrahedra) {
  return std::uint32_t(std::clamp(std::cbrt(double(tetrahedra)), 2.0, 32.0));
}

Vector3f cornerOf(const formats::PackageView& package, const formats::Tetrahedron& t, std::size_t c) {
  return asVector(package.physicalVertices()[t.vertex[c]].rest_position);
}

}  // namespace

DepthMap::DepthMap(const formats::PackageView& package, const formats::DistanceGrid& grid)
    : package_(&package), grid_(&grid) {
  values_ =
      package.distanceValues().subspan(grid.first_value, std::size_t(grid.nodes[0]) * grid.nodes[1] * grid.nodes[2]);
  const formats::PieceRange& body = package.pieces()[grid.piece];
  const auto tetrahedra = package.tetrahedra().subspan(body.first_tetrahedron, body.tetrahedron_count);
  if (tetrahedra.empty()) return;
  Vector3f high = cornerOf(package, tetrahedra[0], 0);
  low_ = high;
  for (const formats::Tetrahedron& t : tetrahedra) {
    for (std::size_t c = 0; c < 4; ++c) {
      low_ = low_.cwiseMin(cornerOf(package, t, c));
      high = high.cwiseMax(cornerOf(package, t, c));
    }
  }
  const float longest = (high - low_).maxCoeff();
  cell_ = longest > 0 ? longest / float(cellsAlong(tetrahedra.size())) : 1;
  std::uint32_t all = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cells_[axis] = 1 + std::uint32_t((high - low_)[Eigen::Index(axis)] / cell_);
    all *= cells_[axis];
  }
  first_.resize(all + 1);
  // Counted, then filled.
  const auto for_each_cell = [&](const formats::Tetrahedron& t, const auto& visit) {
    Vector3f least = cornerOf(package, t, 0), most = least;
    for (std::size_t c = 1; c < 4; ++c) {
      least = least.cwiseMin(cornerOf(package, t, c));
      most = most.cwiseMax(cornerOf(package, t, c));
    }
    std::array<std::uint32_t, 3> from, to;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = Eigen::Index(axis);
      from[axis] = std::min(std::uint32_t((least - low_)[a] / cell_), cells_[axis] - 1);
      to[axis] = std::min(std::uint32_t((most - low_)[a] / cell_), cells_[axis] - 1);
    }
    for (std::uint32_t z = from[2]; z <= to[2]; ++z) {
      for (std::uint32_t y = from[1]; y <= to[1]; ++y) {
        for (std::uint32_t x = from[0]; x <= to[0]; ++x) visit((z * cells_[1] + y) * cells_[0] + x);
      }
    }
  };
  for (const formats::Tetrahedron& t : tetrahedra) for_each_cell(t, [this](std::uint32_t cell) { ++first_[cell + 1]; });
  for (std::uint32_t cell = 0; cell < all; ++cell) first_[cell + 1] += first_[cell];
  list_.resize(first_[all]);
  Array<std::uint32_t> next;
  next.assign(first_);
  first_tetrahedron_ = body.first_tetrahedron;
  inverse_.resize(tetrahedra.size());
  for (std::size_t i = 0; i < tetrahedra.size(); ++i) {
    for_each_cell(tetrahedra[i], [&](std::uint32_t cell) { list_[next[cell]++] = std::uint32_t(i); });
    const Vector3f last = cornerOf(package, tetrahedra[i], 3);
    Matrix3f sides;
    for (std::size_t c = 0; c < 3; ++c) sides.col(Eigen::Index(c)) = cornerOf(package, tetrahedra[i], c) - last;
    inverse_[i] = sides.inverse();
  }
}

float DepthMap::distance(const Vector3f& place, Vector3f* gradient) const {
  Vector3f in = (place - asVector(grid_->origin)) / grid_->spacing;
  std::array<std::uint32_t, 3> node;
  Vector3f part, beyond = Vector3f::Zero();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = Eigen::Index(axis);
    const float most = float(grid_->nodes[axis] - 1), inside = std::clamp(in[a], 0.0F, most);
    beyond[a] = in[a] - inside;
    node[axis] = std::min(std::uint32_t(inside), grid_->nodes[axis] - 2);
    part[a] = inside - float(node[axis]);
  }
  const std::size_t row = grid_->nodes[0], plane = row * grid_->nodes[1];
  const std::int16_t* const at = values_.data() + node[0] + row * node[1] + plane * node[2];
  // Eight corners, x fastest.
  std::array<float, 8> v;
  for (std::size_t c = 0; c < 8; ++c) v[c] = float(at[(c & 1) + row * (c >> 1 & 1) + plane * (c >> 2)]);
  const auto mix = [](float a, float b, float t) { return a + t * (b - a); };
  const float x00 = mix(v[0], v[1], part[0]), x10 = mix(v[2], v[3], part[0]), x01 = mix(v[4], v[5], part[0]),
              x11 = mix(v[6], v[7], part[0]);
  const float y0 = mix(x00, x10, part[1]), y1 = mix(x01, x11, part[1]);
  if (gradient != nullptr) {
    const float scale = grid_->unit / grid_->spacing;
    (*gradient)[0] =
        scale * mix(mix(v[1] - v[0], v[3] - v[2], part[1]), mix(v[5] - v[4], v[7] - v[6], part[1]), part[2]);
    (*gradient)[1] = scale * mix(x10 - x00, x11 - x01, part[2]);
    (*gradient)[2] = scale * (y1 - y0);
  }
  return grid_->unit * mix(y0, y1, part[2]) + grid_->spacing * beyond.norm();
}

std::uint32_t DepthMap::cellOf(const Vector3f& place) const {
  std::array<std::uint32_t, 3> at;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float in = (place - low_)[Eigen::Index(axis)] / cell_;
    at[axis] = std::uint32_t(std::clamp(in, 0.0F, float(cells_[axis] - 1)));
  }
  return (at[2] * cells_[1] + at[1]) * cells_[0] + at[0];
}

bool DepthMap::locate(const Vector3f& place, MaterialPoint& at) const {
  if (list_.empty() || !place.allFinite()) return false;
  const std::uint32_t cell = cellOf(place);
  float best = -1e30F;
  for (std::uint32_t i = first_[cell]; i < first_[cell + 1]; ++i) {
    const formats::Tetrahedron& t = package_->tetrahedra()[first_tetrahedron_ + list_[i]];
    const Vector3f w = inverse_[list_[i]] * (place - cornerOf(*package_, t, 3));
    const float least = std::min(w.minCoeff(), 1 - w.sum());
    if (!(least > best)) continue;
    best = least;
    at = {t.vertex, {w[0], w[1], w[2], 1 - w.sum()}};
    if (least >= 0) break;
  }
  return best > -1e30F;
}

}  // namespace sinew::internal

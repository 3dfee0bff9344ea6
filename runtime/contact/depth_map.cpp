// SPDX-License-Identifier: MIT
#include "runtime/contact/depth_map.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/clusters/algebra.h"

namespace sinew::internal {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

/// Places of the surface that are looked at for its bulge.
constexpr std::size_t kBulges = 512;
/// Contact points around a place: of the triangle between points that has it, they lie within twice the radius of the
/// circle around that (Delaunay). No place is farther from all points than they are apart, for each is as far as
/// possible from those before it, so that radius is at most about the root of the area that is one's share.
constexpr float kAround = 2;

/// Cells along the longest side, so that one has about as many tetrahedra as a tetrahedron has neighbours.
std::uint32_t cellsAlong(std::size_t tetrahedra) {
  return std::uint32_t(std::clamp(std::cbrt(double(tetrahedra)), 2.0, 32.0));
}

Vector3f cornerOf(const formats::PackageView& package, const formats::Tetrahedron& t, std::size_t c) {
  return asVector(package.physicalVertices()[t.vertex[c]].rest_position);
}

}  // namespace

DepthMap::DepthMap(const formats::PackageView& package, const formats::DistanceGrid& grid)
    : package_(&package), grid_(&grid), nodes_a_metre_(1 / grid.spacing) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    last_node_[axis] = float(grid.nodes[axis] - 1);
    apart_[axis] = axis == 0 ? 1 : apart_[axis - 1] * grid.nodes[axis - 1];
  }
  values_ =
      package.distanceValues().subspan(grid.first_value, std::size_t(grid.nodes[0]) * grid.nodes[1] * grid.nodes[2]);
  for (const formats::Field& field : package.fields()) {
    if (field.piece != grid.piece) continue;
    const auto points = package.fieldPoints().subspan(field.first_point, field.point_count);
    for (const formats::FieldPoint& point : points) point_normals_.push_back(outward(asVector(point.at)));
    if (first_point_ != nullptr) continue;
    first_point_ = points.data();
    findBulge(points);
  }
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
  frames_.resize(tetrahedra.size());
  for (std::size_t i = 0; i < tetrahedra.size(); ++i) {
    for_each_cell(tetrahedra[i], [&](std::uint32_t cell) { list_[next[cell]++] = std::uint32_t(i); });
    const Vector3f last = cornerOf(package, tetrahedra[i], 3);
    Matrix3f sides;
    for (std::size_t c = 0; c < 3; ++c) sides.col(Eigen::Index(c)) = cornerOf(package, tetrahedra[i], c) - last;
    frames_[i] = {sides.inverse(), last};
  }
}

void DepthMap::findBulge(std::span<const formats::FieldPoint> points) {
  // Nodes within a cell of the surface, and from each to it.
  const float reach = grid_->spacing / grid_->unit;
  const auto isNear = [&](std::int16_t value) { return std::abs(float(value)) < reach; };
  const auto near = std::size_t(std::count_if(values_.begin(), values_.end(), isNear)), every = near / kBulges + 1;
  std::size_t seen = 0;
  for (std::size_t i = 0; i < values_.size(); ++i) {
    if (!isNear(values_[i]) || seen++ % every != 0) continue;
    const std::size_t row = i / grid_->nodes[0], layer = row / grid_->nodes[1];
    const Vector3f at(float(i % grid_->nodes[0]), float(row % grid_->nodes[1]), float(layer));
    const Vector3f node = asVector(grid_->origin) + grid_->spacing * at, normal = outward(node);
    const Vector3f place = node - grid_->unit * float(values_[i]) * normal;
    constexpr float kNone = std::numeric_limits<float>::infinity();
    float over = kNone;
    for (const formats::FieldPoint& point : points) {
      const Vector3f way = place - asVector(point.at);
      if (way.squaredNorm() < kAround * kAround * point.area) over = std::min(over, normal.dot(way));
      if (over <= bulge_) break;  // others stand out more
    }
    if (over < kNone) bulge_ = std::max(bulge_, over);
  }
}

inline DepthMap::GridPlace DepthMap::gridPlace(const Vector3f& place) const {
  GridPlace at;
  at.value = values_.data();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = Eigen::Index(axis);
    const float in = (place[a] - grid_->origin[axis]) * nodes_a_metre_;
    const float inside = std::min(std::max(0.0F, in), last_node_[axis]);  // 0 where it is no number
    const auto node = std::min(std::uint32_t(std::int32_t(inside)), grid_->nodes[axis] - 2);
    at.beyond[a] = in - inside;
    at.part[a] = inside - float(std::int32_t(node));
    at.value += std::size_t(node) * apart_[axis];
    at.is_inner = (axis == 0 || at.is_inner) && node > 0 && node + 2 < grid_->nodes[axis];
  }
  return at;
}

float DepthMap::distance(const Vector3f& place) const {
  const GridPlace at = gridPlace(place);
  const auto along = [&](std::size_t edge) {
    const std::int16_t* const value = at.value + edge;
    const float first = value[0];
    return first + at.part[0] * (float(value[1]) - first);
  };
  const std::size_t row = apart_[1], layer = apart_[2];
  const float low = along(0), high = along(layer);
  const float below = low + at.part[1] * (along(row) - low);
  const float above = high + at.part[1] * (along(row + layer) - high);
  return grid_->unit * (below + at.part[2] * (above - below)) + grid_->spacing * at.beyond.norm();
}

Vector3f DepthMap::outward(const Vector3f& place) const {
  const GridPlace at = gridPlace(place);
  Vector3f sum = Vector3f::Zero();
  const auto visit = [&](const auto& rise) {
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
      const std::int16_t* value = at.value;
      float weight = 1;
      for (std::uint32_t axis = 0; axis < 3; ++axis) {
        const bool next = (corner >> axis & 1) != 0;
        if (next) value += apart_[axis];
        weight *= next ? at.part[Eigen::Index(axis)] : 1 - at.part[Eigen::Index(axis)];
      }
      for (std::uint32_t axis = 0; axis < 3; ++axis) sum[Eigen::Index(axis)] += weight * rise(value, axis);
    }
  };
  if (at.is_inner) {
    visit([this](const std::int16_t* value, std::uint32_t axis) {
      return 0.5F * float(value[apart_[axis]] - *(value - apart_[axis]));
    });
  } else {
    // At the grid's sides there is a neighbour on one side only.
    visit([this](const std::int16_t* value, std::uint32_t axis) {
      const std::size_t node = std::size_t(value - values_.data()) / apart_[axis] % grid_->nodes[axis];
      const std::size_t below = node > 0 ? apart_[axis] : 0, above = node + 1 < grid_->nodes[axis] ? apart_[axis] : 0;
      return (below > 0 && above > 0 ? 0.5F : 1.0F) * float(value[above] - *(value - below));
    });
  }
  const float length = sum.norm();
  return length > 0 ? Vector3f(sum / length) : Vector3f(Vector3f::Zero());
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
  const auto weightsIn = [&](std::uint32_t tetrahedron) {
    const Vector3f w = frames_[tetrahedron].inverse * (place - frames_[tetrahedron].last);
    return Eigen::Vector4f(w[0], w[1], w[2], 1 - w.sum());
  };
  const auto take = [&](std::uint32_t tetrahedron, const Eigen::Vector4f& w) {
    at = {package_->tetrahedra()[first_tetrahedron_ + tetrahedron].vertex, {w[0], w[1], w[2], w[3]}, tetrahedron};
  };
  if (at.tetrahedron < frames_.size()) {
    const Eigen::Vector4f w = weightsIn(at.tetrahedron);
    if (w.minCoeff() >= 0) {
      take(at.tetrahedron, w);
      return true;
    }
  }
  const std::uint32_t cell = cellOf(place);
  float best = -1e30F;
  std::uint32_t found = formats::kNone;
  Eigen::Vector4f weights = Eigen::Vector4f::Zero();
  for (std::uint32_t i = first_[cell]; i < first_[cell + 1]; ++i) {
    const Eigen::Vector4f w = weightsIn(list_[i]);
    const float least = w.minCoeff();
    if (!(least > best)) continue;
    best = least;
    found = list_[i];
    weights = w;
    if (least >= 0) break;
  }
  if (found == formats::kNone) return false;
  take(found, weights);
  return true;
}

}  // namespace sinew::internal

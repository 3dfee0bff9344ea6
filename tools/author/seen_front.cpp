// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/seen_front.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace sinew::tools {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kMostCells = 256;  // a side
constexpr std::size_t kRayCost = 10;
// Of the diagonal: what hides a point lies this much nearer to the eye, so that a point's own triangles do not.
constexpr double kHides = 2e-3;

double distanceToSegment(const Vector2d& p, const Vector2d& a, const Vector2d& b) {
  const Vector2d along = b - a;
  const double t = std::clamp((p - a).dot(along) / std::max(along.squaredNorm(), 1e-300), 0.0, 1.0);
  return (a + t * along - p).norm();
}

// Even-odd rule.
bool isInside(const Vector2d& p, std::span<const Vector2d> loop) {
  bool inside = false;
  for (std::size_t i = 0, j = loop.size() - 1; i < loop.size(); j = i++) {
    const Vector2d& a = loop[i];
    const Vector2d& b = loop[j];
    if ((a.y() > p.y()) != (b.y() > p.y()) && p.x() < (b.x() - a.x()) * (p.y() - a.y()) / (b.y() - a.y()) + a.x())
      inside = !inside;
  }
  return inside;
}

}  // namespace

SeenFront::SeenFront(const Surface& surface)
    : surface_(surface), distance_(surface.mesh().welded_positions.size(), kInfinity) {}

SeenFront::Seen SeenFront::seen(const Vector3d& place) const {
  const Vector3d x = place - eye_;
  const double depth = x.dot(along_);
  return {Vector2d(x.dot(u_), x.dot(v_)) / std::max(depth, 1e-300), depth};
}

void SeenFront::begin(const Vector3d& eye, const Vector3d& along, std::span<const Vector3d> normals) {
  eye_ = eye;
  along_ = along;
  u_ = along.unitOrthogonal();
  v_ = along.cross(u_);
  only_visible_ = !normals.empty();
  for (const std::uint32_t p : reached_) distance_[p] = kInfinity;
  reached_.clear();
  changed_.clear();
  waiting_.clear();
  next_ = 0;
  cell_ = 0;
  is_first_ = true;
  const auto& x = surface_.mesh().welded_positions;
  at_.resize(x.size());
  points_.clear();
  low_ = Vector2d::Constant(kInfinity);
  high_ = -low_;
  for (std::uint32_t p = 0; p < x.size(); ++p) {
    if (only_visible_ && !(normals[p].dot(eye_ - x[p]) > 0)) continue;
    const Seen s = seen(x[p]);
    if (!(s.depth > 0)) continue;
    at_[p] = s.at;
    points_.push_back(p);
    low_ = low_.cwiseMin(s.at);
    high_ = high_.cwiseMax(s.at);
  }
  sight_.assign(only_visible_ ? x.size() : 0, Sight::unknown);
}

void SeenFront::makeGrid(double cell) {
  const double widest = std::max((high_ - low_).maxCoeff(), 1e-12);
  cell_ = std::max(cell, widest / double(kMostCells));
  columns_ = std::size_t((high_.x() - low_.x()) / cell_) + 1;
  rows_ = std::size_t((high_.y() - low_.y()) / cell_) + 1;
  const auto cellOf = [&](std::uint32_t p) {
    const Vector2d c = (at_[p] - low_) / cell_;
    return std::min(std::size_t(c.y()), rows_ - 1) * columns_ + std::min(std::size_t(c.x()), columns_ - 1);
  };
  first_.assign(columns_ * rows_ + 1, 0);
  for (const std::uint32_t p : points_) ++first_[cellOf(p) + 1];
  for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
  sorted_.resize(points_.size());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for (const std::uint32_t p : points_) sorted_[next[cellOf(p)]++] = p;
}

template <class Use>
void SeenFront::inBox(const Vector2d& low, const Vector2d& high, const Use& use) const {
  const auto cellAt = [&](double x, double from, std::size_t count) {
    return std::size_t(std::clamp((x - from) / cell_, 0.0, double(count - 1)));
  };
  for (std::size_t row = cellAt(low.y(), low_.y(), rows_); row <= cellAt(high.y(), low_.y(), rows_); ++row) {
    const std::size_t begin = row * columns_ + cellAt(low.x(), low_.x(), columns_);
    const std::size_t end = row * columns_ + cellAt(high.x(), low_.x(), columns_);
    for (std::uint32_t i = first_[begin]; i < first_[end + 1]; ++i) use(sorted_[i]);
  }
}

void SeenFront::add(const Vector3d& place, double from, double limit) {
  const Seen s = seen(place);
  if (!(s.depth > 0) || points_.empty()) return;
  const double reach = (limit - from) / s.depth;
  const auto offer = [&](std::uint32_t p) {
    const double d = from + (at_[p] - s.at).norm() * s.depth;
    if (d <= limit && d < distance_[p]) waiting_.emplace_back(p, d);
  };
  // The first place looks at all points: with the grid, a stroke's first step would cost twice as much.
  if (std::exchange(is_first_, false)) {
    for (const std::uint32_t p : points_) offer(p);
    return;
  }
  if (cell_ == 0) makeGrid(limit / s.depth);
  inBox(s.at - Vector2d::Constant(reach), s.at + Vector2d::Constant(reach), offer);
}

void SeenFront::addLoop(std::span<const Vector3d> corners, double limit) {
  if (corners.size() < 3 || points_.empty()) return;
  std::vector<Vector2d> loop;
  double depth = 0;
  Vector2d low = Vector2d::Constant(kInfinity);
  Vector2d high = -low;
  for (const Vector3d& corner : corners) {
    const Seen s = seen(corner);
    if (!(s.depth > 0)) return;
    loop.push_back(s.at);
    depth += s.depth / double(corners.size());
    low = low.cwiseMin(s.at);
    high = high.cwiseMax(s.at);
  }
  const double reach = limit / depth;
  if (cell_ == 0) makeGrid((high - low).maxCoeff() / 16);
  inBox(low - Vector2d::Constant(reach), high + Vector2d::Constant(reach), [&](std::uint32_t p) {
    double d = 0;
    if (!isInside(at_[p], loop)) {
      d = kInfinity;
      for (std::size_t i = 0, j = loop.size() - 1; i < loop.size(); j = i++)
        d = std::min(d, distanceToSegment(at_[p], loop[i], loop[j]) * depth);
    }
    if (d <= limit && d < distance_[p]) waiting_.emplace_back(p, d);
  });
}

bool SeenFront::isVisible(std::uint32_t point) {
  const Vector3d way = surface_.mesh().welded_positions[point] - eye_;
  const double length = way.norm();
  const SurfacePoint hit = surface_.along(eye_, way / length);
  return hit.triangle == formats::kNone || hit.distance >= length - kHides * surface_.mesh().diagonal;
}

bool SeenFront::spread(std::size_t most) {
  for (std::size_t cost = 0; next_ < waiting_.size() && cost < most; ++cost) {
    const auto [p, d] = waiting_[next_++];
    if (!(d < distance_[p])) continue;
    if (only_visible_) {
      if (sight_[p] == Sight::unknown) {
        sight_[p] = isVisible(p) ? Sight::visible : Sight::hidden;
        cost += kRayCost;
      }
      if (sight_[p] == Sight::hidden) continue;
    }
    if (distance_[p] == kInfinity) reached_.push_back(p);
    distance_[p] = d;
    changed_.push_back(p);
  }
  if (next_ < waiting_.size()) return false;
  waiting_.clear();
  next_ = 0;
  return true;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/triangulate.h"

#include <Eigen/Geometry>
#include <cmath>

namespace sinew::tools {
namespace {

double cross2(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// 0 for a degenerate triangle, 1 for an equilateral one.
double shape(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c, double area2) {
  const double edges = (b - a).squaredNorm() + (c - b).squaredNorm() + (a - c).squaredNorm();
  return edges > 0 ? area2 * 3.4641016151377544 / edges : 0;
}

}  // namespace

void Triangulator::cut(std::span<const Eigen::Vector3d> corners, std::vector<Triangle>& triangles) {
  const std::uint32_t n = std::uint32_t(corners.size());
  if (n == 3) {
    triangles.push_back({0, 1, 2});
    return;
  }
  if (n == 4) {
    cutQuad(corners, triangles);
    return;
  }
  // Newell's normal: the polygon's vector area, right for concave and not quite flat ones.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (std::uint32_t i = 0; i < n; ++i) normal += (corners[i] - corners[0]).cross(corners[(i + 1) % n] - corners[0]);
  const double length = normal.norm();
  if (!(length > 0)) {
    for (std::uint32_t i = 1; i + 1 < n; ++i) triangles.push_back({0, i, i + 1});
    return;
  }
  normal /= length;
  const Eigen::Vector3d x = normal.unitOrthogonal();
  const Eigen::Vector3d y = normal.cross(x);
  flat_.resize(n);
  next_.resize(n);
  previous_.resize(n);
  for (std::uint32_t i = 0; i < n; ++i) {
    flat_[i] = {(corners[i] - corners[0]).dot(x), (corners[i] - corners[0]).dot(y)};
    next_[i] = (i + 1) % n;
    previous_[i] = (i + n - 1) % n;
  }
  std::uint32_t left = n;
  std::uint32_t start = 0;
  while (left > 3) {
    std::uint32_t best = formats::kNone;
    double best_shape = -1;
    std::uint32_t fallback = start;
    double fallback_area = -1e300;
    std::uint32_t at = start;
    const bool choose = left <= 64;
    for (std::uint32_t step = 0; step < left && work_left_ > 0; ++step, at = next_[at]) {
      --work_left_;
      const Eigen::Vector2d& a = flat_[previous_[at]];
      const Eigen::Vector2d& b = flat_[at];
      const Eigen::Vector2d& c = flat_[next_[at]];
      const double area2 = cross2(a, b, c);
      if (area2 > fallback_area) fallback_area = area2, fallback = at;
      if (!(area2 > 0)) continue;
      const double quality = shape(a, b, c, area2);
      if (choose && quality <= best_shape) continue;
      bool empty = true;
      for (std::uint32_t p = next_[next_[at]]; p != previous_[at] && empty; p = next_[p]) {
        if (work_left_ > 0) --work_left_;
        const Eigen::Vector2d& q = flat_[p];
        if (q == a || q == b || q == c) continue;
        // A point on the cut a-c hinders as well: the rest would touch itself there.
        empty = !(cross2(a, b, q) > 0 && cross2(b, c, q) > 0 && cross2(c, a, q) >= 0);
      }
      if (!empty) continue;
      best = at, best_shape = quality;
      if (!choose) break;
    }
    if (best == formats::kNone) best = fallback;  // self-crossing or out of work: any corner ends the job
    triangles.push_back({previous_[best], best, next_[best]});
    next_[previous_[best]] = next_[best];
    previous_[next_[best]] = previous_[best];
    start = choose ? next_[best] : next_[next_[best]];
    --left;
  }
  triangles.push_back({previous_[start], start, next_[start]});
}

void Triangulator::cutQuad(std::span<const Eigen::Vector3d> p, std::vector<Triangle>& triangles) const {
  const auto normal = [&](int a, int b, int c) -> Eigen::Vector3d {
    const auto at = [&](int k) -> const Eigen::Vector3d& { return p[std::size_t(k)]; };
    return (at(b) - at(a)).cross(at(c) - at(a));
  };
  // A concave quad folds over along one of its diagonals: the two triangles then face opposite ways.
  const bool fold02 = normal(0, 1, 2).dot(normal(0, 2, 3)) < 0;
  const bool fold13 = normal(1, 2, 3).dot(normal(1, 3, 0)) < 0;
  const double length02 = (p[2] - p[0]).squaredNorm();
  const double length13 = (p[3] - p[1]).squaredNorm();
  const bool cut13 = fold02 != fold13 ? fold02 : length13 < length02 * (1 - 1e-9);
  if (cut13) {
    triangles.push_back({0, 1, 3});
    triangles.push_back({1, 2, 3});
  } else {
    triangles.push_back({0, 1, 2});
    triangles.push_back({0, 2, 3});
  }
}

}  // namespace sinew::tools

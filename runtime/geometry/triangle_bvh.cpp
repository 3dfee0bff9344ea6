// SPDX-License-Identifier: MIT
#include "runtime/geometry/triangle_bvh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "sinew/formats/sections.h"

namespace sinew::geometry {

using formats::kNone;
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

// Separating axis test of a triangle against a box (Akenine-Moller 2001): 3 box normals, the plane, 9 edge products.
bool overlaps(const AlignedBox3d& box, const TriangleBvh::Corners& t) {
  const Vector3d center = box.center(), half = box.sizes() / 2;
  const std::array<Vector3d, 3> v = {t[0] - center, t[1] - center, t[2] - center};
  for (int axis = 0; axis < 3; ++axis) {
    const double low = std::min({v[0][axis], v[1][axis], v[2][axis]});
    const double high = std::max({v[0][axis], v[1][axis], v[2][axis]});
    if (low > half[axis] || high < -half[axis]) return false;
  }
  const auto separates = [&](const Vector3d& axis) {
    const double a = v[0].dot(axis), b = v[1].dot(axis), c = v[2].dot(axis);
    const double reach = half.dot(axis.cwiseAbs());
    return std::min({a, b, c}) > reach || std::max({a, b, c}) < -reach;
  };
  const std::array<Vector3d, 3> edges = {v[1] - v[0], v[2] - v[1], v[0] - v[2]};
  if (separates(edges[0].cross(edges[1]))) return false;
  for (const Vector3d& e : edges) {
    if (separates({0, -e.z(), e.y()}) || separates({e.z(), 0, -e.x()}) || separates({-e.y(), e.x(), 0})) return false;
  }
  return true;
}

double squaredSegmentDistance(const Vector3d& p0, const Vector3d& p1, const Vector3d& q0, const Vector3d& q1) {
  const Vector3d d1 = p1 - p0, d2 = q1 - q0, r = p0 - q0;
  const double a = d1.squaredNorm(), e = d2.squaredNorm(), f = d2.dot(r), c = d1.dot(r), b = d1.dot(d2);
  double s = 0, t = 0;
  if (a > 0 && e > 0) {
    const double denominator = a * e - b * b;
    s = denominator > 0 ? std::clamp((b * f - c * e) / denominator, 0.0, 1.0) : 0;
    t = (b * s + f) / e;
    if (t < 0) {
      t = 0;
      s = std::clamp(-c / a, 0.0, 1.0);
    } else if (t > 1) {
      t = 1;
      s = std::clamp((b - c) / a, 0.0, 1.0);
    }
  } else if (a > 0) {
    s = std::clamp(-c / a, 0.0, 1.0);
  } else if (e > 0) {
    t = std::clamp(f / e, 0.0, 1.0);
  }
  return (p0 + d1 * s - q0 - d2 * t).squaredNorm();
}

// Moller & Trumbore 1997, both sides. Parameter along a-b, or -1.
double segmentCrossing(const Vector3d& a, const Vector3d& direction, const TriangleBvh::Corners& t) {
  const Vector3d e1 = t[1] - t[0], e2 = t[2] - t[0];
  const Vector3d p = direction.cross(e2);
  const double determinant = e1.dot(p);
  if (determinant == 0) return -1;
  const Vector3d s = a - t[0];
  const double u = s.dot(p) / determinant;
  if (!(u >= 0 && u <= 1)) return -1;
  const Vector3d q = s.cross(e1);
  const double v = direction.dot(q) / determinant;
  if (!(v >= 0 && u + v <= 1)) return -1;
  const double parameter = e2.dot(q) / determinant;
  return parameter > 0 && parameter < 1 ? parameter : -1;
}

}  // namespace

double squaredDistance(const TriangleBvh::Corners& s, const TriangleBvh::Corners& t) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (segmentCrossing(s[i], s[(i + 1) % 3] - s[i], t) >= 0) return 0;
    if (segmentCrossing(t[i], t[(i + 1) % 3] - t[i], s) >= 0) return 0;
  }
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    best = std::min(best, (closestPointOnTriangle(s[i], t[0], t[1], t[2]) - s[i]).squaredNorm());
    best = std::min(best, (closestPointOnTriangle(t[i], s[0], s[1], s[2]) - t[i]).squaredNorm());
    for (std::size_t j = 0; j < 3; ++j) {
      best = std::min(best, squaredSegmentDistance(s[i], s[(i + 1) % 3], t[j], t[(j + 1) % 3]));
    }
  }
  return best;
}

TriangleBvh::TriangleBvh(std::span<const Vector3d> positions, std::span<const Triangle> triangles) {
  const auto corners = [&](std::uint32_t i) {
    const Triangle& t = triangles[i];
    return Corners{positions[t[0]], positions[t[1]], positions[t[2]]};
  };
  const auto centre = [&](std::uint32_t i) -> Vector3d {
    const Triangle& t = triangles[i];
    return (positions[t[0]] + positions[t[1]] + positions[t[2]]) / 3;
  };
  tree_ = BoxTree(
      std::uint32_t(triangles.size()),
      [&](std::uint32_t i) {
        const Corners t = corners(i);
        return AlignedBox3d(t[0]).extend(t[1]).extend(t[2]);
      },
      centre, centre, 8);
  corners_.reserve(triangles.size());
  for (const std::uint32_t i : order()) corners_.push_back(corners(i));
}

TriangleBvh::Hit TriangleBvh::closest(const Vector3d& point, double radius) const {
  Hit best;
  double bound = radius * radius;
  tree_.descendNear(point, bound, [&](std::uint32_t i) {
    const Corners& t = corners_[i];
    const Vector3d q = closestPointOnTriangle(point, t[0], t[1], t[2]);
    const double d = (q - point).squaredNorm();
    // Ties go to the lower number, so that the answer does not depend on the tree's shape.
    if (d < bound || (d == bound && order()[i] < best.triangle)) {
      bound = d;
      best = {d, order()[i], q};
    }
  });
  return best;
}

bool TriangleBvh::within(const Vector3d& point, double radius) const {
  double bound = radius * radius;
  bool found = false;
  tree_.descendNear(point, bound, [&](std::uint32_t i) {
    const Corners& t = corners_[i];
    found = found || (closestPointOnTriangle(point, t[0], t[1], t[2]) - point).squaredNorm() <= radius * radius;
    if (found) bound = -1;  // nothing more is as near
  });
  return found;
}

bool TriangleBvh::touches(const AlignedBox3d& box) const {
  bool found = false;
  tree_.descend([&](const Node& node, std::uint32_t) { return !found && node.box.intersects(box); },
                [&](std::uint32_t i) { found = found || overlaps(box, corners_[i]); });
  return found;
}

template <class Visit>
void TriangleBvh::alongSegment(const Vector3d& a, const Vector3d& b, const Visit& visit) const {
  const Vector3d direction = b - a;
  const Eigen::Array3d inverse = 1 / direction.array();
  const auto meets = [&](const Node& node, std::uint32_t) {
    double low = 0, high = 1;
    for (int axis = 0; axis < 3; ++axis) {
      const double least = node.box.min()[axis], most = node.box.max()[axis];
      if (direction[axis] == 0) {
        if (a[axis] < least || a[axis] > most) return false;
        continue;
      }
      const double near = (least - a[axis]) * inverse[axis], far = (most - a[axis]) * inverse[axis];
      low = std::max(low, std::min(near, far) - 1e-12);
      high = std::min(high, std::max(near, far) + 1e-12);
    }
    return low <= high;
  };
  tree_.descend(meets, visit);
}

void TriangleBvh::crossings(const Vector3d& a, const Vector3d& b, std::vector<Crossing>& crossings) const {
  crossings.clear();
  const Vector3d direction = b - a;
  alongSegment(a, b, [&](std::uint32_t i) {
    const Corners& t = corners_[i];
    const double parameter = segmentCrossing(a, direction, t);
    if (parameter >= 0) crossings.push_back({parameter, (t[1] - t[0]).cross(t[2] - t[0]).dot(direction) < 0 ? 1 : -1});
  });
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& p, const Crossing& q) {
    return p.parameter != q.parameter ? p.parameter < q.parameter : p.winding < q.winding;
  });
}

std::optional<int> TriangleBvh::windingChange(const Vector3d& a, const Vector3d& b) const {
  const Vector3d direction = b - a;
  const double length = direction.lpNorm<Eigen::Infinity>();
  int sum = 0;
  bool sure = true;
  alongSegment(a, b, [&](std::uint32_t i) {
    // Moller & Trumbore 1997 before its divisions: all of these are positive, for a segment that enters, where it
    // crosses.
    const Corners& t = corners_[i];
    const Vector3d e1 = t[1] - t[0], e2 = t[2] - t[0], s = a - t[0];
    const Vector3d p = direction.cross(e2), q = s.cross(e1);
    double determinant = e1.dot(p);
    const double sign = determinant < 0 ? -1 : 1;
    determinant *= sign;
    const double u = sign * s.dot(p), v = sign * direction.dot(q), at = sign * e2.dot(q);
    // Rounding of products of three lengths: 8e-16 of their sizes (Shewchuk 1997, orient3d), with a wide margin.
    constexpr double kRounding = 1e-13;
    const double edge = std::max(e1.lpNorm<Eigen::Infinity>(), e2.lpNorm<Eigen::Infinity>());
    const double far = edge + s.lpNorm<Eigen::Infinity>() + length;
    const double slack = kRounding * far * edge * length, slack_along = kRounding * far * edge * far;
    const double inner = std::min({u, v, determinant - u - v}), along = std::min(at, determinant - at);
    if (inner < -slack || along < -slack_along) return;
    sure = sure && inner > slack && along > slack_along;
    sum += sign > 0 ? 1 : -1;
  });
  return sure ? std::optional(sum) : std::nullopt;
}

}  // namespace sinew::geometry

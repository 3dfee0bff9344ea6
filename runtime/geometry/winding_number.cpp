// SPDX-License-Identifier: MIT
#include "runtime/geometry/winding_number.h"

#include <algorithm>
#include <cmath>

namespace sinew::geometry {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = 3.14159265358979323846;
constexpr double kAccuracy = 2;  // beta of Barill et al. 2018

// Sums over a node, with all components: n_i, n_i d_j, n_i d_j d_k (one symmetric matrix for each i).
struct Sums {
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();
  std::array<Matrix3d, 3> third = {Matrix3d::Zero(), Matrix3d::Zero(), Matrix3d::Zero()};

  // Adds sums about a centre that lies at `shift` from this one's.
  void add(const Sums& s, const Vector3d& shift) {
    first += s.first;
    second += s.second + s.first * shift.transpose();
    for (int i = 0; i < 3; ++i) {
      const Vector3d row = s.second.row(i).transpose();
      third[std::size_t(i)] += s.third[std::size_t(i)] + row * shift.transpose() + shift * row.transpose() +
                               s.first[i] * shift * shift.transpose();
    }
  }
};

// Sum of solid angles of triangles with one arc tangent: half angles (van Oosterom & Strackee 1983, eq. 8) add up as
// the arguments of a product of complex numbers; full turns are counted where it passes the negative real axis.
class AngleSum {
 public:
  void add(const Vector3d& point, const TriangleBvh::Corners& triangle) {
    const Vector3d a = triangle[0] - point, b = triangle[1] - point, c = triangle[2] - point;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    const double size = la * lb * lc;
    const double numerator = a.dot(b.cross(c));
    // In the triangle's plane the angle is 0, or undefined on the triangle itself.
    if (numerator == 0 || size == 0) return;
    const double y = numerator / size, x = 1 + (a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb) / size;
    const double real = real_ * x - imaginary_ * y, imaginary = real_ * y + imaginary_ * x;
    if (imaginary_ > 0 && y > 0 && imaginary < 0) ++turns_;
    if (imaginary_ < 0 && y < 0 && imaginary > 0) --turns_;
    real_ = real;
    imaginary_ = imaginary;
  }
  double windingNumber() const { return std::atan2(imaginary_, real_) / (2 * kPi) + turns_; }

 private:
  double real_ = 1, imaginary_ = 0;
  int turns_ = 0;
};

}  // namespace

double triangleWindingNumber(const Vector3d& point, const TriangleBvh::Corners& triangle) {
  AngleSum sum;
  sum.add(point, triangle);
  return sum.windingNumber();
}

WindingNumber::WindingNumber(std::span<const Vector3d> positions, std::span<const Triangle> triangles, bool closed)
    : bvh_(positions, triangles), closed_(closed) {
  const auto& nodes = bvh_.nodes();
  const auto& corners = bvh_.corners();
  moments_.resize(nodes.size());
  std::vector<Sums> sums(nodes.size());
  std::vector<double> areas(nodes.size());
  for (std::size_t n = nodes.size(); n-- > 0;) {
    const TriangleBvh::Node& node = nodes[n];
    Sums& s = sums[n];
    Vector3d center = Vector3d::Zero();
    if (node.right == 0) {
      double area = 0;
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
        const auto& t = corners[i];
        const double a = (t[1] - t[0]).cross(t[2] - t[0]).norm() / 2;
        center += a * (t[0] + t[1] + t[2]) / 3;
        area += a;
      }
      center = area > 0 ? Vector3d(center / area) : node.box.center();
      areas[n] = area;
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
        const auto& t = corners[i];
        const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]) / 2;
        const Vector3d d = (t[0] + t[1] + t[2]) / 3 - center;
        // The mean of x x^T over a triangle is that over its three edge midpoints.
        Matrix3d square = Matrix3d::Zero();
        for (std::size_t e = 0; e < 3; ++e) {
          const Vector3d m = (t[e] + t[(e + 1) % 3]) / 2 - center;
          square += m * m.transpose() / 3;
        }
        s.first += normal;
        s.second += normal * d.transpose();
        for (int k = 0; k < 3; ++k) s.third[std::size_t(k)] += normal[k] * square;
      }
    } else {
      const std::size_t left = n + 1, right = node.right;
      areas[n] = areas[left] + areas[right];
      center = areas[n] > 0
                   ? Vector3d((areas[left] * moments_[left].center + areas[right] * moments_[right].center) / areas[n])
                   : node.box.center();
      s.add(sums[left], moments_[left].center - center);
      s.add(sums[right], moments_[right].center - center);
    }
    Moments& m = moments_[n];
    m.center = center;
    const Vector3d reach = (node.box.max() - center).cwiseMax(center - node.box.min());
    m.squared_reach = kAccuracy * kAccuracy * reach.squaredNorm();
    m.first = s.first;
    const Matrix3d& w = s.second;
    m.second = {w(0, 0), w(1, 1), w(2, 2), w(0, 1) + w(1, 0), w(1, 2) + w(2, 1), w(2, 0) + w(0, 2)};
    const auto& t = s.third;
    for (int k = 0; k < 3; ++k) {
      // d_ij r_k + d_ik r_j + d_jk r_i of the second derivative, contracted with n_i d_j d_k.
      double trace = 0;
      for (int i = 0; i < 3; ++i) trace += 2 * t[std::size_t(i)](i, k);
      m.third_trace[k] = trace + t[std::size_t(k)].trace();
    }
    const auto third = [&](int i, int j, int k) { return t[std::size_t(i)](j, k); };
    const auto two = [&](int i, int j) { return third(i, i, j) + third(i, j, i) + third(j, i, i); };
    m.third = {third(0, 0, 0), third(1, 1, 1),
               third(2, 2, 2), two(0, 1),
               two(0, 2),      two(1, 0),
               two(1, 2),      two(2, 0),
               two(2, 1),      2 * (third(0, 1, 2) + third(1, 2, 0) + third(2, 0, 1))};
  }
}

double WindingNumber::expansion(const Moments& m, const Vector3d& point) const {
  const Vector3d r = m.center - point;
  const double x = r.x(), y = r.y(), z = r.z();
  const double inverse2 = 1 / r.squaredNorm();
  const double inverse3 = inverse2 * std::sqrt(inverse2);
  const double inverse5 = inverse3 * inverse2;
  const auto& s = m.second;
  const auto& t = m.third;
  const double quadratic = s[0] * x * x + s[1] * y * y + s[2] * z * z + s[3] * x * y + s[4] * y * z + s[5] * z * x;
  const double cubic = x * x * (t[0] * x + t[3] * y + t[4] * z) + y * y * (t[1] * y + t[5] * x + t[6] * z) +
                       z * z * (t[2] * z + t[7] * x + t[8] * y) + t[9] * x * y * z;
  double sum = inverse3 * (m.first.dot(r) + s[0] + s[1] + s[2]) - 3 * inverse5 * quadratic;
  sum += 0.5 * (15 * inverse5 * inverse2 * cubic - 3 * inverse5 * m.third_trace.dot(r));
  return sum / (4 * kPi);
}

double WindingNumber::at(const Vector3d& point) const {
  const auto& nodes = bvh_.nodes();
  if (nodes.empty()) return 0;
  const auto& corners = bvh_.corners();
  std::array<std::uint32_t, 64> stack{};
  std::size_t depth = 0;
  stack[depth++] = 0;
  double sum = 0;
  while (depth > 0) {
    const std::uint32_t index = stack[--depth];
    const Moments& m = moments_[index];
    if ((m.center - point).squaredNorm() > m.squared_reach) {
      sum += expansion(m, point);
      continue;
    }
    const TriangleBvh::Node& node = nodes[index];
    if (node.right == 0) {
      AngleSum angles;
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) angles.add(point, corners[i]);
      sum += angles.windingNumber();
      continue;
    }
    stack[depth++] = node.right;
    stack[depth++] = index + 1;
  }
  return sum;
}

double WindingNumber::crossing(const Vector3d& a, const Vector3d& b) const {
  const Vector3d direction = b - a;
  std::vector<TriangleBvh::Crossing> hits;
  bvh_.crossings(a, b, hits);
  if (closed_) {
    // One crossing needs no further question; with several, the first after which a point lies outside.
    for (std::size_t i = 0; i < hits.size(); ++i) {
      if (i + 1 == hits.size()) return hits[i].parameter;
      const double middle = (hits[i].parameter + hits[i + 1].parameter) / 2;
      if (middle - hits[i].parameter > 1e-9 && !inside(a + direction * middle)) return hits[i].parameter;
    }
  } else {
    // Near a hole the level 1/2 leaves the triangles: ask on both sides of each.
    for (const TriangleBvh::Crossing& hit : hits) {
      constexpr double kAside = 1e-4;
      if (hit.winding > 0) continue;
      if (inside(a + direction * (hit.parameter - kAside)) && !inside(a + direction * (hit.parameter + kAside))) {
        return hit.parameter;
      }
    }
  }
  double low = 0, high = 1;
  for (int i = 0; i < 17; ++i) {
    const double middle = (low + high) / 2;
    (inside(a + direction * middle) ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace sinew::geometry

// SPDX-License-Identifier: MIT
#include "tests/geometry/shapes.h"

#include <algorithm>
#include <cmath>

namespace sinew::testing {
namespace {

using Eigen::Vector3d;
constexpr double kPi = 3.14159265358979323846;

Surface fromSphere(std::uint32_t rings, const std::function<Vector3d(const Vector3d&)>& place) {
  Surface s;
  const std::uint32_t around = 2 * rings;
  s.positions.push_back(place({0, 1, 0}));
  for (std::uint32_t i = 1; i < rings; ++i) {
    const double theta = kPi * i / rings;
    for (std::uint32_t j = 0; j < around; ++j) {
      const double phi = 2 * kPi * j / around;
      s.positions.push_back(place({std::sin(theta) * std::cos(phi), std::cos(theta), std::sin(theta) * std::sin(phi)}));
    }
  }
  s.positions.push_back(place({0, -1, 0}));
  const auto at = [&](std::uint32_t ring, std::uint32_t j) {
    if (ring == 0) return 0U;
    if (ring == rings) return 1 + (rings - 1) * around;
    return 1 + (ring - 1) * around + j % around;
  };
  for (std::uint32_t i = 0; i < rings; ++i) {
    for (std::uint32_t j = 0; j < around; ++j) {
      if (i > 0) s.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j)});
      if (i + 1 < rings) s.triangles.push_back({at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)});
    }
  }
  return s;
}

}  // namespace

Eigen::AlignedBox3d Surface::bounds() const {
  Eigen::AlignedBox3d box;
  for (const auto& p : positions) box.extend(p);
  return box;
}

double Surface::volume() const {
  double sum = 0;
  for (const auto& t : triangles) sum += positions[t[0]].dot(positions[t[1]].cross(positions[t[2]])) / 6;
  return sum;
}

void Surface::append(const Surface& other, const Vector3d& offset) {
  const auto base = static_cast<std::uint32_t>(positions.size());
  for (const auto& p : other.positions) positions.push_back(p + offset);
  for (const auto& t : other.triangles) triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
}

void Surface::reverse() {
  for (auto& t : triangles) std::swap(t[1], t[2]);
}

Surface sphere(double radius, std::uint32_t rings) {
  return fromSphere(rings, [=](const Vector3d& d) -> Vector3d { return radius * d; });
}

Surface blob(std::uint32_t seed, std::uint32_t rings) {
  Random random(seed);
  std::vector<std::pair<Vector3d, double>> bumps;
  for (int i = 0; i < 8; ++i) {
    Vector3d direction = random.inBox({Vector3d::Constant(-1), Vector3d::Constant(1)});
    direction.normalize();
    bumps.emplace_back(direction, random.between(-0.35, 0.9));
  }
  return fromSphere(rings, [&](const Vector3d& d) -> Vector3d {
    double radius = 1;
    for (const auto& [direction, height] : bumps) radius += height * std::exp(8 * (d.dot(direction) - 1));
    return radius * d;
  });
}

Surface torus(double major, double minor, std::uint32_t segments) {
  Surface s;
  for (std::uint32_t i = 0; i < segments; ++i) {
    for (std::uint32_t j = 0; j < segments; ++j) {
      const double u = 2 * kPi * i / segments, v = 2 * kPi * j / segments;
      const double r = major + minor * std::cos(v);
      s.positions.emplace_back(r * std::cos(u), minor * std::sin(v), r * std::sin(u));
    }
  }
  const auto at = [&](std::uint32_t i, std::uint32_t j) { return i % segments * segments + j % segments; };
  for (std::uint32_t i = 0; i < segments; ++i) {
    for (std::uint32_t j = 0; j < segments; ++j) {
      s.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
      s.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
    }
  }
  return s;
}

Surface box(const Vector3d& size, std::uint32_t n) {
  Surface s;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-0.5, 0.5}) {
      const auto base = static_cast<std::uint32_t>(s.positions.size());
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      for (std::uint32_t j = 0; j <= n; ++j) {
        for (std::uint32_t i = 0; i <= n; ++i) {
          Vector3d p;
          p[axis] = side;
          p[u] = double(i) / n - 0.5;
          p[v] = double(j) / n - 0.5;
          s.positions.emplace_back(p.cwiseProduct(size));
        }
      }
      for (std::uint32_t j = 0; j < n; ++j) {
        for (std::uint32_t i = 0; i < n; ++i) {
          const std::uint32_t a = base + j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
          if (side > 0) {
            s.triangles.push_back({a, b, d});
            s.triangles.push_back({a, d, c});
          } else {
            s.triangles.push_back({a, d, b});
            s.triangles.push_back({a, c, d});
          }
        }
      }
    }
  }
  return s;
}

double Random::unit() {
  state_ ^= state_ << 13;
  state_ ^= state_ >> 7;
  state_ ^= state_ << 17;
  return double(state_ >> 11) / 9007199254740992.0;
}

Vector3d Random::inBox(const Eigen::AlignedBox3d& box) {
  const double x = between(box.min().x(), box.max().x());
  const double y = between(box.min().y(), box.max().y());
  const double z = between(box.min().z(), box.max().z());
  return {x, y, z};
}

std::vector<Implicit> implicitMenagerie() {
  const Eigen::AlignedBox3d unit(Vector3d::Constant(-1.2), Vector3d::Constant(1.2));
  std::vector<Implicit> list;
  list.push_back({"ball", unit, [](const Vector3d& p) { return p.norm() - 1.0; }});
  list.push_back({"cube", unit, [](const Vector3d& p) { return p.cwiseAbs().maxCoeff() - 0.9; }});
  list.push_back({"tilted cube", unit, [](const Vector3d& p) {
                    const Eigen::AngleAxisd turn(0.7, Vector3d(1, 2, 3).normalized());
                    return (turn * p).cwiseAbs().maxCoeff() - 0.6;
                  }});
  list.push_back({"shell", unit, [](const Vector3d& p) { return std::max(p.norm() - 1.0, 0.6 - p.norm()); }});
  list.push_back({"cone", unit, [](const Vector3d& p) {
                    return std::max(std::hypot(p.x(), p.z()) - 0.4 * (1 - p.y()), -0.9 - p.y());
                  }});
  list.push_back({"gyroid", unit, [](const Vector3d& p) {
                    const Vector3d q = 5 * p;
                    const double g = std::sin(q.x()) * std::cos(q.y()) + std::sin(q.y()) * std::cos(q.z()) +
                                     std::sin(q.z()) * std::cos(q.x());
                    return std::max(g, p.norm() - 1.1);
                  }});
  return list;
}

}  // namespace sinew::testing

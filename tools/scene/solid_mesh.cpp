// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/scene/solid_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <type_traits>

namespace sinew::tools {
namespace {

constexpr unsigned kAround = 32;  ///< corners of a circle
constexpr float kPi = std::numbers::pi_v<float>;

using Eigen::Vector3f;

Eigen::Map<const Vector3f> vectorOf(const Vec3& v) { return Eigen::Map<const Vector3f>(v.data()); }
Vec3 vec3(const Vector3f& v) { return {v[0], v[1], v[2]}; }
/// Unit; up where three points lie in a line.
Vector3f normalOf(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vector3f across = (vectorOf(b) - vectorOf(a)).cross(vectorOf(c) - vectorOf(a));
  return across.norm() > 0 ? Vector3f(across.normalized()) : Vector3f::UnitY();
}

void addFlat(SolidMesh& mesh, std::initializer_list<Vec3> corners) {
  const auto first = std::uint32_t(mesh.positions.size());
  const Vec3* const at = corners.begin();
  const Vec3 normal = vec3(normalOf(at[0], at[1], at[2]));
  for (const Vec3& corner : corners) {
    mesh.positions.push_back(corner);
    mesh.normals.push_back(normal);
  }
  for (std::uint32_t i = 2; i < corners.size(); ++i) mesh.triangles.push_back({first, first + i - 1, first + i});
}

/// One side of a box.
void addSide(SolidMesh& mesh, const Vec3& half, std::size_t axis, float sign) {
  const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
  const auto corner = [&](float a, float b) {
    Vec3 at;
    at[axis] = sign * half[axis];
    at[u] = a * half[u];
    at[v] = b * half[v];
    return at;
  };
  if (sign > 0) {
    addFlat(mesh, {corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)});
  } else {
    addFlat(mesh, {corner(-1, -1), corner(-1, 1), corner(1, 1), corner(1, -1)});
  }
}

/// Points nearer than `radius` to the segment from -half_length to half_length on the y axis.
void addRound(SolidMesh& mesh, float radius, float half_length) {
  constexpr unsigned kRings = kAround / 2;
  for (unsigned ring = 0; ring <= kRings + 1; ++ring) {
    // The middle ring stands at both ends of the segment.
    const bool lower = ring <= kRings / 2;
    const float polar = kPi * float(lower ? ring : ring - 1) / float(kRings);
    const float out = std::max(0.0F, std::sin(polar));  // the sine of pi in floats is below 0
    for (unsigned i = 0; i <= kAround; ++i) {
      const float turn = 2 * kPi * float(i % kAround) / float(kAround);
      const Vec3 normal = {out * std::cos(turn), -std::cos(polar), out * std::sin(turn)};
      mesh.normals.push_back(normal);
      mesh.positions.push_back(
          {radius * normal[0], radius * normal[1] + (lower ? -half_length : half_length), radius * normal[2]});
    }
  }
  for (std::uint32_t ring = 0; ring <= kRings; ++ring) {
    for (std::uint32_t i = 0; i < kAround; ++i) {
      const std::uint32_t a = ring * (kAround + 1) + i, b = a + kAround + 1;
      mesh.triangles.push_back({a, b, a + 1});
      mesh.triangles.push_back({a + 1, b, b + 1});
    }
  }
}

void add(SolidMesh& mesh, const PlaneShape& plane, float reach) {
  const Vector3f n = vectorOf(plane.normal).normalized(), u = n.unitOrthogonal(), v = n.cross(u);
  const auto corner = [&](float a, float b) { return vec3(plane.offset * n + reach * (a * u + b * v)); };
  addFlat(mesh, {corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)});
  mesh.endless = true;
}

void add(SolidMesh& mesh, const MeshShape& shape) {
  for (const formats::Triangle& t : shape.triangles) {
    addFlat(mesh, {shape.positions[t[0]], shape.positions[t[1]], shape.positions[t[2]]});
  }
}

/// Triangles that have all points on one side; of flat sides with more than three corners more than once.
void add(SolidMesh& mesh, const HullShape& hull) {
  const std::span<const Vec3> points = hull.points;
  float size = 0;
  for (const Vec3& p : points) size = std::max(size, (vectorOf(p) - vectorOf(points[0])).norm());
  const float rounding = 1e-5F * size;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = i + 1; j < points.size(); ++j) {
      for (std::size_t k = j + 1; k < points.size(); ++k) {
        const Vector3f across =
            (vectorOf(points[j]) - vectorOf(points[i])).cross(vectorOf(points[k]) - vectorOf(points[i]));
        if (!(across.norm() > rounding * size)) continue;  // in a line
        float low = 0, high = 0;
        for (const Vec3& p : points) {
          const float height = across.normalized().dot(vectorOf(p) - vectorOf(points[i]));
          low = std::min(low, height);
          high = std::max(high, height);
        }
        if (!(high > rounding)) {
          addFlat(mesh, {points[i], points[j], points[k]});
        } else if (!(low < -rounding)) {
          addFlat(mesh, {points[i], points[k], points[j]});
        }
      }
    }
  }
}

void add(SolidMesh& mesh, const HeightFieldShape& field) {
  const auto rows = std::uint32_t(field.heights.size() / std::max(field.columns, 1U));
  const auto corner = [&](std::uint32_t column, std::uint32_t row) {
    return Vec3{float(column) * field.cell, field.heights[row * field.columns + column], float(row) * field.cell};
  };
  for (std::uint32_t row = 0; row + 1 < rows; ++row) {
    for (std::uint32_t column = 0; column + 1 < field.columns; ++column) {
      addFlat(mesh, {corner(column, row), corner(column, row + 1), corner(column + 1, row)});
      addFlat(mesh, {corner(column + 1, row), corner(column, row + 1), corner(column + 1, row + 1)});
    }
  }
}

}  // namespace

std::shared_ptr<const SolidMesh> meshOf(const ColliderShape& shape, float reach) {
  auto mesh = std::make_shared<SolidMesh>();
  std::visit(
      [&](const auto& one) {
        using Shape = std::decay_t<decltype(one)>;
        if constexpr (std::is_same_v<Shape, PlaneShape>) {
          add(*mesh, one, reach);
        } else if constexpr (std::is_same_v<Shape, SphereShape>) {
          addRound(*mesh, one.radius, 0);
        } else if constexpr (std::is_same_v<Shape, CapsuleShape>) {
          addRound(*mesh, one.radius, one.half_length);
        } else if constexpr (std::is_same_v<Shape, BoxShape>) {
          for (std::size_t axis = 0; axis < 3; ++axis) {
            for (const float sign : {-1.0F, 1.0F}) addSide(*mesh, one.half_size, axis, sign);
          }
        } else {
          add(*mesh, one);
        }
      },
      shape);
  return mesh;
}

std::shared_ptr<const SolidMesh> wallOf(const Vec3& half_size, std::size_t axis, float sign) {
  auto mesh = std::make_shared<SolidMesh>();
  mesh->one_sided = true;
  addSide(*mesh, half_size, axis, sign);
  addSide(*mesh, half_size, 1, 1);
  return mesh;
}

std::shared_ptr<const SolidMesh> plateOf(const Vec3& half_size, float sign) {
  auto mesh = std::make_shared<SolidMesh>();
  mesh->one_sided = true;
  addSide(*mesh, half_size, 1, sign);
  for (const std::size_t axis : {std::size_t(0), std::size_t(2)}) {
    addSide(*mesh, half_size, axis, -1);
    addSide(*mesh, half_size, axis, 1);
  }
  return mesh;
}

}  // namespace sinew::tools

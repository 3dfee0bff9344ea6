// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/scene/solid_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <type_traits>

namespace sinew::tools {
namespace {

constexpr unsigned kAround = 32;  ///< corners of a circle
constexpr float kPi = std::numbers::pi_v<float>;

Vec3 minus(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vec3 unit(const Vec3& v) {
  const float length = std::hypot(v[0], v[1], v[2]);
  return length > 0 ? Vec3{v[0] / length, v[1] / length, v[2] / length} : Vec3{0, 1, 0};
}

void addFlat(SolidMesh& mesh, std::initializer_list<Vec3> corners) {
  const auto first = std::uint32_t(mesh.positions.size());
  const Vec3* const at = corners.begin();
  const Vec3 normal = unit(cross(minus(at[1], at[0]), minus(at[2], at[0])));
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
    for (unsigned i = 0; i <= kAround; ++i) {
      const float turn = 2 * kPi * float(i % kAround) / float(kAround);
      const Vec3 normal = {std::sin(polar) * std::cos(turn), -std::cos(polar), std::sin(polar) * std::sin(turn)};
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
  const Vec3 n = unit(plane.normal);
  const Vec3 u = unit(cross(n, std::abs(n[1]) < 0.9F ? Vec3{0, 1, 0} : Vec3{1, 0, 0})), v = cross(n, u);
  const auto corner = [&](float a, float b) {
    Vec3 at;
    for (std::size_t k = 0; k < 3; ++k) at[k] = plane.offset * n[k] + reach * (a * u[k] + b * v[k]);
    return at;
  };
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
  for (const Vec3& p : points) {
    for (std::size_t a = 0; a < 3; ++a) size = std::max(size, std::abs(p[a] - points[0][a]));
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = i + 1; j < points.size(); ++j) {
      for (std::size_t k = j + 1; k < points.size(); ++k) {
        const Vec3 across = cross(minus(points[j], points[i]), minus(points[k], points[i]));
        if (!(std::hypot(across[0], across[1], across[2]) > 1e-6F * size * size)) continue;
        const Vec3 normal = unit(across);
        float low = 0, high = 0;
        for (const Vec3& p : points) {
          const Vec3 arm = minus(p, points[i]);
          const float height = arm[0] * normal[0] + arm[1] * normal[1] + arm[2] * normal[2];
          low = std::min(low, height);
          high = std::max(high, height);
        }
        if (!(high > 1e-5F * size)) {
          addFlat(mesh, {points[i], points[j], points[k]});
        } else if (!(low < -1e-5F * size)) {
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

}  // namespace sinew::tools

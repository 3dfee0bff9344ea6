// SPDX-License-Identifier: GPL-3.0-or-later
//
// Surfaces that are drawn for colliders.
#include "tools/scene/solid_mesh.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

Vector3d at(const std::vector<Vec3>& list, std::uint32_t i) { return {list[i][0], list[i][1], list[i][2]}; }

/// Volume that the triangles enclose; their normals are those of their sides, outward.
double volumeOf(const SolidMesh& mesh) {
  double volume = 0;
  for (const formats::Triangle& t : mesh.triangles) {
    const Vector3d a = at(mesh.positions, t[0]), b = at(mesh.positions, t[1]), c = at(mesh.positions, t[2]);
    const Vector3d across = (b - a).cross(c - a);
    volume += a.dot(b.cross(c)) / 6;
    if (!(across.norm() > 1e-9)) continue;  // at a pole
    for (const std::uint32_t v : t) EXPECT_GT(across.normalized().dot(at(mesh.normals, v)), 0.9);
  }
  return volume;
}

TEST(SolidMesh, EnclosesTheVolumeOfItsShape) {
  constexpr double pi = std::numbers::pi;
  EXPECT_NEAR(volumeOf(*meshOf(SphereShape{2}, 1)), 4.0 / 3 * pi * 8, 0.7);
  EXPECT_NEAR(volumeOf(*meshOf(CapsuleShape{1, 3}, 1)), 4.0 / 3 * pi + pi * 6, 0.4);
  EXPECT_NEAR(volumeOf(*meshOf(BoxShape{{1, 2, 3}}, 1)), 48, 1e-4);
  // A tetrahedron, and a point inside it.
  const std::array<Vec3, 5> points = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.1F, 0.1F, 0.1F}}};
  const auto hull = meshOf(HullShape{points}, 1);
  EXPECT_EQ(hull->triangles.size(), 4U);
  EXPECT_NEAR(volumeOf(*hull), 1.0 / 6, 1e-6);
}

TEST(SolidMesh, SheetsFaceUpAndAPlaneHasNoEnd) {
  const std::array<float, 6> heights = {0, 1, 0, 2, 0, 1};
  const auto field = meshOf(HeightFieldShape{heights, 3, 0.5F}, 1);
  EXPECT_EQ(field->triangles.size(), 4U);
  for (const Vec3& n : field->normals) EXPECT_GT(n[1], 0);
  EXPECT_FALSE(field->endless);
  const auto plane = meshOf(PlaneShape{{0, 0, 1}, 2}, 5);
  EXPECT_TRUE(plane->endless);
  for (const Vec3& p : plane->positions) EXPECT_NEAR(p[2], 2, 1e-5);
  for (const Vec3& n : plane->normals) EXPECT_NEAR(n[2], 1, 1e-6);
}

TEST(SolidMesh, AWallIsSeenFromInsideAndAbove) {
  const auto wall = wallOf({0.1F, 1, 2}, 0, -1);
  EXPECT_TRUE(wall->one_sided);
  ASSERT_EQ(wall->triangles.size(), 4U);
  EXPECT_NEAR(wall->normals[wall->triangles[0][0]][0], -1, 1e-6);
  EXPECT_NEAR(wall->normals[wall->triangles[2][0]][1], 1, 1e-6);
}

}  // namespace
}  // namespace sinew::tools

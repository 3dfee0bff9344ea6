// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/surface.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <numbers>

#include "tests/author/sheet.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

TEST(Surface, DistanceOnAPlaneIsTheStraightOne) {
  const VisualMesh mesh = flat(40);
  const Surface surface(mesh);
  std::vector<double> start(mesh.positions.size(), INFINITY);
  const std::uint32_t source = 20 * 41 + 13;
  start[source] = 0;
  const std::vector<double> distance = surface.distances(start);
  for (std::size_t v = 0; v < distance.size(); ++v) {
    const double straight = (mesh.positions[v] - mesh.positions[source]).norm();
    EXPECT_NEAR(distance[v], straight, 1e-3) << v;
    EXPECT_GE(distance[v], straight - 1e-9);
  }
}

TEST(Surface, DistanceOnASphereIsTheArc) {
  const VisualMesh mesh = sheet(60, [](double u, double v) {
    const double a = (u - 0.5) * 2.4;
    const double b = (v - 0.5) * 2.4;
    return Vector3d(std::sin(a) * std::cos(b), std::sin(b), std::cos(a) * std::cos(b));
  });
  const Surface surface(mesh);
  const SurfacePoint at = surface.nearest({0, 0, 2});
  EXPECT_NEAR(at.distance, 1, 1e-2);
  const std::vector<double> distance = surface.distancesFrom({&at, 1});
  double worst = 0;
  for (std::size_t v = 0; v < distance.size(); ++v) {
    const double arc = std::acos(std::clamp(mesh.positions[v].z(), -1.0, 1.0));
    if (arc > 0.2) worst = std::max(worst, std::abs(distance[v] / arc - 1));
  }
  EXPECT_LT(worst, 0.02);
}

TEST(Surface, DistanceGoesRoundASlitAndNeverAcrossAGap) {
  VisualMesh mesh = flat(20);
  // A slit along x = 0.5 from the lower rim to the middle: triangles that touch it go.
  std::erase_if(mesh.triangles, [&](const Triangle& t) {
    const Vector3d center = (mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]) / 3;
    return std::abs(center.x() - 0.525) < 0.03 && center.y() < 0.5;
  });
  const Surface surface(mesh);
  std::vector<double> start(mesh.positions.size(), INFINITY);
  start[8] = 0;  // (0.4, 0)
  const std::vector<double> distance = surface.distances(start);
  const double round = Vector3d(0.1, 0.5, 0).norm() + 0.05 + Vector3d(0.05, 0.5, 0).norm();
  EXPECT_NEAR(distance[12], round, 0.03);  // (0.6, 0): 0.2 m across the slit
  std::erase_if(mesh.triangles, [&](const Triangle& t) {
    return std::abs((mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]]).x() / 3 - 0.525) < 0.03;
  });
  const Surface apart(mesh);
  EXPECT_TRUE(std::isinf(apart.distances(start)[12]));
}

TEST(Surface, SignedDistanceIsMeasuredFromWhereTheWeightIsOneHalf) {
  const VisualMesh mesh = flat(20);
  const Surface surface(mesh);
  std::vector<double> weight(mesh.positions.size());
  for (std::size_t v = 0; v < weight.size(); ++v) weight[v] = mesh.positions[v].x() < 0.51 ? 1 : 0;
  const std::vector<double> distance = surface.signedDistances(weight);
  for (std::size_t v = 0; v < distance.size(); ++v) EXPECT_NEAR(distance[v], mesh.positions[v].x() - 0.525, 1e-3);
}

TEST(Surface, FindsThePlaneOfSymmetry) {
  // A saddle with a bump on each side: symmetric across one plane only, turned and moved.
  const Eigen::AngleAxisd turn(0.3, Vector3d(1, 2, 3).normalized());
  const VisualMesh mesh = sheet(30, [&](double u, double v) {
    const double x = 2 * u - 1;
    const double y = 2 * v - 1;
    return Vector3d(turn * Vector3d(1.6 * x, y, 0.4 * x * x + 0.25 * y * y * y + 0.2 * y) + Vector3d(5, 6, 7));
  });
  const Surface surface(mesh);
  const auto plane = surface.symmetryPlane();
  ASSERT_TRUE(plane.has_value());
  EXPECT_LT(plane->error, 2e-3);
  EXPECT_GT(std::abs(plane->normal.dot(turn * Vector3d::UnitX())), std::cos(0.01));
  EXPECT_NEAR(plane->normal.dot(plane->point - Vector3d(5, 6, 7)), 0, 1e-2);
}

}  // namespace
}  // namespace sinew::tools

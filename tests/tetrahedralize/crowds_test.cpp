// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/crowds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/geometry/shapes.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using testing::Surface;

// Two cones on one disc, their tips the hubs.
Surface doubleCone(std::uint32_t faces) {
  Surface s;
  s.positions = {{0, 0, 0.3}, {0, 0, -0.3}};
  for (std::uint32_t i = 0; i < faces; ++i) {
    const double angle = 2 * std::numbers::pi * i / faces;
    s.positions.emplace_back(std::cos(angle), std::sin(angle), 0);
    const std::uint32_t a = 2 + i, b = 2 + (i + 1) % faces;
    s.triangles.push_back({0, a, b});
    s.triangles.push_back({1, b, a});
  }
  return s;
}

double volume(const Surface& s) {
  double six = 0;
  for (const auto& t : s.triangles) six += s.positions[t[0]].dot(s.positions[t[1]].cross(s.positions[t[2]]));
  return six / 6;
}

TEST(Crowds, SliversOfAHubAreMergedAlongItsRim) {
  Surface cone = doubleCone(20000);
  const double before = volume(cone);
  cone.triangles = withoutCrowds(cone.positions, cone.triangles);
  EXPECT_LE(cone.triangles.size(), 4 * kCrowd);
  EXPECT_GE(cone.triangles.size(), kCrowd);
  EXPECT_NEAR(volume(cone), before, 1e-3 * before);
  // Still closed: each edge as often one way as the other.
  std::vector<std::array<std::uint32_t, 2>> forth, back;
  for (const auto& t : cone.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      forth.push_back({t[i], t[(i + 1) % 3]});
      back.push_back({t[(i + 1) % 3], t[i]});
    }
  }
  std::sort(forth.begin(), forth.end());
  std::sort(back.begin(), back.end());
  EXPECT_EQ(forth, back);
}

TEST(Crowds, OtherSurfacesAreLeftAlone) {
  const Surface ball = testing::sphere(1, 40), few = doubleCone(kCrowd);
  EXPECT_EQ(withoutCrowds(ball.positions, ball.triangles), ball.triangles);
  EXPECT_EQ(withoutCrowds(few.positions, few.triangles), few.triangles);
}

}  // namespace
}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/suggest_up.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

namespace sinew::tools {
namespace {

using Profile = std::vector<std::pair<double, double>>;  // radius and height, from the bottom's middle to the top's

// A solid of revolution about `axis`.
VisualMesh turned(const Profile& profile, int axis) {
  constexpr std::uint32_t kAround = 24;
  VisualMesh mesh;
  for (const auto& [radius, height] : profile) {
    for (std::uint32_t i = 0; i < kAround; ++i) {
      const double angle = 2 * std::numbers::pi * i / kAround;
      Eigen::Vector3d x;
      x[axis] = height;
      x[(axis + 1) % 3] = radius * std::cos(angle);
      x[(axis + 2) % 3] = radius * std::sin(angle);
      mesh.positions.push_back(x);
    }
  }
  for (std::uint32_t ring = 0; ring + 1 < profile.size(); ++ring) {
    for (std::uint32_t i = 0; i < kAround; ++i) {
      const std::uint32_t a = ring * kAround + i, b = ring * kAround + (i + 1) % kAround;
      mesh.triangles.push_back({a, b, b + kAround});
      mesh.triangles.push_back({a, b + kAround, a + kAround});
    }
  }
  mesh.bounds_min = mesh.bounds_max = mesh.positions[0];
  for (const Eigen::Vector3d& x : mesh.positions) {
    mesh.bounds_min = mesh.bounds_min.cwiseMin(x);
    mesh.bounds_max = mesh.bounds_max.cwiseMax(x);
  }
  return mesh;
}

const Profile kBottle = {{0, 0}, {0.5, 0}, {0.5, 2}, {0.2, 2.5}, {0.2, 3}, {0, 3}};
const Profile kPipe = {{0, 0}, {0.5, 0}, {0.5, 3}, {0, 3}};
const Profile kEgg = {{0, 0}, {0.3, 0.1}, {0.5, 0.5}, {0.6, 1}, {0.5, 1.5}, {0.3, 1.9}, {0, 2}};

TEST(SuggestUp, ABottleThatLiesIsSuggestedToStand) {
  const auto lies = suggestUp(turned(kBottle, 2));
  ASSERT_TRUE(lies);
  EXPECT_EQ(lies->severity, Severity::info);
  EXPECT_NE(lies->cure.find("import.up=z"), std::string::npos);
}

TEST(SuggestUp, NothingIsSuggestedWhereYIsPlausible) {
  EXPECT_FALSE(suggestUp(turned(kBottle, 1)));
  EXPECT_FALSE(suggestUp(turned(kBottle, 0)));
  for (const int axis : {0, 1, 2}) {
    EXPECT_FALSE(suggestUp(turned(kPipe, axis))) << axis;
    EXPECT_FALSE(suggestUp(turned(kEgg, axis))) << axis;
  }
  VisualMesh given = turned(kBottle, 2);
  given.up_axis = "z";
  EXPECT_FALSE(suggestUp(given));
}

}  // namespace
}  // namespace sinew::tools

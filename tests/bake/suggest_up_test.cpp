// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/suggest_up.h"

#include <gtest/gtest.h>

#include <array>
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

// Boxes from one corner to the other, y up.
VisualMesh boxes(const std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>& corners) {
  VisualMesh mesh;
  for (const auto& [low, high] : corners) {
    const auto first = std::uint32_t(mesh.positions.size());
    for (int k = 0; k < 8; ++k)
      mesh.positions.emplace_back((k & 1 ? high : low)[0], (k & 2 ? high : low)[1], (k & 4 ? high : low)[2]);
    for (const auto& [a, b, c, d] : {std::array{0U, 4U, 6U, 2U},
                                     {1U, 3U, 7U, 5U},
                                     {0U, 1U, 5U, 4U},
                                     {2U, 6U, 7U, 3U},
                                     {0U, 2U, 3U, 1U},
                                     {4U, 5U, 7U, 6U}}) {
      mesh.triangles.push_back({first + a, first + b, first + c});
      mesh.triangles.push_back({first + a, first + c, first + d});
    }
  }
  return mesh;
}

// Turned about x: once for a file with z up, twice for one that is upside down, thrice for one with -z up.
VisualMesh aboutX(VisualMesh mesh, int quarters) {
  for (int i = 0; i < quarters; ++i) {
    for (Eigen::Vector3d& x : mesh.positions) x = {x[0], -x[2], x[1]};
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

TEST(SuggestUp, AChairAndADogAreSuggestedToStandWhereZIsUp) {
  const VisualMesh chair = boxes({{{-0.22, 0.42, -0.22}, {0.22, 0.46, 0.22}},
                                  {{-0.22, 0.46, -0.22}, {0.22, 0.95, -0.18}},
                                  {{-0.22, 0, -0.22}, {-0.18, 0.42, -0.18}},
                                  {{0.18, 0, -0.22}, {0.22, 0.42, -0.18}},
                                  {{-0.22, 0, 0.18}, {-0.18, 0.42, 0.22}},
                                  {{0.18, 0, 0.18}, {0.22, 0.42, 0.22}}});
  const VisualMesh dog = boxes({{{-0.15, 0.5, -0.6}, {0.15, 0.85, 0.5}},
                                {{-0.1, 0.8, 0.5}, {0.1, 1.1, 0.85}},
                                {{-0.15, 0, -0.55}, {-0.05, 0.5, -0.45}},
                                {{0.05, 0, -0.55}, {0.15, 0.5, -0.45}},
                                {{-0.15, 0, 0.35}, {-0.05, 0.5, 0.45}},
                                {{0.05, 0, 0.35}, {0.15, 0.5, 0.45}}});
  for (const int quarters : {0, 1, 2, 3}) {
    EXPECT_EQ(suggestUp(aboutX(chair, quarters)).has_value(), quarters == 1) << quarters;
    EXPECT_EQ(suggestUp(aboutX(dog, quarters)).has_value(), quarters == 1) << quarters;
  }
}

TEST(SuggestUp, NothingIsSuggestedToWhatStandsBothWays) {
  const VisualMesh door = boxes({{{0, 0, 0}, {0.9, 2, 0.04}}});
  const VisualMesh table = boxes({{{-0.7, 0.7, -0.4}, {0.7, 0.74, 0.4}},
                                  {{-0.68, 0, -0.38}, {-0.62, 0.7, -0.32}},
                                  {{0.62, 0, -0.38}, {0.68, 0.7, -0.32}},
                                  {{-0.68, 0, 0.32}, {-0.62, 0.7, 0.38}},
                                  {{0.62, 0, 0.32}, {0.68, 0.7, 0.38}}});
  for (const int quarters : {0, 1, 2, 3}) {
    EXPECT_FALSE(suggestUp(aboutX(door, quarters))) << quarters;
    EXPECT_FALSE(suggestUp(aboutX(table, quarters))) << quarters;
  }
}

}  // namespace
}  // namespace sinew::tools

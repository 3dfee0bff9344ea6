// SPDX-License-Identifier: MIT
#include "runtime/cut/triangulate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "runtime/cut/sides.h"

namespace sinew::cutting {
namespace {

/// A star-shaped loop around a place, counter-clockwise for step 1.
void addLoop(std::vector<GridPoint>& points, std::vector<std::array<std::uint32_t, 2>>& edges, double x, double y,
             double radius, int count, int seed, bool reversed) {
  const auto first = std::uint32_t(points.size());
  for (int i = 0; i < count; ++i) {
    const double angle = (reversed ? -1 : 1) * 2 * M_PI * i / count;
    const double r = radius * (0.7 + 0.3 * std::sin(double(seed * i * i + 3 * i)));
    points.push_back({std::int64_t(x + r * std::cos(angle)), std::int64_t(y + r * std::sin(angle))});
    edges.push_back({first + std::uint32_t(i), first + std::uint32_t((i + 1) % count)});
  }
}

double areaOf(const std::vector<GridPoint>& points, const std::vector<std::array<std::uint32_t, 2>>& edges) {
  double area = 0;
  for (const auto& [a, b] : edges) {
    area += 0.5 * (double(points[a].x) * double(points[b].y) - double(points[a].y) * double(points[b].x));
  }
  return area;
}

/// The border of triangles: directed edges without an opposite one.
std::map<std::pair<std::uint32_t, std::uint32_t>, int> borderOf(const std::vector<Corners>& triangles) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> border;
  for (const Corners& t : triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k], b = t[(k + 1) % 3];
      if (border[{b, a}] > 0) {
        --border[{b, a}];
      } else {
        ++border[{a, b}];
      }
    }
  }
  std::erase_if(border, [](const auto& entry) { return entry.second == 0; });
  return border;
}

TEST(Triangulate, PolygonsWithHolesAndPointsInside) {
  for (int seed = 1; seed < 40; ++seed) {
    std::vector<GridPoint> points;
    std::vector<std::array<std::uint32_t, 2>> edges;
    const double middle = 0.5 * double(kGrid);
    addLoop(points, edges, middle, middle, 0.49 * double(kGrid), 5 + 3 * seed, seed, false);
    addLoop(points, edges, middle - 1.2e6, middle, 0.8e6, 3 + seed, seed + 1, true);
    addLoop(points, edges, middle + 1.2e6, middle, 1e6, 3 + 2 * seed, seed + 2, true);
    const std::size_t rim = points.size();
    for (int i = 0; i < 10; ++i) points.push_back({std::int64_t(middle) + 1000 * i, std::int64_t(middle) + 77 * i * i});
    std::vector<Corners> triangles;
    ASSERT_TRUE(triangulate(points, edges, triangles)) << seed;
    double sum = 0;
    for (const Corners& t : triangles) {
      const std::int64_t turn = turnOf(points[t[0]], points[t[1]], points[t[2]]);
      EXPECT_GT(turn, 0);
      sum += 0.5 * double(turn);
    }
    EXPECT_NEAR(sum, areaOf(points, edges), 1);
    const auto border = borderOf(triangles);
    EXPECT_EQ(border.size(), rim);
    for (const auto& [a, b] : edges) EXPECT_TRUE(border.contains({a, b}));
    // Euler: each hole has two triangles more, each point inside too.
    EXPECT_EQ(triangles.size(), points.size() + 10 - 2 + 2 * 2);
  }
}

TEST(Triangulate, CrossingLoopsAreRefusedAndEarsCloseThem) {
  const std::vector<GridPoint> points = {{0, 0}, {1000, 1000}, {1000, 0}, {0, 1000}};
  const std::vector<std::array<std::uint32_t, 2>> edges = {{0, 1}, {1, 2}, {2, 3}, {3, 0}};
  std::vector<Corners> triangles;
  EXPECT_FALSE(triangulate(points, edges, triangles));
  triangles.clear();
  const std::vector<std::uint32_t> loop = {0, 1, 2, 3};
  clipEars(points, loop, 1, triangles);
  ASSERT_EQ(triangles.size(), 2U);
  const auto border = borderOf(triangles);
  EXPECT_EQ(border.size(), 4U);
  for (const auto& [a, b] : edges) EXPECT_TRUE(border.contains({a, b}));
}

TEST(Fraction, PartsOfATetrahedronAddUp) {
  // Moments of all cuts sum to a quarter for each corner; a plane at a third has 1/27 of the volume.
  const Fraction third = fractionOf({1, -2, -2, -2}, {1, -1, -1, -1});
  EXPECT_NEAR(third.volume[1], 1.0 / 27, 1e-12);
  const Fraction half = fractionOf({1, 1, -1, -1}, {1, 1, -1, -1});
  EXPECT_NEAR(half.volume[0], 0.5, 1e-12);
  EXPECT_NEAR(half.volume[1], 0.5, 1e-12);
  for (const auto& heights :
       {std::array<double, 4>{1, 2, -3, -0.5}, {0, 1, -1, 2}, {0, 0, 1, -2}, {-1, 0, 3, 4}, {-1, -1, -2, 3}}) {
    std::array<Side, 4> side = {};
    for (std::size_t k = 0; k < 4; ++k) side[k] = heights[k] > 0 ? Side(1) : heights[k] < 0 ? Side(-1) : Side(0);
    const Fraction f = fractionOf(heights, side);
    EXPECT_NEAR(f.volume[0] + f.volume[1], 1, 1e-12);
    double height = 0, above = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_NEAR(f.moments[0][k] + f.moments[1][k], 0.25, 1e-12);
      EXPECT_GE(f.moments[0][k], 0);
      height += f.moments[0][k] * heights[k];
      above += f.moments[1][k] * heights[k];
    }
    EXPECT_LT(height, 0);  // the middle of what is below lies below
    EXPECT_GT(above, 0);
  }
}

}  // namespace
}  // namespace sinew::cutting

// SPDX-License-Identifier: MIT
#include "runtime/geometry/winding_number.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "tests/geometry/shapes.h"

namespace sinew::geometry {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

double bruteForce(const testing::Surface& s, const Vector3d& p) {
  double sum = 0;
  for (const Triangle& t : s.triangles) {
    sum += triangleWindingNumber(p, {s.positions[t[0]], s.positions[t[1]], s.positions[t[2]]});
  }
  return sum;
}

// Largest error over points within and well around the surface.
double largestError(const testing::Surface& s, std::uint64_t seed) {
  const WindingNumber winding(s.positions, s.triangles);
  AlignedBox3d box = s.bounds();
  const Vector3d margin = box.sizes() / 2;
  box.extend(box.min() - margin);
  box.extend(box.max() + margin);
  testing::Random random(seed);
  double worst = 0;
  for (int i = 0; i < 1500; ++i) {
    const Vector3d p = random.inBox(box);
    worst = std::max(worst, std::abs(winding.at(p) - bruteForce(s, p)));
  }
  return worst;
}

TEST(WindingNumber, OneTriangleMatchesTheOctant) {
  // The triangle through the unit points of the axes covers an eighth of the directions from the origin.
  EXPECT_NEAR(triangleWindingNumber(Vector3d::Zero(), {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()}), 0.125,
              1e-15);
  EXPECT_NEAR(triangleWindingNumber(Vector3d::Zero(), {Vector3d::UnitY(), Vector3d::UnitX(), Vector3d::UnitZ()}),
              -0.125, 1e-15);
}

TEST(WindingNumber, MatchesBruteForce) {
  EXPECT_LT(largestError(testing::sphere(1, 40), 1), 1e-2);
  EXPECT_LT(largestError(testing::torus(1, 0.3, 60), 2), 1e-2);
  EXPECT_LT(largestError(testing::box({4, 1, 0.1}, 20), 3), 1e-2);
  for (std::uint32_t seed = 1; seed < 4; ++seed) EXPECT_LT(largestError(testing::blob(seed, 40), seed), 1e-2);
}

// Far and near points, some on triangles, some counts that no packet divides.
TEST(WindingNumber, ManyPointsAtOnceGiveTheSameBits) {
  testing::Surface open = testing::blob(7, 40);
  open.triangles.resize(open.triangles.size() * 9 / 10);
  const WindingNumber winding(open.positions, open.triangles);
  testing::Random random(11);
  std::vector<Vector3d> points(open.positions.begin(), open.positions.begin() + 20);
  for (const Triangle& t : std::span(open.triangles).first(20)) {
    points.emplace_back((open.positions[t[0]] + open.positions[t[1]] + open.positions[t[2]]) / 3);
  }
  AlignedBox3d box = open.bounds();
  box.extend(3 * box.max());
  for (int i = 0; i < 300; ++i) points.push_back(random.inBox(box));
  for (const std::size_t count : {std::size_t(0), std::size_t(1), std::size_t(3), std::size_t(66), points.size()}) {
    const std::span<const Vector3d> some = std::span(points).last(count);
    std::vector<double> at(count);
    std::vector<char> inside(count);
    winding.at(some, at);
    winding.inside(some, inside);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_EQ(at[i], winding.at(some[i]));
      EXPECT_EQ(inside[i] != 0, winding.inside(some[i]));
    }
  }
}

TEST(WindingNumber, MatchesBruteForceOnOpenAndSelfIntersectingSurfaces) {
  testing::Surface open = testing::sphere(1, 40);
  open.triangles.resize(open.triangles.size() * 4 / 5);
  EXPECT_LT(largestError(open, 5), 1e-2);
  testing::Surface two = testing::sphere(1, 30);
  two.append(testing::sphere(1, 30), {1, 0, 0});
  EXPECT_LT(largestError(two, 6), 1e-2);
  const WindingNumber winding(two.positions, two.triangles);
  EXPECT_NEAR(winding.at({0.5, 0, 0}), 2, 1e-2);
}

// Holes that touch at corners, some with matter left between them, and triangles that are there twice.
TEST(WindingNumber, LidsCloseWhateverIsOpen) {
  testing::Surface s = testing::blob(9, 40);
  const testing::Surface whole = s;
  std::size_t number = 0;
  std::erase_if(s.triangles, [&](const Triangle& t) {
    const bool around = t[0] == 500 || t[1] == 500 || t[2] == 500;
    return (around && number % 2 == 0) || number++ % 25 == 0;
  });
  s.triangles.push_back(s.triangles[100]);
  s.triangles.push_back(s.triangles[103]);
  EXPECT_LT(s.triangles.size(), whole.triangles.size() - 20);
  EXPECT_FALSE(WindingNumber(s.positions, s.triangles).closed());
  EXPECT_LT(largestError(s, 14), 1e-2);
}

TEST(WindingNumber, SecondOrderFallsOffFasterThanFirst) {
  // Error of an expansion to second order falls with the fourth power of distance over size, times the field's own
  // square: doubling the distance gains far more than the 16 of a first-order one (for an open cap, no symmetry).
  testing::Surface cap = testing::blob(7, 24);
  cap.triangles.resize(cap.triangles.size() / 3);
  const WindingNumber winding(cap.positions, cap.triangles);
  double near = 0, far = 0;
  testing::Random random(8);
  for (int i = 0; i < 200; ++i) {
    Vector3d direction = random.inBox({Vector3d::Constant(-1), Vector3d::Constant(1)});
    direction.normalize();
    near = std::max(near, std::abs(winding.at(10 * direction) - bruteForce(cap, 10 * direction)));
    far = std::max(far, std::abs(winding.at(20 * direction) - bruteForce(cap, 20 * direction)));
  }
  EXPECT_GT(near, 0);
  EXPECT_LT(far, near / 20);
}

TEST(WindingNumber, HoleDoesNotMoveTheInside) {
  testing::Surface s = testing::box({1, 1, 1}, 8);
  s.triangles.erase(s.triangles.begin(), s.triangles.begin() + 2);
  const WindingNumber winding(s.positions, s.triangles);
  EXPECT_TRUE(winding.inside({0, 0, 0}));
  EXPECT_TRUE(winding.inside({0.45, 0.45, 0.45}));
  EXPECT_FALSE(winding.inside({0.55, 0.55, 0.55}));
}

TEST(WindingNumber, InsideWhereAnalyticSolidsAre) {
  const testing::Surface ring = testing::torus(1, 0.3, 160);
  const WindingNumber winding(ring.positions, ring.triangles);
  testing::Random random(9);
  int inside = 0;
  for (int i = 0; i < 4000; ++i) {
    const Vector3d p = random.inBox(ring.bounds());
    const double d = std::hypot(std::hypot(p.x(), p.z()) - 1, p.y());
    if (std::abs(d - 0.3) < 1e-3) continue;  // between the torus and its triangles
    inside += d < 0.3 ? 1 : 0;
    EXPECT_EQ(winding.inside(p), d < 0.3);
  }
  EXPECT_GT(inside, 500);
}

TEST(WindingNumber, CrossingLiesOnTheSurface) {
  for (const std::size_t hole : {std::size_t(0), std::size_t(40)}) {
    testing::Surface ball = testing::sphere(1, 60);
    ball.triangles.resize(ball.triangles.size() - hole);
    const WindingNumber winding(ball.positions, ball.triangles);
    EXPECT_EQ(winding.closed(), hole == 0);
    testing::Random random(11);
    WindingNumber::Walk walk;
    int through_triangles = 0;
    for (int i = 0; i < 300; ++i) {
      Vector3d a = random.inBox({Vector3d::Constant(-0.5), Vector3d::Constant(0.5)});
      Vector3d b = random.inBox({Vector3d::Constant(1.1), Vector3d::Constant(2)});
      if (i % 2 == 1) b = -b;
      std::vector<TriangleBvh::Crossing> hits;
      winding.bvh().crossings(a, b, hits);
      if (hits.empty()) continue;
      ++through_triangles;
      const Vector3d hit = a + (b - a) * winding.crossing(a, b, walk);
      EXPECT_LT(std::sqrt(winding.bvh().closest(hit).squared_distance), 1e-4);
    }
    EXPECT_GT(through_triangles, 280);
  }
}

// Edges that are used twice the same way count twice.
TEST(WindingNumber, OpenEdgesOfAFinAndOfNothing) {
  const std::vector<Triangle> twice = {{0, 1, 2}, {0, 1, 3}};
  const auto open = openEdges(twice);
  EXPECT_EQ(open.size(), 6U);
  EXPECT_EQ(std::count(open.begin(), open.end(), std::array<std::uint32_t, 2>{0, 1}), 2);
  EXPECT_TRUE(openEdges(testing::sphere(1, 8).triangles).empty());
}

TEST(WindingNumber, WholeNumbersOfAClosedSurface) {
  testing::Surface two = testing::blob(3, 30);
  two.append(testing::blob(4, 30), {0.5, 0.2, 0});
  const WindingNumber winding(two.positions, two.triangles);
  testing::Random random(12);
  int seen[3] = {};
  for (int i = 0; i < 1000; ++i) {
    const double at = winding.at(random.inBox(two.bounds()));
    ASSERT_TRUE(at == 0 || at == 1 || at == 2) << at;
    ++seen[int(at)];
  }
  for (const int count : seen) EXPECT_GT(count, 10);
}

// Walks over lattices whose lines run along edges, through corners and in faces, and over a crumpled surface with
// holes.
TEST(WindingNumber, WalksGiveTheBitsOfEachPointAlone) {
  std::vector<testing::Surface> surfaces = {testing::box({1, 1, 1}, 4), testing::sphere(1, 12), testing::blob(6, 24),
                                            testing::blob(6, 24)};
  testing::Random random(13);
  for (Vector3d& p : surfaces[3].positions) {
    p += random.inBox({Vector3d::Constant(-0.1), Vector3d::Constant(0.1)});
  }
  surfaces[3].triangles.erase(surfaces[3].triangles.begin() + 50, surfaces[3].triangles.begin() + 80);
  for (const testing::Surface& s : surfaces) {
    const WindingNumber winding(s.positions, s.triangles);
    const AlignedBox3d box = s.bounds();
    std::vector<Vector3d> points;
    constexpr int kSteps = 16;  // multiples of the box's own
    for (int i = 0; i < kSteps * kSteps * kSteps; ++i) {
      const Vector3d at = Vector3d(i % kSteps - 2, i / kSteps % kSteps - 2, i / kSteps / kSteps - 2) / (kSteps - 4);
      points.emplace_back(box.min() + box.sizes().cwiseProduct(at));
    }
    std::vector<double> together(points.size());
    winding.at(points, together);
    WindingNumber::Walk walk;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double alone = winding.at(points[i]);
      ASSERT_EQ(together[i], alone) << points[i].transpose();
      double walked = 0;
      winding.at({&points[i], 1}, {&walked, 1}, walk);
      ASSERT_EQ(walked, alone) << points[i].transpose();
    }
  }
}

TEST(WindingNumber, CrossingOfOverlappingPartsIsTheOutermost) {
  testing::Surface two = testing::box({2, 2, 2}, 3);
  two.append(testing::box({2, 2, 2}, 3), {1, 0.1, 0.1});
  const WindingNumber winding(two.positions, two.triangles);
  WindingNumber::Walk walk;
  // From (0,0,0) along x: leaves the first box at 1 while inside the second, which ends at 2.
  EXPECT_NEAR(winding.crossing({0, 0.03, 0.01}, {4, 0.03, 0.01}, walk), 0.5, 1e-12);
}

TEST(WindingNumber, PlaceOfLeavingIsFoundInRoundsOfFour) {
  for (const double wall : {0.0, 0.1, 0.2, 0.5, 0.77777, 0.99999, 1.0}) {
    int asked = 0;
    const double found = leavingPoint({2, 0, 0}, {4, 0, 0}, 7, [&](std::span<const Vector3d> points, auto answers) {
      asked += int(points.size());
      for (std::size_t i = 0; i < points.size(); ++i) answers[i] = points[i].x() < 2 + 2 * wall ? 1 : 0;
    });
    EXPECT_EQ(asked, 28);
    EXPECT_NEAR(found, wall, 0.51 * std::pow(5, -7)) << wall;
  }
}

TEST(WindingNumber, WithinIsWhatTheClosestSays) {
  const testing::Surface s = testing::blob(5, 20);
  const TriangleBvh bvh(s.positions, s.triangles);
  testing::Random random(3);
  for (int i = 0; i < 500; ++i) {
    const Vector3d p = random.inBox(s.bounds());
    const double distance = std::sqrt(bvh.closest(p).squared_distance);
    EXPECT_TRUE(bvh.within(p, distance * (1 + 1e-9)));
    EXPECT_FALSE(bvh.within(p, distance * (1 - 1e-9)));
  }
  EXPECT_FALSE(TriangleBvh().within(Vector3d::Zero(), 1));
}

TEST(WindingNumber, NothingIsNeverInside) {
  const WindingNumber winding;
  EXPECT_EQ(winding.at({0, 0, 0}), 0);
  EXPECT_FALSE(winding.bvh().touches({Vector3d::Constant(-1), Vector3d::Constant(1)}));
}

TEST(WindingNumber, ScaleDoesNotMatter) {
  for (const double scale : {1e-6, 1e6}) {
    testing::Surface s = testing::blob(2, 20);
    for (auto& p : s.positions) p *= scale;
    const WindingNumber winding(s.positions, s.triangles);
    EXPECT_TRUE(winding.inside(Vector3d::Zero()));
    EXPECT_FALSE(winding.inside(Vector3d(5, 5, 5) * scale));
  }
}

TEST(TriangleBvh, ClosestMatchesBruteForce) {
  const testing::Surface s = testing::blob(4, 20);
  const TriangleBvh bvh(s.positions, s.triangles);
  testing::Random random(12);
  for (int i = 0; i < 500; ++i) {
    const Vector3d p = random.inBox({Vector3d::Constant(-3), Vector3d::Constant(3)});
    double best = 1e300;
    for (const Triangle& t : s.triangles) {
      best = std::min(
          best, (closestPointOnTriangle(p, s.positions[t[0]], s.positions[t[1]], s.positions[t[2]]) - p).squaredNorm());
    }
    EXPECT_EQ(bvh.closest(p).squared_distance, best);
  }
}

TEST(TriangleBvh, TrianglesApartAndCrossing) {
  const TriangleBvh::Corners a = {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0)};
  EXPECT_NEAR(squaredDistance(a, {Vector3d(0, 0, 2), Vector3d(1, 0, 2), Vector3d(0, 1, 2)}), 4, 1e-15);
  EXPECT_EQ(squaredDistance(a, {Vector3d(0.2, 0.2, -1), Vector3d(0.2, 0.2, 1), Vector3d(5, 5, 1)}), 0);
  EXPECT_NEAR(squaredDistance(a, {Vector3d(2, 0, 0), Vector3d(3, 0, 0), Vector3d(2, 1, 0)}), 1, 1e-15);
  // Edge against edge.
  EXPECT_NEAR(squaredDistance(a, {Vector3d(0.5, -1, 0.5), Vector3d(0.5, 1, 0.5), Vector3d(0.5, 0, 3)}), 0.25, 1e-15);
}

}  // namespace
}  // namespace sinew::geometry

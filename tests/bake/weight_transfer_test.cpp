// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <numbers>

#include "tests/bake/box_mesh.h"
#include "tools/author/weights.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// A slab of 2 x 2 x 0.1 m with its middle at the origin.
PhysicalMesh slab() {
  PhysicalMesh mesh = latticeMesh({20, 20, 1}, 0.1);
  for (Vector3d& x : mesh.positions) x -= Vector3d(1, 1, 0.05);
  return mesh;
}

struct Sheet {
  VisualMesh mesh;
  std::vector<TetrahedronPlace> places;
};

// Each vertex hangs in its cell of the slab.
Sheet placed(std::vector<Vector3d> positions, std::vector<Triangle> triangles, const PhysicalMesh& physical) {
  Sheet sheet;
  for (const Vector3d& x : positions) {
    TetrahedronPlace best{0, {}, 1e9};
    const auto cell = [](double c) { return std::uint32_t(std::clamp(int(std::floor((c + 1) / 0.1)), 0, 19)); };
    const std::uint32_t first = 6 * (20 * cell(x[0]) + cell(x[1]));
    for (std::uint32_t t = first; t < first + 6; ++t) {
      const TetrahedronPlace place = placeIn(t, x, physical);
      if (place.distance < best.distance) best = place;
    }
    sheet.places.push_back(best);
  }
  sheet.mesh.positions = std::move(positions);
  sheet.mesh.triangles = std::move(triangles);
  return sheet;
}

// A disc of a radius of 0.95 m, all faces around its middle.
Sheet fan(std::uint32_t faces, const PhysicalMesh& physical) {
  std::vector<Vector3d> x = {Vector3d::Zero()};
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i < faces; ++i) {
    const double angle = 2 * std::numbers::pi * i / faces;
    x.emplace_back(0.95 * std::cos(angle), 0.95 * std::sin(angle), 0);
    triangles.push_back({0, i + 1, (i + 1) % faces + 1});
  }
  return placed(x, triangles, physical);
}

double secondsOf(const Sheet& sheet, const PhysicalMesh& physical) {
  const std::clock_t start = std::clock();
  const WeightTransfer transfer(sheet.mesh, physical, sheet.places);
  return double(std::clock() - start) / CLOCKS_PER_SEC;
}

TEST(WeightTransfer, SliversCarryWeightsToAllTetrahedraUnderThem) {
  const PhysicalMesh physical = slab();
  const Sheet disc = fan(20000, physical);
  std::vector<double> radius;
  for (const Vector3d& x : disc.mesh.positions) radius.push_back(x.norm());
  const std::vector<double> weights = WeightTransfer(disc.mesh, physical, disc.places)(radius);
  for (std::size_t v = 0; v < weights.size(); ++v) {
    const double r = physical.positions[v].head<2>().norm();
    if (r > 0.9) continue;
    EXPECT_NEAR(weights[v], r, 0.08) << v;
  }
}

// By the square of their length, 20,000 faces around one point took hundreds of times as long as the same number in
// rows.
TEST(WeightTransfer, AFanCostsWhatAsManySmallTrianglesDo) {
  const PhysicalMesh physical = slab();
  std::vector<Vector3d> x;
  std::vector<Triangle> triangles;
  for (std::uint32_t j = 0; j <= 100; ++j) {
    for (std::uint32_t i = 0; i <= 100; ++i) x.emplace_back(0.019 * i - 0.95, 0.019 * j - 0.95, 0);
  }
  for (std::uint32_t j = 0; j < 100; ++j) {
    for (std::uint32_t i = 0; i < 100; ++i) {
      const std::uint32_t a = 101 * j + i;
      triangles.push_back({a, a + 1, a + 102});
      triangles.push_back({a, a + 102, a + 101});
    }
  }
  const double rows = secondsOf(placed(x, triangles, physical), physical);
  EXPECT_LT(secondsOf(fan(20000, physical), physical), 20 * rows);
}

}  // namespace
}  // namespace sinew::tools

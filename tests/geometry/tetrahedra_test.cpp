// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "runtime/geometry/grid_tetrahedra.h"
#include "runtime/geometry/stuffing.h"
#include "runtime/geometry/winding_number.h"
#include "tests/geometry/shapes.h"

namespace sinew::geometry {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

struct Angles {
  double smallest = 180, largest = 0;
};

// What every mesh must hold: positive tetrahedra, each face in one or two, the border closed. Returns the angles.
Angles checkMesh(const TetMesh& mesh, const std::string& what) {
  Angles angles;
  std::map<Triangle, int> faces;
  double size = 0;
  for (const auto& p : mesh.positions) size = std::max(size, p.cwiseAbs().maxCoeff());
  for (const Tetrahedron& t : mesh.tetrahedra) {
    for (const std::uint32_t v : t) EXPECT_LT(v, mesh.positions.size()) << what;
    EXPECT_GT(volume(mesh, t), 0) << what;
    const auto& x = mesh.positions;
    const auto range = dihedralRange(x[t[0]], x[t[1]], x[t[2]], x[t[3]]);
    angles.smallest = std::min(angles.smallest, range[0]);
    angles.largest = std::max(angles.largest, range[1]);
    for (std::size_t skip = 0; skip < 4; ++skip) {
      Triangle face{};
      for (std::size_t i = 0, n = 0; i < 4; ++i) {
        if (i != skip) face[n++] = t[i];
      }
      std::sort(face.begin(), face.end());
      ++faces[face];
    }
  }
  for (const auto& [face, count] : faces) EXPECT_LE(count, 2) << what;
  // The border, oriented, is closed: each directed edge has as many partners the other way.
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  const auto border = boundaryFaces(mesh);
  double border_volume = 0;
  for (const Triangle& f : border) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = f[i], b = f[(i + 1) % 3];
      edges[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
    border_volume += mesh.positions[f[0]].dot(mesh.positions[f[1]].cross(mesh.positions[f[2]])) / 6;
  }
  for (const auto& [edge, sum] : edges) EXPECT_EQ(sum, 0) << what;
  // Volumes that add up to what the border encloses: nothing overlaps, nothing is missing in between.
  EXPECT_NEAR(border_volume, volume(mesh), 1e-9 * size * size * size) << what;
  // Every vertex is used.
  std::vector<char> used(mesh.positions.size(), 0);
  for (const Tetrahedron& t : mesh.tetrahedra) {
    for (const std::uint32_t v : t) used[v] = 1;
  }
  EXPECT_EQ(std::count(used.begin(), used.end(), char(0)), 0) << what;
  return angles;
}

// Of each point alone, and where a segment leaves.
template <class Inside, class Crossing>
StuffingDomain domainOf(const Inside& inside, const Crossing& crossing) {
  return {[inside](std::span<const Vector3d> points, std::span<char> result, WindingNumber::Walk&) {
            std::transform(points.begin(), points.end(), result.begin(),
                           [&](const auto& p) { return inside(p) ? 1 : 0; });
          },
          [crossing](const Vector3d& a, const Vector3d& b, WindingNumber::Walk&) { return crossing(a, b); }};
}

StuffingDomain domainOf(const std::function<double(const Vector3d&)>& value) {
  return domainOf([value](const Vector3d& p) { return value(p) < 0; },
                  [value](const Vector3d& a, const Vector3d& b) {
                    double low = 0, high = 1;
                    for (int i = 0; i < 40; ++i) {
                      const double middle = (low + high) / 2;
                      (value(a + (b - a) * middle) < 0 ? low : high) = middle;
                    }
                    return (low + high) / 2;
                  });
}

StuffingDomain domainOf(const WindingNumber& solid) {
  return {[&solid](auto points, auto result, auto& walk) { solid.inside(points, result, walk); },
          [&solid](const Vector3d& a, const Vector3d& b, auto& walk) { return solid.crossing(a, b, walk); }};
}

// Labelle & Shewchuk 2007, table 1.
constexpr double kStuffingSmallest = 10.78, kStuffingLargest = 164.75;

TEST(Stuffing, AnglesOverImplicitShapes) {
  for (const auto& shape : testing::implicitMenagerie()) {
    for (const double spacing : {0.4, 0.23, 0.11}) {
      const TetMesh mesh = stuffIsosurface(domainOf(shape.value), shape.bounds, spacing);
      const std::string what = shape.name + " at " + std::to_string(spacing);
      ASSERT_FALSE(mesh.tetrahedra.empty()) << what;
      const Angles angles = checkMesh(mesh, what);
      EXPECT_GE(angles.smallest, kStuffingSmallest) << what;
      EXPECT_LE(angles.largest, kStuffingLargest) << what;
    }
  }
}

// The proof allows any sign at any lattice point and any cut on any edge: so does the test.
TEST(Stuffing, AnglesForArbitrarySignsAndCuts) {
  for (std::uint32_t seed = 1; seed <= 40; ++seed) {
    const double solid = 0.1 + 0.8 * double(seed % 9) / 8;
    const auto noise = [seed](const Vector3d& p) {
      const auto hash = [](double v) { return std::llround(v * 1e6); };
      testing::Random random(std::uint64_t(hash(p.x()) * 73856093 ^ hash(p.y()) * 19349663 ^ hash(p.z()) * 83492791) +
                             seed);
      random.unit();
      return random.unit();
    };
    // Extremes of the cut are where the angles are worst: half of the cuts lie at the warp thresholds.
    const StuffingDomain domain =
        domainOf([&](const Vector3d& p) { return p.cwiseAbs().maxCoeff() < 1 && noise(p) < solid; },
                 [&](const Vector3d& a, const Vector3d& b) {
                   const double t = noise((a + b) / 2);
                   if (t < 0.3) return 0.412;
                   if (t < 0.6) return 0.588;
                   return noise((a + b) / 2 + Vector3d::Constant(9));
                 });
    const TetMesh mesh = stuffIsosurface(domain, {Vector3d::Constant(-1), Vector3d::Constant(1)}, 0.3);
    const Angles angles = checkMesh(mesh, "seed " + std::to_string(seed));
    EXPECT_GE(angles.smallest, kStuffingSmallest) << seed;
    EXPECT_LE(angles.largest, kStuffingLargest) << seed;
  }
}

TEST(Stuffing, VolumeConvergesToTheSolid) {
  for (std::uint32_t seed = 1; seed <= 5; ++seed) {
    const testing::Surface surface = testing::blob(seed, 40);
    const WindingNumber solid(surface.positions, surface.triangles);
    const TetMesh coarse = stuffIsosurface(domainOf(solid), surface.bounds(), 0.3);
    const TetMesh fine = stuffIsosurface(domainOf(solid), surface.bounds(), 0.15);
    const double exact = surface.volume();
    EXPECT_NEAR(volume(coarse) / exact, 1, 0.05) << seed;
    EXPECT_NEAR(volume(fine) / exact, 1, 0.015) << seed;
    EXPECT_GE(checkMesh(fine, "blob").smallest, kStuffingSmallest);
  }
}

TEST(Stuffing, SameResultHoweverTheLoopIsCut) {
  const testing::Surface surface = testing::torus(1, 0.35, 40);
  const WindingNumber solid(surface.positions, surface.triangles);
  const ParallelFor backwards = [](std::size_t count, std::size_t grain,
                                   const std::function<void(std::size_t, std::size_t)>& body) {
    for (std::size_t piece = (count + grain - 1) / grain; piece-- > 0;) {
      body(piece * grain, std::min(count, (piece + 1) * grain));
    }
  };
  const TetMesh a = stuffIsosurface(domainOf(solid), surface.bounds(), 0.2);
  const TetMesh b = stuffIsosurface(domainOf(solid), surface.bounds(), 0.2, backwards);
  EXPECT_EQ(a.tetrahedra, b.tetrahedra);
  EXPECT_EQ(a.positions, b.positions);
}

TEST(Grid, BoxAngles) {
  EXPECT_NEAR(boxDihedral({1, 1, 1}), 54.7356, 1e-3);
  EXPECT_LT(boxDihedral({1, 0.2, 1}), 20);
  EXPECT_NEAR(boxDihedral({5, 5, 5}), boxDihedral({1, 1, 1}), 1e-9);
}

TEST(Grid, FitKeepsAngles) {
  for (const Vector3d& extent : {Vector3d(1, 1, 1), Vector3d(4, 1, 1), Vector3d(2, 0.01, 2), Vector3d(1, 0, 1),
                                 Vector3d(0.01, 0.01, 3), Vector3d(1, 1.49, 0.51), Vector3d(1e-5, 2e-5, 1e-5)}) {
    for (const double relative : {0.5, 0.2, 0.07}) {
      const CellGrid grid = fitGrid({-extent / 2, extent / 2}, extent.maxCoeff() * relative, 31);
      EXPECT_GE(boxDihedral(grid.spacing), 31 - 1e-9) << extent.transpose() << " at " << relative;
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_GE(grid.spacing[axis] * grid.size[std::size_t(axis)], extent[axis] * (1 - 1e-12));
      }
    }
  }
}

TEST(Grid, KeepsASlabsThicknessWhereAnglesAllow) {
  const testing::Surface slab = testing::box({1, 0.1, 1}, 4);
  const WindingNumber solid(slab.positions, slab.triangles);
  CellGrid grid = fitGrid(slab.bounds(), 0.2, 30);
  keepTouchedCells(grid, solid.bvh(), &solid);
  const TetMesh mesh = gridTetrahedra(grid);
  EXPECT_GE(checkMesh(mesh, "slab").smallest, 30);
  EXPECT_NEAR(volume(mesh), 0.1, 1e-12);
}

TEST(Grid, MenagerieHoldsAndCoversTheSurface) {
  testing::Surface hollow = testing::sphere(1, 20), inner = testing::sphere(0.6, 20);
  inner.reverse();
  hollow.append(inner);
  const std::vector<std::pair<std::string, testing::Surface>> shapes = {{"ball", testing::sphere(1, 16)},
                                                                        {"torus", testing::torus(1, 0.2, 30)},
                                                                        {"box", testing::box({1, 2, 3}, 3)},
                                                                        {"hollow", hollow},
                                                                        {"blob", testing::blob(3, 30)}};
  for (const auto& [name, surface] : shapes) {
    const WindingNumber solid(surface.positions, surface.triangles);
    for (const double spacing : {0.5, 0.23}) {
      CellGrid grid = fitGrid(surface.bounds(), spacing, 30);
      keepTouchedCells(grid, solid.bvh(), &solid);
      EXPECT_EQ(bridgeCells(grid), 0U) << name;
      const TetMesh mesh = gridTetrahedra(grid);
      EXPECT_GE(checkMesh(mesh, name).smallest, 30) << name;
      EXPECT_GE(volume(mesh), surface.volume() * (1 - 1e-9)) << name;
      const auto faces = boundaryFaces(mesh);
      const WindingNumber cage(mesh.positions, faces);
      for (const auto& p : surface.positions) {
        EXPECT_TRUE(cage.inside(p) || cage.bvh().closest(p).squared_distance < 1e-6) << name;
      }
      if (name == "hollow" && spacing < 0.3) {
        EXPECT_FALSE(cage.inside(Vector3d::Zero()));
      }
    }
  }
}

// A sheet in a plane of the grid enters no box, and another one that does keeps none for it.
TEST(Grid, KeepsASheetThatRunsBetweenBoxes) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double place : {0.0, 0.5, 1.0}) {
      const std::array<std::array<double, 2>, 4> square = {{{0.05, 0.05}, {0.95, 0.05}, {0.95, 0.95}, {0.05, 0.95}}};
      std::vector<Vector3d> positions;
      for (const auto& corner : square) {
        Vector3d& p = positions.emplace_back();
        p[axis] = place;
        p[(axis + 1) % 3] = corner[0];
        p[(axis + 2) % 3] = corner[1];
      }
      const std::vector<Triangle> triangles = {{0, 1, 2}, {0, 2, 3}};
      const WindingNumber sheet(positions, triangles);
      CellGrid grid = fitGrid({Vector3d::Zero(), Vector3d::Ones()}, 0.25, 30);
      keepTouchedCells(grid, sheet.bvh(), nullptr);
      EXPECT_EQ(std::count(grid.kept.begin(), grid.kept.end(), char(1)), 16) << axis << " at " << place;
    }
  }
}

TEST(Grid, BridgesPiecesThatFallApart) {
  CellGrid grid;
  grid.size = {7, 3, 5};
  grid.kept.assign(7 * 3 * 5, 0);
  grid.kept[grid.index(0, 0, 0)] = grid.kept[grid.index(6, 2, 4)] = grid.kept[grid.index(0, 2, 4)] = 1;
  EXPECT_GT(bridgeCells(grid), 0U);
  const TetMesh mesh = gridTetrahedra(grid);
  std::vector<std::uint32_t> component;
  EXPECT_EQ(connectedComponents(mesh, JoinedBy::vertices, component), 1U);
  checkMesh(mesh, "bridge");
}

TEST(TetMesh, DihedralOfKnownTetrahedra) {
  const auto regular = dihedralRange({0, 0, 0}, {1, 1, 0}, {0, 1, 1}, {1, 0, 1});
  EXPECT_NEAR(regular[0], 70.528779, 1e-5);
  EXPECT_NEAR(regular[1], 70.528779, 1e-5);
  const auto corner = dihedralRange({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1});
  EXPECT_NEAR(corner[0], 54.735610, 1e-5);
  EXPECT_NEAR(corner[1], 90, 1e-9);
  const auto flat = dihedralRange({0, 0, 0}, {1, 0, 0}, {1, 1, 1e-9}, {0, 1, 0});
  EXPECT_LT(flat[0], 1e-6);
  EXPECT_GT(flat[1], 180 - 1e-6);
}

TEST(TetMesh, SortingKeepsTheShape) {
  const auto shape = testing::implicitMenagerie().front();
  TetMesh mesh = stuffIsosurface(domainOf(shape.value), shape.bounds, 0.3);
  const double before = volume(mesh);
  const std::size_t count = mesh.positions.size();
  sortForLocality(mesh);
  EXPECT_EQ(mesh.positions.size(), count);
  EXPECT_NEAR(volume(mesh), before, 1e-12);
  checkMesh(mesh, "sorted");
}

}  // namespace
}  // namespace sinew::geometry

// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/obj_reader.h"
#include "tools/import/topology.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using testing::makeMesh;
using testing::readObj;
using Faces = std::vector<std::vector<std::uint32_t>>;

VisualMesh generated(const char* name) {
  return readObj(std::filesystem::path(SINEW_TEST_ASSETS) / "generated" / name);
}

double volumeOf(const Topology& topology) {
  double volume = 0;
  for (const SurfacePart& part : topology.parts) volume += part.signed_volume;
  return volume;
}

struct Expected {
  const char* file;
  std::size_t parts = 1, boundary_edges = 0, loops = 0, non_manifold_edges = 0, non_manifold_vertices = 0;
  std::size_t flipped_edges = 0, turned = 0, degenerate = 0, duplicates = 0;
  bool closed = true;
  double volume = 1;
};

class GeneratedTopology : public ::testing::TestWithParam<Expected> {};

TEST_P(GeneratedTopology, HasTheKnownAnswer) {
  const Expected& e = GetParam();
  const VisualMesh mesh = generated(e.file);
  const Topology topology = analyzeTopology(mesh);
  EXPECT_EQ(topology.parts.size(), e.parts);
  EXPECT_EQ(topology.boundary_edges.size(), e.boundary_edges);
  EXPECT_EQ(topology.boundary_loops.size(), e.loops);
  EXPECT_EQ(topology.non_manifold_edges.size(), e.non_manifold_edges);
  EXPECT_EQ(topology.non_manifold_vertices.size(), e.non_manifold_vertices);
  EXPECT_EQ(topology.flipped_edges.size(), e.flipped_edges);
  EXPECT_EQ(topology.turned_triangles.size(), e.turned);
  EXPECT_EQ(topology.degenerate_triangles.size(), e.degenerate);
  EXPECT_EQ(topology.duplicate_triangles.size(), e.duplicates);
  EXPECT_EQ(topology.closed, e.closed);
  EXPECT_NEAR(volumeOf(topology), e.volume, 1e-9 * std::abs(e.volume));
}

// Quads are two triangles. Volumes: truth.json beside the files; of an open surface that of its faces about the middle
// of its box: the unit cube lacks the pyramid over one of 96 quads, 1/96 * 1/2 * ... = 1/96; a turned quad counts
// twice.
INSTANTIATE_TEST_SUITE_P(
    All, GeneratedTopology,
    ::testing::Values(
        Expected{.file = "cube.obj"}, Expected{.file = "beam.obj", .volume = 4},
        Expected{.file = "l_bar.obj", .volume = 0.117}, Expected{.file = "slab.obj", .volume = 0.04},
        Expected{.file = "torus.obj", .volume = 1.7201164965198983},
        Expected{.file = "hollow_sphere.obj", .parts = 2, .volume = 3.191313050883037},
        Expected{.file = "chain.obj", .parts = 3, .volume = 2.2934886620265247},
        Expected{.file = "bad_bowtie.obj", .parts = 2, .non_manifold_vertices = 1, .volume = 2},
        Expected{.file = "bad_duplicate.obj", .duplicates = 16}, Expected{.file = "bad_far.obj"},
        Expected{.file = "bad_fin.obj", .boundary_edges = 2, .loops = 1, .non_manifold_edges = 1, .closed = false},
        Expected{.file = "bad_flipped.obj", .flipped_edges = 54, .turned = 28, .volume = 1 - 2 * 14 / 96.0},
        Expected{.file = "bad_hole.obj", .boundary_edges = 4, .loops = 1, .closed = false, .volume = 95 / 96.0},
        Expected{.file = "bad_inner_wall.obj", .non_manifold_edges = 16},
        Expected{.file = "bad_inside_out.obj", .volume = -4.070552360820172}, Expected{.file = "bad_sliver.obj"},
        Expected{.file = "bad_tiny.obj", .volume = 1e-15},
        Expected{.file = "bad_tjunction.obj", .boundary_edges = 3, .loops = 1, .closed = false},
        Expected{.file = "bad_unreferenced.obj"}, Expected{.file = "bad_zero_area.obj", .degenerate = 2}),
    [](const auto& tested) { return std::string(tested.param.file, std::string_view(tested.param.file).find('.')); });

TEST(AnalyzeTopology, TurningTheListedTrianglesLeavesNoFlippedEdge) {
  VisualMesh mesh = generated("bad_flipped.obj");
  for (const std::uint32_t t : analyzeTopology(mesh).turned_triangles)
    std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
  const Topology topology = analyzeTopology(mesh);
  EXPECT_TRUE(topology.flipped_edges.empty());
  EXPECT_TRUE(topology.turned_triangles.empty());
  EXPECT_NEAR(volumeOf(topology), 1, 1e-12);
}

TEST(AnalyzeTopology, AreaIsThatOfTheSurface) {
  EXPECT_NEAR(analyzeTopology(generated("beam.obj")).parts.at(0).area, 18, 1e-9);
  EXPECT_NEAR(analyzeTopology(generated("bad_duplicate.obj")).parts.at(0).area, 6, 1e-9);
}

TEST(AnalyzeTopology, KeepsTheSmallestTrianglesAtAnyScale) {
  const VisualMesh mesh = generated("bad_tiny.obj");
  EXPECT_TRUE(analyzeTopology(mesh).degenerate_triangles.empty());
}

// A strip of quads around a circle, its end joined to its start after a number of half turns.
VisualMesh twistedStrip(std::uint32_t half_turns) {
  constexpr std::uint32_t kSteps = 24;
  std::vector<Vector3d> positions;
  Faces faces;
  for (std::uint32_t i = 0; i < kSteps; ++i) {
    const double u = 2 * std::numbers::pi * i / kSteps, twist = half_turns * u / 2;
    for (const double side : {-0.3, 0.3}) {
      const double r = 1 + side * std::cos(twist);
      positions.emplace_back(r * std::cos(u), side * std::sin(twist), r * std::sin(u));
    }
    std::uint32_t next = 2 * (i + 1), next_top = next + 1;
    if (i + 1 == kSteps) {
      next = half_turns % 2;
      next_top = 1 - next;
    }
    faces.push_back({2 * i, 2 * i + 1, next_top, next});
  }
  return makeMesh(positions, faces);
}

TEST(AnalyzeTopology, TellsOneSidedSurfaces) {
  const Topology band = analyzeTopology(twistedStrip(2));
  EXPECT_TRUE(band.parts.at(0).orientable);
  EXPECT_TRUE(band.flipped_edges.empty());
  EXPECT_EQ(band.boundary_loops.size(), 2U);
  const Topology moebius = analyzeTopology(twistedStrip(1));
  EXPECT_FALSE(moebius.parts.at(0).orientable);
  EXPECT_EQ(moebius.flipped_edges.size(), 1U);
  EXPECT_TRUE(moebius.turned_triangles.empty());  // nothing to turn would help
  ASSERT_EQ(moebius.boundary_loops.size(), 1U);
  EXPECT_EQ(moebius.boundary_loops[0].size(), 48U);
}

TEST(AnalyzeTopology, RimsThatTouchInAPointStaySeparate) {
  // Two quads are missing that meet in point 12, the middle of a sheet of 4 x 4.
  std::vector<Vector3d> positions;
  Faces faces;
  for (std::uint32_t y = 0; y <= 4; ++y) {
    for (std::uint32_t x = 0; x <= 4; ++x) positions.emplace_back(x, y, 0);
  }
  for (std::uint32_t y = 0; y < 4; ++y) {
    for (std::uint32_t x = 0; x < 4; ++x) {
      if ((x == 1 && y == 2) || (x == 2 && y == 1)) continue;
      const std::uint32_t a = 5 * y + x;
      faces.push_back({a, a + 1, a + 6, a + 5});
    }
  }
  const Topology topology = analyzeTopology(makeMesh(positions, faces));
  EXPECT_EQ(topology.non_manifold_vertices, (std::vector<std::uint32_t>{12}));
  std::vector<std::size_t> lengths;
  for (const auto& loop : topology.boundary_loops) lengths.push_back(loop.size());
  std::sort(lengths.begin(), lengths.end());
  EXPECT_EQ(lengths, (std::vector<std::size_t>{4, 4, 16}));
}

TEST(AnalyzeTopology, LoopsRunAlongBoundaryEdges) {
  for (const char* file : {"bad_hole.obj", "skin_patch.obj", "bad_tjunction.obj"}) {
    const Topology topology = analyzeTopology(generated(file));
    std::vector<std::array<std::uint32_t, 2>> walked;
    for (const auto& loop : topology.boundary_loops) {
      for (std::size_t i = 0; i < loop.size(); ++i) {
        const std::uint32_t a = loop[i], b = loop[(i + 1) % loop.size()];
        walked.push_back({std::min(a, b), std::max(a, b)});
      }
    }
    std::sort(walked.begin(), walked.end());
    EXPECT_EQ(walked, topology.boundary_edges) << file;
  }
}

TEST(AnalyzeTopology, TheCapOfATJunctionKeepsTheSurfaceClosed) {
  // A tetrahedron whose edge 0-1 is split at 4 on one side only; the flat triangle 0-4-1 closes the crack.
  const std::vector<Vector3d> positions = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {1, 0, 0}};
  const Faces split = {{0, 2, 4}, {4, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  EXPECT_EQ(analyzeTopology(makeMesh(positions, split)).boundary_edges.size(), 3U);
  Faces capped = split;
  capped.push_back({0, 4, 1});
  const Topology topology = analyzeTopology(makeMesh(positions, capped));
  EXPECT_TRUE(topology.closed);
  EXPECT_EQ(topology.degenerate_triangles, (std::vector<std::uint32_t>{5}));
  EXPECT_EQ(topology.part_of_triangle[5], 0U);
  EXPECT_TRUE(topology.flipped_edges.empty());
  EXPECT_NEAR(topology.parts.at(0).signed_volume, 8.0 / 6, 1e-12);
}

TEST(AnalyzeTopology, AFlatTriangleThatHoldsNothingTakesNoPart) {
  const std::vector<Vector3d> positions = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {1, 0, 0}};
  const Topology topology =
      analyzeTopology(makeMesh(positions, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {0, 4, 1}}));
  EXPECT_TRUE(topology.closed);
  EXPECT_TRUE(topology.non_manifold_edges.empty());
  EXPECT_EQ(topology.part_of_triangle[4], formats::kNone);
}

TEST(AnalyzeTopology, ADoubledQuadCutTheOtherWayIsADuplicate) {
  // A bent quad and its back: as triangles they have nothing but their rim in common.
  const std::vector<Vector3d> positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0.2}, {0, 1, 0}};
  const Topology topology = analyzeTopology(makeMesh(positions, {{0, 1, 2, 3}, {3, 2, 1, 0}}));
  EXPECT_EQ(topology.duplicate_triangles, (std::vector<std::uint32_t>{2, 3}));
  EXPECT_FALSE(topology.closed);
  EXPECT_EQ(topology.boundary_edges.size(), 4U);
  EXPECT_EQ(topology.part_of_triangle[2], 0U);
}

TEST(AnalyzeTopology, ACopyThatClosesTheSurfaceStays) {
  // Two tetrahedra on either side of triangle 0-1-2, each with that triangle as its own: as a union they share it there
  // and back. Without the copy the rest would have three faces on each of its edges; with a fin on one edge left open,
  // the copy must stay only where it closes something.
  const std::vector<Vector3d> positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -1}};
  const Faces both = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 1, 2}, {1, 0, 4}, {2, 1, 4}, {0, 2, 4}};
  const Topology topology = analyzeTopology(makeMesh(positions, both));
  EXPECT_EQ(topology.duplicate_triangles, (std::vector<std::uint32_t>{4}));
  EXPECT_TRUE(topology.closed);
  EXPECT_NEAR(topology.parts.at(0).signed_volume, 1.0 / 3, 1e-12);
}

TEST(AnalyzeTopology, AMillionCopiesOfOneTriangleTakeNoQuadraticTime) {
  VisualMesh mesh = makeMesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  mesh.triangles.resize(1'000'000, mesh.triangles[0]);
  mesh.triangle_face.resize(mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangle_face.size(); ++t) mesh.triangle_face[t] = t;
  const Topology topology = analyzeTopology(mesh);
  EXPECT_EQ(topology.duplicate_triangles.size(), 999'999U);
  EXPECT_EQ(topology.parts.size(), 1U);
}

TEST(AnalyzeTopology, AnEmptyMeshIsNotClosed) {
  const Topology topology = analyzeTopology(VisualMesh{});
  EXPECT_FALSE(topology.closed);
  EXPECT_TRUE(topology.parts.empty());
}

}  // namespace
}  // namespace sinew::tools

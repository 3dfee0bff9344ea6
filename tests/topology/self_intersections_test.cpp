// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <random>

#include "tests/support/obj_reader.h"
#include "tests/topology/exact_pairs.h"
#include "tools/import/topology.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using testing::makeMesh;
using testing::readObj;
using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;
using Faces = std::vector<std::vector<std::uint32_t>>;

Pairs pairsOf(const VisualMesh& mesh, std::size_t limit = 1'000'000, bool different_parts_only = false) {
  return findSelfIntersections(mesh, analyzeTopology(mesh), limit, different_parts_only);
}

struct Case {
  const char* name;
  std::vector<Vector3d> positions;
  Faces faces;
  bool pierce;
};

class TwoTriangles : public ::testing::TestWithParam<Case> {};

TEST_P(TwoTriangles, AreJudged) {
  const Case& c = GetParam();
  // Any order of faces and corners, either way round, near the origin and far from it.
  for (const Vector3d& offset : {Vector3d(0, 0, 0), Vector3d(1 << 20, -(1 << 21), 3)}) {
    std::vector<Vector3d> positions = c.positions;
    for (Vector3d& p : positions) p += offset;
    for (int variant = 0; variant < 72; ++variant) {
      Faces faces = c.faces;
      std::rotate(faces[0].begin(), faces[0].begin() + variant % 3, faces[0].end());
      std::rotate(faces[1].begin(), faces[1].begin() + variant / 3 % 3, faces[1].end());
      if (variant / 9 % 2 == 1) std::reverse(faces[0].begin(), faces[0].end());
      if (variant / 18 % 2 == 1) std::reverse(faces[1].begin(), faces[1].end());
      if (variant / 36 % 2 == 1) std::swap(faces[0], faces[1]);
      EXPECT_EQ(pairsOf(makeMesh(positions, faces)).size(), c.pierce ? 1U : 0U) << variant;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, TwoTriangles,
    ::testing::Values(
        Case{
            "Apart", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}}, {{0, 1, 2}, {3, 4, 5}}, false},
        Case{"PierceThrough",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, -1}, {1, 1, 1}, {9, 9, 0}},
             {{0, 1, 2}, {3, 4, 5}},
             true},
        Case{"ChainedEdges",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, -1}, {1.5, 1, 1}, {1, 1.5, 1}},
             {{0, 1, 2}, {3, 4, 5}},
             true},
        Case{"CornerTouchesInterior",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, 0}, {1, 1, 1}, {2, 1, 1}},
             {{0, 1, 2}, {3, 4, 5}},
             false},
        Case{"CornerTouchesEdge",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {2, 0, 0}, {2, -1, 1}, {2, -1, -1}},
             {{0, 1, 2}, {3, 4, 5}},
             false},
        Case{"EdgesCrossInAPoint",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {2, 0, -1}, {2, 0, 1}, {2, -3, 0}},
             {{0, 1, 2}, {3, 4, 5}},
             false},
        Case{"EdgeLiesInInterior",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, 0}, {2, 1, 0}, {1, 1, 3}},
             {{0, 1, 2}, {3, 4, 5}},
             true},
        Case{"EdgeLiesOnEdge",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 0, 0}, {3, 0, 0}, {2, -1, 1}},
             {{0, 1, 2}, {3, 4, 5}},
             false},
        Case{"CoplanarApart",
             {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 2, 0}, {3, 2, 0}, {2, 3, 0}},
             {{0, 1, 2}, {3, 4, 5}},
             false},
        Case{"CoplanarOverlap",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, 0}, {5, 1, 0}, {1, 5, 0}},
             {{0, 1, 2}, {3, 4, 5}},
             true},
        Case{"CoplanarInside",
             {{0, 0, 0}, {9, 0, 0}, {0, 9, 0}, {1, 1, 0}, {2, 1, 0}, {1, 2, 0}},
             {{0, 1, 2}, {3, 4, 5}},
             true},
        Case{"CoplanarEdgeToEdge",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 0, 0}, {3, 0, 0}, {2, -2, 0}},
             {{0, 1, 2}, {3, 4, 5}},
             false},
        Case{"CoplanarOnASteepPlane",
             {{0, 0, 0}, {4, 0, 4}, {0, 4, 4}, {1, 1, 2}, {5, 1, 6}, {1, 5, 6}},
             {{0, 1, 2}, {3, 4, 5}},
             true},
        Case{"SharedCornerApart",
             {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 1}, {0, -1, 1}},
             {{0, 1, 2}, {0, 3, 4}},
             false},
        Case{"SharedCornerPierce",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, -1}, {1, 1, 1}},
             {{0, 1, 2}, {0, 3, 4}},
             true},
        Case{"SharedCornerCoplanarOverlap",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {4, 1, 0}, {1, 4, 0}},
             {{0, 1, 2}, {0, 3, 4}},
             true},
        Case{"SharedCornerCoplanarApart",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {-4, 0, 0}, {0, -4, 0}},
             {{0, 1, 2}, {0, 3, 4}},
             false},
        Case{"SharedCornerEdgeOnEdge",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {2, 0, 0}, {1, -1, 1}},
             {{0, 1, 2}, {0, 3, 4}},
             false},
        Case{"SharedEdgeBent", {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, -4, 1}}, {{0, 1, 2}, {1, 0, 3}}, false},
        Case{"SharedEdgeFlat", {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, -4, 0}}, {{0, 1, 2}, {1, 0, 3}}, false},
        Case{"SharedEdgeFoldedOver", {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 2, 0}}, {{0, 1, 2}, {1, 0, 3}}, true},
        Case{"SharedEdgeNearlyFoldedOver",
             {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 2, 1e-9}},
             {{0, 1, 2}, {1, 0, 3}},
             false}),
    [](const auto& tested) { return std::string(tested.param.name); });

TEST(SelfIntersections, AgreeWithExactConstructionOnDegenerateConfigurations) {
  // Corners on a 4 x 4 x 4 grid: half of the pairs share corners, are coplanar or touch.
  std::mt19937 random(7);
  const auto coordinate = [&] { return double(random() % 4); };
  std::size_t pierce = 0, tried = 0;
  for (int i = 0; i < 30000; ++i) {
    std::array<std::array<Vector3d, 3>, 2> t;
    for (auto& triangle : t) {
      for (Vector3d& p : triangle) p = {coordinate(), coordinate(), i % 3 == 0 ? 0 : coordinate()};
    }
    if (testing::collinearExactly(t[0]) || testing::collinearExactly(t[1])) continue;
    const VisualMesh mesh = makeMesh({t[0][0], t[0][1], t[0][2], t[1][0], t[1][1], t[1][2]}, {{0, 1, 2}, {3, 4, 5}});
    if (!analyzeTopology(mesh).duplicate_triangles.empty()) continue;
    ++tried;
    const bool truth = testing::pierceExactly(t[0], t[1]);
    pierce += truth;
    ASSERT_EQ(pairsOf(mesh).size(), truth ? 1U : 0U) << i;
  }
  EXPECT_GT(tried, 20000U);
  EXPECT_GT(pierce, tried / 5);
  EXPECT_LT(pierce, tried * 4 / 5);
}

// Every pair of triangles of a mesh, by exact construction.
Pairs exactPairs(const VisualMesh& mesh) {
  const Topology topology = analyzeTopology(mesh);
  std::vector<std::uint8_t> skipped(mesh.triangles.size(), 0);
  for (const std::uint32_t t : topology.degenerate_triangles) skipped[t] = 1;
  for (const std::uint32_t t : topology.duplicate_triangles) skipped[t] = 1;
  const auto corners = [&](std::uint32_t t) {
    const Triangle p = mesh.weldedTriangle(t);
    return std::array{mesh.welded_positions[p[0]], mesh.welded_positions[p[1]], mesh.welded_positions[p[2]]};
  };
  const auto box = [&](std::uint32_t t) {
    Eigen::AlignedBox3d b;
    for (const Vector3d& p : corners(t)) b.extend(p);
    return b;
  };
  Pairs pairs;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    for (std::uint32_t j = i + 1; j < mesh.triangles.size(); ++j) {
      if (skipped[i] || skipped[j] || !box(i).intersects(box(j))) continue;
      if (testing::pierceExactly(corners(i), corners(j))) pairs.emplace_back(i, j);
    }
  }
  return pairs;
}

TEST(SelfIntersections, AgreeWithAllPairsOfAMesh) {
  for (const char* file : {"two_spheres.obj", "bad_fin.obj", "bad_inner_wall.obj", "bad_tjunction.obj",
                           "bad_sliver.obj", "bad_near_duplicate.obj", "l_bar.obj"}) {
    const VisualMesh mesh = readObj(std::filesystem::path(SINEW_TEST_ASSETS) / "generated" / file);
    EXPECT_EQ(pairsOf(mesh), exactPairs(mesh)) << file;
  }
}

TEST(SelfIntersections, LimitGivesTheFirstPairs) {
  const VisualMesh mesh = readObj(std::filesystem::path(SINEW_TEST_ASSETS) / "generated" / "two_spheres.obj");
  const Pairs all = pairsOf(mesh);
  ASSERT_EQ(all.size(), 84U);
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end()));
  for (const std::size_t limit : {0U, 1U, 17U, 84U, 85U}) {
    const Pairs some = pairsOf(mesh, limit);
    EXPECT_EQ(some, Pairs(all.begin(), all.begin() + std::ptrdiff_t(std::min(limit, all.size()))));
  }
}

TEST(SelfIntersections, AreTheSameForAnyNumberOfThreads) {
  const VisualMesh mesh = readObj(std::filesystem::path(SINEW_TEST_ASSETS) / "generated" / "two_spheres.obj");
  const Pairs parallel = pairsOf(mesh);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(pairsOf(mesh), parallel);
}

TEST(SelfIntersections, BetweenPartsOnly) {
  // Two crossing sheets, the first of which is folded over onto itself.
  const VisualMesh mesh = makeMesh({{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 2, 0}, {2, 1, -1}, {2, 1, 1}, {9, 9, 0}},
                                   {{0, 1, 2}, {1, 0, 3}, {4, 5, 6}});
  const Pairs all = pairsOf(mesh);
  EXPECT_EQ(all, exactPairs(mesh));
  EXPECT_EQ(all.front(), (std::pair<std::uint32_t, std::uint32_t>(0, 1)));
  Pairs expected(all.begin() + 1, all.end());
  EXPECT_FALSE(expected.empty());
  EXPECT_EQ(pairsOf(mesh, 100, true), expected);
}

}  // namespace
}  // namespace sinew::tools

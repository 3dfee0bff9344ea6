// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/clusters.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "tests/bake/box_mesh.h"
#include "tools/author/regions.h"

namespace sinew::tools {
namespace {

// Every vertex is covered, members ascend, weights are positive, a cluster stays in its body.
void expectSound(const PhysicalMesh& mesh, const std::vector<ClusterSource>& clusters) {
  std::vector<int> covered(mesh.positions.size(), 0);
  for (const ClusterSource& cluster : clusters) {
    ASSERT_EQ(cluster.vertices.size(), cluster.weights.size());
    ASSERT_FALSE(cluster.vertices.empty());
    EXPECT_TRUE(std::is_sorted(cluster.vertices.begin(), cluster.vertices.end()));
    EXPECT_EQ(std::adjacent_find(cluster.vertices.begin(), cluster.vertices.end()), cluster.vertices.end());
    const PhysicalPiece& body = mesh.pieces[cluster.piece];
    for (std::size_t i = 0; i < cluster.vertices.size(); ++i) {
      EXPECT_GE(cluster.vertices[i], body.first_vertex);
      EXPECT_LT(cluster.vertices[i], body.first_vertex + body.vertex_count);
      EXPECT_GT(cluster.weights[i], 0);
      ++covered[cluster.vertices[i]];
    }
  }
  EXPECT_EQ(std::count(covered.begin(), covered.end(), 0), 0);
}

TEST(Clusters, AGivenGridMakesThatManyOverlappingBoxes) {
  const PhysicalMesh mesh = latticeMesh({16, 4, 4}, 0.25);
  ClusterOptions options;
  options.grid = {4, 1, 1};
  std::vector<Finding> findings;
  const auto clusters = gridClusters(mesh, options, findings);
  ASSERT_EQ(clusters.size(), 4U);
  expectSound(mesh, clusters);
  // Neighbours share members, the ends do not.
  const std::set<std::uint32_t> first(clusters[0].vertices.begin(), clusters[0].vertices.end());
  const auto shares = [&](const ClusterSource& other) {
    return std::any_of(other.vertices.begin(), other.vertices.end(),
                       [&](std::uint32_t v) { return first.contains(v); });
  };
  EXPECT_TRUE(shares(clusters[1]));
  EXPECT_FALSE(shares(clusters[3]));
}

TEST(Clusters, HalfOverlapIsAPartitionOfUnity) {
  const PhysicalMesh mesh = latticeMesh({12, 3, 3}, 0.1);
  ClusterOptions options;
  options.grid = {3, 1, 1};
  std::vector<Finding> findings;
  std::vector<double> sum(mesh.positions.size(), 0);
  for (const auto& cluster : gridClusters(mesh, options, findings)) {
    for (std::size_t i = 0; i < cluster.vertices.size(); ++i) sum[cluster.vertices[i]] += cluster.weights[i];
  }
  for (double s : sum) EXPECT_NEAR(s, 1, 0.03);  // members below the least weight are left out
}

TEST(Clusters, ABoxReachesSoManyMetresIntoItsNeighbours) {
  const PhysicalMesh mesh = latticeMesh({12, 3, 3}, 0.1);
  ClusterOptions options;
  options.grid = {3, 1, 1};  // boxes of 0.4 m
  std::vector<Finding> findings;
  const auto half = gridClusters(mesh, options, findings);
  options.overlap = 0.2;
  const auto metres = gridClusters(mesh, options, findings);
  ASSERT_EQ(metres.size(), half.size());
  for (std::size_t c = 0; c < half.size(); ++c) {
    EXPECT_EQ(metres[c].vertices, half[c].vertices);
    for (std::size_t i = 0; i < half[c].weights.size(); ++i) {
      EXPECT_NEAR(metres[c].weights[i], half[c].weights[i], 1e-9);
    }
  }
  options.overlap = 0.1;
  EXPECT_LT(gridClusters(mesh, options, findings)[0].vertices.size(), half[0].vertices.size());
}

TEST(Clusters, NoOverlapIsADisjointPartition) {
  const PhysicalMesh mesh = latticeMesh({13, 4, 4}, 0.25);
  ClusterOptions options;
  options.grid = {3, 1, 1};
  options.overlap = 0;
  std::vector<Finding> findings;
  std::size_t members = 0;
  for (const auto& cluster : gridClusters(mesh, options, findings)) members += cluster.vertices.size();
  EXPECT_EQ(members, mesh.positions.size());
}

TEST(Clusters, TwoLegsInOneBoxAreTwoClusters) {
  // A table: a top and two legs that only meet above. The lower boxes hold both legs.
  const PhysicalMesh mesh = latticeMesh({9, 12, 3}, 0.1, [](int x, int y, int) { return y >= 9 || x < 3 || x >= 6; });
  ClusterOptions options;
  options.grid = {1, 4, 1};
  std::vector<Finding> findings;
  const auto clusters = gridClusters(mesh, options, findings);
  expectSound(mesh, clusters);
  bool split = false;
  for (const auto& cluster : clusters) {
    bool left = false;
    bool right = false;
    bool top = false;
    for (std::uint32_t v : cluster.vertices) {
      left = left || mesh.positions[v][0] < 0.35;
      right = right || mesh.positions[v][0] > 0.55;
      top = top || mesh.positions[v][1] > 0.85;
    }
    if (!top) {
      EXPECT_FALSE(left && right) << cluster.name << " joins two legs through the air";
      split = true;
    }
  }
  EXPECT_TRUE(split);
}

TEST(Clusters, AutomaticResolutionFollowsSizeAndShape) {
  std::vector<Finding> findings;
  const PhysicalMesh small = latticeMesh({2, 2, 2}, 1);
  EXPECT_EQ(gridClusters(small, {}, findings).size(), 1U);
  const PhysicalMesh bar = latticeMesh({60, 4, 4}, 0.1);  // 1525 vertices, long in x
  const auto clusters = gridClusters(bar, {}, findings);
  EXPECT_GE(clusters.size(), 8U);
  EXPECT_LE(clusters.size(), 20U);
  for (const auto& cluster : clusters) EXPECT_TRUE(cluster.name.ends_with("y0z0")) << cluster.name;
  expectSound(bar, clusters);
}

TEST(Clusters, TinyPiecesJoinANeighbour) {
  const PhysicalMesh mesh = latticeMesh({8, 2, 2}, 0.1);
  ClusterOptions options;
  options.grid = {32, 8, 8};
  options.overlap = 0;
  std::vector<Finding> findings;
  const auto clusters = gridClusters(mesh, options, findings);
  expectSound(mesh, clusters);
  for (const auto& cluster : clusters) EXPECT_GE(cluster.vertices.size(), 8U) << cluster.name;
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].id, "clusters-merged");
}

// Mean over the members of the largest distance within their region.
double meanWidth(const PhysicalMesh& mesh, const std::vector<std::uint32_t>& members,
                 const std::vector<std::uint32_t>& region) {
  std::map<std::uint32_t, double> widest;
  for (std::size_t i = 0; i < members.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (region[k] != region[i]) continue;
      double& width = widest[region[i]];
      width = std::max(width, (mesh.positions[members[i]] - mesh.positions[members[k]]).norm());
    }
  }
  double sum = 0;
  for (const std::uint32_t r : region) sum += widest[r];
  return sum / double(members.size());
}

TEST(Regions, AreAsWideAsAskedAndCrumbsAreNone) {
  const PhysicalMesh mesh = latticeMesh({16, 16, 1}, 0.1);  // 1.6 x 1.6 m
  const TetGraph graph = makeTetGraph(mesh);
  std::vector<std::uint32_t> members;
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    // All but a strip, in which single vertices are left.
    const double x = mesh.positions[v].x();
    const bool crumb = std::abs(x - 1.3) < 0.01 && std::abs(std::remainder(mesh.positions[v].y(), 0.4)) < 0.01 &&
                       mesh.positions[v].z() < 0.01;
    if (x < 1.15 || crumb) members.push_back(v);
  }
  const std::vector<std::uint32_t> region = regionsOfSize(mesh, graph, members, 0.6);
  ASSERT_EQ(region.size(), members.size());
  std::map<std::uint32_t, std::size_t> sizes;
  for (const std::uint32_t r : region) ++sizes[r];
  for (const auto& [r, size] : sizes) EXPECT_GE(size, 8U) << r;
  EXPECT_LE(meanWidth(mesh, members, region), 0.66);
  EXPECT_GE(meanWidth(mesh, members, region), 0.45);
  // Hexagons 0.6 m wide from corner to corner cover 1.1 x 1.6 m seven and a half times.
  EXPECT_LE(sizes.size(), 12U);
}

}  // namespace
}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/regions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace sinew::tools {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::size_t kMostRegions = 256;
constexpr int kLloydRounds = 6;
// A region as wide as asked reaches this part of its width from its centre.
constexpr double kReach = 0.6;
// What an automatic region holds (as the automatic grid's boxes), and the most of them in a body.
constexpr std::uint32_t kVerticesPerRegion = 100;
constexpr std::size_t kMostAutomatic = 48;
constexpr double kAutomaticOverlap = 1.5;  // edges
constexpr double kMinimumWeight = 0.02;

// Regions around centres until every member is within `reach` of one, or there are `most`.
std::vector<std::uint32_t> lloyd(const PhysicalMesh& mesh, const TetGraph& graph,
                                 std::span<const std::uint32_t> members, double reach, std::size_t most) {
  std::vector<std::uint8_t> inside(mesh.positions.size(), 0);
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const std::uint32_t v : members) {
    inside[v] = 1;
    center += mesh.positions[v] / double(members.size());
  }
  const auto nearestTo = [&](const Eigen::Vector3d& x, const auto& eligible) {
    std::uint32_t best = kNoIndex;
    for (const std::uint32_t v : members) {
      if (!eligible(v)) continue;
      if (best == kNoIndex || (mesh.positions[v] - x).squaredNorm() < (mesh.positions[best] - x).squaredNorm())
        best = v;
    }
    return best;
  };
  std::vector<std::uint32_t> centers = {nearestTo(center, [](std::uint32_t) { return true; })};
  TetDistances nearest = tetDistances(graph, centers, kInfinity, inside);
  while (true) {
    std::uint32_t farthest = members[0];
    for (const std::uint32_t v : members) {
      if (nearest.distance[v] > nearest.distance[farthest]) farthest = v;
    }
    // A piece that no centre reaches needs one of its own, whatever the count.
    const bool apart = !std::isfinite(nearest.distance[farthest]);
    if (!apart && (centers.size() >= most || nearest.distance[farthest] <= reach)) break;
    if (centers.size() >= kMostRegions) break;
    centers.push_back(farthest);
    nearest = tetDistances(graph, centers, kInfinity, inside);
  }
  for (int round = 0; round < kLloydRounds; ++round) {
    std::vector<std::uint32_t> moved;
    for (const std::uint32_t c : centers) {
      Eigen::Vector3d mean = Eigen::Vector3d::Zero();
      double count = 0;
      for (const std::uint32_t v : members) {
        if (nearest.nearest[v] != c) continue;
        mean += mesh.positions[v];
        ++count;
      }
      moved.push_back(nearestTo(mean / std::max(count, 1.0), [&](std::uint32_t v) { return nearest.nearest[v] == c; }));
    }
    if (moved == centers) break;
    centers = moved;
    nearest = tetDistances(graph, centers, kInfinity, inside);
  }
  std::vector<std::uint32_t> region(members.size(), 0);
  for (std::size_t i = 0; i < members.size(); ++i) {
    const auto at = std::find(centers.begin(), centers.end(), nearest.nearest[members[i]]);
    region[i] = at == centers.end() ? 0 : std::uint32_t(at - centers.begin());
  }
  return region;
}

std::vector<ClusterSource> kmeansClusters(const PhysicalMesh& mesh, const TetGraph& graph, std::uint32_t b,
                                          const ClusterOptions& options) {
  const PhysicalBody& body = mesh.bodies[b];
  std::vector<std::uint32_t> members(body.vertex_count);
  std::iota(members.begin(), members.end(), body.first_vertex);
  const std::size_t wanted =
      std::clamp<std::size_t>((members.size() + kVerticesPerRegion / 2) / kVerticesPerRegion, 1, kMostAutomatic);
  const std::vector<std::uint32_t> region =
      options.size > 0 ? regionsOfSize(mesh, graph, members, options.size) : lloyd(mesh, graph, members, 0, wanted);
  const double overlap = options.overlap_metres > 0 ? options.overlap_metres : kAutomaticOverlap * graph.mean_edge[b];
  const std::uint32_t count = *std::max_element(region.begin(), region.end()) + 1;
  std::vector<ClusterSource> clusters;
  for (std::uint32_t r = 0; r < count; ++r) {
    std::vector<std::uint32_t> core;
    for (std::size_t i = 0; i < members.size(); ++i) {
      if (region[i] == r) core.push_back(members[i]);
    }
    if (core.empty()) continue;
    const TetDistances reach = tetDistances(graph, core, overlap);
    ClusterSource cluster;
    cluster.name = (mesh.bodies.size() == 1 ? "" : body.name + "/") + "k" + std::to_string(r);
    cluster.body = b;
    cluster.mode = options.mode;
    for (const std::uint32_t v : members) {
      const double t = std::clamp(1 - reach.distance[v] / overlap, 0.0, 1.0);
      const double weight = t * t * (3 - 2 * t);
      if (weight < kMinimumWeight) continue;
      cluster.vertices.push_back(v);
      cluster.weights.push_back(weight);
    }
    clusters.push_back(std::move(cluster));
  }
  return clusters;
}

}  // namespace

std::vector<std::uint32_t> regionsOfSize(const PhysicalMesh& mesh, const TetGraph& graph,
                                         std::span<const std::uint32_t> members, double size) {
  if (members.empty()) return {};
  return lloyd(mesh, graph, members, kReach * size, kMostRegions);
}

std::vector<ClusterSource> automaticClusters(const PhysicalMesh& mesh, const ClusterOptions& options,
                                             std::span<const std::uint8_t> authored, std::vector<Finding>& findings) {
  if (!authored.empty() && std::find(authored.begin(), authored.end(), 0) == authored.end()) return {};
  if (options.method == ClusterMethod::grid) {
    std::vector<ClusterSource> clusters = gridClusters(mesh, options, findings);
    if (!authored.empty()) std::erase_if(clusters, [&](const ClusterSource& c) { return authored[c.body] != 0; });
    return clusters;
  }
  const TetGraph graph = makeTetGraph(mesh);
  std::vector<ClusterSource> clusters;
  for (std::uint32_t b = 0; b < mesh.bodies.size(); ++b) {
    if (!authored.empty() && authored[b] != 0) continue;
    for (ClusterSource& cluster : kmeansClusters(mesh, graph, b, options)) clusters.push_back(std::move(cluster));
  }
  return clusters;
}

}  // namespace sinew::tools

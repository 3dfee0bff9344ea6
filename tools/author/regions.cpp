// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/regions.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "runtime/geometry/smoothstep.h"
#include "tools/author/surface.h"

namespace sinew::tools {
namespace {

constexpr std::size_t kMostRegions = 256;
constexpr int kLloydRounds = 6;
// Fewer vertices cannot turn, let alone bend.
constexpr std::size_t kFewMembers = 8;
// Vertices of an automatic region (as of the automatic grid's boxes), and most regions of a piece.
constexpr std::uint32_t kVerticesPerRegion = 100;
constexpr std::size_t kMostAutomatic = 48;

// Regions of members around centres: farthest points, then Lloyd's rounds; distances along the edges among members.
class Regions {
 public:
  Regions(const PhysicalMesh& mesh, const TetGraph& graph, std::span<const std::uint32_t> members)
      : mesh_(mesh), graph_(graph), members_(members), inside_(mesh.positions.size(), 0) {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (const std::uint32_t v : members) {
      inside_[v] = 1;
      center += mesh.positions[v] / double(members.size());
    }
    centers_ = {nearestTo(center, [](std::uint32_t) { return true; })};
    nearest_ = distances(centers_);
    // A vertex that no centre reaches becomes a centre, whatever the count.
    while (!std::isfinite(nearest_.distance[farthest()]) && centers_.size() < kMostRegions) add();
    least_ = centers_.size();
  }

  /// The fewest there can be: one for each piece that touches no other.
  std::size_t least() const { return least_; }

  /// Region of each member, of `count` regions, or of as many as there can be.
  std::vector<std::uint32_t> make(std::size_t count) {
    while (centers_.size() < std::min(count, kMostRegions) && nearest_.distance[farthest()] > 0) add();
    std::vector<std::uint32_t> centers(centers_.begin(),
                                       centers_.begin() + std::ptrdiff_t(std::clamp(count, least_, centers_.size())));
    TetDistances nearest = distances(centers);
    for (int round = 0; round < kLloydRounds; ++round) {
      std::vector<std::uint32_t> moved;
      for (const std::uint32_t c : centers) {
        Eigen::Vector3d mean = Eigen::Vector3d::Zero();
        double in_region = 0;
        for (const std::uint32_t v : members_) {
          if (nearest.nearest[v] != c) continue;
          mean += mesh_.positions[v];
          ++in_region;
        }
        moved.push_back(
            nearestTo(mean / std::max(in_region, 1.0), [&](std::uint32_t v) { return nearest.nearest[v] == c; }));
      }
      if (moved == centers) break;
      centers = moved;
      nearest = distances(centers);
    }
    std::vector<std::uint32_t> region(members_.size(), 0);
    for (std::size_t i = 0; i < members_.size(); ++i) {
      const auto at = std::find(centers.begin(), centers.end(), nearest.nearest[members_[i]]);
      region[i] = at == centers.end() ? 0 : std::uint32_t(at - centers.begin());
    }
    return region;
  }

  /// Mean over the members of how wide their region is: from one of its vertices to that farthest from it, where the
  /// first is the farthest from any.
  double width(const std::vector<std::uint32_t>& region) const {
    const std::uint32_t count = *std::max_element(region.begin(), region.end()) + 1;
    std::vector<std::vector<std::uint32_t>> of(count);
    for (std::size_t i = 0; i < region.size(); ++i) of[region[i]].push_back(members_[i]);
    double sum = 0;
    for (const std::vector<std::uint32_t>& vertices : of) {
      if (vertices.empty()) continue;
      Eigen::Vector3d from = mesh_.positions[vertices[0]];
      double widest = 0;
      for (int sweep = 0; sweep < 2; ++sweep) {
        Eigen::Vector3d far = from;
        for (const std::uint32_t v : vertices) {
          if ((mesh_.positions[v] - from).squaredNorm() > (far - from).squaredNorm()) far = mesh_.positions[v];
        }
        widest = (far - from).norm();
        from = far;
      }
      sum += widest * double(vertices.size());
    }
    return sum / double(members_.size());
  }

 private:
  template <class Eligible>
  std::uint32_t nearestTo(const Eigen::Vector3d& x, const Eligible& eligible) const {
    std::uint32_t best = formats::kNone;
    for (const std::uint32_t v : members_) {
      if (!eligible(v)) continue;
      if (best == formats::kNone || (mesh_.positions[v] - x).squaredNorm() < (mesh_.positions[best] - x).squaredNorm())
        best = v;
    }
    return best;
  }
  TetDistances distances(const std::vector<std::uint32_t>& from) const {
    return tetDistances(graph_, from, kInfinity, inside_);
  }
  std::uint32_t farthest() const {
    std::uint32_t farthest = members_[0];
    for (const std::uint32_t v : members_) {
      if (nearest_.distance[v] > nearest_.distance[farthest]) farthest = v;
    }
    return farthest;
  }
  void add() {
    centers_.push_back(farthest());
    nearest_ = distances(centers_);
  }

  const PhysicalMesh& mesh_;
  const TetGraph& graph_;
  std::span<const std::uint32_t> members_;
  std::vector<std::uint8_t> inside_;
  std::vector<std::uint32_t> centers_;  // farthest points, in order
  TetDistances nearest_;                // to them
  std::size_t least_ = 1;
};

// Members in pieces apart of fewer vertices than can bend; none where all are.
std::vector<std::uint8_t> crumbsOf(const TetGraph& graph, std::span<const std::uint32_t> members) {
  std::vector<std::uint8_t> left(graph.first.size() - 1, 0);
  for (const std::uint32_t v : members) left[v] = 1;
  std::vector<std::uint8_t> crumb(left.size(), 0);
  bool any_whole = false;
  std::vector<std::uint32_t> piece;
  for (const std::uint32_t start : members) {
    if (left[start] == 0) continue;
    piece.assign(1, start);
    left[start] = 0;
    for (std::size_t at = 0; at < piece.size(); ++at) {
      for (std::uint32_t e = graph.first[piece[at]]; e < graph.first[piece[at] + 1]; ++e) {
        const std::uint32_t n = graph.neighbour[e];
        if (left[n] == 0) continue;
        left[n] = 0;
        piece.push_back(n);
      }
    }
    if (piece.size() >= kFewMembers) {
      any_whole = true;
    } else {
      for (const std::uint32_t v : piece) crumb[v] = 1;
    }
  }
  if (!any_whole) std::fill(crumb.begin(), crumb.end(), 0);
  return crumb;
}

std::vector<ClusterSource> kmeansClusters(const PhysicalMesh& mesh, const TetGraph& graph, std::uint32_t b,
                                          const ClusterOptions& options) {
  const PhysicalPiece& body = mesh.pieces[b];
  std::vector<std::uint32_t> members(body.vertex_count);
  std::iota(members.begin(), members.end(), body.first_vertex);
  const std::size_t wanted =
      std::clamp<std::size_t>((members.size() + kVerticesPerRegion / 2) / kVerticesPerRegion, 1, kMostAutomatic);
  const std::vector<std::uint32_t> region =
      options.size > 0 ? regionsOfSize(mesh, graph, members, options.size) : Regions(mesh, graph, members).make(wanted);
  const double overlap = overlapOf(options, graph.mean_edge[b]);
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
    cluster.name = (mesh.pieces.size() == 1 ? "" : body.name + "/") + "k" + std::to_string(r);
    cluster.piece = b;
    cluster.mode = options.mode;
    for (const std::uint32_t v : members) {
      const double weight = reach.distance[v] > 0 ? geometry::smoothstep(1 - reach.distance[v] / overlap) : 1;
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
  const std::vector<std::uint8_t> crumb = crumbsOf(graph, members);
  std::vector<std::uint32_t> whole;
  for (const std::uint32_t v : members) {
    if (crumb[v] == 0) whole.push_back(v);
  }
  // The fewest whose mean width is no larger than asked: doubled until they are, then halved between.
  Regions regions(mesh, graph, whole);
  std::size_t enough = std::max<std::size_t>(regions.least(), 1);
  std::vector<std::uint32_t> best = regions.make(enough);
  std::size_t few = enough - 1;
  while (regions.width(best) > size && enough < kMostRegions) {
    few = enough;
    enough = std::min(2 * enough, kMostRegions);
    best = regions.make(enough);
  }
  while (enough - few > 1) {
    const std::size_t middle = (few + enough) / 2;
    std::vector<std::uint32_t> trial = regions.make(middle);
    if (regions.width(trial) > size) {
      few = middle;
    } else {
      enough = middle;
      best = std::move(trial);
    }
  }
  std::vector<std::uint32_t> of_vertex(mesh.positions.size(), 0);
  for (std::size_t i = 0; i < whole.size(); ++i) of_vertex[whole[i]] = best[i];
  if (whole.size() < members.size()) {
    const TetDistances nearest = tetDistances(graph, whole, kInfinity);
    for (const std::uint32_t v : members) {
      if (crumb[v] != 0 && nearest.nearest[v] != formats::kNone) of_vertex[v] = of_vertex[nearest.nearest[v]];
    }
  }
  std::vector<std::uint32_t> region;
  for (const std::uint32_t v : members) region.push_back(of_vertex[v]);
  return region;
}

std::vector<ClusterSource> automaticClusters(const PhysicalMesh& mesh, const ClusterOptions& options,
                                             std::span<const std::uint8_t> authored, std::vector<Finding>& findings) {
  if (!authored.empty() && std::find(authored.begin(), authored.end(), 0) == authored.end()) return {};
  if (options.method == ClusterMethod::grid) {
    std::vector<ClusterSource> clusters = gridClusters(mesh, options, findings);
    if (!authored.empty()) std::erase_if(clusters, [&](const ClusterSource& c) { return authored[c.piece] != 0; });
    return clusters;
  }
  const TetGraph graph = makeTetGraph(mesh);
  std::vector<ClusterSource> clusters;
  for (std::uint32_t b = 0; b < mesh.pieces.size(); ++b) {
    if (!authored.empty() && authored[b] != 0) continue;
    for (ClusterSource& cluster : kmeansClusters(mesh, graph, b, options)) clusters.push_back(std::move(cluster));
  }
  return clusters;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/weights.h"

#include <Eigen/Geometry>
#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "runtime/geometry/smoothstep.h"
#include "tools/author/regions.h"
#include "tools/author/surface.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// Of a vertex' weights: below the first a membership is dropped, up to the second it fades. Clusters that pull apart
// stand far apart at the ends of their ramps: a dropped share of 2 % is seen as a step in the surface.
constexpr double kMinimumShare = 0.004;
constexpr double kFullShare = 0.02;
// A tetrahedron's corner to which a visual vertex belongs less than this says nothing of the corner.
constexpr double kMinimumInfluence = 0.05;
// Fewer vertices cannot turn, let alone bend.
constexpr std::size_t kFewMembers = 8;
// Of the largest weight: clusters that agree so well are one.
constexpr double kIdentical = 1e-3;
// Of the largest piece's weight: a piece apart that has less is not meant.
constexpr double kStray = 0.2;
// Standard deviations between 10 % and 90 % of a step that has been diffused.
constexpr double kDeviationsInRamp = 2.56;
constexpr int kSoftenSteps = 2;
// Of the cube of its edges: a flat tetrahedron still conducts.
constexpr double kLeastVolume = 1e-6;
// A triangle wider than this, of the tetrahedra's edges, is looked at in pieces so small; at most so many a side.
constexpr double kSampleStep = 0.5;
constexpr double kMostPieces = 32;
// A triangle narrower than such a piece has so many points at most, or for each square of a piece's side in area.
constexpr double kSliverSamples = 16;
// Of all triangles: more than this, and slivers have fewer.
constexpr double kMostSamples = 5e5;
constexpr double kGoldenSection = 0.618033988749895;
constexpr int kMostSteps = 64;

// Weights of one piece of one cluster in one body.
struct Piece {
  std::uint32_t cluster;
  std::string name;
  std::vector<double> weight;  // per vertex of the body
};

// Effect of a cluster's overlap.
struct Overlap {
  double next = kInfinity;  // m, from the border to the nearest vertex beyond it
  bool widens = false;      // whether any vertex beyond the border weighs more by it
};

class PieceClusters {
 public:
  PieceClusters(const WeightTransfer& transfer, std::uint32_t body, std::span<const RecipeCluster> clusters,
                const Settings& settings)
      : graph_(transfer.graph()),
        mesh_(transfer.physical()),
        body_(transfer.physical().pieces[body]),
        number_(body),
        clusters_(clusters),
        settings_(settings) {}

  // Pieces of this body; adds up how many vertices no cluster covered, and how many memberships strayed, and how the
  // overlap of each cluster fared.
  std::vector<Piece> run(const std::vector<std::vector<double>>& weights, const std::vector<std::uint8_t>& takes_part,
                         std::size_t& uncovered, std::size_t& strays, std::vector<Overlap>& overlaps) {
    std::vector<Piece> pieces;
    for (std::uint32_t c = 0; c < clusters_.size(); ++c) {
      if (takes_part[c] == 0) continue;
      Piece piece{c, clusters_[c].name, std::vector<double>(body_.vertex_count)};
      for (std::uint32_t v = 0; v < body_.vertex_count; ++v) piece.weight[v] = weights[c][body_.first_vertex + v];
      pieces.push_back(std::move(piece));
    }
    if (pieces.empty()) return pieces;
    uncovered += coverRest(pieces);
    std::vector<Piece> cut;
    for (Piece& piece : pieces) split(std::move(piece), cut);
    for (Piece& piece : cut) widen(piece, overlaps[piece.cluster]);
    prune(cut);
    soften(cut);
    for (Piece& piece : cut) strays += dropStrays(piece, cut);
    return cut;
  }

 private:
  std::uint32_t global(std::uint32_t v) const { return body_.first_vertex + v; }

  std::size_t coverRest(std::vector<Piece>& pieces) const {
    std::vector<std::uint32_t> covered;
    std::vector<std::uint32_t> bare;
    for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
      double sum = 0;
      for (const Piece& piece : pieces) sum += piece.weight[v];
      if (sum >= kMinimumWeight)
        covered.push_back(global(v));
      else
        bare.push_back(v);
    }
    if (bare.empty() || covered.empty()) return 0;
    const TetDistances nearest = tetDistances(graph_, covered, kInfinity);
    for (const std::uint32_t v : bare) {
      // A vertex connected to no covered one (tetrahedra that touch in a point count) goes to the first cluster.
      const std::uint32_t from = nearest.nearest[global(v)];
      Piece* strongest = pieces.data();
      for (Piece& piece : pieces) {
        if (from != formats::kNone &&
            piece.weight[from - body_.first_vertex] > strongest->weight[from - body_.first_vertex])
          strongest = &piece;
      }
      strongest->weight[v] = 1;
    }
    return bare.size();
  }

  void split(Piece piece, std::vector<Piece>& out) const {
    const std::optional<double> size = clusters_[piece.cluster].split;
    if (!size) {
      out.push_back(std::move(piece));
      return;
    }
    std::vector<std::uint32_t> members;
    for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
      if (piece.weight[v] >= kMinimumWeight) members.push_back(global(v));
    }
    const std::vector<std::uint32_t> region = regionsOfSize(mesh_, graph_, members, *size);
    const std::uint32_t count = region.empty() ? 0 : *std::max_element(region.begin(), region.end()) + 1;
    for (std::uint32_t r = 0; r < count; ++r) {
      Piece part{piece.cluster, count == 1 ? piece.name : piece.name + "." + std::to_string(r + 1),
                 std::vector<double>(body_.vertex_count, 0)};
      for (std::size_t i = 0; i < members.size(); ++i) {
        const std::uint32_t v = members[i] - body_.first_vertex;
        if (region[i] == r) part.weight[v] = piece.weight[v];
      }
      out.push_back(std::move(part));
    }
  }

  // Neighbours must share vertices, or the body falls apart between them.
  void widen(Piece& piece, Overlap& said) const {
    const double overlap = overlapOf(optionsOf(clusters_[piece.cluster], settings_), graph_.mean_edge[number_]);
    if (!(overlap > 0)) return;
    const double largest = *std::max_element(piece.weight.begin(), piece.weight.end());
    // From where the weight crosses one half on the edges, so that a little more or less moves the border a little.
    const double half = 0.5 * largest;
    std::vector<double> start(graph_.first.size() - 1, kInfinity);
    for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
      const double w = piece.weight[v];
      if (w >= half) {
        start[global(v)] = 0;
        continue;
      }
      for (std::uint32_t e = graph_.first[global(v)]; e < graph_.first[global(v) + 1]; ++e) {
        const double other = piece.weight[graph_.neighbour[e] - body_.first_vertex];
        if (other < half) continue;
        start[global(v)] = std::min(start[global(v)], graph_.length[e] * (half - w) / (other - w));
      }
      said.next = std::min(said.next, start[global(v)]);
    }
    const TetDistances reach = tetDistances(graph_, start, overlap);
    for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
      const double d = reach.distance[global(v)];
      if (!std::isfinite(d)) continue;
      const double before =
          std::exchange(piece.weight[v], std::max(piece.weight[v], largest * geometry::smoothstep(1 - d / overlap)));
      if (before < half && piece.weight[v] - before > kMinimumShare * largest) said.widens = true;
    }
  }

  // Drops memberships that weigh next to nothing beside the vertex' others.
  void prune(std::vector<Piece>& pieces) const {
    for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
      double sum = 0;
      for (const Piece& piece : pieces) sum += piece.weight[v];
      for (Piece& piece : pieces) {
        piece.weight[v] *= geometry::smoothstep((piece.weight[v] / sum - kMinimumShare) / (kFullShare - kMinimumShare));
      }
    }
  }

  // A region measured straight through space, or painted in a hurry, reaches into sheets it does not mean: the lip
  // behind the lip. Pieces apart that weigh next to nothing beside the largest leave the cluster, where others cover
  // them.
  std::size_t dropStrays(Piece& piece, const std::vector<Piece>& pieces) const {
    std::vector<std::uint32_t> run(body_.vertex_count, formats::kNone);
    std::vector<double> mass;
    std::vector<std::uint32_t> stack;
    for (std::uint32_t start = 0; start < body_.vertex_count; ++start) {
      if (!(piece.weight[start] > 0) || run[start] != formats::kNone) continue;
      const auto number = std::uint32_t(mass.size());
      mass.push_back(0);
      run[start] = number;
      stack.assign(1, start);
      while (!stack.empty()) {
        const std::uint32_t v = stack.back();
        stack.pop_back();
        mass.back() += piece.weight[v];
        for (std::uint32_t e = graph_.first[global(v)]; e < graph_.first[global(v) + 1]; ++e) {
          const std::uint32_t n = graph_.neighbour[e] - body_.first_vertex;
          if (!(piece.weight[n] > 0) || run[n] != formats::kNone) continue;
          run[n] = number;
          stack.push_back(n);
        }
      }
    }
    if (mass.size() < 2) return 0;
    const double least = kStray * *std::max_element(mass.begin(), mass.end());
    std::size_t dropped = 0;
    for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
      if (run[v] == formats::kNone || mass[run[v]] >= least) continue;
      double sum = 0;
      for (const Piece& other : pieces) sum += other.weight[v];
      if (!(sum > piece.weight[v])) continue;
      piece.weight[v] = 0;
      ++dropped;
    }
    return dropped;
  }

  // A share that jumps between neighbours is a kink in the surface, whatever made it jump: a group's border, two masks
  // that end beside each other. Shares diffuse along the tetrahedra, by implicit steps of a graph Laplacian: an
  // M-matrix whose rows sum to 1, so they stay within 0..1 and sum to 1 at every vertex.
  void soften(std::vector<Piece>& pieces) const {
    const double width = settings_.clusters.soften_metres;
    if (!(width > 0) || pieces.size() < 2) return;
    const auto count = Eigen::Index(body_.vertex_count);
    const double deviation = width / kDeviationsInRamp;
    const double diffusion = deviation * deviation / kSoftenSteps;

    Eigen::VectorXd volume = Eigen::VectorXd::Zero(count);
    std::vector<Eigen::Triplet<double>> entries;
    for (std::uint32_t t = body_.first_tetrahedron; t < body_.first_tetrahedron + body_.tetrahedron_count; ++t) {
      const auto& corners = mesh_.tetrahedra[t];
      const Vector3d& d = mesh_.positions[corners[3]];
      Eigen::Matrix3d edges;
      for (int k = 0; k < 3; ++k) edges.col(k) = mesh_.positions[corners[std::size_t(k)]] - d;
      const double v = std::max(std::abs(edges.determinant()) / 6, kLeastVolume * edges.squaredNorm() * edges.norm());
      for (std::size_t i = 0; i < 4; ++i) {
        const auto a = Eigen::Index(corners[i] - body_.first_vertex);
        volume[a] += v / 4;
        for (std::size_t j = 0; j < i; ++j) {
          const auto b = Eigen::Index(corners[j] - body_.first_vertex);
          // Of edges in all directions: the flow of a Laplacian of one half.
          const double flow =
              diffusion * v / (4 * (mesh_.positions[corners[i]] - mesh_.positions[corners[j]]).squaredNorm());
          entries.emplace_back(a, a, flow);
          entries.emplace_back(b, b, flow);
          entries.emplace_back(a, b, -flow);
          entries.emplace_back(b, a, -flow);
        }
      }
    }
    for (Eigen::Index v = 0; v < count; ++v) {
      volume[v] = std::max(volume[v], std::numeric_limits<double>::min());
      entries.emplace_back(v, v, volume[v]);
    }
    Eigen::SparseMatrix<double> system(count, count);
    system.setFromTriplets(entries.begin(), entries.end());
    Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver(system);
    solver.setTolerance(1e-4);

    Eigen::VectorXd whole = Eigen::VectorXd::Zero(count);
    for (const Piece& piece : pieces) whole += Eigen::Map<const Eigen::VectorXd>(piece.weight.data(), count);
    for (Piece& piece : pieces) {
      Eigen::Map<Eigen::VectorXd> weight(piece.weight.data(), count);
      Eigen::VectorXd share = (whole.array() > 0).select(weight.array() / whole.array(), 0);
      for (int step = 0; step < kSoftenSteps; ++step)
        share = solver.solveWithGuess(volume.cwiseProduct(share), share).eval();
      weight = share.cwiseMax(0).cwiseProduct(whole);
    }
    prune(pieces);
  }

  const TetGraph& graph_;
  const PhysicalMesh& mesh_;
  const PhysicalPiece& body_;
  std::uint32_t number_;
  std::span<const RecipeCluster> clusters_;
  const Settings& settings_;
};

bool hangsTogether(const TetGraph& graph, const ClusterSource& cluster) {
  std::vector<std::uint8_t> inside(graph.first.size() - 1, 0);
  for (const std::uint32_t v : cluster.vertices) inside[v] = 1;
  const std::uint32_t start = cluster.vertices.front();
  const TetDistances reach = tetDistances(graph, {&start, 1}, kInfinity, inside);
  return std::all_of(cluster.vertices.begin(), cluster.vertices.end(),
                     [&](std::uint32_t v) { return std::isfinite(reach.distance[v]); });
}

// Runs of clusters that share no vertex with each other: the body falls apart there.
std::size_t looseRuns(std::span<const ClusterSource> clusters, std::size_t vertex_count) {
  std::vector<std::size_t> root(clusters.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](std::size_t i) {
    while (root[i] != i) i = root[i];
    return i;
  };
  std::vector<std::size_t> owner(vertex_count, clusters.size());
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    for (const std::uint32_t v : clusters[c].vertices) {
      if (owner[v] == clusters.size())
        owner[v] = c;
      else
        root[std::max(find(c), find(owner[v]))] = std::min(find(c), find(owner[v]));
    }
  }
  std::size_t runs = 0;
  for (std::size_t c = 0; c < clusters.size(); ++c) runs += find(c) == c ? 1U : 0U;
  return runs;
}

// Walks from one tetrahedron over faces to the one that holds a point, or to the last one on the way: it never leaves
// what hangs together, so it jumps no gap.
class TetWalk {
 public:
  explicit TetWalk(const PhysicalMesh& mesh) : mesh_(mesh), across_(mesh.tetrahedra.size()) {
    std::vector<std::pair<std::array<std::uint32_t, 3>, std::uint32_t>> faces;
    for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
      across_[t].fill(formats::kNone);
      for (std::uint32_t k = 0; k < 4; ++k) {
        const auto& v = mesh.tetrahedra[t];
        std::array<std::uint32_t, 3> face = {v[(k + 1) % 4], v[(k + 2) % 4], v[(k + 3) % 4]};
        std::sort(face.begin(), face.end());
        faces.emplace_back(face, 4 * t + k);
      }
    }
    std::sort(faces.begin(), faces.end());
    for (std::size_t i = 1; i < faces.size(); ++i) {
      if (faces[i].first != faces[i - 1].first) continue;
      across_[faces[i].second / 4][faces[i].second % 4] = faces[i - 1].second / 4;
      across_[faces[i - 1].second / 4][faces[i - 1].second % 4] = faces[i].second / 4;
    }
  }

  TetrahedronPlace operator()(const Vector3d& x, std::uint32_t start) const {
    TetrahedronPlace place{start, weights(x, start), 0};
    for (int step = 0; step < kMostSteps; ++step) {
      const auto worst =
          std::size_t(std::min_element(place.weights.begin(), place.weights.end()) - place.weights.begin());
      const std::uint32_t next = across_[place.tetrahedron][worst];
      if (place.weights[worst] >= 0 || next == formats::kNone) break;
      place = {next, weights(x, next), 0};
    }
    return place;
  }

 private:
  std::array<double, 4> weights(const Vector3d& x, std::uint32_t t) const {
    const auto& v = mesh_.tetrahedra[t];
    const Vector3d& d = mesh_.positions[v[3]];
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = mesh_.positions[v[std::size_t(k)]] - d;
    const Vector3d w = edges.inverse() * (x - d);
    return {w[0], w[1], w[2], 1 - w.sum()};
  }

  const PhysicalMesh& mesh_;
  std::vector<std::array<std::uint32_t, 4>> across_;
};

// An artist's likely mistakes. \param held each of the recipe's largest weight of a physical vertex
void judge(const WeightTransfer& transfer, const std::vector<ClusterSource>& clusters,
           std::span<const RecipeCluster> recipe_clusters, std::span<const double> held,
           std::vector<Finding>& findings) {
  std::vector<std::string> small;
  std::vector<std::string> apart;
  std::vector<std::string> identical;
  std::vector<std::string> idle;
  std::vector<std::string> riding;
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    const ClusterSource& cluster = clusters[c];
    if (cluster.recipe_cluster == formats::kNone) continue;
    if (cluster.vertices.size() < kFewMembers) small.push_back(cluster.name);
    if (!hangsTogether(transfer.graph(), cluster)) apart.push_back(cluster.name);
    for (std::size_t other = 0; other < c; ++other) {
      if (clusters[other].vertices != cluster.vertices) continue;
      double largest = 0;
      for (std::size_t i = 0; i < cluster.weights.size(); ++i) {
        largest = std::max(largest, std::abs(cluster.weights[i] - clusters[other].weights[i]));
      }
      if (largest <= kIdentical) identical.push_back(clusters[other].name + " = " + cluster.name);
    }
  }
  for (std::uint32_t c = 0; c < recipe_clusters.size(); ++c) {
    const auto is = [c](const ClusterSource& cluster) { return cluster.recipe_cluster == c; };
    if (std::none_of(clusters.begin(), clusters.end(), is))
      (held[c] > 0 ? idle : riding).push_back(recipe_clusters[c].name);
  }
  const auto have = [](const std::vector<std::string>& several) {
    return std::string(several.size() == 1 ? "of the recipe has " : "of the recipe have ");
  };
  reportClusters(findings, "cluster-small", small,
                 have(small) + "fewer than " + std::to_string(kFewMembers) + " physical vertices and cannot bend",
                 "Raise tetrahedra.vertices, or make the region larger.", Severity::warning);
  reportClusters(findings, "cluster-apart", apart, have(apart) + "pieces that do not touch, yet move as one",
                 "If that is not meant, make a cluster of each piece, or use split.", Severity::info);
  reportClusters(findings, "cluster-identical", identical, have(identical) + "the same vertices and weights as another",
                 "Remove one of them.", Severity::warning);
  reportClusters(findings, "cluster-idle", idle, have(idle) + "no influence on any physical vertex",
                 "Others cover the same region with far larger weights; make it larger, or remove it.",
                 Severity::warning);
  reportClusters(
      findings, "cluster-idle", riding,
      have(riding) + "no influence on any physical vertex: all that is selected rides along (parts), or has no area",
      "It has no tetrahedra of its own and moves with what carries it: select that, or remove the part.",
      Severity::warning);
  std::size_t from = 0;
  for (std::uint32_t b = 0; b < transfer.physical().pieces.size(); ++b) {
    std::size_t to = from;
    while (to < clusters.size() && clusters[to].piece == b) ++to;
    const std::size_t runs =
        looseRuns(std::span(clusters).subspan(from, to - from), transfer.physical().positions.size());
    from = to;
    if (runs < 2) continue;
    const std::string what = "the clusters of piece " + transfer.physical().pieces[b].name + " form " +
                             std::to_string(runs) + " sets that share no vertex: it falls apart between them";
    const char* const cure = "Raise clusters.overlap, of all or of the clusters beside the gap.";
    findings.push_back({"clusters-unconnected", Severity::warning, what, runs, "", {}, "", cure});
  }
}

}  // namespace

ClusterOptions optionsOf(const RecipeCluster& cluster, const Settings& settings) {
  Settings own = settings;
  for (const auto& [key, value] : cluster.settings) own.setJson(key, value);
  return own.clusters;
}

WeightTransfer::WeightTransfer(const VisualMesh& mesh, const PhysicalMesh& physical,
                               const std::vector<TetrahedronPlace>& places)
    : physical_(physical), graph_(makeTetGraph(physical)) {
  std::vector<std::uint8_t> known(physical.positions.size(), 0);
  const auto hang = [&](const TetrahedronPlace& place, std::uint32_t visual, double weight) {
    double sum = 0;
    for (const double w : place.weights) sum += std::max(w, 0.0);
    for (std::size_t k = 0; k < 4; ++k) {
      const double w = std::max(place.weights[k], 0.0) / sum;
      if (w < kMinimumInfluence) continue;
      const std::uint32_t p = physical.tetrahedra[place.tetrahedron][k];
      contributions_.push_back({p, visual, w * weight});
      known[p] = 1;
    }
  };
  // Small triangles speak through their corners; one that spans tetrahedra through points all over it, so that weights
  // do not depend on how finely the artist divided the surface.
  std::vector<double> area(mesh.positions.size(), 0);
  std::optional<TetWalk> walk;
  const auto stepAt = [&](const Triangle& t) {
    return kSampleStep * graph_.mean_edge[physical.pieceOf(places[t[0]].tetrahedron)];
  };
  const auto longestSide = [&](const Triangle& t) {
    const auto &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    return std::sqrt(std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()}));
  };
  const auto piecesOf = [&](const Triangle& t) {
    const double step = stepAt(t);
    return step > 0 ? int(std::clamp(std::ceil(longestSide(t) / step), 1.0, kMostPieces)) : 1;
  };
  double samples = 0;
  for (const Triangle& t : mesh.triangles) samples += std::pow(piecesOf(t), 2);
  double slivers = 0;
  for (const Triangle& t : mesh.triangles) {
    const std::array<Vector3d, 3> x = {mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]};
    const double whole = (x[1] - x[0]).cross(x[2] - x[0]).norm() / 2;
    const double step = stepAt(t), longest = longestSide(t);
    const int pieces = piecesOf(t);
    if (pieces == 1 || !(whole > 0)) {
      for (const std::uint32_t v : t) area[v] += whole / 3;
      continue;
    }
    if (!walk) walk.emplace(physical);
    const double by_area = kSliverSamples * whole / (step * step);
    if (samples > kMostSamples && 2 * whole <= step * longest && pieces * pieces > std::max(kSliverSamples, by_area)) {
      // A sliver, no wider than a step, of too many: by area, on the middle line over the longest side, and elsewhere
      // than its neighbours. All have then so many points a triangle and a square of steps, not the product.
      const auto length = [&](std::size_t i) { return (x[(i + 1) % 3] - x[i]).squaredNorm(); };
      const std::size_t p = length(0) >= std::max(length(1), length(2)) ? 0 : length(1) >= length(2) ? 1 : 2;
      const std::size_t q = (p + 1) % 3, r = (p + 2) % 3;
      const double foot = std::clamp((x[r] - x[p]).dot(x[q] - x[p]) / length(p), 0.0, 1.0);
      const double count = std::clamp(std::ceil(by_area), 1.0, double(pieces));
      for (double s = std::fmod(kGoldenSection * ++slivers, 1) / count; s < 1; s += 1 / count) {
        const double width = s < foot ? s / foot : (1 - s) / (1 - foot);  // there, of the height
        std::array<double, 3> corner{};
        corner[p] = (1 - s + (s < foot ? 1 - width : 0)) / 2;
        corner[r] = width / 2;
        corner[q] = 1 - corner[p] - corner[r];
        const TetrahedronPlace place =
            (*walk)(corner[0] * x[0] + corner[1] * x[1] + corner[2] * x[2], places[t[s < 0.5 ? p : q]].tetrahedron);
        for (std::size_t k = 0; k < 3; ++k) hang(place, t[k], corner[k] * 2 * width * whole / count);
      }
      continue;
    }
    for (int i = 0; i < pieces; ++i) {
      for (int j = 0; j < 2 * (pieces - i) - 1; ++j) {
        // Centres of the small triangles of a row, upright and inverted by turns.
        const double a = (i + (j % 2 == 0 ? 1.0 : 2.0) / 3) / pieces;
        const int cell = j / 2;
        const double b = (cell + (j % 2 == 0 ? 1.0 : 2.0) / 3) / pieces;
        const std::array<double, 3> corner = {1 - a - b, b, a};
        const Vector3d at = corner[0] * x[0] + corner[1] * x[1] + corner[2] * x[2];
        const auto nearest = std::size_t(std::max_element(corner.begin(), corner.end()) - corner.begin());
        const TetrahedronPlace place = (*walk)(at, places[t[nearest]].tetrahedron);
        for (std::size_t k = 0; k < 3; ++k) hang(place, t[k], corner[k] * whole / (pieces * pieces));
      }
    }
  }
  for (std::uint32_t v = 0; v < places.size(); ++v) {
    if (area[v] > 0) hang(places[v], v, area[v]);
  }
  // One for each pair of vertices.
  std::vector<std::size_t> next(known.size() + 1, 0);
  for (const Contribution& c : contributions_) ++next[c.physical + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  std::vector<Contribution> sorted(contributions_.size());
  for (const Contribution& c : contributions_) sorted[next[c.physical]++] = c;
  contributions_.clear();
  std::vector<std::size_t> at(mesh.positions.size(), 0);  // of a visual vertex, its last one, and 1
  std::size_t first = 0;
  for (const Contribution& c : sorted) {
    if (first < contributions_.size() && contributions_[first].physical != c.physical) first = contributions_.size();
    if (at[c.visual] > first) {
      contributions_[at[c.visual] - 1].weight += c.weight;
    } else {
      contributions_.push_back(c);
      at[c.visual] = contributions_.size();
    }
  }
  total_.assign(known.size(), 0);
  for (const Contribution& c : contributions_) total_[c.physical] += c.weight;
  std::vector<std::uint32_t> sources;
  for (std::uint32_t p = 0; p < known.size(); ++p) {
    if (known[p] != 0) sources.push_back(p);
  }
  taken_from_ = tetDistances(graph_, sources, kInfinity).nearest;
}

std::vector<double> WeightTransfer::operator()(std::span<const double> visual) const {
  std::vector<double> sum(taken_from_.size(), 0);
  for (const Contribution& c : contributions_) sum[c.physical] += c.weight * visual[c.visual];
  std::vector<double> weights(taken_from_.size(), 0);
  for (std::size_t p = 0; p < weights.size(); ++p) {
    const std::uint32_t from = taken_from_[p];
    if (from != formats::kNone) weights[p] = sum[from] / total_[from];
  }
  return weights;
}

std::vector<ClusterSource> authoredClusters(const WeightTransfer& transfer,
                                            std::span<const RecipeCluster> recipe_clusters,
                                            std::span<const VisualWeights> visual, const Settings& settings,
                                            std::vector<Finding>& findings) {
  const PhysicalMesh& mesh = transfer.physical();
  std::vector<std::vector<double>> weights;
  weights.reserve(visual.size());
  for (const VisualWeights& w : visual) weights.push_back(transfer(w));
  // A cluster takes part in a body where it has at least a tenth of its largest weight.
  std::vector<double> largest(weights.size(), 0);
  for (std::size_t c = 0; c < weights.size(); ++c) largest[c] = *std::max_element(weights[c].begin(), weights[c].end());
  std::vector<std::uint32_t> bodies_of(weights.size(), 0);
  std::vector<std::vector<std::uint8_t>> takes_part(mesh.pieces.size());
  std::vector<std::uint8_t> authored(mesh.pieces.size(), 0);
  for (std::uint32_t b = 0; b < mesh.pieces.size(); ++b) {
    const PhysicalPiece& body = mesh.pieces[b];
    takes_part[b].assign(weights.size(), 0);
    for (std::size_t c = 0; c < weights.size(); ++c) {
      const auto begin = weights[c].begin() + body.first_vertex;
      const double here = *std::max_element(begin, begin + body.vertex_count);
      if (!(here > 0) || here < 0.1 * largest[c] || here < kMinimumWeight) continue;
      takes_part[b][c] = 1;
      authored[b] = 1;
      ++bodies_of[c];
    }
  }
  std::vector<ClusterSource> automatic = automaticClusters(mesh, settings.clusters, authored, findings);
  std::vector<ClusterSource> clusters;
  std::size_t uncovered = 0;
  std::size_t strays = 0;
  std::vector<Overlap> overlaps(recipe_clusters.size());
  for (std::uint32_t b = 0; b < mesh.pieces.size(); ++b) {
    if (authored[b] == 0) {
      for (ClusterSource& cluster : automatic) {
        if (cluster.piece == b) clusters.push_back(std::move(cluster));
      }
      continue;
    }
    PieceClusters in_body(transfer, b, recipe_clusters, settings);
    for (const Piece& piece : in_body.run(weights, takes_part[b], uncovered, strays, overlaps)) {
      ClusterSource cluster;
      cluster.name = bodies_of[piece.cluster] > 1 ? piece.name + "@" + mesh.pieces[b].name : piece.name;
      cluster.piece = b;
      cluster.recipe_cluster = piece.cluster;
      cluster.options = optionsOf(recipe_clusters[piece.cluster], settings);
      cluster.mode = cluster.options->mode;
      for (std::uint32_t v = 0; v < piece.weight.size(); ++v) {
        if (!(piece.weight[v] > 0)) continue;
        cluster.vertices.push_back(mesh.pieces[b].first_vertex + v);
        cluster.weights.push_back(piece.weight[v]);
      }
      if (!cluster.vertices.empty()) clusters.push_back(std::move(cluster));
    }
  }
  if (strays > 0) {
    const std::string what =
        counted(strays, "membership", "memberships") +
        " in small pieces apart from the rest of their cluster were left to the other clusters there";
    const char* const cure = "Make a cluster of each piece where they are meant.";
    findings.push_back({"cluster-strays", Severity::info, what, strays, "", {}, "", cure});
  }
  if (uncovered > 0) {
    const std::string what =
        std::to_string(uncovered) + " of " + std::to_string(mesh.positions.size()) +
        " physical vertices lie in no cluster of the recipe and went to the nearest one, whose material they have";
    const char* const cure =
        R"(Add {"name": "rest", "from": {"rest": true}, "split": SIZE} to give them clusters of their own.)";
    // Where it is most of the body the recipe says something else than it does.
    const Severity severity = 2 * uncovered > mesh.positions.size() ? Severity::warning : Severity::info;
    findings.push_back({"cluster-uncovered", severity, what, uncovered, "", {}, "", cure});
  }
  std::vector<std::string> narrow;
  double nearest = kInfinity;
  for (std::uint32_t c = 0; c < recipe_clusters.size(); ++c) {
    if (optionsOf(recipe_clusters[c], settings).overlap.value_or(0) <= 0 || overlaps[c].widens) continue;
    if (!std::isfinite(overlaps[c].next)) continue;
    narrow.push_back(recipe_clusters[c].name);
    nearest = std::min(nearest, overlaps[c].next);
  }
  reportClusters(findings, "overlap-short", narrow,
                 std::string("of the recipe ") + (narrow.size() == 1 ? "has" : "have") +
                     " an overlap that reaches no vertex beyond the border, where the nearest is " +
                     lengthText(nearest) + " away",
                 "Make clusters.overlap larger than that, or 0; or raise tetrahedra.vertices.", Severity::warning);
  judge(transfer, clusters, recipe_clusters, largest, findings);
  return clusters;
}

Vector3d longestAxis(const PhysicalMesh& mesh, const TetGraph& graph, const ClusterSource& cluster) {
  std::vector<std::uint8_t> inside(mesh.positions.size(), 0);
  // The cluster's own region, without the overlap into its neighbours.
  const double largest = *std::max_element(cluster.weights.begin(), cluster.weights.end());
  std::uint32_t at = cluster.vertices.front();
  for (std::size_t i = 0; i < cluster.vertices.size(); ++i) {
    if (cluster.weights[i] < 0.5 * largest) continue;
    inside[cluster.vertices[i]] = 1;
    at = cluster.vertices[i];
  }
  // Twice to the farthest: the ends of the longest way, or nearly.
  std::uint32_t ends[2] = {at, at};
  for (int sweep = 0; sweep < 2; ++sweep) {
    const TetDistances reach = tetDistances(graph, {&at, 1}, kInfinity, inside);
    double farthest = -1;
    for (const std::uint32_t v : cluster.vertices) {
      if (inside[v] == 0 || !std::isfinite(reach.distance[v]) || reach.distance[v] <= farthest) continue;
      farthest = reach.distance[v];
      at = v;
    }
    ends[sweep] = at;
  }
  Vector3d axis = mesh.positions[ends[1]] - mesh.positions[ends[0]];
  if (!(axis.norm() > 0)) return Vector3d::Zero();
  Eigen::Index component = 0;
  axis.cwiseAbs().maxCoeff(&component);
  return axis.normalized() * (axis[component] < 0 ? -1.0 : 1.0);
}

}  // namespace sinew::tools

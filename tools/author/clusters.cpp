// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/clusters.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <span>

#include "runtime/geometry/smoothstep.h"
#include "tools/author/tet_graph.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

// Below this a cluster's own shape is too poor to match against; it joins a neighbour.
constexpr std::size_t kMinimumMembers = 8;
// Physical vertices per box that the automatic resolution aims at, and the most boxes it makes of one piece.
constexpr std::uint32_t kVerticesPerBox = 100;
constexpr std::uint32_t kMaximumBoxes = 48;
// And the most along one axis. Where the report's solver moves them a push passes from box to box once a step, so a
// long chain is far softer than its frequency says.
constexpr std::uint32_t kMaximumBoxesAlongAxis = 8;
// How far a box reaches into its neighbours where nobody says it, of its own size.
constexpr double kAutomaticOverlap = 0.5;

struct Box {
  Eigen::Vector3d low, size;
  std::array<std::uint32_t, 3> count;
};

std::array<std::uint32_t, 3> boxOf(const Box& box, const Eigen::Vector3d& x) {
  std::array<std::uint32_t, 3> index{};
  for (int a = 0; a < 3; ++a) {
    const double t = (x[a] - box.low[a]) / box.size[a];
    index[std::size_t(a)] = std::uint32_t(std::clamp(int(std::floor(t)), 0, int(box.count[std::size_t(a)]) - 1));
  }
  return index;
}

Box makeBox(const Eigen::Vector3d& low, const Eigen::Vector3d& extent, const std::array<std::uint32_t, 3>& count) {
  Box box{low, extent, count};
  for (int a = 0; a < 3; ++a) box.size[a] = std::max(extent[a], 1e-12 * extent.norm()) / count[std::size_t(a)];
  return box;
}

std::size_t occupiedBoxes(const Box& box, std::span<const Eigen::Vector3d> positions) {
  std::vector<std::array<std::uint32_t, 3>> boxes;
  boxes.reserve(positions.size());
  for (const auto& x : positions) boxes.push_back(boxOf(box, x));
  std::sort(boxes.begin(), boxes.end());
  return std::size_t(std::unique(boxes.begin(), boxes.end()) - boxes.begin());
}

std::array<std::uint32_t, 3> automaticGrid(const Eigen::Vector3d& low, const Eigen::Vector3d& extent,
                                           std::span<const Eigen::Vector3d> positions) {
  const std::size_t wanted =
      std::clamp<std::size_t>((positions.size() + kVerticesPerBox / 2) / kVerticesPerBox, 1, kMaximumBoxes);
  std::array<std::uint32_t, 3> best = {1, 1, 1};
  // Nearly cubic boxes, made smaller until enough of them are occupied.
  for (double edge = extent.maxCoeff(); edge > extent.maxCoeff() / 64; edge /= 1.05) {
    std::array<std::uint32_t, 3> count{};
    for (int a = 0; a < 3; ++a) {
      const auto fitting = std::uint32_t(std::max(1.0, std::round(extent[a] / edge)));
      count[std::size_t(a)] = std::min(fitting, kMaximumBoxesAlongAxis);
    }
    const std::size_t occupied = occupiedBoxes(makeBox(low, extent, count), positions);
    if (occupied > wanted && occupied > 1) break;
    best = count;
  }
  return best;
}

// 1 at the box's centre, falling smoothly to 0 where the box ends inside its neighbour; 1 out to the rim at an outer
// box.
double axisWeight(double x, double low, double size, std::uint32_t index, std::uint32_t count,
                  std::optional<double> metres) {
  // A box reaches no further than its neighbours.
  const double overlap = metres ? std::min(*metres / size, 1.0) : kAutomaticOverlap;
  const double centre = low + (index + 0.5) * size;
  const double distance = std::abs(x - centre);
  if ((index == 0 && x <= centre) || (index + 1 == count && x >= centre)) return 1;
  const double half = size * (0.5 + overlap);
  const double ramp = size * std::max(1e-6, std::min(2 * overlap, 0.5 + overlap));
  return geometry::smoothstep((half - distance) / ramp);
}

}  // namespace

std::vector<ClusterSource> gridClusters(const PhysicalMesh& mesh, const ClusterOptions& options,
                                        std::vector<Finding>& findings) {
  std::vector<ClusterSource> clusters;
  std::size_t merged = 0;
  const TetGraph graph = makeTetGraph(mesh);
  for (std::uint32_t b = 0; b < mesh.pieces.size(); ++b) {
    const PhysicalPiece& body = mesh.pieces[b];
    const std::span<const Eigen::Vector3d> positions(mesh.positions.data() + body.first_vertex, body.vertex_count);
    Eigen::Vector3d low = positions[0];
    Eigen::Vector3d high = positions[0];
    for (const auto& x : positions) {
      low = low.cwiseMin(x);
      high = high.cwiseMax(x);
    }
    const Eigen::Vector3d extent = high - low;
    const bool automatic = options.grid[0] == 0;
    const Box box = makeBox(low, extent, automatic ? automaticGrid(low, extent, positions) : options.grid);
    const std::uint32_t base = body.first_vertex;

    // Members of each box: the boxes a vertex can reach are its own and the two beside it on each axis.
    std::map<std::array<std::uint32_t, 3>, std::vector<std::pair<std::uint32_t, double>>> boxes;
    for (std::uint32_t v = 0; v < body.vertex_count; ++v) {
      const auto home = boxOf(box, positions[v]);
      std::array<std::uint32_t, 3> index{};
      const auto range = [&](std::size_t a) {
        return std::pair{home[a] == 0 ? 0U : home[a] - 1, std::min(home[a] + 1, box.count[a] - 1)};
      };
      for (index[2] = range(2).first; index[2] <= range(2).second; ++index[2]) {
        for (index[1] = range(1).first; index[1] <= range(1).second; ++index[1]) {
          for (index[0] = range(0).first; index[0] <= range(0).second; ++index[0]) {
            double weight = 1;
            for (int a = 0; a < 3; ++a) {
              const auto ua = std::size_t(a);
              weight *= axisWeight(positions[v][a], box.low[a], box.size[a], index[ua], box.count[ua], options.overlap);
            }
            if (weight >= kMinimumWeight || index == home)
              boxes[index].emplace_back(v, std::max(weight, kMinimumWeight));
          }
        }
      }
    }

    // One cluster for each piece of a box that hangs together over tetrahedra: two legs in one box must not move as
    // one.
    struct Piece {
      std::string name;
      std::vector<std::pair<std::uint32_t, double>> members;
    };
    std::vector<Piece> pieces;
    std::vector<std::uint32_t> piece_of(body.vertex_count);
    for (const auto& [index, members] : boxes) {
      std::fill(piece_of.begin(), piece_of.end(), formats::kNone);
      std::vector<double> weight(body.vertex_count, 0);
      for (const auto& [v, w] : members) weight[v] = w;
      std::uint32_t piece_count = 0;
      const std::string name =
          "x" + std::to_string(index[0]) + "y" + std::to_string(index[1]) + "z" + std::to_string(index[2]);
      for (const auto& member : members) {
        if (piece_of[member.first] != formats::kNone) continue;
        Piece piece;
        piece.name = piece_count == 0 ? name : name + "." + std::to_string(piece_count + 1);
        std::vector<std::uint32_t> queue = {member.first};
        piece_of[member.first] = piece_count;
        for (std::size_t at = 0; at < queue.size(); ++at) {
          const std::uint32_t v = queue[at];
          piece.members.emplace_back(v, weight[v]);
          for (std::uint32_t e = graph.first[base + v]; e < graph.first[base + v + 1]; ++e) {
            const std::uint32_t n = graph.neighbour[e] - base;
            if (weight[n] > 0 && piece_of[n] == formats::kNone) {
              piece_of[n] = piece_count;
              queue.push_back(n);
            }
          }
        }
        std::sort(piece.members.begin(), piece.members.end());
        pieces.push_back(std::move(piece));
        ++piece_count;
      }
    }

    // Small pieces, smallest first, dissolve into the piece they share most edges with.
    std::vector<std::uint32_t> order(pieces.size());
    std::iota(order.begin(), order.end(), 0U);
    std::stable_sort(order.begin(), order.end(), [&](std::uint32_t x, std::uint32_t y) {
      return pieces[x].members.size() < pieces[y].members.size();
    });
    for (std::uint32_t p : order) {
      Piece& piece = pieces[p];
      if (piece.members.empty() || piece.members.size() >= kMinimumMembers) continue;
      std::vector<std::uint8_t> near(body.vertex_count, 0);
      for (const auto& [v, w] : piece.members) {
        near[v] = 1;
        for (std::uint32_t e = graph.first[base + v]; e < graph.first[base + v + 1]; ++e)
          near[graph.neighbour[e] - base] = 1;
      }
      std::size_t best_shared = 0;
      std::uint32_t best = formats::kNone;
      for (std::uint32_t q = 0; q < pieces.size(); ++q) {
        if (q == p) continue;
        std::size_t shared = 0;
        for (const auto& member : pieces[q].members) shared += near[member.first];
        if (shared > best_shared) {
          best_shared = shared;
          best = q;
        }
      }
      if (best == formats::kNone) continue;  // a whole piece of so few vertices
      auto& target = pieces[best].members;
      for (const auto& member : piece.members) {
        const auto at = std::lower_bound(target.begin(), target.end(), std::pair(member.first, 0.0));
        if (at == target.end() || at->first != member.first) target.insert(at, member);
      }
      piece.members.clear();
      ++merged;
    }

    for (const Piece& piece : pieces) {
      if (piece.members.empty()) continue;
      ClusterSource cluster;
      cluster.name = mesh.pieces.size() == 1 ? piece.name : body.name + "/" + piece.name;
      cluster.piece = b;
      cluster.mode = options.mode;
      for (const auto& [v, w] : piece.members) {
        cluster.vertices.push_back(v + body.first_vertex);
        cluster.weights.push_back(w);
      }
      clusters.push_back(std::move(cluster));
    }
  }
  if (merged > 0) {
    const std::string what = counted(merged, "cluster", "clusters") + " of fewer than " +
                             std::to_string(kMinimumMembers) + " vertices joined a neighbour";
    const char* const cure = "Nothing to do; a coarser clusters.grid makes fewer of them.";
    findings.push_back({"clusters-merged", Severity::info, what, merged, "", {}, "", cure});
  }
  return clusters;
}

void reportClusters(std::vector<Finding>& findings, const char* id, const std::vector<std::string>& names,
                    const std::string& what, const std::string& cure, Severity severity) {
  if (names.empty()) return;
  findings.push_back(
      {id, severity, counted(names.size(), "cluster ", "clusters ") + what, names.size(), "", {}, listed(names), cure});
}

}  // namespace sinew::tools

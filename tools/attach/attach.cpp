// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/attach/attach.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

#include "runtime/geometry/box_tree.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Corners = std::array<Vector3d, 4>;

// Of a point in its tetrahedron; with a larger one another tetrahedron beside it may serve it better.
constexpr double kLargestWeight = 8;

// Closest point of a triangle: Ericson, Real-Time Collision Detection, 5.1.5.
Vector3d closestOnTriangle(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d ab = b - a;
  const Vector3d ac = c - a;
  const Vector3d ap = p - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vector3d bp = p - b;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + ab * (d1 / (d1 - d3));
  const Vector3d cp = p - c;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + ac * (d2 / (d2 - d6));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  const double denominator = 1 / (va + vb + vc);
  return a + ab * (vb * denominator) + ac * (vc * denominator);
}

std::array<double, 4> barycentric(const Vector3d& p, const Corners& x) {
  Eigen::Matrix3d edges;
  edges << x[0] - x[3], x[1] - x[3], x[2] - x[3];
  const Vector3d w = edges.inverse() * (p - x[3]);
  return {w[0], w[1], w[2], 1 - w.sum()};
}

double squaredDistance(const Vector3d& p, const Corners& x) {
  const auto w = barycentric(p, x);
  if (*std::min_element(w.begin(), w.end()) >= 0) return 0;
  constexpr std::array<std::array<std::size_t, 3>, 4> faces = {{{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}}};
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t f = 0; f < 4; ++f) {
    if (w[f] >= 0) continue;  // p is on the inner side of this face, so another one is nearer
    best = std::min(best, (closestOnTriangle(p, x[faces[f][0]], x[faces[f][1]], x[faces[f][2]]) - p).squaredNorm());
  }
  return best;
}

// A tree of boxes over some tetrahedra, for "which one is nearest".
class TetrahedronTree {
 public:
  TetrahedronTree(const PhysicalMesh& mesh, std::uint32_t first, std::uint32_t count) : mesh_(mesh), first_(first) {
    const auto box = [&](std::uint32_t i) {
      const Corners x = corners(first + i);
      return Eigen::AlignedBox3d(x[0]).extend(x[1]).extend(x[2]).extend(x[3]);
    };
    const auto sum = [&](std::uint32_t i) -> Vector3d {
      const Corners x = corners(first + i);
      return x[0] + x[1] + x[2] + x[3];
    };
    tree_ = geometry::BoxTree(count, box, sum, box, 4);
  }

  std::uint32_t nearest(const Vector3d& p, double& squared_distance) const {
    std::uint32_t best = formats::kNone;
    squared_distance = std::numeric_limits<double>::infinity();
    tree_.descendNear(p, squared_distance, [&](std::uint32_t place) {
      const std::uint32_t t = first_ + tree_.order()[place];
      const double d = squaredDistance(p, corners(t));
      if (!(d < squared_distance)) return;
      squared_distance = d;
      best = t;
    });
    return best;
  }

  Corners corners(std::uint32_t t) const {
    const auto& v = mesh_.tetrahedra[t];
    return {mesh_.positions[v[0]], mesh_.positions[v[1]], mesh_.positions[v[2]], mesh_.positions[v[3]]};
  }

 private:
  const PhysicalMesh& mesh_;
  std::uint32_t first_;
  geometry::BoxTree tree_;
};

// Tetrahedra around each vertex, without the ties between pieces.
class Neighbourhood {
 public:
  explicit Neighbourhood(const PhysicalMesh& mesh) : mesh_(mesh), first_(mesh.positions.size() + 1, 0) {
    const auto forCarrying = [&](auto&& visit) {
      for (const PhysicalPiece& piece : mesh.pieces) {
        for (std::uint32_t i = 0; i < piece.tetrahedron_count - piece.tie_count; ++i)
          visit(piece.first_tetrahedron + i);
      }
    };
    forCarrying([&](std::uint32_t t) {
      for (const std::uint32_t v : mesh.tetrahedra[t]) ++first_[v + 1];
    });
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    around_.resize(first_.back());
    std::vector<std::uint32_t> filled = first_;
    forCarrying([&](std::uint32_t t) {
      for (const std::uint32_t v : mesh.tetrahedra[t]) around_[filled[v]++] = t;
    });
    std::vector<std::uint32_t> order(mesh.positions.size());
    std::iota(order.begin(), order.end(), 0U);
    const auto key = [&](std::uint32_t v) {
      return std::tuple(mesh.positions[v].x(), mesh.positions[v].y(), mesh.positions[v].z());
    };
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
    doubled_.assign(order.size(), 0);
    for (std::size_t i = 1; i < order.size(); ++i) {
      if (key(order[i]) == key(order[i - 1])) doubled_[order[i]] = doubled_[order[i - 1]] = 1;
    }
  }

  // Whether other tetrahedra may lie over this one.
  bool doubled(std::uint32_t t) const {
    return std::any_of(mesh_.tetrahedra[t].begin(), mesh_.tetrahedra[t].end(),
                       [&](std::uint32_t v) { return doubled_[v] != 0; });
  }

  // Squared.
  double distance(std::uint32_t t, const Vector3d& p) const {
    const auto& v = mesh_.tetrahedra[t];
    return squaredDistance(
        p, {mesh_.positions[v[0]], mesh_.positions[v[1]], mesh_.positions[v[2]], mesh_.positions[v[3]]});
  }

  // But for the rounding of positions to single precision since it was found.
  bool holds(std::uint32_t t, const Vector3d& p) const {
    const auto& v = mesh_.tetrahedra[t];
    return distance(t, p) <= 1e-12 * (mesh_.positions[v[0]] - mesh_.positions[v[1]]).squaredNorm();
  }

  // Whether two tetrahedra share a vertex or are both beside a third.
  bool close(std::uint32_t a, std::uint32_t b) const {
    const auto& wanted = mesh_.tetrahedra[b];
    for (const std::uint32_t v : mesh_.tetrahedra[a]) {
      if (std::find(wanted.begin(), wanted.end(), v) != wanted.end()) return true;
    }
    for (const std::uint32_t v : mesh_.tetrahedra[a]) {
      for (std::uint32_t i = first_[v]; i < first_[v + 1]; ++i) {
        for (const std::uint32_t w : mesh_.tetrahedra[around_[i]]) {
          if (std::find(wanted.begin(), wanted.end(), w) != wanted.end()) return true;
        }
      }
    }
    return false;
  }

  // Of a tetrahedron and those beside it the one in which the largest weight of a point is smallest: in a flat one a
  // point outside has weights by which the rounding of vertices and every tremble of theirs is multiplied.
  std::uint32_t calmest(std::uint32_t from, const Vector3d& p) const {
    const auto largest = [&](std::uint32_t t) {
      const auto& v = mesh_.tetrahedra[t];
      double most = 0;
      for (const double w : barycentric(
               p, {mesh_.positions[v[0]], mesh_.positions[v[1]], mesh_.positions[v[2]], mesh_.positions[v[3]]})) {
        most = std::max(most, std::abs(w));
      }
      return most;
    };
    double least = largest(from);
    if (least <= kLargestWeight) return from;
    std::uint32_t best = from;
    for (const std::uint32_t v : mesh_.tetrahedra[from]) {
      for (std::uint32_t i = first_[v]; i < first_[v + 1]; ++i) {
        const double most = largest(around_[i]);
        if (most >= least) continue;
        least = most;
        best = around_[i];
      }
    }
    return best;
  }

  // Of a tetrahedron and those beside it that hold the point as well, as it lies on their corner or side, the one of
  // the largest least height: normals follow its deformation, and a flat one has that of rounding across.
  std::uint32_t broadest(std::uint32_t from, const Vector3d& p) const {
    const auto height = [&](std::uint32_t t) {
      const auto& v = mesh_.tetrahedra[t];
      Eigen::Matrix3d edges;
      for (int k = 0; k < 3; ++k) edges.col(k) = mesh_.positions[v[std::size_t(k)]] - mesh_.positions[v[3]];
      const Eigen::Matrix3d slopes = edges.inverse();
      return 1 / std::max(slopes.rowwise().norm().maxCoeff(), slopes.colwise().sum().norm());
    };
    double most = height(from);
    std::uint32_t best = from;
    for (const std::uint32_t v : mesh_.tetrahedra[from]) {
      for (std::uint32_t i = first_[v]; i < first_[v + 1]; ++i) {
        const double here = height(around_[i]);
        if (!(here > most) || !holds(around_[i], p)) continue;
        most = here;
        best = around_[i];
      }
    }
    return best;
  }

  // From one tetrahedron to ever nearer ones beside it.
  std::uint32_t walk(std::uint32_t from, const Vector3d& p, double& squared_distance) const {
    squared_distance = distance(from, p);
    for (std::uint32_t last = formats::kNone; last != from && squared_distance > 0;) {
      last = from;
      for (const std::uint32_t v : mesh_.tetrahedra[last]) {
        for (std::uint32_t i = first_[v]; i < first_[v + 1]; ++i) {
          const double d = distance(around_[i], p);
          if (d < squared_distance) {
            squared_distance = d;
            from = around_[i];
          }
        }
      }
    }
    return from;
  }

 private:
  const PhysicalMesh& mesh_;
  std::vector<std::uint32_t> first_, around_;
  std::vector<char> doubled_;  // of each vertex: another lies in its place
};

// A tetrahedron for each welded point to start from: its home, else that of the first point along the surface that has
// one. formats::kNone where none can be reached.
std::vector<std::uint32_t> startingPlaces(const VisualMesh& mesh, const PhysicalMesh& physical) {
  std::vector<std::uint32_t> start(mesh.welded_positions.size(), formats::kNone);
  if (physical.home.empty()) return start;
  start = physical.home;
  // Edges that lead to points without a home.
  const auto forEdges = [&](auto&& visit) {
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const Triangle points = mesh.weldedTriangle(t);
      for (const std::uint32_t b : points) {
        if (physical.home[b] != formats::kNone) continue;
        for (const std::uint32_t a : points) {
          if (a != b) visit(a, b);
        }
      }
    }
  };
  std::vector<std::uint32_t> first(start.size() + 1, 0);
  forEdges([&](std::uint32_t a, std::uint32_t) { ++first[a + 1]; });
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<std::uint32_t> next(first.back()), filled = first;
  forEdges([&](std::uint32_t a, std::uint32_t b) { next[filled[a]++] = b; });
  std::vector<std::uint32_t> queue;
  for (std::uint32_t p = 0; p < start.size(); ++p) {
    if (start[p] != formats::kNone) queue.push_back(p);
  }
  for (std::size_t at = 0; at < queue.size(); ++at) {
    const std::uint32_t p = queue[at];
    for (std::uint32_t i = first[p]; i < first[p + 1]; ++i) {
      if (start[next[i]] != formats::kNone) continue;
      start[next[i]] = start[p];
      queue.push_back(next[i]);
    }
  }
  return start;
}

Corners cornersOf(const PhysicalMesh& physical, std::uint32_t tetrahedron) {
  const auto& v = physical.tetrahedra[tetrahedron];
  return {physical.positions[v[0]], physical.positions[v[1]], physical.positions[v[2]], physical.positions[v[3]]};
}

}  // namespace

HungPlace hungAtRest(std::span<const formats::ClusterAttachment> uses, std::span<const formats::Cluster> clusters,
                     const std::array<float, 3>& place) {
  HungPlace hung;
  for (std::size_t c = 0; c < 3; ++c) {
    for (const formats::ClusterAttachment& use : uses) {
      const formats::Cluster& cluster = clusters[use.cluster];
      const float q = (place[c] - cluster.rest_center[c]) / cluster.radius;
      hung.place[c] += use.weight * (q * cluster.radius + cluster.rest_center[c]);
    }
  }
  return hung;
}

TetrahedronPlace placeIn(std::uint32_t tetrahedron, const Vector3d& point, const PhysicalMesh& physical) {
  const Corners corners = cornersOf(physical, tetrahedron);
  return {tetrahedron, barycentric(point, corners), std::sqrt(squaredDistance(point, corners))};
}

std::vector<TetrahedronPlace> placeVisualVertices(const VisualMesh& mesh, const Topology& topology,
                                                  const PhysicalMesh& physical) {
  // A point's piece is that of the first part that uses it; a point of no part (unused, or only of degenerate faces)
  // takes whatever is nearest.
  std::vector<std::uint32_t> piece_of(mesh.welded_positions.size(), formats::kNone);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t part = topology.part_of_triangle[t];
    if (part == formats::kNone) continue;
    for (std::uint32_t p : mesh.weldedTriangle(t)) {
      if (piece_of[p] == formats::kNone) piece_of[p] = physical.part_piece[part];
    }
  }
  std::vector<TetrahedronTree> trees;
  trees.reserve(physical.pieces.size());
  for (const PhysicalPiece& piece : physical.pieces)
    trees.emplace_back(physical, piece.first_tetrahedron, piece.tetrahedron_count - piece.tie_count);

  const Neighbourhood neighbourhood(physical);
  const std::vector<std::uint32_t> start = startingPlaces(mesh, physical);
  std::vector<TetrahedronPlace> places(mesh.welded_positions.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, places.size(), 256), [&](const auto& range) {
    for (std::size_t p = range.begin(); p != range.end(); ++p) {
      const Vector3d& x = mesh.welded_positions[p];
      if (start[p] != formats::kNone && neighbourhood.holds(start[p], x)) {
        places[p] = {neighbourhood.broadest(start[p], x), {}, 0};
        continue;
      }
      double best = std::numeric_limits<double>::infinity();
      std::uint32_t best_tetrahedron = formats::kNone;
      for (std::uint32_t b = 0; b < trees.size(); ++b) {
        if (piece_of[p] != formats::kNone && piece_of[p] != b) continue;
        double d = 0;
        const std::uint32_t t = trees[b].nearest(x, d);
        if (d < best) {
          best = d;
          best_tetrahedron = t;
        }
      }
      // The nearest one may lie across a gap.
      if (start[p] != formats::kNone &&
          (neighbourhood.doubled(best_tetrahedron) || !neighbourhood.close(start[p], best_tetrahedron))) {
        best_tetrahedron = neighbourhood.walk(start[p], x, best);
      }
      best_tetrahedron =
          best > 0 ? neighbourhood.calmest(best_tetrahedron, x) : neighbourhood.broadest(best_tetrahedron, x);
      places[p] = {best_tetrahedron, {}, std::sqrt(best)};
    }
  });

  // Visual vertices of one point share its tetrahedron, each with weights for its own position (they differ by less
  // than the welding tolerance).
  std::vector<TetrahedronPlace> result(mesh.positions.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, result.size(), 1024), [&](const auto& range) {
    for (std::size_t v = range.begin(); v != range.end(); ++v) {
      result[v] = places[mesh.welded[v]];
      result[v].weights = barycentric(mesh.positions[v], cornersOf(physical, result[v].tetrahedron));
    }
  });
  return result;
}

}  // namespace sinew::tools

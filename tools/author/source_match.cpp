// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/source_match.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <queue>

#include "runtime/geometry/triangle_bvh.h"

namespace sinew::tools {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Of the diagonal: the same place but for rounding; on the surface; near enough to have been moved from there.
constexpr double kSame = 1e-5;
constexpr double kOnSurface = 1e-3;
constexpr double kNear = 0.02;
// UVs that differ less than this lie on the same place of the picture.
constexpr double kSameUv = 2e-3;
constexpr double kUvOutside = 1e-4;
// Vertices that are asked whether UVs were kept.
constexpr std::size_t kUvSamples = 4000;
// A part whose vertices lie so much further off than the others' is a new one.
constexpr double kNewPart = 3e-3;
constexpr double kNewPartFactor = 5;

// Visits the triangles of a tree within `radius` of a point; `visit` returns the radius to go on with.
template <class Visit>
void visitNear(const geometry::TriangleBvh& tree, const Vector3d& point, double radius, const Visit& visit) {
  double squared = radius * radius;
  tree.tree().descendNear(point, squared, [&](std::uint32_t i) {
    const auto& c = tree.corners()[i];
    const Vector3d at = geometry::closestPointOnTriangle(point, c[0], c[1], c[2]);
    if ((at - point).squaredNorm() > squared) return;
    radius = visit(tree.order()[i], at, radius);
    squared = radius * radius;
  });
}

std::array<double, 3> barycentric(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d n = (b - a).cross(c - a);
  const double twice = n.squaredNorm();
  if (!(twice > 0)) {
    // A degenerate one: its nearest corner.
    const double da = (p - a).squaredNorm();
    const double db = (p - b).squaredNorm();
    const double dc = (p - c).squaredNorm();
    return da <= db && da <= dc ? std::array<double, 3>{1, 0, 0}
           : db <= dc           ? std::array<double, 3>{0, 1, 0}
                                : std::array<double, 3>{0, 0, 1};
  }
  std::array<double, 3> w = {(b - p).cross(c - p).dot(n) / twice, (c - p).cross(a - p).dot(n) / twice, 0};
  w[0] = std::clamp(w[0], 0.0, 1.0);
  w[1] = std::clamp(w[1], 0.0, 1.0 - w[0]);
  w[2] = 1 - w[0] - w[1];
  return w;
}

struct Place {
  std::uint32_t triangle = formats::kNone;
  std::array<double, 3> corner = {0, 0, 0};
  double distance = kInfinity;  // m
  double uv_distance = 0;       // in UV
};

class OldSource {
 public:
  explicit OldSource(const VisualMesh& mesh) : mesh_(mesh) {
    std::vector<geometry::Triangle> triangles;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) triangles.push_back(mesh.weldedTriangle(t));
    tree_ = geometry::TriangleBvh(mesh.welded_positions, triangles);
    for (const auto& c : triangles) {
      const auto& x = mesh.welded_positions;
      normals_.push_back((x[c[1]] - x[c[0]]).cross(x[c[2]] - x[c[0]]).normalized());
    }
    if (mesh.uvs.empty()) return;
    std::vector<Vector3d> flat;
    for (const auto& uv : mesh.uvs) flat.emplace_back(double(uv[0]), double(uv[1]), 0);
    uv_tree_ = geometry::TriangleBvh(flat, mesh.triangles);
    double area = 0;
    double uv_area = 0;
    for (const Triangle& t : mesh.triangles) {
      area += (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).norm();
      uv_area += (flat[t[1]] - flat[t[0]]).cross(flat[t[2]] - flat[t[0]]).norm();
    }
    metres_per_uv_ = uv_area > 0 ? std::sqrt(area / uv_area) : 0;
  }

  // The nearest place that looks the same way; with UVs, distances in the picture count as well.
  Place near(const Vector3d& x, const Vector3d& normal, const std::optional<Vector2d>& uv, double radius) const {
    Place best;
    double least = kInfinity;
    visitNear(tree_, x, radius, [&](std::uint32_t t, const Vector3d& at, double reach) {
      if (!(normals_[t].dot(normal) > 0)) return reach;
      const Place place = placeAt(t, at, x, uv);
      const double cost = std::hypot(place.distance, metres_per_uv_ * place.uv_distance);
      if (cost >= least) return reach;
      least = cost;
      best = place;
      return std::min(reach, cost);
    });
    return best;
  }

  // Of the places with this UV the one nearest to x.
  Place withUv(const Vector3d& x, const Vector2d& uv) const {
    Place best;
    visitNear(uv_tree_, {uv[0], uv[1], 0}, kUvOutside, [&](std::uint32_t t, const Vector3d& at, double reach) {
      std::array<Vector3d, 3> flat;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto& c = mesh_.uvs[mesh_.triangles[t][k]];
        flat[k] = {double(c[0]), double(c[1]), 0};
      }
      Place place;
      place.triangle = t;
      place.corner = barycentric(at, flat[0], flat[1], flat[2]);
      place.distance = (pointOf(t, place.corner) - x).norm();
      if (place.distance < best.distance) best = place;
      return reach;
    });
    return best;
  }

  Vector3d pointOf(std::uint32_t t, const std::array<double, 3>& corner) const {
    Vector3d x = Vector3d::Zero();
    for (std::size_t k = 0; k < 3; ++k) x += corner[k] * mesh_.positions[mesh_.triangles[t][k]];
    return x;
  }

 private:
  Place placeAt(std::uint32_t t, const Vector3d& at, const Vector3d& x, const std::optional<Vector2d>& uv) const {
    const Triangle& c = mesh_.triangles[t];
    Place place;
    place.triangle = t;
    place.distance = (at - x).norm();
    place.corner = barycentric(at, mesh_.positions[c[0]], mesh_.positions[c[1]], mesh_.positions[c[2]]);
    if (uv) {
      Vector2d there = Vector2d::Zero();
      for (std::size_t k = 0; k < 3; ++k) there += place.corner[k] * mesh_.uvs[c[k]].cast<double>();
      place.uv_distance = (there - *uv).norm();
    }
    return place;
  }

  const VisualMesh& mesh_;
  geometry::TriangleBvh tree_, uv_tree_;
  std::vector<Vector3d> normals_;
  double metres_per_uv_ = 0;
};

class Matcher {
 public:
  Matcher(const VisualMesh& old_mesh, const VisualMesh& new_mesh, const Similarity& to_old)
      : old_(old_mesh), new_mesh_(new_mesh), to_old_(to_old), diagonal_(old_mesh.diagonal) {
    match_.vertices.resize(new_mesh.positions.size());
    match_.uvs_kept = !old_mesh.uvs.empty() && !new_mesh.uvs.empty() && uvsKept();
  }

  SourceMatch run(const Topology& topology) {
    for (std::uint32_t v = 0; v < match_.vertices.size(); ++v) match_.vertices[v] = find(v);
    leaveNewParts(topology);
    fillNeighbours();
    double area = 0;
    double matched = 0;
    for (const Triangle& t : new_mesh_.triangles) {
      const auto& x = new_mesh_.positions;
      const double third = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).norm() / 3;
      for (const std::uint32_t v : t) {
        area += third;
        if (match_.vertices[v].triangle != formats::kNone) matched += third;
      }
    }
    match_.matched = area > 0 ? matched / area : 0;
    return std::move(match_);
  }

 private:
  Vector3d place(std::uint32_t v) const { return to_old_(new_mesh_.positions[v]); }
  Vector3d normal(std::uint32_t v) const { return to_old_.rotation * new_mesh_.normals[v].cast<double>(); }
  Vector2d uv(std::uint32_t v) const { return new_mesh_.uvs[v].cast<double>(); }

  // Whether most vertices have a UV that the old picture knows, at a place where it had it, or, where they were all
  // moved, such that edges kept their lengths.
  bool uvsKept() const {
    const std::size_t step = std::max<std::size_t>(1, new_mesh_.positions.size() / kUvSamples);
    std::size_t asked = 0;
    std::size_t hit = 0;
    std::size_t on = 0;
    std::size_t agree = 0;
    for (std::uint32_t v = 0; v < new_mesh_.positions.size(); v += std::uint32_t(step)) {
      ++asked;
      const Place by_uv = old_.withUv(place(v), uv(v));
      if (by_uv.triangle == formats::kNone) continue;
      ++hit;
      if (old_.near(place(v), normal(v), std::nullopt, 0.25 * kNear * diagonal_).triangle == formats::kNone) continue;
      ++on;
      if (by_uv.distance <= kNear * diagonal_) ++agree;
    }
    if (hit * 10 < asked * 7) return false;
    if (on * 5 >= asked) return agree * 10 >= on * 7;
    return lengthsKept();
  }

  bool lengthsKept() const {
    const std::size_t step = std::max<std::size_t>(1, new_mesh_.triangles.size() / kUvSamples);
    std::size_t asked = 0;
    std::size_t kept = 0;
    for (std::size_t t = 0; t < new_mesh_.triangles.size(); t += step) {
      const Triangle& c = new_mesh_.triangles[t];
      const Place a = old_.withUv(place(c[0]), uv(c[0]));
      const Place b = old_.withUv(place(c[1]), uv(c[1]));
      if (a.triangle == formats::kNone || b.triangle == formats::kNone) continue;
      const double now = (place(c[1]) - place(c[0])).norm();
      const double then = (old_.pointOf(b.triangle, b.corner) - old_.pointOf(a.triangle, a.corner)).norm();
      ++asked;
      if (now < 1.5 * then && then < 1.5 * now) ++kept;
    }
    return asked > 0 && kept * 10 >= asked * 7;
  }

  SourceMatch::Vertex find(std::uint32_t v) const {
    const Vector3d x = place(v);
    const std::optional<Vector2d> own_uv = match_.uvs_kept ? std::optional(uv(v)) : std::nullopt;
    // First within what a rounding moves it, so that one that stayed costs little.
    Place near = old_.near(x, normal(v), own_uv, kSame * diagonal_);
    if (near.triangle == formats::kNone || near.uv_distance > kSameUv) {
      const Place wide = old_.near(x, normal(v), own_uv, kNear * diagonal_);
      if (wide.triangle != formats::kNone) near = wide;
    }
    const bool same = near.distance <= kSame * diagonal_ && near.uv_distance <= kSameUv;
    if (own_uv && !same) {
      // One that was moved a little kept its UV; further off it counts where nothing else is.
      const Place by_uv = old_.withUv(x, *own_uv);
      const bool nothing_else = near.triangle == formats::kNone ||
                                (near.uv_distance > 10 * kSameUv && near.distance > kOnSurface * diagonal_);
      if (by_uv.triangle != formats::kNone && (nothing_else || by_uv.distance <= kNear * diagonal_)) {
        return {MatchRule::uv, by_uv.triangle, by_uv.corner, by_uv.distance, formats::kNone};
      }
    }
    if (near.triangle == formats::kNone) return {};
    return {near.distance <= kSame * diagonal_ ? MatchRule::same : MatchRule::position, near.triangle, near.corner,
            near.distance, formats::kNone};
  }

  // Glasses on a face are near it, and no part of it.
  void leaveNewParts(const Topology& topology) {
    std::vector<double> all;
    std::vector<std::vector<double>> of_part(topology.parts.size());
    std::vector<std::uint32_t> part(match_.vertices.size(), formats::kNone);
    for (std::size_t t = 0; t < new_mesh_.triangles.size(); ++t) {
      if (topology.part_of_triangle[t] == formats::kNone) continue;
      for (const std::uint32_t v : new_mesh_.triangles[t]) part[v] = topology.part_of_triangle[t];
    }
    const auto distance = [&](std::uint32_t v) {
      const SourceMatch::Vertex& m = match_.vertices[v];
      return m.rule == MatchRule::uv ? 0 : m.triangle == formats::kNone ? kNear * diagonal_ : m.distance;
    };
    for (std::uint32_t v = 0; v < part.size(); ++v) {
      if (part[v] == formats::kNone) continue;
      all.push_back(distance(v));
      of_part[part[v]].push_back(all.back());
    }
    const auto median = [](std::vector<double>& values) {
      if (values.empty()) return 0.0;
      const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
      std::nth_element(values.begin(), middle, values.end());
      return *middle;
    };
    const double limit = std::max(kNewPart * diagonal_, kNewPartFactor * median(all));
    std::vector<std::uint8_t> is_new(of_part.size(), 0);
    for (std::size_t p = 0; p < of_part.size(); ++p) is_new[p] = median(of_part[p]) > limit ? 1 : 0;
    for (std::uint32_t v = 0; v < part.size(); ++v) {
      if (part[v] != formats::kNone && is_new[part[v]] != 0) match_.vertices[v] = {};
    }
  }

  void fillNeighbours() {
    const std::size_t points = new_mesh_.welded_positions.size();
    std::vector<std::uint32_t> vertex_of(points, formats::kNone);
    for (std::uint32_t v = 0; v < match_.vertices.size(); ++v) {
      if (match_.vertices[v].triangle != formats::kNone) vertex_of[new_mesh_.welded[v]] = v;
    }
    std::vector<std::vector<std::uint32_t>> edges(points);
    for (std::size_t t = 0; t < new_mesh_.triangles.size(); ++t) {
      const Triangle c = new_mesh_.weldedTriangle(t);
      for (std::size_t k = 0; k < 3; ++k) {
        edges[c[k]].push_back(c[(k + 1) % 3]);
        edges[c[(k + 1) % 3]].push_back(c[k]);
      }
    }
    using Entry = std::pair<double, std::uint32_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    std::vector<double> distance(points, kInfinity);
    for (std::uint32_t p = 0; p < points; ++p) {
      if (vertex_of[p] == formats::kNone) continue;
      distance[p] = 0;
      queue.emplace(0.0, p);
    }
    while (!queue.empty()) {
      const auto [d, p] = queue.top();
      queue.pop();
      if (d > distance[p]) continue;
      for (const std::uint32_t q : edges[p]) {
        const double next = d + (new_mesh_.welded_positions[q] - new_mesh_.welded_positions[p]).norm();
        if (next >= distance[q]) continue;
        distance[q] = next;
        vertex_of[q] = vertex_of[p];
        queue.emplace(next, q);
      }
    }
    for (std::uint32_t v = 0; v < match_.vertices.size(); ++v) {
      SourceMatch::Vertex& m = match_.vertices[v];
      if (m.triangle != formats::kNone || vertex_of[new_mesh_.welded[v]] == formats::kNone) continue;
      m.rule = MatchRule::neighbour;
      m.neighbour = vertex_of[new_mesh_.welded[v]];
    }
  }

  OldSource old_;
  const VisualMesh& new_mesh_;
  const Similarity& to_old_;
  double diagonal_;
  SourceMatch match_;
};

}  // namespace

const char* matchRuleName(MatchRule rule) {
  constexpr std::array<const char*, kMatchRules> kNames = {"same", "position", "uv", "neighbour", "none"};
  return kNames[std::size_t(rule)];
}

std::vector<double> SourceMatch::carry(const std::vector<double>& old_weights, const VisualMesh& old_mesh) const {
  std::vector<double> weights(vertices.size(), 0);
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const Vertex& m = vertices[v].neighbour == formats::kNone ? vertices[v] : vertices[vertices[v].neighbour];
    if (m.triangle == formats::kNone) continue;
    for (std::size_t k = 0; k < 3; ++k) weights[v] += m.corner[k] * old_weights[old_mesh.triangles[m.triangle][k]];
  }
  return weights;
}

std::vector<std::pair<Vector3d, Vector3d>> pairsByUv(const VisualMesh& old_mesh, const VisualMesh& new_mesh) {
  std::vector<std::pair<Vector3d, Vector3d>> pairs;
  if (old_mesh.uvs.empty() || new_mesh.uvs.empty()) return pairs;
  const OldSource old(old_mesh);
  const std::size_t step = std::max<std::size_t>(1, new_mesh.positions.size() / kUvSamples);
  for (std::size_t v = 0; v < new_mesh.positions.size(); v += step) {
    const Place at = old.withUv(new_mesh.positions[v], new_mesh.uvs[v].cast<double>());
    if (at.triangle != formats::kNone) pairs.emplace_back(old.pointOf(at.triangle, at.corner), new_mesh.positions[v]);
  }
  if (2 * pairs.size() * step < new_mesh.positions.size()) pairs.clear();
  return pairs;
}

SourceMatch matchSources(const VisualMesh& old_mesh, const VisualMesh& new_mesh, const Topology& new_topology,
                         const Similarity& to_old) {
  return Matcher(old_mesh, new_mesh, to_old).run(new_topology);
}

}  // namespace sinew::tools

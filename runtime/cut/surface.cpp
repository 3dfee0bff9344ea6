// SPDX-License-Identifier: MIT
#include "runtime/cut/surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <unordered_map>

namespace sinew::cutting {
namespace {

std::uint64_t keyOf(const std::array<std::uint32_t, 2>& edge) {
  return pairKey(std::min(edge[0], edge[1]), std::max(edge[0], edge[1]));
}

class Clip {
 public:
  Clip(const formats::PackageView& package, const Sides& sides) : package_(package), sides_(sides) {
    count_ = std::uint32_t(package.visualPositions().size());
    node_of_point_.assign(sides.face.size(), formats::kNone);
    const auto triangles = package.visualTriangles();
    surface_.fragments.reserve(triangles.size() + triangles.size() / 8);
    for (std::uint32_t t = 0; t < triangles.size(); ++t) clip(triangles[t], t);
    joinRim();
  }

  Surface take() { return std::move(surface_); }

 private:
  Side sideOf(std::uint32_t v) const { return sides_.visual_side[v]; }

  void clip(const formats::Triangle& corner, std::uint32_t triangle) {
    int above = 0, below = 0;
    for (const std::uint32_t v : corner) {
      above += sideOf(v) > 0 ? 1 : 0;
      below += sideOf(v) < 0 ? 1 : 0;
    }
    if (above == 0 || below == 0) {
      Side side = above > 0 ? Side(1) : Side(-1);
      if (above + below == 0) {
        const Vector3d &a = sides_.visual_at[corner[0]], &b = sides_.visual_at[corner[1]],
                       &c = sides_.visual_at[corner[2]];
        side = (b - a).cross(c - a).dot(sides_.plane.normal) >= 0 ? Side(-1) : Side(1);
      }
      surface_.fragments.push_back({corner, triangle, side});
      if (above + below < 2) addEdges(std::array<std::uint32_t, 3>(corner), 3, side);
      return;
    }
    std::array<std::array<std::uint32_t, 4>, 2> polygon = {};
    std::array<std::size_t, 2> corners = {};
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t v = corner[i], next = corner[(i + 1) % 3];
      for (const Side side : kSides) {
        if (sideOf(v) != -side) polygon[placeOf(side)][corners[placeOf(side)]++] = v;
      }
      if (sideOf(v) * sideOf(next) < 0) {
        const std::uint32_t p = vertexBetween(v, next);
        for (std::size_t s = 0; s < 2; ++s) polygon[s][corners[s]++] = p;
      }
    }
    for (const Side side : kSides) {
      const auto& p = polygon[placeOf(side)];
      const std::size_t n = corners[placeOf(side)];
      if (n == 3) {
        surface_.fragments.push_back({{p[0], p[1], p[2]}, triangle, side});
      } else if ((restOf(p[0]) - restOf(p[2])).squaredNorm() <= (restOf(p[1]) - restOf(p[3])).squaredNorm()) {
        surface_.fragments.push_back({{p[0], p[1], p[2]}, triangle, side});
        surface_.fragments.push_back({{p[0], p[2], p[3]}, triangle, side});
      } else {
        surface_.fragments.push_back({{p[0], p[1], p[3]}, triangle, side});
        surface_.fragments.push_back({{p[1], p[2], p[3]}, triangle, side});
      }
      addEdges(p, n, side);
    }
  }

  Vector3d restOf(std::uint32_t v) const {
    return v < count_ ? asVector(package_.visualPositions()[v])
                      : surface_.nodes[surface_.vertices[v - count_].node].rest;
  }

  /// The sides of a polygon that lie on the plane.
  template <std::size_t kMost>
  void addEdges(const std::array<std::uint32_t, kMost>& polygon, std::size_t n, Side side) {
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint32_t u = polygon[i], v = polygon[(i + 1) % n];
      if ((u < count_ && sideOf(u) != 0) || (v < count_ && sideOf(v) != 0)) continue;
      const std::uint32_t from = nodeOf(u), to = nodeOf(v);
      if (from == to) continue;
      // A rim above is one below too, the other way round.
      if (side < 0) surface_.rim.push_back({to, from});
      surface_.touching.push_back({std::min(from, to), std::max(from, to)});
    }
  }

  std::uint32_t nodeOf(std::uint32_t v) {
    if (v >= count_) return surface_.vertices[v - count_].node;
    std::uint32_t& node = node_of_point_[sides_.weld[v]];
    if (node == formats::kNone) {
      node = std::uint32_t(surface_.nodes.size());
      const std::uint32_t face = sides_.face[sides_.weld[v]];
      surface_.nodes.push_back({face, face, 0, asVector(package_.visualPositions()[face]), sides_.visual_at[face]});
    }
    return node;
  }

  std::uint32_t vertexBetween(std::uint32_t v, std::uint32_t w) {
    const std::uint32_t a = std::min(v, w), b = std::max(v, w);
    const auto [place, added] = vertices_.try_emplace(pairKey(a, b), std::uint32_t(surface_.vertices.size()));
    if (added) {
      const std::uint32_t low = std::min(sides_.weld[a], sides_.weld[b]),
                          high = std::max(sides_.weld[a], sides_.weld[b]);
      const auto [node, is_new] = nodes_.try_emplace(pairKey(low, high), std::uint32_t(surface_.nodes.size()));
      if (is_new) {
        Node made;
        made.a = sides_.face[low];
        made.b = sides_.face[high];
        const double from = sides_.visual_height[made.a], to = sides_.visual_height[made.b];
        made.t = std::clamp(from / (from - to), kLeastOfEdge, 1 - kLeastOfEdge);
        const Vector3d rest_a = asVector(package_.visualPositions()[made.a]),
                       rest_b = asVector(package_.visualPositions()[made.b]);
        made.rest = rest_a + made.t * (rest_b - rest_a);
        made.at = sides_.visual_at[made.a] + made.t * (sides_.visual_at[made.b] - sides_.visual_at[made.a]);
        surface_.nodes.push_back(made);
      }
      const double t = surface_.nodes[node->second].t;
      surface_.vertices.push_back({a, b, sides_.weld[a] == low ? t : 1 - t, node->second});
    }
    return count_ + place->second;
  }

  /// Edges that run both ways are inside of what is below.
  void joinRim() {
    cancelOpposite(surface_.rim);
    const auto& rim = surface_.rim;
    auto& touching = surface_.touching;
    std::sort(touching.begin(), touching.end());
    touching.erase(std::unique(touching.begin(), touching.end()), touching.end());
    // Both are in the order of their pairs.
    std::vector<std::array<std::uint32_t, 2>> others;
    auto next = rim.begin();
    for (const auto& edge : touching) {
      while (next != rim.end() && keyOf(*next) < keyOf(edge)) ++next;
      if (next == rim.end() || keyOf(*next) != keyOf(edge)) others.push_back(edge);
    }
    touching = std::move(others);
  }

  const formats::PackageView& package_;
  const Sides& sides_;
  std::uint32_t count_ = 0;
  std::vector<std::uint32_t> node_of_point_;
  std::unordered_map<std::uint64_t, std::uint32_t> nodes_, vertices_;  // by pairs: looked up only
  Surface surface_;
};

}  // namespace

void cancelOpposite(std::vector<std::array<std::uint32_t, 2>>& rim) {
  std::sort(rim.begin(), rim.end(),
            [&](const auto& a, const auto& b) { return keyOf(a) != keyOf(b) ? keyOf(a) < keyOf(b) : a[0] < b[0]; });
  std::vector<std::array<std::uint32_t, 2>> left;
  for (std::size_t i = 0; i < rim.size();) {
    std::size_t end = i;
    std::ptrdiff_t forward = 0;
    while (end < rim.size() && keyOf(rim[end]) == keyOf(rim[i])) {
      forward += rim[end][0] < rim[end][1] ? 1 : -1;
      ++end;
    }
    const std::uint32_t low = std::min(rim[i][0], rim[i][1]), high = std::max(rim[i][0], rim[i][1]);
    for (; forward > 0; --forward) left.push_back({low, high});
    for (; forward < 0; ++forward) left.push_back({high, low});
    i = end;
  }
  rim = std::move(left);
}

Surface clipSurface(const formats::PackageView& package, const Sides& sides) { return Clip(package, sides).take(); }

}  // namespace sinew::cutting

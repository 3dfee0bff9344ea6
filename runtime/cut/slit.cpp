// SPDX-License-Identifier: MIT
#include "runtime/cut/slit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace sinew::cutting {
namespace {

/// The same of nodes where the outline crosses what the plane has of a triangle, of that's length.
constexpr double kLeastOfSegment = 10 * kLeastOfEdge;
/// Nodes along the outline at most.
constexpr double kMostAlong = 2000;

/// The part of a segment within a convex outline. \return false where there is none.
bool clipToOutline(const Outline& outline, const Vector2d& p, const Vector2d& q, double& from, double& to) {
  from = 0;
  to = 1;
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector2d along = outline[(i + 1) % 4] - outline[i];
    const auto inside = [&](const Vector2d& x) {
      const Vector2d off = x - outline[i];
      return along[0] * off[1] - along[1] * off[0];
    };
    const double at_p = inside(p), at_q = inside(q);
    if (!(at_p > 0) && !(at_q > 0)) return false;
    if (!(at_p > 0)) from = std::max(from, at_p / (at_p - at_q));
    if (!(at_q > 0)) to = std::min(to, at_p / (at_p - at_q));
  }
  return to - from > 2 * kLeastOfSegment;
}

class Slit {
 public:
  Slit(const formats::PackageView& package, const Sides& sides)
      : package_(package), sides_(sides), outline_(*sides.plane.outline) {
    count_ = std::uint32_t(package.visualPositions().size());
    const auto triangles = package.visualTriangles();
    surface_.fragments.reserve(triangles.size() + triangles.size() / 8);
    for (std::uint32_t t = 0; t < triangles.size(); ++t) clip(triangles[t], t);
    cancelOpposite(surface_.rim);
  }

  Surface take() { return std::move(surface_); }

 private:
  /// Where a welded edge crosses the plane.
  struct Place {
    Node node;
    bool within = false;
    std::uint32_t number = formats::kNone;  // of the surface's nodes, once it is one
  };

  void clip(const formats::Triangle& corner, std::uint32_t triangle) {
    const auto sideOf = [&](std::size_t i) { return sides_.visual_side[corner[i]]; };
    std::size_t lone = 3;
    for (std::size_t i = 0; i < 3; ++i) {
      if (sideOf(i) != sideOf((i + 1) % 3) && sideOf(i) != sideOf((i + 2) % 3)) lone = i;
    }
    if (lone < 3) {
      const std::uint32_t a = corner[lone], b = corner[(lone + 1) % 3], c = corner[(lone + 2) % 3];
      if (open(a, b, c, triangle)) return;
    }
    surface_.fragments.push_back({corner, triangle, sideOf(lone < 3 ? lone : 0)});
  }

  /// Cuts a triangle whose first corner is alone on its side. \return false where the outline leaves it whole.
  bool open(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t triangle) {
    Place &on_b = placeOf(a, b), &on_c = placeOf(a, c);
    const Vector2d p = sides_.plane.flat(on_b.node.at), q = sides_.plane.flat(on_c.node.at);
    surface_.whole_rim.push_back({p, q});
    double from = 0, to = 1;
    if (!(on_b.within && on_c.within) && !clipToOutline(outline_, p, q, from, to)) return false;
    // Vertices along the cut, from the edge a b to the edge a c. Two tips have one between them that opens.
    std::vector<std::uint32_t> way;
    way.push_back(on_b.within ? vertexOn(a, b, on_b) : vertexWithin(a, b, c, on_b, on_c, from, true));
    if (!on_b.within && !on_c.within) way.push_back(vertexWithin(a, b, c, on_b, on_c, 0.5 * (from + to), false));
    way.push_back(on_c.within ? vertexOn(a, c, on_c) : vertexWithin(a, b, c, on_b, on_c, to, true));
    const Side side = sides_.visual_side[a];
    const auto add = [&](Side of, std::uint32_t u, std::uint32_t v, std::uint32_t w) {
      surface_.fragments.push_back({{u, v, w}, triangle, of});
    };
    for (std::size_t i = 0; i + 1 < way.size(); ++i) {
      add(side, a, way[i], way[i + 1]);
      const std::uint32_t u = nodeOf(way[i]), v = nodeOf(way[i + 1]);
      if (u == v) continue;
      surface_.rim.push_back(side > 0 ? std::array<std::uint32_t, 2>{u, v} : std::array<std::uint32_t, 2>{v, u});
    }
    if (!on_b.within) add(side, a, b, way.front());
    if (!on_c.within) add(side, a, way.back(), c);
    if (way.size() == 3) {
      add(Side(-side), way[0], b, way[1]);
      add(Side(-side), way[1], b, c);
      add(Side(-side), way[1], c, way[2]);
    } else if ((restOf(b) - restOf(way[1])).squaredNorm() <= (restOf(c) - restOf(way[0])).squaredNorm()) {
      add(Side(-side), way[0], b, way[1]);
      add(Side(-side), way[1], b, c);
    } else {
      add(Side(-side), way[0], b, c);
      add(Side(-side), way[0], c, way[1]);
    }
    return true;
  }

  Vector3d restOf(std::uint32_t v) const {
    return v < count_ ? asVector(package_.visualPositions()[v]) : surface_.nodes[nodeOf(v)].rest;
  }
  std::uint32_t nodeOf(std::uint32_t v) const { return surface_.vertices[v - count_].node; }

  Place& placeOf(std::uint32_t v, std::uint32_t w) {
    const std::uint32_t low = std::min(sides_.weld[v], sides_.weld[w]), high = std::max(sides_.weld[v], sides_.weld[w]);
    const auto [found, added] = places_.try_emplace(pairKey(low, high));
    Place& place = found->second;
    if (!added) return place;
    Node& made = place.node;
    made.a = sides_.face[low];
    made.b = sides_.face[high];
    const double from = sides_.visual_height[made.a], to = sides_.visual_height[made.b];
    made.t = std::clamp(from / (from - to), kLeastOfEdge, 1 - kLeastOfEdge);
    const Vector3d rest = asVector(package_.visualPositions()[made.a]);
    made.rest = rest + made.t * (asVector(package_.visualPositions()[made.b]) - rest);
    made.at = sides_.visual_at[made.a] + made.t * (sides_.visual_at[made.b] - sides_.visual_at[made.a]);
    place.within = isWithin(outline_, sides_.plane.flat(made.at));
    return place;
  }

  std::uint32_t vertexOn(std::uint32_t v, std::uint32_t w, Place& place) {
    const std::uint32_t a = std::min(v, w), b = std::max(v, w);
    const auto [found, added] = vertices_.try_emplace(pairKey(a, b), std::uint32_t(surface_.vertices.size()));
    if (added) {
      if (place.number == formats::kNone) {
        place.number = std::uint32_t(surface_.nodes.size());
        surface_.nodes.push_back(place.node);
      }
      const bool forward = sides_.weld[a] == sides_.weld[place.node.a];
      surface_.vertices.push_back({a, b, forward ? place.node.t : 1 - place.node.t, place.number});
    }
    return count_ + found->second;
  }

  /// A vertex within a triangle, on the way from its edge a b to its edge a c.
  std::uint32_t vertexWithin(std::uint32_t a, std::uint32_t b, std::uint32_t c, const Place& on_b, const Place& on_c,
                             double part, bool tip) {
    part = std::clamp(part, kLeastOfSegment, 1 - kLeastOfSegment);
    const auto shareFrom = [&](const Place& place) {
      return sides_.weld[a] == sides_.weld[place.node.a] ? place.node.t : 1 - place.node.t;
    };
    Node made;
    made.a = a;
    made.b = b;
    made.c = c;
    made.t = (1 - part) * shareFrom(on_b);
    made.s = part * shareFrom(on_c);
    made.rest = on_b.node.rest + part * (on_c.node.rest - on_b.node.rest);
    made.at = on_b.node.at + part * (on_c.node.at - on_b.node.at);
    made.tip = tip;
    const auto node = std::uint32_t(surface_.nodes.size());
    surface_.nodes.push_back(made);
    surface_.vertices.push_back({a, b, made.t, node, c, made.s});
    return count_ + std::uint32_t(surface_.vertices.size() - 1);
  }

  const formats::PackageView& package_;
  const Sides& sides_;
  const Outline& outline_;
  std::uint32_t count_ = 0;
  std::unordered_map<std::uint64_t, Place> places_;            // by pairs of welded points: looked up only
  std::unordered_map<std::uint64_t, std::uint32_t> vertices_;  // by pairs of visual vertices: the same
  Surface surface_;
};

/// Ways along the outline.
class End {
 public:
  End(Surface& surface, const PlaneFrame& plane, double spacing, const Locate& locate)
      : surface_(surface), plane_(plane), outline_(*plane.outline), spacing_(spacing), locate_(locate) {
    for (std::size_t i = 0; i < 4; ++i) start_[i + 1] = start_[i] + (outline_[(i + 1) % 4] - outline_[i]).norm();
    const double length = start_[4];
    if (!(spacing_ > 0)) {
      double sum = 0;
      for (const auto& [u, v] : surface.rim) sum += (surface.nodes[u].at - surface.nodes[v].at).norm();
      spacing_ = sum / double(std::max<std::size_t>(1, surface.rim.size()));
    }
    spacing_ = std::max(spacing_, length / kMostAlong);
    const std::vector<std::array<std::uint32_t, 2>> ways = waysAlong();
    for (const auto& [from, to] : ways) {
      const double first = along(from);
      double last = along(to);
      if (last < first) last += length;
      walk(from, to, first, last);
    }
    const bool ends = std::any_of(surface.nodes.begin(), surface.nodes.end(), [](const Node& n) { return n.tip; });
    if (!ends && hasAround(outline_[0])) walkAround();
  }

 private:
  /// Length along the outline to the place on it nearest to a node.
  double along(std::uint32_t node) const {
    const Vector2d p = plane_.flat(surface_.nodes[node].at);
    double nearest = 1e300, result = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      const Vector2d side = outline_[(i + 1) % 4] - outline_[i];
      const double t = std::clamp((p - outline_[i]).dot(side) / side.squaredNorm(), 0.0, 1.0);
      const double distance = (outline_[i] + t * side - p).squaredNorm();
      if (distance < nearest) nearest = distance, result = start_[i] + t * side.norm();
    }
    return result;
  }
  Vector2d placeAt(double length) const {
    length = std::fmod(length, start_[4]);
    std::size_t i = 0;
    while (i < 3 && length >= start_[i + 1]) ++i;
    return outline_[i] + (length - start_[i]) / (start_[i + 1] - start_[i]) * (outline_[(i + 1) % 4] - outline_[i]);
  }

  /// Tips where the rim leaves the outline with those where it comes in, as brackets match: the last that left first.
  std::vector<std::array<std::uint32_t, 2>> waysAlong() const {
    struct Event {
      double at;
      std::uint32_t node;
      int leaves;
    };
    std::vector<int> surplus(surface_.nodes.size(), 0);
    for (const auto& [u, v] : surface_.rim) --surplus[u], ++surplus[v];
    std::vector<Event> events;
    for (std::uint32_t n = 0; n < surplus.size(); ++n) {
      if (surface_.nodes[n].tip && surplus[n] != 0) events.push_back({along(n), n, surplus[n]});
    }
    std::stable_sort(events.begin(), events.end(), [](const Event& a, const Event& b) { return a.at < b.at; });
    std::vector<std::array<std::uint32_t, 2>> ways;
    std::vector<std::uint32_t> left;
    std::vector<char> come(surplus.size(), 0);
    for (int round = 0; round < 2; ++round) {
      for (const Event& event : events) {
        if (event.leaves > 0) {
          if (round == 0) left.push_back(event.node);
        } else if (!left.empty() && come[event.node] == 0) {
          come[event.node] = 1;
          ways.push_back({left.back(), event.node});
          left.pop_back();
        }
      }
    }
    return ways;
  }

  /// Whether the rim goes around a place: the plane ends within the body.
  bool hasAround(const Vector2d& p) const {
    bool inside = false;
    for (const auto& [u, v] : surface_.whole_rim) {
      if ((u[1] > p[1]) == (v[1] > p[1])) continue;
      inside ^= p[0] < u[0] + (p[1] - u[1]) / (v[1] - u[1]) * (v[0] - u[0]);
    }
    return inside;
  }

  std::uint32_t addNode(double at) {
    const std::optional<Interior> found = locate_(plane_.lifted(placeAt(at)), formats::kNone);
    if (!found) return formats::kNone;
    Node made;
    made.a = made.b = formats::kNone;
    made.rest = found->rest;
    made.at = found->at;
    made.tip = true;
    made.hung = found->hung;
    surface_.nodes.push_back(made);
    return std::uint32_t(surface_.nodes.size() - 1);
  }

  void walk(std::uint32_t from, std::uint32_t to, double first, double last) {
    std::vector<double> stops = {first};
    for (int turn = 0; turn < 2; ++turn) {
      for (std::size_t i = 0; i < 4; ++i) {
        const double corner = start_[i] + turn * start_[4];
        if (corner > first + 1e-3 * spacing_ && corner < last - 1e-3 * spacing_) stops.push_back(corner);
      }
    }
    stops.push_back(last);
    std::uint32_t here = from;
    const auto go = [&](std::uint32_t next) {
      if (next == formats::kNone || next == here) return;
      surface_.rim.push_back({here, next});
      here = next;
    };
    for (std::size_t s = 0; s + 1 < stops.size(); ++s) {
      if (s > 0) go(addNode(stops[s]));
      const double steps = std::round((stops[s + 1] - stops[s]) / spacing_);
      for (double i = 1; i < steps; ++i) go(addNode(stops[s] + i / steps * (stops[s + 1] - stops[s])));
    }
    go(to);
  }

  void walkAround() {
    const std::uint32_t first = addNode(0);
    if (first != formats::kNone) walk(first, first, 0, start_[4]);
  }

  Surface& surface_;
  const PlaneFrame& plane_;
  const Outline& outline_;
  double spacing_;
  const Locate& locate_;
  std::array<double, 5> start_ = {};  // of the sides, m along the outline
};

}  // namespace

Surface clipSlit(const formats::PackageView& package, const Sides& sides) { return Slit(package, sides).take(); }

void endSlit(Surface& surface, const PlaneFrame& plane, double spacing, const Locate& locate) {
  if (!surface.rim.empty()) End(surface, plane, std::isfinite(spacing) ? spacing : 0, locate);
}

}  // namespace sinew::cutting

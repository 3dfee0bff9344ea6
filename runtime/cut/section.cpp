// SPDX-License-Identifier: MIT
#include "runtime/cut/section.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>

#include "runtime/cut/triangulate.h"

namespace sinew::cutting {
namespace {

/// Points inside are at least so far from the rim, of their spacing, and about so many in a polygon at most; enough of
/// them are some times a body's contact points, of which no more press, and of its functions, which bend it.
constexpr double kFromRim = 0.6;
constexpr double kMostInterior = 4000, kEnoughInterior = 1000;
/// A loop may lead so far over gaps of the surface, of its length: what is more open is a sheet.
constexpr double kMostOpen = 0.35;
/// Gaps that are bridged at most: with more of them the surface is none.
constexpr std::size_t kMostGaps = 1000;

struct Loop {
  std::vector<std::uint32_t> nodes;
  std::uint32_t piece = 0;
  double area = 0;  // m^2, positive where it turns counter-clockwise
};

class Closing {
 public:
  Closing(const Surface& surface, std::span<const std::uint32_t> piece_of, const PlaneFrame& plane, double spacing,
          const Locate& locate)
      : surface_(surface), piece_of_(piece_of), plane_(plane), locate_(locate) {
    place();
    spacing_ = spacing > 0 ? spacing : meanEdge();
    most_interior_ = spacing > 0 ? kMostInterior : kEnoughInterior;
    walk();
    group();
  }

  Section take() { return std::move(section_); }

 private:
  GridPoint snapped(const Eigen::Vector2d& p) const {
    const Eigen::Vector2d q = (p - low_) * scale_;
    return {std::int64_t(std::llround(q[0])), std::int64_t(std::llround(q[1]))};
  }

  void place() {
    flat_.reserve(surface_.nodes.size());
    for (const Node& node : surface_.nodes) flat_.push_back(plane_.flat(node.at));
    for (const auto& [u, v] : surface_.rim) {
      if (surface_.nodes[u].tip && surface_.nodes[v].tip) tip_rim_.push_back({std::min(u, v), std::max(u, v)});
    }
    std::sort(tip_rim_.begin(), tip_rim_.end());
    Eigen::Vector2d high = Eigen::Vector2d::Constant(-1e300);
    low_ = -high;
    for (const auto& edge : surface_.rim) {
      for (const std::uint32_t n : edge) {
        low_ = low_.cwiseMin(flat_[n]);
        high = high.cwiseMax(flat_[n]);
      }
    }
    const double size = surface_.rim.empty() ? 1 : (high - low_).maxCoeff();
    scale_ = size > 0 ? double(kGrid) / size : 1;
    grid_.resize(flat_.size());
    if (surface_.rim.empty()) return;
    for (const auto& edge : surface_.rim) {
      for (const std::uint32_t n : edge) grid_[n] = snapped(flat_[n]);
    }
  }

  double meanEdge() const {
    double sum = 0;
    for (const auto& [u, v] : surface_.rim) sum += (flat_[u] - flat_[v]).norm();
    return surface_.rim.empty() ? 1 : sum / double(surface_.rim.size());
  }

  /// Loops from edge to edge. Where several leave a node the sharpest left one goes on: loops touch there and do not
  /// cross. A way back to a node of the way so far is a loop of its own.
  void walk() {
    std::vector<std::vector<std::uint32_t>> leaving(surface_.nodes.size());
    for (const auto& [u, v] : surface_.rim) leaving[u].push_back(v);
    for (const auto& [u, v] : bridges()) {
      leaving[u].push_back(v);
      bridged_.push_back({u, v});
    }
    std::sort(bridged_.begin(), bridged_.end());
    std::vector<std::size_t> on_way(surface_.nodes.size(), 0);  // place in the way, from 1
    for (const auto& edge : surface_.rim) {
      const std::uint32_t first = edge[0];
      std::vector<std::uint32_t> way = {first};
      on_way[first] = 1;
      while (way.size() > 1 || !leaving[first].empty()) {
        const std::uint32_t here = way.back();
        if (leaving[here].empty()) {
          // The way ends: the surface is open.
          on_way[here] = 0;
          way.pop_back();
          ++section_.open;
          continue;
        }
        const std::uint32_t next = takeNext(leaving[here], way);
        if (on_way[next] == 0) {
          way.push_back(next);
          on_way[next] = way.size();
          continue;
        }
        Loop loop;
        loop.nodes.assign(way.begin() + std::ptrdiff_t(on_way[next]) - 1, way.end());
        way.resize(on_way[next]);
        for (std::size_t i = 1; i < loop.nodes.size(); ++i) on_way[loop.nodes[i]] = 0;
        addLoop(std::move(loop));
      }
      on_way[first] = 0;
    }
  }

  /// Ways over gaps of the surface: from each node where the rim ends to one of its piece where it begins, the nearest
  /// first.
  std::vector<std::array<std::uint32_t, 2>> bridges() const {
    std::vector<int> surplus(surface_.nodes.size(), 0);  // leaving edges less coming ones
    for (const auto& [u, v] : surface_.rim) ++surplus[u], --surplus[v];
    std::vector<std::uint32_t> ends, starts;
    for (std::uint32_t n = 0; n < surplus.size(); ++n) {
      for (int i = surplus[n]; i < 0; ++i) ends.push_back(n);
      for (int i = surplus[n]; i > 0; --i) starts.push_back(n);
    }
    std::vector<std::array<std::uint32_t, 2>> found;
    if (ends.size() > kMostGaps) return found;
    struct Gap {
      double length;
      std::uint32_t end, start;  // of the lists
    };
    std::vector<Gap> gaps;
    for (std::uint32_t e = 0; e < ends.size(); ++e) {
      for (std::uint32_t s = 0; s < starts.size(); ++s) {
        if (piece_of_[ends[e]] != piece_of_[starts[s]]) continue;
        gaps.push_back({(flat_[ends[e]] - flat_[starts[s]]).squaredNorm(), e, s});
      }
    }
    std::stable_sort(gaps.begin(), gaps.end(), [](const Gap& a, const Gap& b) { return a.length < b.length; });
    std::vector<char> has_start(ends.size(), 0), has_end(starts.size(), 0);
    for (const Gap& gap : gaps) {
      if (has_start[gap.end] != 0 || has_end[gap.start] != 0) continue;
      has_start[gap.end] = has_end[gap.start] = 1;
      found.push_back({ends[gap.end], starts[gap.start]});
    }
    return found;
  }

  /// Counts what is open of a loop. \return whether it is closed well enough.
  bool takeOpen(const Loop& loop) {
    if (bridged_.empty()) return true;
    double length = 0, over = 0;
    std::size_t steps = 0;
    for (std::size_t i = 0; i < loop.nodes.size(); ++i) {
      const std::uint32_t u = loop.nodes[i], v = loop.nodes[(i + 1) % loop.nodes.size()];
      const double step = (flat_[u] - flat_[v]).norm();
      length += step;
      if (!std::binary_search(bridged_.begin(), bridged_.end(), std::array<std::uint32_t, 2>{u, v})) continue;
      over += step;
      ++steps;
    }
    const bool closed = over <= kMostOpen * length;
    section_.open += closed ? steps : loop.nodes.size() - steps;
    return closed;
  }

  std::uint32_t takeNext(std::vector<std::uint32_t>& choices, const std::vector<std::uint32_t>& way) const {
    std::size_t best = 0;
    if (choices.size() > 1 && way.size() > 1) {
      const Eigen::Vector2d in = flat_[way.back()] - flat_[way[way.size() - 2]];
      double best_angle = -10;
      for (std::size_t i = 0; i < choices.size(); ++i) {
        const Eigen::Vector2d out = flat_[choices[i]] - flat_[way.back()];
        const double angle = std::atan2(in[0] * out[1] - in[1] * out[0], in.dot(out));
        if (angle > best_angle) best_angle = angle, best = i;
      }
    }
    const std::uint32_t next = choices[best];
    choices.erase(choices.begin() + std::ptrdiff_t(best));
    return next;
  }

  void addLoop(Loop loop) {
    if (!takeOpen(loop) || loop.nodes.size() < 3) return;
    loop.piece = piece_of_[loop.nodes[0]];
    const Eigen::Vector2d origin = flat_[loop.nodes[0]];
    for (std::size_t i = 0; i < loop.nodes.size(); ++i) {
      const Eigen::Vector2d a = flat_[loop.nodes[i]] - origin,
                            b = flat_[loop.nodes[(i + 1) % loop.nodes.size()]] - origin;
      loop.area += 0.5 * (a[0] * b[1] - a[1] * b[0]);
    }
    loops_.push_back(std::move(loop));
  }

  /// Whether a place is within a loop, by crossings of a ray; exact.
  bool isInside(const Loop& loop, const GridPoint& p) const {
    bool inside = false;
    for (std::size_t i = 0; i < loop.nodes.size(); ++i) {
      const GridPoint &a = grid_[loop.nodes[i]], &b = grid_[loop.nodes[(i + 1) % loop.nodes.size()]];
      if ((a.y > p.y) == (b.y > p.y)) continue;
      const std::int64_t turn = turnOf(a, b, p);
      inside ^= b.y > a.y ? turn > 0 : turn < 0;
    }
    return inside;
  }

  bool isAround(const Loop& outer, const Loop& hole) const {
    // Most of the hole's nodes: some may be nodes of the outer loop too.
    std::size_t in = 0, asked = 0;
    const std::size_t stride = std::max<std::size_t>(1, hole.nodes.size() / 7);
    for (std::size_t i = 0; i < hole.nodes.size(); i += stride, ++asked)
      in += isInside(outer, grid_[hole.nodes[i]]) ? 1U : 0U;
    return 2 * in > asked;
  }

  /// Each hole belongs to the smallest loop of its piece around it.
  void group() {
    std::vector<std::vector<std::size_t>> holes(loops_.size());
    std::vector<char> alone(loops_.size(), 0);
    for (std::size_t h = 0; h < loops_.size(); ++h) {
      if (loops_[h].area >= 0) continue;
      std::size_t best = loops_.size();
      for (std::size_t o = 0; o < loops_.size(); ++o) {
        if (loops_[o].piece != loops_[h].piece || !(loops_[o].area > -loops_[h].area) ||
            (best < loops_.size() && loops_[o].area >= loops_[best].area))
          continue;
        if (isAround(loops_[o], loops_[h])) best = o;
      }
      if (best < loops_.size()) {
        holes[best].push_back(h);
      } else {
        alone[h] = 1;
      }
    }
    for (std::size_t o = 0; o < loops_.size(); ++o) {
      if (loops_[o].area >= 0) {
        addPolygon(o, holes[o]);
      } else if (alone[o] != 0) {
        // A surface that is inside out: its section is turned as it is.
        addEars(o);
      }
    }
  }

  void addEars(std::size_t l) {
    Polygon polygon;
    polygon.nodes = loops_[l].nodes;
    polygon.area = std::abs(loops_[l].area);
    polygon.piece = loops_[l].piece;
    polygon.plain = false;
    std::vector<GridPoint> points;
    std::vector<std::uint32_t> order;
    for (const std::uint32_t n : polygon.nodes) {
      order.push_back(std::uint32_t(points.size()));
      points.push_back(grid_[n]);
    }
    clipEars(points, order, loops_[l].area >= 0 ? 1 : -1, polygon.triangles);
    section_.polygons.push_back(std::move(polygon));
  }

  void addPolygon(std::size_t outer, const std::vector<std::size_t>& holes) {
    Polygon polygon;
    polygon.area = loops_[outer].area;
    polygon.piece = loops_[outer].piece;
    std::vector<std::size_t> all = {outer};
    all.insert(all.end(), holes.begin(), holes.end());
    std::vector<GridPoint> points;    // of the triangulation
    std::vector<std::uint32_t> name;  // of these: place in polygon.nodes, then interior
    std::vector<std::array<std::uint32_t, 2>> edges;
    std::vector<std::array<std::uint32_t, 3>> folded;           // what joins nodes that the grid has in one place
    std::unordered_map<std::uint32_t, std::uint32_t> place_of;  // of a node
    std::map<std::pair<std::int64_t, std::int64_t>, std::uint32_t> at;
    bool sound = true;
    const auto placeOfNode = [&](std::uint32_t node) {
      const auto [found, added] = place_of.try_emplace(node, std::uint32_t(polygon.nodes.size()));
      if (added) polygon.nodes.push_back(node);
      return found->second;
    };
    for (const std::size_t l : all) {
      if (l != outer) polygon.area += loops_[l].area;
      const std::vector<std::uint32_t>& nodes = loops_[l].nodes;
      // Runs of nodes in one place of the grid count as the first of them.
      std::size_t start = 0;
      while (start < nodes.size() && grid_[nodes[start]] == grid_[nodes[(start + nodes.size() - 1) % nodes.size()]])
        ++start;
      if (start == nodes.size()) {
        sound = false;
        break;
      }
      std::vector<std::uint32_t> kept;
      std::vector<std::array<std::uint32_t, 2>> folds;  // point, and the place of a node that lies there too
      for (std::size_t i = 0; i < nodes.size(); ++i) {
        const std::uint32_t node = nodes[(start + i) % nodes.size()];
        const std::uint32_t place = placeOfNode(node);
        if (!kept.empty() && grid_[polygon.nodes[name[kept.back()]]] == grid_[node]) {
          folds.push_back({kept.back(), place});
          continue;
        }
        const GridPoint& p = grid_[node];
        const auto [found, added] = at.try_emplace({p.x, p.y}, std::uint32_t(points.size()));
        if (added) {
          points.push_back(p);
          name.push_back(place);
        } else if (name[found->second] != place) {
          sound = false;
        }
        kept.push_back(found->second);
      }
      if (kept.size() < 3) sound = false;
      for (std::size_t i = 0; i < kept.size(); ++i) edges.push_back({kept[i], kept[(i + 1) % kept.size()]});
      fold(kept, name, folds, folded);
    }
    std::vector<Corners> triangles;
    if (sound) {
      addInterior(all, polygon, points, name);
      sound = triangulate(points, edges, triangles);
    }
    if (!sound) {
      for (const std::size_t l : all) addEars(l);
      return;
    }
    for (const Corners& t : triangles) polygon.triangles.push_back({name[t[0]], name[t[1]], name[t[2]]});
    for (const auto& t : folded) polygon.triangles.push_back(t);
    splitTouching(polygon);
    section_.polygons.push_back(std::move(polygon));
  }

  /// Nodes b, c, ... that lie where a does, between a and the next n: the edge a n of the triangulation becomes
  /// a b, b c, .. n by flat triangles.
  static void fold(const std::vector<std::uint32_t>& kept, const std::vector<std::uint32_t>& name,
                   const std::vector<std::array<std::uint32_t, 2>>& folds,
                   std::vector<std::array<std::uint32_t, 3>>& folded) {
    if (folds.empty()) return;
    for (std::size_t i = 0; i < kept.size(); ++i) {
      const std::uint32_t next = name[kept[(i + 1) % kept.size()]];
      std::uint32_t last = name[kept[i]];
      for (const auto& [point, place] : folds) {
        if (point != kept[i]) continue;
        // The triangulation has last -> next inside; outside of it: last -> place -> next.
        folded.push_back({last, place, next});
        last = place;
      }
    }
  }

  /// Edges across the polygon that the surface has too get a point in their middle.
  void splitTouching(Polygon& polygon) const {
    if (surface_.touching.empty() && tip_rim_.empty()) return;
    const auto touches = [&](std::uint32_t u, std::uint32_t v) {
      if (u >= polygon.nodes.size() || v >= polygon.nodes.size()) return false;
      const std::uint32_t a = polygon.nodes[u], b = polygon.nodes[v];
      const std::array<std::uint32_t, 2> edge = {std::min(a, b), std::max(a, b)};
      // Both faces of a slit have its tips.
      if (surface_.nodes[a].tip && surface_.nodes[b].tip) {
        return !std::binary_search(tip_rim_.begin(), tip_rim_.end(), edge);
      }
      return std::binary_search(surface_.touching.begin(), surface_.touching.end(), edge);
    };
    std::map<std::array<std::uint32_t, 2>, std::uint32_t> middles;
    for (std::size_t t = 0; t < polygon.triangles.size(); ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::array<std::uint32_t, 3> old = polygon.triangles[t];
        const std::uint32_t u = old[k], v = old[(k + 1) % 3], w = old[(k + 2) % 3];
        if (!touches(u, v)) continue;
        const auto [found, added] = middles.try_emplace({std::min(u, v), std::max(u, v)}, formats::kNone);
        if (added) {
          const Vector3d &from = surface_.nodes[polygon.nodes[u]].at, &to = surface_.nodes[polygon.nodes[v]].at;
          // The middle, or else what of the edge lies in a tetrahedron: a bent surface may leave them.
          for (const double share : {0.5, 0.25, 0.75, 0.06, 0.94}) {
            const std::optional<Interior> middle = locate_(from + share * (to - from), polygon.piece);
            if (!middle) continue;
            found->second = std::uint32_t(polygon.nodes.size() + polygon.interior.size());
            polygon.interior.push_back(*middle);
            break;
          }
        }
        if (found->second == formats::kNone) continue;
        polygon.triangles[t] = {u, found->second, w};
        polygon.triangles.push_back({found->second, v, w});
        k = std::size_t(-1);  // the corner is another one: its sides anew
      }
    }
  }

  /// Points of a hexagonal grid that lie within the loops and away from their edges.
  void addInterior(const std::vector<std::size_t>& all, Polygon& polygon, std::vector<GridPoint>& points,
                   std::vector<std::uint32_t>& name) {
    if (!std::isfinite(spacing_)) return;
    const double h = std::max(spacing_, std::sqrt(std::max(0.0, polygon.area) / most_interior_));
    if (!(h * scale_ > 64) || !(polygon.area > h * h)) return;
    Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300), high = -low;
    std::vector<std::array<std::uint32_t, 2>> edges;
    for (const std::size_t l : all) {
      const auto& nodes = loops_[l].nodes;
      for (std::size_t i = 0; i < nodes.size(); ++i) {
        edges.push_back({nodes[i], nodes[(i + 1) % nodes.size()]});
        low = low.cwiseMin(flat_[nodes[i]]);
        high = high.cwiseMax(flat_[nodes[i]]);
      }
    }
    // Cells of width h list the edges that come near.
    const double reach = kFromRim * h;
    const Eigen::Vector2d extent = (high - low) / h;
    const std::size_t columns = std::size_t(extent[0]) + 1, rows = std::size_t(extent[1]) + 1;
    std::vector<std::vector<std::uint32_t>> near(columns * rows);
    const auto cell = [&](double value, std::size_t count) {
      return std::size_t(std::clamp(value / h, 0.0, double(count) - 1));
    };
    for (std::uint32_t e = 0; e < edges.size(); ++e) {
      const Eigen::Vector2d a = flat_[edges[e][0]] - low, b = flat_[edges[e][1]] - low;
      const Eigen::Vector2d from = a.cwiseMin(b).array() - reach, to = a.cwiseMax(b).array() + reach;
      for (std::size_t row = cell(from[1], rows); row <= cell(to[1], rows); ++row) {
        for (std::size_t column = cell(from[0], columns); column <= cell(to[0], columns); ++column) {
          near[row * columns + column].push_back(e);
        }
      }
    }
    const double pitch = h * std::sqrt(0.75);
    std::vector<double> crossings;
    std::size_t line = 0;
    for (double y = low[1] + 0.5 * pitch; y < high[1]; y += pitch, ++line) {
      crossings.clear();
      for (const auto& [u, v] : edges) {
        const Eigen::Vector2d &a = flat_[u], &b = flat_[v];
        if ((a[1] > y) != (b[1] > y)) crossings.push_back(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
      }
      std::sort(crossings.begin(), crossings.end());
      for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
        const double shift = low[0] + (line % 2 == 0 ? 0.25 : 0.75) * h;
        for (double x = shift + std::ceil((crossings[i] - shift) / h) * h; x < crossings[i + 1]; x += h) {
          addInteriorPoint({x, y}, edges, near[cell(y - low[1], rows) * columns + cell(x - low[0], columns)], reach,
                           polygon, points, name);
        }
      }
    }
  }

  void addInteriorPoint(const Eigen::Vector2d& p, const std::vector<std::array<std::uint32_t, 2>>& edges,
                        const std::vector<std::uint32_t>& near, double reach, Polygon& polygon,
                        std::vector<GridPoint>& points, std::vector<std::uint32_t>& name) {
    for (const std::uint32_t e : near) {
      const Eigen::Vector2d a = flat_[edges[e][0]], along = flat_[edges[e][1]] - a;
      const double t = std::clamp((p - a).dot(along) / std::max(1e-300, along.squaredNorm()), 0.0, 1.0);
      if ((p - a - t * along).squaredNorm() < reach * reach) return;
    }
    const std::optional<Interior> found = locate_(plane_.lifted(p), polygon.piece);
    if (!found) return;
    name.push_back(std::uint32_t(polygon.nodes.size() + polygon.interior.size()));
    polygon.interior.push_back(*found);
    points.push_back(snapped(p));
  }

  const Surface& surface_;
  std::span<const std::uint32_t> piece_of_;  // of nodes
  const PlaneFrame& plane_;
  const Locate& locate_;
  std::vector<Eigen::Vector2d> flat_;  // of nodes: places in the plane, m
  std::vector<GridPoint> grid_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  double scale_ = 1, spacing_ = 1, most_interior_ = 0;
  std::vector<std::array<std::uint32_t, 2>> bridged_;  // directed edges over gaps, ascending
  std::vector<std::array<std::uint32_t, 2>> tip_rim_;  // edges of the rim between tips, the lower first, ascending
  std::vector<Loop> loops_;
  Section section_;
};

}  // namespace

Section closeSection(const Surface& surface, std::span<const std::uint32_t> piece_of, const PlaneFrame& plane,
                     double spacing, const Locate& locate) {
  return Closing(surface, piece_of, plane, spacing, locate).take();
}

}  // namespace sinew::cutting

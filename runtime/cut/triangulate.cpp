// SPDX-License-Identifier: MIT
#include "runtime/cut/triangulate.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <initializer_list>
#include <limits>
#include <numeric>

#include "sinew/formats/sections.h"

namespace sinew::cutting {
namespace {

__extension__ using Wide = __int128;
/// Loops of more points are cut by the shape of ears alone, or the time would grow with the cube.
constexpr std::size_t kMostTested = 200;

/// Share of the sum of their sizes that six products of four numbers are at most off in doubles (differences are
/// exact).
constexpr double kRoundingOfTurns = 1e-14;

/// Whether d lies within the circle through a, b, c (counter-clockwise): in doubles where these are sure, else exactly.
bool isInCircle(const GridPoint& a, const GridPoint& b, const GridPoint& c, const GridPoint& d) {
  const std::int64_t ax = a.x - d.x, ay = a.y - d.y, bx = b.x - d.x, by = b.y - d.y, cx = c.x - d.x, cy = c.y - d.y;
  const auto squared = [](std::int64_t x, std::int64_t y) { return double(x) * double(x) + double(y) * double(y); };
  const double bc = double(bx) * double(cy), cb = double(by) * double(cx), ac = double(ax) * double(cy),
               ca = double(ay) * double(cx), ab = double(ax) * double(by), ba = double(ay) * double(bx);
  const double a2 = squared(ax, ay), b2 = squared(bx, by), c2 = squared(cx, cy);
  const double about = a2 * (bc - cb) - b2 * (ac - ca) + c2 * (ab - ba);
  const double sizes =
      a2 * (std::abs(bc) + std::abs(cb)) + b2 * (std::abs(ac) + std::abs(ca)) + c2 * (std::abs(ab) + std::abs(ba));
  if (std::abs(about) > kRoundingOfTurns * sizes) return about > 0;
  const Wide aa = Wide(ax) * ax + Wide(ay) * ay, bb = Wide(bx) * bx + Wide(by) * by, cc = Wide(cx) * cx + Wide(cy) * cy;
  return aa * (Wide(bx) * cy - Wide(by) * cx) - bb * (Wide(ax) * cy - Wide(ay) * cx) +
             cc * (Wide(ax) * by - Wide(ay) * bx) >
         0;
}

class Triangulation {
 public:
  explicit Triangulation(std::span<const GridPoint> points) : points_(points.begin(), points.end()) {
    first_extra_ = std::uint32_t(points_.size());
    // A triangle around all: what it adds to a circle's test stays within 112 bits.
    points_.push_back({-3 * kGrid, -3 * kGrid});
    points_.push_back({6 * kGrid, -3 * kGrid});
    points_.push_back({kGrid / 2, 6 * kGrid});
    around_.assign(points_.size(), formats::kNone);
    triangles_.reserve(2 * points_.size() + 4);
    add({first_extra_, first_extra_ + 1, first_extra_ + 2}, {formats::kNone, formats::kNone, formats::kNone});
  }

  /// In an order in which each point is near the last.
  bool insertAll() {
    std::vector<std::uint32_t> order(first_extra_);
    std::iota(order.begin(), order.end(), 0U);
    const std::int64_t rows = 1 + std::int64_t(std::max(1.0, double(order.size()) / 8));
    const std::int64_t strip = std::max<std::int64_t>(1, kGrid / std::max<std::int64_t>(1, isqrt(rows)));
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      const GridPoint &p = points_[a], &q = points_[b];
      const std::int64_t row = p.y / strip, other = q.y / strip;
      if (row != other) return row < other;
      if (p.x != q.x) return (row % 2 == 0) == (p.x < q.x);
      return p.y != q.y ? p.y < q.y : a < b;
    });
    return std::all_of(order.begin(), order.end(), [this](std::uint32_t p) { return insert(p); });
  }

  /// Makes an edge one that no flip takes away. \return false where another one crosses it, or a point lies on it.
  bool constrain(std::uint32_t a, std::uint32_t b) {
    if (markEdge(a, b)) return true;
    std::deque<std::array<std::uint32_t, 2>> crossing;
    if (!findCrossing(a, b, crossing)) return false;
    std::vector<std::array<std::uint32_t, 2>> made;
    for (std::size_t left = 64 + 32 * crossing.size() * (1 + crossing.size()); !crossing.empty(); --left) {
      if (left == 0) return false;
      const auto [u, v] = crossing.front();
      crossing.pop_front();
      const auto [t, i] = sideOf(u, v);
      if (t == formats::kNone) return false;
      const std::uint32_t other = triangles_[t].next[i], p = triangles_[t].at[i];
      const std::uint32_t j = sideTo(other, t), q = triangles_[other].at[j];
      const std::int64_t one = turnOf(points_[p], points_[q], points_[u]);
      const std::int64_t two = turnOf(points_[p], points_[q], points_[v]);
      if (!((one > 0 && two < 0) || (one < 0 && two > 0))) {
        crossing.push_back({u, v});
        continue;
      }
      flip(t, i);
      if (p == a || p == b || q == a || q == b || !crosses(p, q, a, b)) {
        made.push_back({p, q});
      } else {
        crossing.push_back({p, q});
      }
    }
    if (!markEdge(a, b)) return false;
    restoreDelaunay(made, a, b);
    return true;
  }

  /// The triangles left of the directed constraints, grown up to constraints.
  bool collect(std::span<const std::array<std::uint32_t, 2>> edges, std::vector<Corners>& out) const {
    std::vector<char> inside(triangles_.size(), 0);
    std::vector<std::uint32_t> stack;
    for (const auto& [u, v] : edges) {
      const auto [t, i] = sideOf(u, v);
      if (t == formats::kNone) return false;
      if (inside[t] == 0) inside[t] = 1, stack.push_back(t);
    }
    while (!stack.empty()) {
      const std::uint32_t t = stack.back();
      stack.pop_back();
      for (std::uint32_t i = 0; i < 3; ++i) {
        if (triangles_[t].at[i] >= first_extra_) return false;
        const std::uint32_t other = triangles_[t].next[i];
        if (triangles_[t].fixed[i] || other == formats::kNone || inside[other] != 0) continue;
        inside[other] = 1;
        stack.push_back(other);
      }
    }
    // Triangles right of an edge must stay unreached.
    for (const auto& [u, v] : edges) {
      const auto [t, i] = sideOf(v, u);
      if (t == formats::kNone || inside[t] != 0) return false;
    }
    for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
      if (inside[t] != 0) out.push_back(triangles_[t].at);
    }
    return true;
  }

 private:
  struct Triangle {
    Corners at;
    std::array<std::uint32_t, 3> next;  // across the side that lies opposite of a corner
    std::array<bool, 3> fixed;
  };

  static std::int64_t isqrt(std::int64_t n) {
    std::int64_t root = 1;
    while ((root + 1) * (root + 1) <= n) ++root;
    return root;
  }

  std::uint32_t add(const Corners& at, const std::array<std::uint32_t, 3>& next) {
    triangles_.push_back({at, next, {false, false, false}});
    const auto t = std::uint32_t(triangles_.size() - 1);
    for (const std::uint32_t p : at) around_[p] = t;
    return t;
  }

  std::uint32_t sideTo(std::uint32_t t, std::uint32_t other) const {
    for (std::uint32_t i = 0; i < 3; ++i) {
      if (triangles_[t].next[i] == other) return i;
    }
    return 0;
  }

  void relink(std::uint32_t t, std::uint32_t from, std::uint32_t to) {
    if (t != formats::kNone) triangles_[t].next[sideTo(t, from)] = to;
  }

  std::int64_t turn(std::uint32_t a, std::uint32_t b, const GridPoint& p) const {
    return turnOf(points_[a], points_[b], p);
  }

  /// Lawson's walk, then a division into three or, on a side, four.
  bool insert(std::uint32_t p) {
    const GridPoint& at = points_[p];
    std::uint32_t t = last_;
    for (std::size_t left = 4 * triangles_.size() + 16; left > 0; --left) {
      std::uint32_t go = 3;
      for (std::uint32_t i = 0; i < 3 && go == 3; ++i) {
        if (turn(triangles_[t].at[(i + 1) % 3], triangles_[t].at[(i + 2) % 3], at) < 0) go = i;
      }
      if (go == 3) break;
      t = triangles_[t].next[go];
      if (t == formats::kNone) return false;
    }
    std::uint32_t on = 3;
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::int64_t side = turn(triangles_[t].at[(i + 1) % 3], triangles_[t].at[(i + 2) % 3], at);
      if (side < 0) return false;
      if (side == 0) {
        if (on != 3) return false;  // the same place as a corner
        on = i;
      }
    }
    on == 3 ? splitInside(t, p) : splitSide(t, on, p);
    last_ = around_[p];
    return true;
  }

  void splitInside(std::uint32_t t, std::uint32_t p) {
    const Triangle old = triangles_[t];
    const auto [a, b, c] = old.at;
    const auto t1 = std::uint32_t(triangles_.size()), t2 = t1 + 1;
    triangles_[t] = {{p, b, c}, {old.next[0], t1, t2}, {false, false, false}};
    add({p, c, a}, {old.next[1], t2, t});
    add({p, a, b}, {old.next[2], t, t1});
    relink(old.next[1], t, t1);
    relink(old.next[2], t, t2);
    for (const std::uint32_t corner : {p, b, c}) around_[corner] = t;
    legalize({t, t1, t2}, p);
  }

  void splitSide(std::uint32_t t, std::uint32_t i, std::uint32_t p) {
    const std::uint32_t other = triangles_[t].next[i];
    const Triangle one = triangles_[t], two = triangles_[other];
    const std::uint32_t j = sideTo(other, t);
    const std::uint32_t a = one.at[i], b = one.at[(i + 1) % 3], c = one.at[(i + 2) % 3], d = two.at[j];
    // one: a b c, two: d c b, p on b c.
    const std::uint32_t across_ab = one.next[(i + 2) % 3], across_ca = one.next[(i + 1) % 3];
    const std::uint32_t across_dc = two.next[(j + 2) % 3], across_bd = two.next[(j + 1) % 3];
    const auto t1 = std::uint32_t(triangles_.size()), t2 = t1 + 1;
    triangles_[t] = {{p, a, b}, {across_ab, t2, t1}, {false, false, false}};
    triangles_[other] = {{p, d, c}, {across_dc, t1, t2}, {false, false, false}};
    // p a b: across a b; across b p lies p c' ... the four turn around p: (a b), (c a), (d c), (b d).
    add({p, c, a}, {across_ca, t, other});
    add({p, b, d}, {across_bd, other, t});
    triangles_[t].next = {across_ab, t2, t1};
    triangles_[other].next = {across_dc, t1, t2};
    triangles_[t1].next = {across_ca, t, other};
    triangles_[t2].next = {across_bd, other, t};
    relink(across_ca, t, t1);
    relink(across_bd, other, t2);
    for (const std::uint32_t corner : {p, a, b}) around_[corner] = t;
    for (const std::uint32_t corner : {d, c}) around_[corner] = other;
    legalize({t, t1, other, t2}, p);
  }

  /// Triangles have p as their first corner; flips until the side across from p is Delaunay.
  void legalize(std::initializer_list<std::uint32_t> around, std::uint32_t p) {
    stack_.assign(around);
    while (!stack_.empty()) {
      const std::uint32_t t = stack_.back();
      stack_.pop_back();
      std::uint32_t i = 0;
      while (i < 3 && triangles_[t].at[i] != p) ++i;
      if (i == 3) continue;
      const std::uint32_t other = triangles_[t].next[i];
      if (other == formats::kNone || triangles_[t].fixed[i]) continue;
      const Triangle& here = triangles_[t];
      const std::uint32_t q = triangles_[other].at[sideTo(other, t)];
      if (!isInCircle(points_[here.at[0]], points_[here.at[1]], points_[here.at[2]], points_[q])) continue;
      flip(t, i);
      stack_.push_back(t);
      stack_.push_back(other);
    }
  }

  /// The side across from corner i of t and the triangle behind it: the other diagonal of the four corners.
  void flip(std::uint32_t t, std::uint32_t i) {
    const std::uint32_t other = triangles_[t].next[i], j = sideTo(other, t);
    const Triangle one = triangles_[t], two = triangles_[other];
    const std::uint32_t i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
    const std::uint32_t a = one.at[i], b = one.at[i1], c = one.at[i2], d = two.at[j];
    // a b c and d c b become a b d and d c a.
    triangles_[t] = {{a, b, d}, {two.next[j1], other, one.next[i2]}, {two.fixed[j1], false, one.fixed[i2]}};
    triangles_[other] = {{d, c, a}, {one.next[i1], t, two.next[j2]}, {one.fixed[i1], false, two.fixed[j2]}};
    relink(two.next[j1], other, t);
    relink(one.next[i1], t, other);
    around_[a] = around_[b] = around_[d] = t;
    around_[c] = other;
  }

  /// The triangle that has the directed edge u v, and the corner across from it.
  std::array<std::uint32_t, 2> sideOf(std::uint32_t u, std::uint32_t v) const {
    std::uint32_t t = around_[u];
    const std::uint32_t start = t;
    for (const bool back : {false, true}) {
      t = start;
      for (std::size_t left = triangles_.size(); left > 0; --left) {
        const Triangle& here = triangles_[t];
        std::uint32_t i = 0;
        while (i < 3 && here.at[i] != u) ++i;
        if (i == 3) break;
        if (here.at[(i + 1) % 3] == v) return {t, (i + 2) % 3};
        const std::uint32_t next = here.next[back ? (i + 2) % 3 : (i + 1) % 3];
        if (next == formats::kNone) break;
        t = next;
        if (t == start) return {formats::kNone, 0};
      }
    }
    return {formats::kNone, 0};
  }

  bool markEdge(std::uint32_t a, std::uint32_t b) {
    const auto [t, i] = sideOf(a, b);
    if (t == formats::kNone) return false;
    triangles_[t].fixed[i] = true;
    const std::uint32_t other = triangles_[t].next[i];
    if (other != formats::kNone) triangles_[other].fixed[sideTo(other, t)] = true;
    return true;
  }

  bool crosses(std::uint32_t p, std::uint32_t q, std::uint32_t a, std::uint32_t b) const {
    const auto differ = [](std::int64_t one, std::int64_t two) { return (one > 0 && two < 0) || (one < 0 && two > 0); };
    return differ(turn(a, b, points_[p]), turn(a, b, points_[q])) &&
           differ(turn(p, q, points_[a]), turn(p, q, points_[b]));
  }

  /// The sides that the way from a to b crosses.
  bool findCrossing(std::uint32_t a, std::uint32_t b, std::deque<std::array<std::uint32_t, 2>>& crossing) const {
    const GridPoint& to = points_[b];
    std::uint32_t t = formats::kNone, i = 0;
    // The triangle at a into which the way goes.
    const std::uint32_t start = around_[a];
    for (const bool back : {false, true}) {
      std::uint32_t now = start;
      for (std::size_t left = triangles_.size(); left > 0 && t == formats::kNone; --left) {
        const Triangle& here = triangles_[now];
        std::uint32_t k = 0;
        while (k < 3 && here.at[k] != a) ++k;
        if (k == 3) return false;
        const std::uint32_t u = here.at[(k + 1) % 3], v = here.at[(k + 2) % 3];
        const std::int64_t at_u = turn(a, u, to), at_v = turn(a, v, to);
        if (at_u > 0 && at_v < 0) {
          t = now;
          i = k;
          break;
        }
        const std::uint32_t next = here.next[back ? (k + 2) % 3 : (k + 1) % 3];
        if (next == formats::kNone || next == start) break;
        now = next;
      }
    }
    if (t == formats::kNone) return false;  // it leaves through a corner
    for (std::size_t left = triangles_.size(); left > 0; --left) {
      const std::uint32_t u = triangles_[t].at[(i + 1) % 3], v = triangles_[t].at[(i + 2) % 3];
      if (triangles_[t].fixed[i]) return false;
      crossing.push_back({u, v});
      const std::uint32_t other = triangles_[t].next[i];
      if (other == formats::kNone) return false;
      const std::uint32_t q = triangles_[other].at[sideTo(other, t)];
      if (q == b) return true;
      const std::int64_t side = turn(a, b, points_[q]);
      if (side == 0) return false;
      // On to the side of the next triangle that has its ends left and right of the way: u is right, v left.
      const std::uint32_t leave = side > 0 ? v : u;
      t = other;
      i = 0;
      while (triangles_[t].at[i] != leave) ++i;
    }
    return false;
  }

  void restoreDelaunay(std::vector<std::array<std::uint32_t, 2>>& made, std::uint32_t a, std::uint32_t b) {
    bool changed = true;
    for (std::size_t round = 0; changed && round < 8 + made.size(); ++round) {
      changed = false;
      for (auto& edge : made) {
        const auto [u, v] = edge;
        if ((u == a && v == b) || (u == b && v == a)) continue;
        const auto [t, i] = sideOf(u, v);
        if (t == formats::kNone || triangles_[t].fixed[i]) continue;
        const std::uint32_t other = triangles_[t].next[i];
        if (other == formats::kNone) continue;
        const Triangle& here = triangles_[t];
        const std::uint32_t p = here.at[i], q = triangles_[other].at[sideTo(other, t)];
        if (!isInCircle(points_[here.at[0]], points_[here.at[1]], points_[here.at[2]], points_[q])) continue;
        flip(t, i);
        edge = {p, q};
        changed = true;
      }
    }
  }

  std::vector<GridPoint> points_;
  std::vector<Triangle> triangles_;
  std::vector<std::uint32_t> around_;  // of each point: a triangle that has it
  std::vector<std::uint32_t> stack_;   // scratch of legalize()
  std::uint32_t first_extra_ = 0, last_ = 0;
};

bool lieIn(const GridPoint& p, const GridPoint& a, const GridPoint& b, const GridPoint& c, int sign) {
  return turnOf(a, b, p) * sign >= 0 && turnOf(b, c, p) * sign >= 0 && turnOf(c, a, p) * sign >= 0;
}

double squaredLength(const GridPoint& a, const GridPoint& b) {
  const double x = double(b.x - a.x), y = double(b.y - a.y);
  return x * x + y * y;
}

}  // namespace

bool triangulate(std::span<const GridPoint> points, std::span<const std::array<std::uint32_t, 2>> edges,
                 std::vector<Corners>& triangles) {
  Triangulation t(points);
  if (!t.insertAll()) return false;
  for (const auto& [u, v] : edges) {
    if (!t.constrain(u, v)) return false;
  }
  return t.collect(edges, triangles);
}

void clipEars(std::span<const GridPoint> points, std::span<const std::uint32_t> loop, int sign,
              std::vector<Corners>& triangles) {
  std::vector<std::uint32_t> left(loop.begin(), loop.end());
  while (left.size() > 3) {
    const std::size_t n = left.size();
    std::size_t best = 0;
    double best_cost = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint32_t a = left[(i + n - 1) % n], b = left[i], c = left[(i + 1) % n];
      const std::int64_t area = turnOf(points[a], points[b], points[c]) * sign;
      // Short diagonals first; ears that turn the wrong way, or hold other corners, last.
      double cost = squaredLength(points[a], points[c]);
      if (area <= 0) cost += 1e30;
      if (cost < best_cost && area > 0 && n <= kMostTested) {
        for (const std::uint32_t p : left) {
          if (p != a && p != b && p != c && lieIn(points[p], points[a], points[b], points[c], sign)) {
            cost += 1e25;
            break;
          }
        }
      }
      if (cost < best_cost) best_cost = cost, best = i;
    }
    triangles.push_back({left[(best + n - 1) % n], left[best], left[(best + 1) % n]});
    left.erase(left.begin() + std::ptrdiff_t(best));
  }
  if (left.size() == 3) triangles.push_back({left[0], left[1], left[2]});
}

}  // namespace sinew::cutting

// SPDX-License-Identifier: GPL-3.0-or-later
//
// The predicates are CGAL's filtered exact ones on the points as they are stored, so the answer is right for those
// points whatever their scale; the two intervals on the planes' common line follow Guigue and Devillers, "Fast and
// robust triangle-triangle overlap test using orientation predicates", J. Graphics Tools 8(1), 2003, with strict
// inequalities: a touch in a point does not count.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <numeric>
#include <span>

#include "runtime/geometry/box_tree.h"
#include "tools/import/topology.h"

namespace sinew::tools {
namespace {

using Eigen::AlignedBox3d;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point3 = Kernel::Point_3;
using Point2 = Kernel::Point_2;

struct Corner {
  Point3 point;
  std::uint32_t index;  // welded
};
using Corners = std::array<Corner, 3>;

// Which side of the plane a, b, c the point d is on. Neighbours share points: asking whether these are the same spares
// most pairs the exact arithmetic that a zero otherwise takes.
int side(const Corner& a, const Corner& b, const Corner& c, const Corner& d) {
  if (d.index == a.index || d.index == b.index || d.index == c.index || a.index == b.index || b.index == c.index ||
      c.index == a.index) {
    return 0;
  }
  return static_cast<int>(CGAL::orientation(a.point, b.point, c.point, d.point));
}

std::array<int, 3> sides(const Corners& plane, const Corners& t) {
  return {side(plane[0], plane[1], plane[2], t[0]), side(plane[0], plane[1], plane[2], t[1]),
          side(plane[0], plane[1], plane[2], t[2])};
}

bool oneSide(const std::array<int, 3>& s) { return s[0] == s[1] && s[1] == s[2] && s[0] != 0; }

// The triangle meets the plane in one of its corners only.
bool pointOnly(const std::array<int, 3>& s) {
  const auto zeros = std::count(s.begin(), s.end(), 0);
  return zeros == 1 && s[0] + s[1] + s[2] != 0;
}

// The triangle meets the plane in one of its edges.
bool edgeOnly(const std::array<int, 3>& s) { return std::count(s.begin(), s.end(), 0) == 2; }

// Which corner has the plane between itself and the two others (which may lie on the plane, not both beyond it).
std::size_t loneCorner(const std::array<int, 3>& s) {
  for (std::size_t k = 0; k < 3; ++k) {
    const int next = s[(k + 1) % 3], last = s[(k + 2) % 3];
    if (s[k] != 0 && next != s[k] && last != s[k]) return k;
  }
  return 0;  // cannot be: callers sort out the other cases
}

// Open interiors of two triangles in one plane meet: no edge of either has the other wholly on its outer side.
bool coplanarOverlap(const Corners& a, const Corners& b) {
  for (int dropped = 0; dropped < 3; ++dropped) {
    const int u = (dropped + 1) % 3, v = (dropped + 2) % 3;
    const auto flat = [&](const Corners& t) {
      const auto drop = [&](const Corner& c) { return Point2(c.point[u], c.point[v]); };
      return std::array{drop(t[0]), drop(t[1]), drop(t[2])};
    };
    const auto turn = [](const std::array<Point2, 3>& t) { return CGAL::orientation(t[0], t[1], t[2]); };
    std::array<Point2, 3> p = flat(a), q = flat(b);
    if (turn(p) == CGAL::COLLINEAR || turn(q) == CGAL::COLLINEAR) continue;  // seen edge on: drop another axis
    if (turn(p) == CGAL::RIGHT_TURN) std::swap(p[1], p[2]);
    if (turn(q) == CGAL::RIGHT_TURN) std::swap(q[1], q[2]);
    const auto separates = [](const std::array<Point2, 3>& t, const std::array<Point2, 3>& other) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (std::none_of(other.begin(), other.end(), [&](const Point2& x) {
              return CGAL::orientation(t[k], t[(k + 1) % 3], x) == CGAL::LEFT_TURN;
            })) {
          return true;
        }
      }
      return false;
    };
    return !separates(p, q) && !separates(q, p);
  }
  return false;
}

// The triangles share more than single points and more than pieces of an edge of both.
bool pierce(const Corners& a, const Corners& b) {
  const std::array<int, 3> sa = sides(b, a);
  if (oneSide(sa) || pointOnly(sa)) return false;
  if (sa == std::array{0, 0, 0}) return coplanarOverlap(a, b);
  const std::array<int, 3> sb = sides(a, b);
  if (oneSide(sb) || pointOnly(sb)) return false;
  if (edgeOnly(sa) && edgeOnly(sb)) return false;
  const std::size_t ka = loneCorner(sa), kb = loneCorner(sb);
  const Corner &p1 = a[ka], &p2 = b[kb];
  const Corner *q1 = &a[(ka + 1) % 3], *r1 = &a[(ka + 2) % 3];
  const Corner *q2 = &b[(kb + 1) % 3], *r2 = &b[(kb + 2) % 3];
  if (sa[ka] < 0) std::swap(q2, r2);
  if (sb[kb] < 0) std::swap(q1, r1);
  return side(p1, *q1, p2, *q2) < 0 && side(p1, *r1, *r2, p2) < 0;
}

// Calls found(j) for every j > i whose box meets box i. \param last largest item below each node.
template <class Found>
void forLaterOverlaps(const geometry::BoxTree& tree, const std::vector<std::uint32_t>& last,
                      const std::vector<AlignedBox3d>& boxes, std::uint32_t i, const Found& found) {
  tree.descend([&](const auto& node, std::uint32_t n) { return last[n] > i && node.box.intersects(boxes[i]); },
               [&](std::uint32_t place) {
                 const std::uint32_t j = tree.order()[place];
                 if (j > i && boxes[j].intersects(boxes[i])) found(j);
               });
}

std::vector<std::uint32_t> largestBelow(const geometry::BoxTree& tree) {
  std::vector<std::uint32_t> last(tree.nodes().size());
  for (std::size_t n = last.size(); n-- > 0;) {
    const auto& node = tree.nodes()[n];
    const auto items = tree.itemsOf(node);
    last[n] = node.right != 0 ? std::max(last[n + 1], last[node.right]) : *std::max_element(items.begin(), items.end());
  }
  return last;
}

}  // namespace

std::vector<std::pair<std::uint32_t, std::uint32_t>> findSelfIntersections(const VisualMesh& mesh,
                                                                           const Topology& topology, std::size_t limit,
                                                                           bool different_parts_only) {
  // Degenerate triangles span no plane, copies would repeat what their originals say.
  std::vector<std::uint8_t> skipped(mesh.triangles.size(), 0);
  for (const std::uint32_t t : topology.degenerate_triangles) skipped[t] = 1;
  for (const std::uint32_t t : topology.duplicate_triangles) skipped[t] = 1;
  std::vector<std::uint32_t> triangle;
  std::vector<AlignedBox3d> boxes;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (skipped[t]) continue;
    AlignedBox3d box;
    for (const std::uint32_t p : mesh.weldedTriangle(t)) box.extend(mesh.welded_positions[p]);
    triangle.push_back(t);
    boxes.push_back(box);
  }
  const auto box = [&](std::uint32_t i) -> const AlignedBox3d& { return boxes[i]; };
  const geometry::BoxTree tree(
      std::uint32_t(boxes.size()), box,
      [&](std::uint32_t i) -> Eigen::Vector3d { return boxes[i].min() + boxes[i].max(); }, box, 4);
  const std::vector<std::uint32_t> last = largestBelow(tree);
  const auto corners = [&](std::uint32_t t) {
    const Triangle p = mesh.weldedTriangle(t);
    const auto point = [&](std::uint32_t i) {
      const Eigen::Vector3d& x = mesh.welded_positions[i];
      return Corner{Point3(x.x(), x.y(), x.z()), i};
    };
    return Corners{point(p[0]), point(p[1]), point(p[2])};
  };

  // In blocks, so that the limit ends the work early and the pairs are the same for any number of threads.
  constexpr std::size_t kBlock = 512;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  std::vector<std::vector<std::uint32_t>> hits(kBlock);
  for (std::size_t begin = 0; begin < triangle.size() && pairs.size() < limit; begin += kBlock) {
    const std::size_t count = std::min(kBlock, triangle.size() - begin);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 32), [&](const tbb::blocked_range<std::size_t>& range) {
      std::vector<std::uint32_t> candidates;
      for (std::size_t k = range.begin(); k != range.end(); ++k) {
        hits[k].clear();
        const std::uint32_t t = triangle[begin + k];
        candidates.clear();
        forLaterOverlaps(tree, last, boxes, std::uint32_t(begin + k),
                         [&](std::uint32_t i) { candidates.push_back(triangle[i]); });
        if (candidates.empty()) continue;
        std::sort(candidates.begin(), candidates.end());
        const Corners a = corners(t);
        for (const std::uint32_t other : candidates) {
          if (different_parts_only && topology.part_of_triangle[t] == topology.part_of_triangle[other]) continue;
          if (!pierce(a, corners(other))) continue;
          hits[k].push_back(other);
          if (hits[k].size() == limit) break;
        }
      }
    });
    for (std::size_t k = 0; k < count; ++k) {
      for (const std::uint32_t other : hits[k]) {
        if (pairs.size() < limit) pairs.emplace_back(triangle[begin + k], other);
      }
    }
  }
  return pairs;
}

}  // namespace sinew::tools

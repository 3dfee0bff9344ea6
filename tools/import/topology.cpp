// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/topology.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "runtime/geometry/sets.h"

namespace sinew::tools {
namespace {

// A half-edge is named by the corner it starts at: corner c = 3 * triangle + k runs to the triangle's next corner.
std::uint32_t nextCorner(std::uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

// Below this altitude, relative to the longest edge, a triangle has no area; twice the area over the longest edge
// squared is the altitude over the longest edge.
constexpr double kZeroAltitude = 1e-14;

bool hasZeroArea(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const double longest_squared = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  const double longest = std::sqrt(longest_squared);
  // Far from the origin the coordinates' own rounding is larger than that.
  const double largest_coordinate =
      std::max({a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff(), c.cwiseAbs().maxCoeff()});
  const double rounding = 4 * std::numeric_limits<double>::epsilon() * largest_coordinate;
  return (b - a).cross(c - a).norm() <= longest * std::max(kZeroAltitude * longest, rounding);
}

class Analysis {
 public:
  explicit Analysis(const VisualMesh& mesh) : mesh_(mesh), triangle_count_(mesh.triangles.size()) {}

  Topology run() {
    collectTriangles();
    findDuplicates();
    buildEdges();
    chooseOptionalTriangles();
    buildActiveEdges();
    classifyEdges();
    findParts();
    findFans();
    traceBoundary();
    return std::move(result_);
  }

 private:
  void collectTriangles() {
    points_.resize(triangle_count_);
    active_.assign(triangle_count_, 1);
    distinct_.assign(triangle_count_, 1);
    for (std::size_t t = 0; t < triangle_count_; ++t) {
      const Triangle p = mesh_.weldedTriangle(t);
      points_[t] = p;
      const auto& x = mesh_.welded_positions;
      if (p[0] == p[1] || p[1] == p[2] || p[2] == p[0]) {
        active_[t] = distinct_[t] = 0;
        result_.degenerate_triangles.push_back(std::uint32_t(t));
      } else if (hasZeroArea(x[p[0]], x[p[1]], x[p[2]])) {
        zero_area_.push_back(std::uint32_t(t));
        result_.degenerate_triangles.push_back(std::uint32_t(t));
      }
    }
  }

  // A copy is a triangle with the points of an earlier triangle, or part of a polygon with the points of an earlier
  // polygon: a doubled quad may have been cut along its other diagonal.
  void findDuplicates() {
    original_.assign(triangle_count_, formats::kNone);
    findEqual(
        triangle_count_,
        [&](std::size_t t, std::vector<std::uint32_t>& key) {
          if (distinct_[t]) key.assign(points_[t].begin(), points_[t].end());
        },
        [&](std::size_t copy, std::size_t first) { original_[copy] = std::uint32_t(first); });

    // Runs of triangles of one polygon lie together.
    std::vector<std::uint32_t> first_of_run;
    for (std::size_t t = 0; t < triangle_count_; ++t) {
      if (t == 0 || face(t) != face(t - 1)) first_of_run.push_back(std::uint32_t(t));
    }
    if (first_of_run.size() != triangle_count_) {
      first_of_run.push_back(std::uint32_t(triangle_count_));
      findEqual(
          first_of_run.size() - 1,
          [&](std::size_t run, std::vector<std::uint32_t>& key) {
            if (first_of_run[run + 1] - first_of_run[run] < 2) return;
            for (std::uint32_t t = first_of_run[run]; t < first_of_run[run + 1]; ++t) {
              key.insert(key.end(), points_[t].begin(), points_[t].end());
            }
          },
          [&](std::size_t copy, std::size_t first) {
            for (std::uint32_t t = first_of_run[copy]; t < first_of_run[copy + 1]; ++t) {
              if (original_[t] == formats::kNone && distinct_[t]) original_[t] = first_of_run[first];
            }
          });
    }
    for (std::size_t t = 0; t < triangle_count_; ++t) {
      if (original_[t] == formats::kNone) continue;
      active_[t] = 0;
      result_.duplicate_triangles.push_back(std::uint32_t(t));
    }
  }

  std::uint32_t face(std::size_t triangle) const {
    return mesh_.triangle_face.empty() ? std::uint32_t(triangle) : mesh_.triangle_face[triangle];
  }

  // Calls found(copy, first) for each item whose set of points an earlier item has too. Items with few points: bucket
  // by the smallest point, then compare within the bucket. An empty key takes no part.
  template <class Key, class Found>
  void findEqual(std::size_t count, const Key& makeKey, const Found& found) {
    std::vector<std::uint32_t> key, other;
    std::vector<std::uint32_t> firsts;  // of items alike so far
    const auto sortedKey = [&](std::size_t item, std::vector<std::uint32_t>& out) {
      out.clear();
      makeKey(item, out);
      std::sort(out.begin(), out.end());
      out.erase(std::unique(out.begin(), out.end()), out.end());
    };
    struct Entry {
      std::uint64_t rest;  // the next two points: nearly always decides
      std::uint32_t item;
    };
    std::vector<std::uint32_t> begin(mesh_.welded_positions.size() + 1, 0);
    std::vector<std::uint32_t> smallest(count, formats::kNone);
    std::vector<std::uint64_t> rest(count, 0);
    for (std::size_t i = 0; i < count; ++i) {
      sortedKey(i, key);
      if (key.empty()) continue;
      smallest[i] = key[0];
      rest[i] = std::uint64_t(key.size() > 1 ? key[1] : 0) << 32 | (key.size() > 2 ? key[2] : 0);
      ++begin[key[0] + 1];
    }
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    std::vector<Entry> entries(begin.back());
    std::vector<std::uint32_t> cursor(begin.begin(), begin.end() - 1);
    for (std::size_t i = 0; i < count; ++i) {
      if (smallest[i] != formats::kNone) entries[cursor[smallest[i]]++] = {rest[i], std::uint32_t(i)};
    }
    for (std::size_t p = 0; p + 1 < begin.size(); ++p) {
      const std::span<Entry> bucket(entries.data() + begin[p], begin[p + 1] - begin[p]);
      if (bucket.size() < 2) continue;
      std::sort(bucket.begin(), bucket.end(),
                [](const Entry& a, const Entry& b) { return a.rest != b.rest ? a.rest < b.rest : a.item < b.item; });
      for (std::size_t i = 0; i < bucket.size(); ++i) {
        if (i == 0 || bucket[i].rest != bucket[i - 1].rest) firsts.clear();
        sortedKey(bucket[i].item, key);
        const auto first = std::find_if(firsts.begin(), firsts.end(), [&](std::uint32_t item) {
          sortedKey(item, other);
          return key == other;
        });
        if (first == firsts.end()) {
          firsts.push_back(bucket[i].item);
        } else {
          found(bucket[i].item, *first);
        }
      }
    }
  }

  // Sorts the half-edges of all triangles with three distinct points by edge: bucket by the smaller point, sort by the
  // larger one.
  void buildEdges() {
    const std::size_t corners = 3 * triangle_count_;
    std::vector<std::uint32_t> begin(mesh_.welded_positions.size() + 1, 0);
    for (std::uint32_t c = 0; c < corners; ++c) {
      if (distinct_[c / 3]) ++begin[std::min(point(c), point(nextCorner(c))) + 1];
    }
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    std::vector<std::uint64_t> sorted(begin.back());  // larger point, corner
    std::vector<std::uint32_t> cursor(begin.begin(), begin.end() - 1);
    for (std::uint32_t c = 0; c < corners; ++c) {
      if (!distinct_[c / 3]) continue;
      const auto [low, high] = std::minmax({point(c), point(nextCorner(c))});
      sorted[cursor[low]++] = std::uint64_t(high) << 32 | c;
    }
    half_edges_.resize(sorted.size());
    edge_of_.assign(corners, formats::kNone);
    edge_begin_.reserve(sorted.size() / 2 + 1);
    for (std::size_t p = 0; p + 1 < begin.size(); ++p) {
      std::sort(sorted.begin() + begin[p], sorted.begin() + begin[p + 1]);
      for (std::uint32_t i = begin[p]; i < begin[p + 1]; ++i) {
        if (i == begin[p] || sorted[i] >> 32 != sorted[i - 1] >> 32) edge_begin_.push_back(i);
        const std::uint32_t corner = std::uint32_t(sorted[i]);
        half_edges_[i] = corner;
        edge_of_[corner] = std::uint32_t(edge_begin_.size() - 1);
      }
    }
    edge_begin_.push_back(std::uint32_t(sorted.size()));
  }

  // Decides which triangles of zero area and which copies take part (see Topology).
  void chooseOptionalTriangles() {
    if (zero_area_.empty() && result_.duplicate_triangles.empty()) return;
    std::vector<std::uint32_t> uses(edge_begin_.size() - 1, 0);
    for (std::size_t e = 0; e < uses.size(); ++e) {
      for (const std::uint32_t c : halfEdges(e)) uses[e] += active_[c / 3];
    }
    const auto set = [&](std::uint32_t t, bool active) {
      active_[t] = active ? 1 : 0;
      for (std::uint32_t k = 0; k < 3; ++k) uses[edge_of_[3 * t + k]] += active ? 1U : ~0U;
    };
    const auto usesOf = [&](std::uint32_t t) {
      return std::array{uses[edge_of_[3 * t]], uses[edge_of_[3 * t + 1]], uses[edge_of_[3 * t + 2]]};
    };
    // One that hangs free on an edge holds nothing together; taking it out may free the next.
    for (bool changed = true; changed;) {
      changed = false;
      for (const std::uint32_t t : zero_area_) {
        if (!active_[t]) continue;
        const auto u = usesOf(t);
        if (std::find(u.begin(), u.end(), 1U) == u.end()) continue;
        set(t, false);
        changed = true;
      }
    }
    // A copy closes a rim if it fills a boundary edge and makes no edge worse; a lone pair stays an open sheet.
    for (bool changed = true; changed;) {
      changed = false;
      for (const std::uint32_t t : result_.duplicate_triangles) {
        if (active_[t]) continue;
        const auto u = usesOf(t);
        const auto boundary = std::count(u.begin(), u.end(), 1U);
        const auto crowded = std::count_if(u.begin(), u.end(), [](std::uint32_t n) { return n > 2; });
        if (boundary == 0 || crowded == 0 || boundary + crowded != 3) continue;
        set(t, true);
        changed = true;
      }
    }
  }

  // From here on edges list only triangles that take part.
  void buildActiveEdges() {
    if (std::find(active_.begin(), active_.end(), std::uint8_t(0)) == active_.end()) return;
    std::uint32_t kept = 0;
    std::uint32_t edges = 0;
    const std::size_t edge_count = edge_begin_.size() - 1;
    for (std::size_t e = 0; e < edge_count; ++e) {
      const std::uint32_t first = kept;
      for (std::uint32_t i = edge_begin_[e]; i < edge_begin_[e + 1]; ++i) {
        const std::uint32_t c = half_edges_[i];
        if (!active_[c / 3]) continue;
        half_edges_[kept++] = c;
        edge_of_[c] = edges;
      }
      if (kept != first) edge_begin_[edges++] = first;
    }
    edge_begin_.resize(edges + 1);
    edge_begin_[edges] = kept;
    half_edges_.resize(kept);
  }

  void classifyEdges() {
    for (std::size_t e = 0; e + 1 < edge_begin_.size(); ++e) {
      const auto half = halfEdges(e);
      const auto [low, high] = std::minmax({point(half[0]), point(nextCorner(half[0]))});
      if (half.size() == 1) {
        result_.boundary_edges.push_back({low, high});
        boundary_corners_.push_back(half[0]);
      } else if (half.size() > 2) {
        result_.non_manifold_edges.push_back({low, high});
      } else if (point(half[0]) == point(half[1])) {
        result_.flipped_edges.push_back({low, high});
      }
    }
  }

  // Patches are connected over edges of two faces, and know which of their faces run against the first; parts are
  // patches connected over any edge.
  void findParts() {
    struct Patch {
      bool consistent = true;
      double area[2] = {0, 0};
    };
    std::vector<Patch> patches;
    std::vector<std::uint32_t> patch_of(triangle_count_, formats::kNone);
    std::vector<std::uint8_t> against(triangle_count_, 0);
    std::vector<std::uint32_t> stack;
    for (std::uint32_t seed = 0; seed < triangle_count_; ++seed) {
      if (!active_[seed] || patch_of[seed] != formats::kNone) continue;
      const std::uint32_t patch = std::uint32_t(patches.size());
      patches.emplace_back();
      patch_of[seed] = patch;
      stack.push_back(seed);
      while (!stack.empty()) {
        const std::uint32_t t = stack.back();
        stack.pop_back();
        for (std::uint32_t c = 3 * t; c < 3 * t + 3; ++c) {
          const auto half = halfEdges(edge_of_[c]);
          if (half.size() != 2) continue;
          const std::uint32_t other = half[0] == c ? half[1] : half[0];
          const std::uint8_t side = std::uint8_t(against[t] ^ (point(other) == point(c) ? 1 : 0));
          if (patch_of[other / 3] == formats::kNone) {
            patch_of[other / 3] = patch;
            against[other / 3] = side;
            stack.push_back(other / 3);
          } else if (against[other / 3] != side) {
            patches[patch].consistent = false;
          }
        }
      }
    }

    geometry::Sets joined(patches.size());
    for (std::size_t e = 0; e + 1 < edge_begin_.size(); ++e) {
      const auto half = halfEdges(e);
      for (std::size_t i = 1; half.size() > 2 && i < half.size(); ++i) {
        joined.join(patch_of[half[0] / 3], patch_of[half[i] / 3]);
      }
    }
    // Patches are numbered by their first triangle and a set is named by its first patch, so parts come out so too.
    std::vector<std::uint32_t> part_of_patch(patches.size());
    for (std::uint32_t i = 0; i < patches.size(); ++i) {
      const std::uint32_t first = joined.find(i);
      if (first == i) {
        part_of_patch[i] = std::uint32_t(result_.parts.size());
        result_.parts.emplace_back();
        result_.parts.back().closed = true;
      } else {
        part_of_patch[i] = part_of_patch[first];
      }
    }

    result_.part_of_triangle.assign(triangle_count_, formats::kNone);
    for (std::uint32_t t = 0; t < triangle_count_; ++t) {
      if (!active_[t]) continue;
      result_.part_of_triangle[t] = part_of_patch[patch_of[t]];
      result_.parts[result_.part_of_triangle[t]].triangles.push_back(t);
    }
    for (const std::uint32_t t : result_.duplicate_triangles) {
      if (!active_[t]) result_.part_of_triangle[t] = result_.part_of_triangle[original_[t]];
    }
    for (const std::uint32_t c : boundary_corners_) result_.parts[result_.part_of_triangle[c / 3]].closed = false;
    for (std::size_t e = 0; e + 1 < edge_begin_.size(); ++e) {
      if (halfEdges(e).size() > 2) result_.parts[result_.part_of_triangle[halfEdges(e)[0] / 3]].manifold = false;
    }
    for (SurfacePart& part : result_.parts) measure(part);
    for (std::uint32_t i = 0; i < patches.size(); ++i) {
      if (!patches[i].consistent) result_.parts[part_of_patch[i]].orientable = false;
    }
    result_.closed = !result_.parts.empty() && std::all_of(result_.parts.begin(), result_.parts.end(),
                                                           [](const SurfacePart& part) { return part.closed; });

    if (result_.flipped_edges.empty()) return;
    for (std::uint32_t t = 0; t < triangle_count_; ++t) {
      if (active_[t]) patches[patch_of[t]].area[against[t]] += doubleArea(t);
    }
    for (std::uint32_t t = 0; t < triangle_count_; ++t) {
      if (!active_[t]) continue;
      const Patch& patch = patches[patch_of[t]];
      const std::uint8_t smaller = patch.area[1] <= patch.area[0] ? 1 : 0;
      if (patch.consistent && against[t] == smaller) result_.turned_triangles.push_back(t);
    }
  }

  void measure(SurfacePart& part) const {
    Eigen::AlignedBox3d box;
    for (const std::uint32_t t : part.triangles) {
      for (const std::uint32_t p : points_[t]) box.extend(mesh_.welded_positions[p]);
    }
    const Eigen::Vector3d center = box.center();
    double double_area = 0;
    double six_volumes = 0;
    for (const std::uint32_t t : part.triangles) {
      const Eigen::Vector3d a = position(t, 0) - center, b = position(t, 1) - center, c = position(t, 2) - center;
      double_area += (b - a).cross(c - a).norm();
      six_volumes += a.dot(b.cross(c));
    }
    part.area = double_area / 2;
    part.signed_volume = six_volumes / 6;
  }

  // A fan is a set of corners at one point connected over shared edges there.
  void findFans() {
    fans_ = geometry::Sets(3 * triangle_count_);
    for (std::size_t e = 0; e + 1 < edge_begin_.size(); ++e) {
      const auto half = halfEdges(e);
      for (std::size_t i = 1; i < half.size(); ++i) {
        const std::uint32_t a = half[0], b = half[i];
        const bool same_way = point(a) == point(b);
        fans_.join(a, same_way ? b : nextCorner(b));
        fans_.join(nextCorner(a), same_way ? nextCorner(b) : b);
      }
    }
    std::vector<std::uint32_t> fan_at(mesh_.welded_positions.size(), formats::kNone);
    std::vector<std::uint8_t> several(mesh_.welded_positions.size(), 0);
    for (std::uint32_t c = 0; c < 3 * triangle_count_; ++c) {
      if (!active_[c / 3]) continue;
      std::uint32_t& fan = fan_at[point(c)];
      const std::uint32_t here = fans_.find(c);
      if (fan == formats::kNone) {
        fan = here;
      } else if (fan != here) {
        several[point(c)] = 1;
      }
    }
    for (std::uint32_t p = 0; p < several.size(); ++p) {
      if (several[p]) result_.non_manifold_vertices.push_back(p);
    }
  }

  // Joins boundary edges that end in the same fan. End 2b is where boundary edge b starts, 2b + 1 where it stops.
  void traceBoundary() {
    const std::size_t edge_count = boundary_corners_.size();
    struct End {
      std::uint32_t fan;
      std::uint32_t end;
    };
    std::vector<End> ends;
    ends.reserve(2 * edge_count);
    for (std::uint32_t b = 0; b < edge_count; ++b) {
      const std::uint32_t c = boundary_corners_[b];
      ends.push_back({fans_.find(c), 2 * b});
      ends.push_back({fans_.find(nextCorner(c)), 2 * b + 1});
    }
    std::sort(ends.begin(), ends.end(),
              [](const End& a, const End& b) { return a.fan != b.fan ? a.fan < b.fan : a.end < b.end; });
    std::vector<std::uint32_t> partner(2 * edge_count, formats::kNone);
    for (std::size_t i = 0; i + 1 < ends.size(); ++i) {
      if (ends[i].fan != ends[i + 1].fan) continue;
      partner[ends[i].end] = ends[i + 1].end;
      partner[ends[i + 1].end] = ends[i].end;
      ++i;
    }
    const auto pointOf = [&](std::uint32_t end) {
      const std::uint32_t c = boundary_corners_[end / 2];
      return point(end % 2 == 0 ? c : nextCorner(c));
    };
    std::vector<std::uint8_t> seen(edge_count, 0);
    const auto trace = [&](std::uint32_t start) {
      std::vector<std::uint32_t> loop;
      std::uint32_t end = start;
      while (end != formats::kNone && !seen[end / 2]) {
        seen[end / 2] = 1;
        loop.push_back(pointOf(end));
        const std::uint32_t far = end ^ 1U;
        end = partner[far];
        if (end == formats::kNone) loop.push_back(pointOf(far));
      }
      splitLoop(loop);
    };
    // Rims with loose ends first: started in the middle they would come out in two pieces.
    for (std::uint32_t end = 0; end < partner.size(); ++end) {
      if (partner[end] == formats::kNone && !seen[end / 2]) trace(end);
    }
    for (std::uint32_t b = 0; b < edge_count; ++b) {
      if (!seen[b]) trace(2 * b);
    }
  }

  // A walk along the surface's rim passes twice through a point where two holes touch: a loop for each.
  void splitLoop(const std::vector<std::uint32_t>& walk) {
    place_in_loop_.resize(mesh_.welded_positions.size(), formats::kNone);
    std::vector<std::uint32_t> open;
    const auto close = [&](std::size_t first) {
      for (std::size_t i = first; i < open.size(); ++i) place_in_loop_[open[i]] = formats::kNone;
      if (open.size() - first > 1) {
        result_.boundary_loops.emplace_back(open.begin() + std::ptrdiff_t(first), open.end());
      }
      open.resize(first);
    };
    for (const std::uint32_t p : walk) {
      if (place_in_loop_[p] != formats::kNone) close(place_in_loop_[p]);
      place_in_loop_[p] = std::uint32_t(open.size());
      open.push_back(p);
    }
    close(0);
  }

  std::uint32_t point(std::uint32_t corner) const { return points_[corner / 3][corner % 3]; }
  const Eigen::Vector3d& position(std::uint32_t triangle, std::size_t k) const {
    return mesh_.welded_positions[points_[triangle][k]];
  }
  double doubleArea(std::uint32_t t) const {
    return (position(t, 1) - position(t, 0)).cross(position(t, 2) - position(t, 0)).norm();
  }
  std::span<const std::uint32_t> halfEdges(std::size_t edge) const {
    return {half_edges_.data() + edge_begin_[edge], edge_begin_[edge + 1] - edge_begin_[edge]};
  }

  const VisualMesh& mesh_;
  std::size_t triangle_count_;
  Topology result_;
  std::vector<Triangle> points_;                 // welded
  std::vector<std::uint8_t> active_;             // takes part
  std::vector<std::uint8_t> distinct_;           // three distinct points
  std::vector<std::uint32_t> zero_area_;         // of those
  std::vector<std::uint32_t> original_;          // of a copy
  std::vector<std::uint32_t> half_edges_;        // corners, edge by edge
  std::vector<std::uint32_t> edge_begin_;        // into half_edges_, one more than edges
  std::vector<std::uint32_t> edge_of_;           // per corner
  std::vector<std::uint32_t> boundary_corners_;  // half-edge of each boundary edge
  std::vector<std::uint32_t> place_in_loop_;     // per welded point, while a loop is split
  geometry::Sets fans_{0};
};

}  // namespace

Topology analyzeTopology(const VisualMesh& mesh) { return Analysis(mesh).run(); }

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/pieces.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>

#include "tools/core/sets.h"
#include "tools/core/text.h"
#include "tools/tetrahedralize/crowds.h"

namespace sinew::tools {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;
using geometry::ParallelFor;
using geometry::TriangleBvh;
using geometry::WindingNumber;

// An open surface whose area vectors add up to more than this fraction of its area has a mouth about as wide as itself
// (a disc 1, a hemisphere 0.5, a cube without a lid 0.2): it encloses nothing.
constexpr double kMostOpen = 0.35;
// Enclosed volume over area^(3/2) (a sphere 0.094, a plate of 1:100 0.003). An open surface must enclose at least that
// much of a plate; of a closed one only rounding is not a solid (both sides of a leaf, back to back).
constexpr double kLeastVolumeOpen = 3e-3;
constexpr double kLeastVolumeClosed = 1e-7;
// An open part that faces inwards is a cavity if more than this part of it lies within the others.
constexpr double kCavityShare = 0.75;
// Pieces within this multiple of the distance that would join them are reported.
constexpr double kNearPieces = 4;
// A sheet that rides along is reported if it has this part of all area, or reaches this part of the model's diagonal
// away from its piece.
constexpr double kLargeSheet = 0.25;
constexpr double kFarSheet = 0.15;

// Triangles over welded points, neighbours turned the same way, relative to the middle of the mesh.
struct Frame {
  Vector3d center;
  std::vector<Vector3d> points;
  std::vector<Triangle> triangles;
};

Frame makeFrame(const VisualMesh& mesh, const Topology& topology) {
  Frame frame;
  frame.center = (mesh.bounds_min + mesh.bounds_max) / 2;
  frame.points.reserve(mesh.welded_positions.size());
  for (const Vector3d& p : mesh.welded_positions) frame.points.emplace_back(p - frame.center);
  frame.triangles.resize(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) frame.triangles[t] = mesh.weldedTriangle(t);
  for (const std::uint32_t t : topology.turned_triangles) std::swap(frame.triangles[t][1], frame.triangles[t][2]);
  return frame;
}

// Directed edges that no opposite one cancels; none means that winding numbers are whole.
std::vector<std::array<std::uint32_t, 2>> unbalancedEdges(std::span<const Triangle> triangles) {
  struct Edge {
    std::uint32_t low, high;
    int direction;
    bool operator<(const Edge& o) const { return low != o.low ? low < o.low : high < o.high; }
  };
  std::vector<Edge> edges;
  edges.reserve(triangles.size() * 3);
  for (const Triangle& t : triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), a < b ? 1 : -1});
    }
  }
  std::sort(edges.begin(), edges.end());
  std::vector<std::array<std::uint32_t, 2>> open;
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i;
    int sum = 0;
    for (; end < edges.size() && edges[end].low == edges[i].low && edges[end].high == edges[i].high; ++end) {
      sum += edges[end].direction;
    }
    if (sum != 0) open.push_back({edges[i].low, edges[i].high});
    i = end;
  }
  return open;
}

struct Enclosure {
  double area = 0;
  double volume = 0;    // signed; holes closed by fans about the middle of their edges
  double openness = 0;  // |sum of area vectors| / area
  bool balanced = false;
  bool encloses = false;
};

Enclosure measure(const Frame& frame, std::span<const Triangle> triangles) {
  Enclosure e;
  const auto open = unbalancedEdges(triangles);
  e.balanced = open.empty();
  Vector3d apex = Vector3d::Zero();
  if (!open.empty()) {
    double length = 0;
    for (const auto& edge : open) {
      const Vector3d &a = frame.points[edge[0]], &b = frame.points[edge[1]];
      apex += (b - a).norm() * (a + b) / 2;
      length += (b - a).norm();
    }
    apex = length > 0 ? Vector3d(apex / length) : frame.points[open.front()[0]];
  } else if (!triangles.empty()) {
    apex = frame.points[triangles.front()[0]];
  }
  Vector3d sum = Vector3d::Zero();
  for (const Triangle& t : triangles) {
    const Vector3d a = frame.points[t[0]] - apex, b = frame.points[t[1]] - apex, c = frame.points[t[2]] - apex;
    const Vector3d normal = (b - a).cross(c - a) / 2;
    sum += normal;
    e.area += normal.norm();
    e.volume += a.dot(b.cross(c)) / 6;
  }
  e.openness = e.area > 0 ? sum.norm() / e.area : 1;
  const double least = (e.balanced ? kLeastVolumeClosed : kLeastVolumeOpen) * std::pow(e.area, 1.5);
  e.encloses = e.area > 0 && std::abs(e.volume) > least && (e.balanced || e.openness < kMostOpen);
  return e;
}

// Where an edge has three faces, one of them is a wall through the inside or a fin outside. The mean of the winding
// numbers on its two sides decides: 1/2 at a surface, 1 at a wall, 0 at a fin. They are left out if that
// leaves no open edge.
std::vector<Triangle> withoutWallsAndFins(const Frame& frame, std::vector<Triangle> triangles) {
  const WindingNumber winding(frame.points, triangles, false);
  std::vector<Triangle> kept;
  for (const Triangle& t : triangles) {
    const Vector3d &a = frame.points[t[0]], &b = frame.points[t[1]], &c = frame.points[t[2]];
    const Vector3d cross = (b - a).cross(c - a);
    const double norm = cross.norm();
    if (norm == 0) {
      kept.push_back(t);
      continue;
    }
    const Vector3d step = 1e-3 * std::sqrt(norm) * cross / norm;
    const Vector3d middle = (a + b + c) / 3;
    const double mean = (winding.at(middle + step) + winding.at(middle - step)) / 2;
    if (std::abs(mean - 0.5) < 0.25) kept.push_back(t);
  }
  if (kept.empty() || kept.size() == triangles.size() || !unbalancedEdges(kept).empty()) return triangles;
  return kept;
}

// Calls `visit(a, b, squared distance)` for triangles of two labels within `distance` of each other, but where
// `same(a, b)` says that these two labels need no more of them.
template <class Same, class Visit>
void forNearTriangles(std::span<const Vector3d> points, std::span<const Triangle> triangles,
                      std::span<const std::uint32_t> label, double distance, const Same& same, const Visit& visit) {
  const TriangleBvh bvh(points, triangles);
  const auto& nodes = bvh.nodes();
  // Nodes whose triangles are all of one label can be skipped as a whole.
  std::vector<std::uint32_t> only(nodes.size(), kNoIndex);
  for (std::size_t n = nodes.size(); n-- > 0;) {
    const auto& node = nodes[n];
    if (node.right != 0) {
      only[n] = only[n + 1] == only[node.right] ? only[n + 1] : kNoIndex;
      continue;
    }
    only[n] = label[bvh.order()[node.first]];
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      if (label[bvh.order()[i]] != only[n]) only[n] = kNoIndex;
    }
  }
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    const TriangleBvh::Corners& mine = bvh.corners()[i];
    const std::uint32_t my_label = label[bvh.order()[i]];
    AlignedBox3d box(mine[0]);
    box.extend(mine[1]);
    box.extend(mine[2]);
    box.extend(Vector3d(box.min() - Vector3d::Constant(distance)));
    box.extend(Vector3d(box.max() + Vector3d::Constant(distance)));
    // Each pair is met from both sides: one is enough.
    bvh.tree().descend(
        [&](const auto& node, std::uint32_t index) {
          return node.first + node.count > i && node.box.intersects(box) &&
                 (only[index] == kNoIndex || !same(only[index], my_label));
        },
        [&](std::uint32_t j) {
          const std::uint32_t other = label[bvh.order()[j]];
          if (j <= i || same(other, my_label)) return;
          const double squared = geometry::squaredDistance(mine, bvh.corners()[j]);
          if (squared <= distance * distance) visit(other, my_label, squared);
        });
  }
}

// Joins parts with triangles within `distance` of each other.
void joinNearParts(const Frame& frame, const Topology& topology, double distance, Sets& sets) {
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> part;
  for (std::uint32_t p = 0; p < topology.parts.size(); ++p) {
    for (const std::uint32_t t : topology.parts[p].triangles) {
      triangles.push_back(frame.triangles[t]);
      part.push_back(p);
    }
  }
  forNearTriangles(
      frame.points, triangles, part, distance,
      [&](std::uint32_t a, std::uint32_t b) { return sets.find(a) == sets.find(b); },
      [&](std::uint32_t a, std::uint32_t b, double) { sets.join(a, b); });
}

// Parts that touch, taken together.
// A solid of at most this part of a neighbour's volume, wholly within this part of the neighbour's diagonal of its
// surface, moves with the neighbour.
constexpr double kAccessoryVolume = 0.02;
constexpr double kAccessoryReach = 0.1;

struct Group {
  std::vector<std::uint32_t> parts, solid_parts;
  std::vector<std::uint32_t> turned;  // open solid parts that were inside out
  std::vector<Triangle> triangles;    // of the solid parts (all where it encloses nothing)
  Enclosure enclosure;
  AlignedBox3d bounds;
  WindingNumber winding;
};

void gather(const Topology& topology, const Frame& frame, const std::vector<std::uint32_t>& parts,
            std::vector<Triangle>& triangles) {
  triangles.clear();
  for (const std::uint32_t p : parts) {
    for (const std::uint32_t t : topology.parts[p].triangles) triangles.push_back(frame.triangles[t]);
  }
}

// Of patches that enclose something together, those it takes: the widest open ones are left out one by one while what
// the others enclose stays nearly the same (fins on a fish of several patches).
std::vector<std::uint32_t> withoutSheets(const Topology& topology, const Frame& frame,
                                         const std::vector<std::uint32_t>& parts, double volume) {
  constexpr std::size_t kMostTried = 64;
  std::vector<std::pair<double, std::uint32_t>> open;
  std::vector<Triangle> triangles;
  for (const std::uint32_t p : parts) {
    gather(topology, frame, {p}, triangles);
    const Enclosure e = measure(frame, triangles);
    if (!e.encloses) open.emplace_back(-e.openness, p);
  }
  std::sort(open.begin(), open.end());
  std::vector<std::uint32_t> kept = parts;
  for (std::size_t i = 0; i < open.size() && i < kMostTried; ++i) {
    std::vector<std::uint32_t> fewer = kept;
    fewer.erase(std::find(fewer.begin(), fewer.end(), open[i].second));
    gather(topology, frame, fewer, triangles);
    const Enclosure e = measure(frame, triangles);
    if (e.encloses && std::abs(e.volume - volume) < 0.03 * std::abs(volume)) kept = std::move(fewer);
  }
  return kept;
}

// Edges that are run through once more one way than the other, that way.
std::vector<std::array<std::uint32_t, 2>> borderOf(std::span<const Triangle> triangles) {
  std::map<std::array<std::uint32_t, 2>, int> runs;
  for (const Triangle& t : triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      runs[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  }
  std::vector<std::array<std::uint32_t, 2>> border;
  for (const auto& [edge, count] : runs) {
    if (count > 0) border.push_back(edge);
    if (count < 0) border.push_back({edge[1], edge[0]});
  }
  return border;
}

// Takes the lids of an open solid, patches that share no edge with it (the front of a letter whose sides are cut more
// finely): those whose border lies on the solid's, turned so that the two run against each other.
void addLids(const Topology& topology, const Frame& frame, const std::vector<std::uint32_t>& parts, Group& group) {
  constexpr std::size_t kMostEdges = 20000;  // each is compared with each
  constexpr double kReach = 1e-3;            // of the solid's diagonal
  const std::vector<std::array<std::uint32_t, 2>> rim = borderOf(group.triangles);
  AlignedBox3d box;
  for (const Triangle& t : group.triangles) {
    for (const std::uint32_t v : t) box.extend(frame.points[v]);
  }
  const double reach = kReach * box.diagonal().norm();
  std::vector<Triangle> triangles;
  for (const std::uint32_t p : parts) {
    const auto& solid = group.solid_parts;
    if (rim.empty() || std::find(solid.begin(), solid.end(), p) != solid.end()) continue;
    gather(topology, frame, {p}, triangles);
    const auto border = borderOf(triangles);
    if (rim.size() + border.size() > kMostEdges) continue;
    double length = 0, with = 0, against = 0;
    for (const auto& edge : border) {
      const Vector3d &a = frame.points[edge[0]], &b = frame.points[edge[1]];
      const Vector3d middle = (a + b) / 2;
      length += (b - a).norm();
      double nearest = reach * reach;
      double along = 0;
      for (const auto& other : rim) {
        const Vector3d& from = frame.points[other[0]];
        const Vector3d way = frame.points[other[1]] - from;
        if (way.squaredNorm() == 0) continue;
        const double t = std::clamp((middle - from).dot(way) / way.squaredNorm(), 0.0, 1.0);
        const double distance = (from + t * way - middle).squaredNorm();
        if (distance > nearest) continue;
        nearest = distance;
        along = (b - a).dot(way.normalized());
      }
      (along > 0 ? with : against) += std::abs(along);
    }
    if (std::max(with, against) < length / 2) continue;
    group.solid_parts.push_back(p);
    for (Triangle& t : triangles) {
      if (with > against) std::swap(t[1], t[2]);
      group.triangles.push_back(t);
    }
  }
  std::sort(group.solid_parts.begin(), group.solid_parts.end());
}

// A Moebius strip: it has no side that could be the outer one, so whatever its turns add up to is no volume.
bool isOneSidedSheet(const SurfacePart& part) { return part.manifold && !part.orientable && !part.closed; }

// A solid part of a group.
struct SolidPart {
  std::uint32_t part;
  std::size_t first, count;  // of the group's triangles
  double volume;
  bool closed;
};

// Turns open parts that face inwards around the others (a shirt on a piece): each would take from the piece what it
// covers. One that lies within them is a cavity and stays (the bag of a mouth).
void turnCovers(const Frame& frame, const std::vector<SolidPart>& solids, Group& group) {
  if (solids.size() < 2) return;
  // The largest closed part faces the right way, else the largest.
  const SolidPart& host = *std::max_element(solids.begin(), solids.end(), [](const SolidPart& a, const SolidPart& b) {
    return a.closed != b.closed ? b.closed : std::abs(a.volume) < std::abs(b.volume);
  });
  const double side = host.volume < 0 ? -1 : 1;
  std::vector<Triangle> right;
  for (const SolidPart& s : solids) {
    if (s.volume * side < 0) continue;
    const auto first = group.triangles.begin() + std::ptrdiff_t(s.first);
    right.insert(right.end(), first, first + std::ptrdiff_t(s.count));
  }
  WindingNumber winding;
  for (const SolidPart& s : solids) {
    if (s.closed || s.volume * side > 0) continue;
    if (winding.bvh().empty()) winding = WindingNumber(frame.points, right, false);
    constexpr std::size_t kSamples = 64;
    const std::size_t step = std::max<std::size_t>(1, s.count / kSamples);
    std::size_t samples = 0, within = 0;
    for (std::size_t i = s.first; i < s.first + s.count; i += step) {
      const Triangle& t = group.triangles[i];
      ++samples;
      const double around = winding.at((frame.points[t[0]] + frame.points[t[1]] + frame.points[t[2]]) / 3);
      if (side * around > 0.5) ++within;
    }
    // A tight one pokes in here and there, and the rim of a cavity out.
    if (double(within) > kCavityShare * double(samples)) continue;
    for (std::size_t i = s.first; i < s.first + s.count; ++i) std::swap(group.triangles[i][1], group.triangles[i][2]);
    group.turned.push_back(s.part);
  }
}

Group makeGroup(const Topology& topology, const Frame& frame, const std::vector<std::uint32_t>& parts) {
  Group group;
  group.parts = parts;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> two_sided;
  std::vector<SolidPart> solids;
  double solid_volume = 0;
  for (const std::uint32_t p : parts) {
    if (isOneSidedSheet(topology.parts[p])) continue;
    two_sided.push_back(p);
    gather(topology, frame, {p}, triangles);
    Enclosure e = measure(frame, triangles);
    if (!e.balanced && !topology.parts[p].manifold) {
      triangles = withoutWallsAndFins(frame, std::move(triangles));
      e = measure(frame, triangles);
    }
    if (!e.encloses) continue;
    group.solid_parts.push_back(p);
    solids.push_back({p, group.triangles.size(), triangles.size(), e.volume, e.balanced});
    group.triangles.insert(group.triangles.end(), triangles.begin(), triangles.end());
    solid_volume += std::abs(e.volume);
  }
  // Patches that enclose something only together: halves of a piece, a coat with its buttons.
  gather(topology, frame, two_sided, triangles);
  const Enclosure all = measure(frame, triangles);
  if (group.solid_parts.size() < two_sided.size() && all.encloses && std::abs(all.volume) > 2 * solid_volume) {
    group.solid_parts = withoutSheets(topology, frame, two_sided, all.volume);
    gather(topology, frame, group.solid_parts, group.triangles);
  } else {
    turnCovers(frame, solids, group);
  }
  if (!group.solid_parts.empty() && group.solid_parts.size() < two_sided.size()) {
    addLids(topology, frame, two_sided, group);
  }
  if (group.solid_parts.empty()) gather(topology, frame, parts, group.triangles);
  group.enclosure = measure(frame, group.triangles);
  group.enclosure.encloses = !group.solid_parts.empty();
  for (const Triangle& t : group.triangles) {
    for (const std::uint32_t v : t) group.bounds.extend(frame.points[v]);
  }
  return group;
}

// Up to `limit` points of a group, spread over its triangles.
std::vector<Vector3d> samplePoints(const Frame& frame, const Group& group, std::size_t limit) {
  std::vector<Vector3d> points;
  const std::size_t step = std::max<std::size_t>(1, group.triangles.size() / limit);
  for (std::size_t i = 0; i < group.triangles.size() && points.size() < limit; i += step) {
    const Triangle& t = group.triangles[i];
    points.push_back((frame.points[t[0]] + frame.points[t[1]] + frame.points[t[2]]) / 3);
  }
  return points;
}

// Joins groups that lie in the solid of others; turns those that are inside out. Whether a group lies in solid or in a
// cavity is the sum over all groups around it, a cavity's shell counting -1.
void joinNestedGroups(const Frame& frame, std::vector<Group>& groups, Sets& sets) {
  std::vector<std::uint32_t> solids;
  for (std::uint32_t g = 0; g < groups.size(); ++g) {
    if (groups[g].enclosure.encloses) solids.push_back(g);
  }
  for (const std::uint32_t a : solids) {
    const std::vector<Vector3d> points = samplePoints(frame, groups[a], 7);
    double around = 0;
    std::uint32_t innermost = kNoIndex;
    for (const std::uint32_t b : solids) {
      if (a == b || !groups[b].bounds.contains(groups[a].bounds)) continue;
      if (std::abs(groups[b].enclosure.volume) <= std::abs(groups[a].enclosure.volume)) continue;
      double mean = 0;
      for (const Vector3d& p : points) mean += groups[b].winding.at(p) / double(points.size());
      // A group inside out as a whole, within no other, is turned below, so its sign counts as turned.
      around += std::round(mean);
      if (std::abs(mean) > 0.5 && (innermost == kNoIndex || std::abs(groups[b].enclosure.volume) <
                                                                std::abs(groups[innermost].enclosure.volume))) {
        innermost = b;
      }
    }
    if (innermost != kNoIndex && std::abs(around) > 0.5) {
      sets.join(a, innermost);
    } else if (groups[a].enclosure.volume < 0) {
      // Outermost, or in a cavity, and inside out.
      for (Triangle& t : groups[a].triangles) std::swap(t[1], t[2]);
      groups[a].enclosure.volume = -groups[a].enclosure.volume;
      groups[a].winding = WindingNumber(frame.points, groups[a].triangles, groups[a].enclosure.balanced);
    }
  }
}

std::uint32_t largestPart(const Topology& topology, const std::vector<std::uint32_t>& parts) {
  return *std::max_element(parts.begin(), parts.end(), [&](std::uint32_t a, std::uint32_t b) {
    return topology.parts[a].area < topology.parts[b].area;
  });
}

std::string pieceName(const VisualMesh& mesh, const Topology& topology, const std::vector<std::uint32_t>& parts) {
  const std::uint32_t triangle = topology.parts[largestPart(topology, parts)].triangles.front();
  for (const SubMeshSource& sub : mesh.sub_meshes) {
    if (triangle < sub.first_triangle || triangle >= sub.first_triangle + sub.triangle_count) continue;
    if (!sub.mesh.empty()) return sub.mesh;
    if (!sub.node.empty()) return sub.node;
  }
  return "piece";
}

// What a person would call a part.
std::string partName(const VisualMesh& mesh, const Topology& topology, std::uint32_t part) {
  const std::vector<std::uint32_t>& triangles = topology.parts[part].triangles;
  for (const GroupSource& group : mesh.groups) {
    if (group.triangles == triangles) return group.name;
  }
  return "part " + std::to_string(part) + " of " + pieceName(mesh, topology, {part});
}

void placeParts(const VisualMesh& mesh, const Topology& topology, const std::vector<std::uint32_t>& parts,
                Finding& finding) {
  constexpr std::size_t kNamed = 4;
  finding.place_kind = "face";
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (i < kNamed) finding.place += (i == 0 ? "" : ", ") + partName(mesh, topology, parts[i]);
    if (i == kNamed) finding.place += ", ...";
    if (i < Finding::kMaxPlaces) {
      finding.places.push_back(mesh.triangle_face[topology.parts[parts[i]].triangles.front()]);
    }
  }
}

// The value of tetrahedra.join that closes a gap, rounded up to two digits.
std::string joinText(double gap, double diagonal) {
  const double value = 1.005 * gap / diagonal;
  const double digit = std::pow(10, std::floor(std::log10(value)) - 1);
  return rounded(std::ceil(value / digit) * digit);
}

// Pieces that the next larger tetrahedra.join would make one: more often the drawers of a chest than two things.
void reportNearPieces(const VisualMesh& mesh, const Topology& topology, const PieceSet& set, double join_distance,
                      std::vector<Finding>& findings) {
  if (set.pieces.size() < 2) return;
  const Vector3d center = (mesh.bounds_min + mesh.bounds_max) / 2;
  std::vector<Vector3d> points;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> label;
  for (std::uint32_t b = 0; b < set.pieces.size(); ++b) {
    const SolidPiece& piece = set.pieces[b];
    const auto first = std::uint32_t(points.size());
    for (const Vector3d& p : piece.positions) points.emplace_back(p + (piece.center - center));
    for (const Triangle& t : piece.triangles) {
      triangles.push_back({first + t[0], first + t[1], first + t[2]});
      label.push_back(b);
    }
  }
  std::map<std::array<std::uint32_t, 2>, double> squared;
  forNearTriangles(
      points, triangles, label, kNearPieces * std::max(join_distance, mesh.weld_tolerance),
      [](std::uint32_t a, std::uint32_t b) { return a == b; },
      [&](std::uint32_t a, std::uint32_t b, double d) {
        const auto [at, fresh] = squared.try_emplace({std::min(a, b), std::max(a, b)}, d);
        at->second = std::min(at->second, d);
      });
  if (squared.empty()) return;
  std::vector<std::pair<double, std::array<std::uint32_t, 2>>> gaps;
  for (const auto& [pair, d] : squared) gaps.emplace_back(std::sqrt(d), pair);
  std::sort(gaps.begin(), gaps.end());
  // What joins all of them: the widest gap that is needed.
  Sets sets(set.pieces.size());
  double widest = 0;
  std::vector<std::uint32_t> near, parts;
  for (const auto& [gap, pair] : gaps) {
    if (sets.join(pair[0], pair[1])) widest = gap;
    near.insert(near.end(), pair.begin(), pair.end());
  }
  std::sort(near.begin(), near.end());
  near.erase(std::unique(near.begin(), near.end()), near.end());
  for (const std::uint32_t b : near) parts.push_back(largestPart(topology, set.pieces[b].parts));
  const auto& [smallest, closest] = gaps.front();
  Finding f;
  f.id = "near-pieces";
  f.count = near.size();
  f.message = std::to_string(near.size()) + " pieces that move on their own lie within " + rounded(kNearPieces) +
              " times tetrahedra.join of another; the smallest gap is " + rounded(1000 * smallest) + " mm, from " +
              set.pieces[closest[0]].title + " to " + set.pieces[closest[1]].title;
  placeParts(mesh, topology, parts, f);
  const std::string first = joinText(smallest, mesh.diagonal), all = joinText(widest, mesh.diagonal);
  f.cure = "Nothing to do if they are to come apart; else --set tetrahedra.join=" + first +
           (first == all ? " makes them one" : " closes the smallest gap, " + all + " one in each pair") +
           ", and more holds them where they lie further apart.";
  findings.push_back(std::move(f));
}

// Sheets that ride along are drawn where the piece's motion would carry them, and touch nothing: that suits fins.
void reportLargeSheets(const VisualMesh& mesh, const Topology& topology, const PieceSet& set,
                       std::vector<Finding>& findings) {
  double all = 0;
  for (const SurfacePart& part : topology.parts) all += part.area;
  std::vector<std::uint32_t> parts;
  double area = 0, farthest = 0;
  for (const SolidPiece& piece : set.pieces) {
    if (!piece.encloses) continue;
    for (const std::uint32_t p : piece.sheets) {
      const SurfacePart& part = topology.parts[p];
      constexpr std::size_t kSamples = 256;
      const std::size_t step = std::max<std::size_t>(1, part.triangles.size() / kSamples);
      double reach = 0;
      for (std::size_t i = 0; i < part.triangles.size(); i += step) {
        for (const std::uint32_t v : mesh.weldedTriangle(part.triangles[i])) {
          const Vector3d local = mesh.welded_positions[v] - piece.center;
          reach = std::max(reach, std::sqrt(piece.winding.bvh().closest(local).squared_distance));
        }
      }
      if (part.area < kLargeSheet * all && reach < kFarSheet * mesh.diagonal) continue;
      parts.push_back(p);
      area += part.area;
      farthest = std::max(farthest, reach);
    }
  }
  if (parts.empty()) return;
  Finding f;
  f.id = "large-sheets";
  f.count = parts.size();
  const bool one = parts.size() == 1;
  f.message = std::to_string(parts.size()) + (one ? " sheet, " : " sheets, ") + rounded(100 * area / all) +
              " % of the area and up to " + rounded(farthest) + " m off the piece nearest to " + (one ? "it" : "them") +
              ", only " + (one ? "follows" : "follow") + " that piece: nothing bends there or stops at the ground";
  placeParts(mesh, topology, parts, f);
  f.cure =
      "Give a sheet two sides and a rim to have it filled, or bake it as a file of its own: alone it becomes a shell "
      "(tetrahedra.thickness).";
  findings.push_back(std::move(f));
}

void reportTurned(const VisualMesh& mesh, const Topology& topology, const PieceSet& set,
                  std::vector<Finding>& findings) {
  if (set.turned_parts.empty()) return;
  Finding f;
  f.id = "cover-inside-out";
  f.count = set.turned_parts.size();
  f.message = std::to_string(f.count) +
              (f.count == 1 ? " open part that faces inwards covers" : " open parts that face inwards cover") +
              " a solid: filled as if it faced outwards";
  placeParts(mesh, topology, set.turned_parts, f);
  f.cure = "Flip its normals in the program that made the file; it is also lit from the wrong side.";
  findings.push_back(std::move(f));
}

// Lengths of rays inside, over a grid of rays: exact along x, sampled in y and z.
double rayVolume(const SolidPiece& piece, const ParallelFor& parallel_for) {
  constexpr std::size_t kRays = 96;
  AlignedBox3d box = piece.bounds;
  const double margin = std::max(1e-3 * box.sizes().norm(), 1e-300);
  const double dy = box.sizes().y() / kRays, dz = box.sizes().z() / kRays;
  std::vector<double> row(kRays, 0);
  parallel_for(kRays, 4, [&](std::size_t begin, std::size_t end) {
    std::vector<TriangleBvh::Crossing> crossings;
    for (std::size_t k = begin; k < end; ++k) {
      for (std::size_t j = 0; j < kRays; ++j) {
        // Off the middle of the cells, so that rays miss the edges of regular meshes.
        const double y = box.min().y() + dy * (double(j) + 0.5137), z = box.min().z() + dz * (double(k) + 0.4893);
        const Vector3d a(box.min().x() - margin, y, z), b(box.max().x() + margin, y, z);
        piece.winding.bvh().crossings(a, b, crossings);
        int winding = 0;
        double inside = 0;
        for (std::size_t i = 0; i < crossings.size(); ++i) {
          winding += crossings[i].winding;
          if (winding > 0 && i + 1 < crossings.size()) inside += crossings[i + 1].parameter - crossings[i].parameter;
        }
        row[k] += inside * (b.x() - a.x()) * dy * dz;
      }
    }
  });
  return std::accumulate(row.begin(), row.end(), 0.0);
}

double pointVolume(const SolidPiece& piece, const ParallelFor& parallel_for) {
  constexpr std::size_t kLongest = 64;
  const Vector3d extent = piece.bounds.sizes();
  std::array<std::size_t, 3> cells{};
  for (int axis = 0; axis < 3; ++axis) {
    const double share = extent.maxCoeff() > 0 ? extent[axis] / extent.maxCoeff() : 1;
    cells[std::size_t(axis)] = std::max<std::size_t>(16, std::size_t(std::ceil(share * kLongest)));
  }
  std::vector<std::size_t> inside(cells[2], 0);
  parallel_for(cells[2], 1, [&](std::size_t begin, std::size_t end) {
    std::vector<Vector3d> row(cells[0]);
    std::vector<char> answers(cells[0]);
    for (std::size_t k = begin; k < end; ++k) {
      for (std::size_t j = 0; j < cells[1]; ++j) {
        for (std::size_t i = 0; i < cells[0]; ++i) {
          const Vector3d unit((double(i) + 0.5) / double(cells[0]), (double(j) + 0.5) / double(cells[1]),
                              (double(k) + 0.5) / double(cells[2]));
          row[i] = piece.bounds.min() + extent.cwiseProduct(unit);
        }
        piece.winding.inside(row, answers);
        inside[k] += std::size_t(std::count(answers.begin(), answers.end(), char(1)));
      }
    }
  });
  const std::size_t total = std::accumulate(inside.begin(), inside.end(), std::size_t(0));
  return piece.bounds.volume() * double(total) / double(cells[0] * cells[1] * cells[2]);
}

void measureVolume(SolidPiece& piece, double divergence_volume, const ParallelFor& parallel_for) {
  if (!piece.encloses) return;
  piece.volume = piece.balanced ? rayVolume(piece, parallel_for) : pointVolume(piece, parallel_for);
  // The divergence theorem counts overlaps twice. Where it agrees with the sampling, it is the exact one.
  if (piece.balanced && std::abs(divergence_volume - piece.volume) <= 0.02 * std::abs(divergence_volume)) {
    piece.volume = divergence_volume;
    piece.volume_exact = true;
  }
}

}  // namespace

PieceSet findPieces(const VisualMesh& mesh, const Topology& topology, double join_distance,
                    const ParallelFor& parallel_for) {
  PieceSet set;
  const auto part_count = static_cast<std::uint32_t>(topology.parts.size());
  set.part_piece.assign(part_count, kNoIndex);
  if (part_count == 0) return set;
  const Frame frame = makeFrame(mesh, topology);

  // 1. Parts that touch are one group.
  Sets near(part_count);
  if (part_count > 1) joinNearParts(frame, topology, std::max(join_distance, mesh.weld_tolerance), near);
  std::vector<std::vector<std::uint32_t>> members(part_count);
  for (std::uint32_t p = 0; p < part_count; ++p) members[near.find(p)].push_back(p);
  std::vector<Group> groups;
  for (const auto& parts : members) {
    if (!parts.empty()) groups.push_back(makeGroup(topology, frame, parts));
  }
  const auto group_count = static_cast<std::uint32_t>(groups.size());
  for (const Group& group : groups) {
    set.turned_parts.insert(set.turned_parts.end(), group.turned.begin(), group.turned.end());
  }

  // 2. Groups inside the solid of others belong to them.
  Sets nested(group_count);
  if (group_count > 1) {
    for (Group& group : groups) {
      if (group.enclosure.encloses) {
        group.winding = WindingNumber(frame.points, group.triangles, group.enclosure.balanced);
      }
    }
  }
  joinNestedGroups(frame, groups, nested);

  // 3. Small solids close to a much larger one (a tongue, a tooth, a button) move with it: as pieces of their own they
  // would fall off it.
  const auto enclosedVolume = [&](std::uint32_t g) { return std::abs(groups[g].enclosure.volume); };
  std::vector<std::uint32_t> small;
  for (std::uint32_t g = 0; g < group_count; ++g) {
    if (!groups[g].enclosure.encloses || nested.find(g) != g) continue;
    for (std::uint32_t h = 0; h < group_count; ++h) {
      if (h == g || !groups[h].enclosure.encloses || enclosedVolume(g) > kAccessoryVolume * enclosedVolume(h)) continue;
      const double reach = kAccessoryReach * groups[h].bounds.diagonal().norm();
      const std::vector<Vector3d> points = samplePoints(frame, groups[g], 64);
      const bool close = std::all_of(points.begin(), points.end(), [&](const Vector3d& p) {
        return groups[h].winding.bvh().closest(p, reach).squared_distance < reach * reach;
      });
      if (!close) continue;
      small.push_back(g);
      break;
    }
  }
  for (const std::uint32_t g : small) {
    groups[g].enclosure.encloses = false;
    groups[g].solid_parts.clear();
    set.attached_solids.insert(set.attached_solids.end(), groups[g].parts.begin(), groups[g].parts.end());
  }

  // 4. Groups that enclose nothing join the nearest that does.
  const bool any = std::any_of(groups.begin(), groups.end(), [](const Group& g) { return g.enclosure.encloses; });
  for (std::uint32_t g = 0; g < group_count && any; ++g) {
    if (groups[g].enclosure.encloses) continue;
    double nearest = std::numeric_limits<double>::infinity();
    std::uint32_t target = kNoIndex;
    const std::vector<Vector3d> points = samplePoints(frame, groups[g], 64);
    for (std::uint32_t h = 0; h < group_count; ++h) {
      if (!groups[h].enclosure.encloses) continue;
      for (const Vector3d& p : points) {
        const double d = groups[h].winding.bvh().closest(p, std::sqrt(nearest)).squared_distance;
        if (d < nearest) {
          nearest = d;
          target = h;
        }
      }
    }
    if (target == kNoIndex)
      target = std::uint32_t(
          std::find_if(groups.begin(), groups.end(), [](const Group& x) { return x.enclosure.encloses; }) -
          groups.begin());
    // Not joined in `nested` by number of group: the solid stays the representative.
    nested.join(g, target);
    if (std::find(small.begin(), small.end(), g) == small.end()) {
      set.attached_sheets.insert(set.attached_sheets.end(), groups[g].parts.begin(), groups[g].parts.end());
    }
  }

  // 5. Pieces, in the order of their first part.
  std::vector<std::vector<std::uint32_t>> piece_groups(group_count);
  for (std::uint32_t g = 0; g < group_count; ++g) piece_groups[nested.find(g)].push_back(g);
  std::vector<std::uint32_t> number(frame.points.size(), kNoIndex);  // of a point in its piece; cleared after each
  for (const auto& list : piece_groups) {
    if (list.empty()) continue;
    SolidPiece piece;
    std::vector<Triangle> triangles;
    double divergence_volume = 0;
    for (const std::uint32_t g : list) {
      const Group& group = groups[g];
      piece.parts.insert(piece.parts.end(), group.parts.begin(), group.parts.end());
      for (const std::uint32_t p : group.parts) {
        if (std::find(group.solid_parts.begin(), group.solid_parts.end(), p) == group.solid_parts.end()) {
          piece.sheets.push_back(p);
        }
      }
      if (group.enclosure.encloses || !any) {
        triangles.insert(triangles.end(), group.triangles.begin(), group.triangles.end());
      }
      if (!group.enclosure.encloses) continue;
      piece.encloses = true;
      divergence_volume += group.enclosure.volume;
    }
    const std::size_t given = triangles.size();
    triangles = withoutCrowds(frame.points, std::move(triangles));
    piece.crowded = triangles.size() < given;
    std::sort(piece.parts.begin(), piece.parts.end());
    std::sort(piece.sheets.begin(), piece.sheets.end());
    piece.name = pieceName(mesh, topology, piece.parts);
    piece.balanced = piece.encloses && unbalancedEdges(triangles).empty();

    AlignedBox3d bounds;
    for (const Triangle& t : triangles) {
      for (const std::uint32_t v : t) bounds.extend(frame.points[v]);
    }
    piece.center = frame.center + bounds.center();
    piece.bounds = AlignedBox3d(bounds.min() - bounds.center(), bounds.max() - bounds.center());
    for (const Triangle& t : triangles) {
      geometry::Triangle local{};
      for (std::size_t i = 0; i < 3; ++i) {
        std::uint32_t& n = number[t[i]];
        if (n == kNoIndex) {
          n = static_cast<std::uint32_t>(piece.positions.size());
          piece.positions.emplace_back(frame.points[t[i]] - bounds.center());
          piece.points.push_back(t[i]);
        }
        local[i] = n;
      }
      piece.triangles.push_back(local);
      piece.area += (piece.positions[local[1]] - piece.positions[local[0]])
                        .cross(piece.positions[local[2]] - piece.positions[local[0]])
                        .norm() /
                    2;
    }
    for (const Triangle& t : triangles) {
      for (const std::uint32_t v : t) number[v] = kNoIndex;
    }
    piece.winding = WindingNumber(piece.positions, piece.triangles, piece.balanced);
    measureVolume(piece, divergence_volume, parallel_for);
    for (const std::uint32_t p : piece.parts) set.part_piece[p] = static_cast<std::uint32_t>(set.pieces.size());
    set.pieces.push_back(std::move(piece));
  }
  std::vector<std::string> names;
  for (const SolidPiece& piece : set.pieces) names.push_back(piece.name);
  names = distinctNames(names);
  for (std::size_t b = 0; b < names.size(); ++b) set.pieces[b].title = names[b];
  return set;
}

std::vector<std::string> distinctNames(const std::vector<std::string>& names) {
  std::map<std::string, std::size_t> all, seen;
  for (const std::string& name : names) ++all[name];
  std::vector<std::string> distinct;
  for (const std::string& name : names) {
    distinct.push_back(all[name] == 1 ? name : name + " " + std::to_string(++seen[name]));
  }
  return distinct;
}

std::vector<Finding> pieceFindings(const VisualMesh& mesh, const Topology& topology, const PieceSet& set,
                                   double join_distance) {
  std::vector<Finding> findings;
  reportNearPieces(mesh, topology, set, join_distance, findings);
  reportLargeSheets(mesh, topology, set, findings);
  reportTurned(mesh, topology, set, findings);
  return findings;
}

}  // namespace sinew::tools

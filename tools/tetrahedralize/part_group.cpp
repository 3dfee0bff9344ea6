// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/part_group.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sinew::tools {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;
using geometry::WindingNumber;

// An open part that faces inwards is a cavity if more than this part of it lies within the others.
constexpr double kCavityShare = 0.75;

void gather(const Topology& topology, const WeldedSurface& surface, const std::vector<std::uint32_t>& parts,
            std::vector<Triangle>& triangles) {
  triangles.clear();
  for (const std::uint32_t p : parts) {
    for (const std::uint32_t t : topology.parts[p].triangles) triangles.push_back(surface.triangles[t]);
  }
}

// Of patches that enclose something together, those it takes: the widest open ones are left out one by one while what
// the others enclose stays nearly the same (fins on a fish of several patches).
std::vector<std::uint32_t> withoutSheets(const Topology& topology, const WeldedSurface& surface,
                                         const std::vector<std::uint32_t>& parts, double volume) {
  constexpr std::size_t kMostTried = 64;
  std::vector<std::pair<double, std::uint32_t>> open;
  std::vector<Triangle> triangles;
  for (const std::uint32_t p : parts) {
    gather(topology, surface, {p}, triangles);
    const Enclosure e = enclosureOf(surface.points, triangles);
    if (!e.encloses) open.emplace_back(-e.openness, p);
  }
  std::sort(open.begin(), open.end());
  std::vector<std::uint32_t> kept = parts;
  for (std::size_t i = 0; i < open.size() && i < kMostTried; ++i) {
    std::vector<std::uint32_t> fewer = kept;
    fewer.erase(std::find(fewer.begin(), fewer.end(), open[i].second));
    gather(topology, surface, fewer, triangles);
    const Enclosure e = enclosureOf(surface.points, triangles);
    if (e.encloses && std::abs(e.volume - volume) < 0.03 * std::abs(volume)) kept = std::move(fewer);
  }
  return kept;
}

// Takes the lids of an open solid, patches that share no edge with it (the front of a letter whose sides are cut more
// finely): those whose border lies on the solid's, turned so that the two run against each other.
void addLids(const Topology& topology, const WeldedSurface& surface, const std::vector<std::uint32_t>& parts,
             PartGroup& group) {
  constexpr std::size_t kMostEdges = 20000;  // each is compared with each
  constexpr double kReach = 1e-3;            // of the solid's diagonal
  const std::vector<std::array<std::uint32_t, 2>> rim = geometry::openEdges(group.triangles);
  AlignedBox3d box;
  for (const Triangle& t : group.triangles) {
    for (const std::uint32_t v : t) box.extend(surface.points[v]);
  }
  const double reach = kReach * box.diagonal().norm();
  std::vector<Triangle> triangles;
  for (const std::uint32_t p : parts) {
    const auto& solid = group.solid_parts;
    if (rim.empty() || std::find(solid.begin(), solid.end(), p) != solid.end()) continue;
    gather(topology, surface, {p}, triangles);
    const auto border = geometry::openEdges(triangles);
    if (rim.size() + border.size() > kMostEdges) continue;
    double length = 0, with = 0, against = 0;
    for (const auto& edge : border) {
      const Vector3d &a = surface.points[edge[0]], &b = surface.points[edge[1]];
      const Vector3d middle = (a + b) / 2;
      length += (b - a).norm();
      double nearest = reach * reach;
      double along = 0;
      for (const auto& other : rim) {
        const Vector3d& from = surface.points[other[0]];
        const Vector3d way = surface.points[other[1]] - from;
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
void turnCovers(const WeldedSurface& surface, const std::vector<SolidPart>& solids, PartGroup& group) {
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
    if (winding.bvh().empty()) winding = WindingNumber(surface.points, right);
    constexpr std::size_t kSamples = 64;
    const std::size_t step = std::max<std::size_t>(1, s.count / kSamples);
    std::size_t samples = 0, within = 0;
    for (std::size_t i = s.first; i < s.first + s.count; i += step) {
      const Triangle& t = group.triangles[i];
      ++samples;
      const double around = winding.at((surface.points[t[0]] + surface.points[t[1]] + surface.points[t[2]]) / 3);
      if (side * around > 0.5) ++within;
    }
    // A tight one pokes in here and there, and the rim of a cavity out.
    if (double(within) > kCavityShare * double(samples)) continue;
    for (std::size_t i = s.first; i < s.first + s.count; ++i) std::swap(group.triangles[i][1], group.triangles[i][2]);
    group.turned.push_back(s.part);
  }
}

}  // namespace

WeldedSurface weldedSurface(const VisualMesh& mesh, const Topology& topology) {
  WeldedSurface surface;
  surface.center = (mesh.bounds_min + mesh.bounds_max) / 2;
  surface.points.reserve(mesh.welded_positions.size());
  for (const Vector3d& p : mesh.welded_positions) surface.points.emplace_back(p - surface.center);
  surface.triangles.resize(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) surface.triangles[t] = mesh.weldedTriangle(t);
  for (const std::uint32_t t : topology.turned_triangles) std::swap(surface.triangles[t][1], surface.triangles[t][2]);
  return surface;
}

PartGroup makePartGroup(const Topology& topology, const WeldedSurface& surface,
                        const std::vector<std::uint32_t>& parts) {
  PartGroup group;
  group.parts = parts;
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> two_sided;
  std::vector<SolidPart> solids;
  double solid_volume = 0;
  for (const std::uint32_t p : parts) {
    if (isOneSidedSheet(topology.parts[p])) continue;
    two_sided.push_back(p);
    gather(topology, surface, {p}, triangles);
    Enclosure e = enclosureOf(surface.points, triangles);
    if (!e.balanced && !topology.parts[p].manifold) {
      triangles = withoutWallsAndFins(surface.points, std::move(triangles));
      e = enclosureOf(surface.points, triangles);
    }
    if (!e.encloses) continue;
    group.solid_parts.push_back(p);
    solids.push_back({p, group.triangles.size(), triangles.size(), e.volume, e.balanced});
    group.triangles.insert(group.triangles.end(), triangles.begin(), triangles.end());
    solid_volume += std::abs(e.volume);
  }
  // Patches that enclose something only together: halves of a piece, a coat with its buttons.
  gather(topology, surface, two_sided, triangles);
  const Enclosure all = enclosureOf(surface.points, triangles);
  if (group.solid_parts.size() < two_sided.size() && all.encloses && std::abs(all.volume) > 2 * solid_volume) {
    group.solid_parts = withoutSheets(topology, surface, two_sided, all.volume);
    gather(topology, surface, group.solid_parts, group.triangles);
  } else {
    turnCovers(surface, solids, group);
  }
  if (!group.solid_parts.empty() && group.solid_parts.size() < two_sided.size()) {
    addLids(topology, surface, two_sided, group);
  }
  if (group.solid_parts.empty()) gather(topology, surface, parts, group.triangles);
  group.enclosure = enclosureOf(surface.points, group.triangles);
  group.enclosure.encloses = !group.solid_parts.empty();
  for (const Triangle& t : group.triangles) {
    for (const std::uint32_t v : t) group.bounds.extend(surface.points[v]);
  }
  return group;
}

}  // namespace sinew::tools

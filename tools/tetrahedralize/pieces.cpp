// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/pieces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "runtime/geometry/sets.h"
#include "tools/tetrahedralize/crowds.h"
#include "tools/tetrahedralize/enclosure.h"
#include "tools/tetrahedralize/near_triangles.h"
#include "tools/tetrahedralize/part_group.h"

namespace sinew::tools {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;
using geometry::ParallelFor;
using geometry::TriangleBvh;
using geometry::WindingNumber;

// A solid of at most this part of a neighbour's volume, wholly within this part of the neighbour's diagonal of its
// surface, moves with the neighbour.
constexpr double kAccessoryVolume = 0.02;
constexpr double kAccessoryReach = 0.1;

// Joins parts with triangles within `distance` of each other.
void joinNearParts(const WeldedSurface& surface, const Topology& topology, double distance, geometry::Sets& sets) {
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> part;
  for (std::uint32_t p = 0; p < topology.parts.size(); ++p) {
    for (const std::uint32_t t : topology.parts[p].triangles) {
      triangles.push_back(surface.triangles[t]);
      part.push_back(p);
    }
  }
  forNearTriangles(
      surface.points, triangles, part, distance,
      [&](std::uint32_t a, std::uint32_t b) { return sets.find(a) == sets.find(b); },
      [&](std::uint32_t a, std::uint32_t b, double) { sets.join(a, b); });
}

// Up to `limit` points of a group, spread over its triangles.
std::vector<Vector3d> samplePoints(const WeldedSurface& surface, const PartGroup& group, std::size_t limit) {
  std::vector<Vector3d> points;
  const std::size_t step = std::max<std::size_t>(1, group.triangles.size() / limit);
  for (std::size_t i = 0; i < group.triangles.size() && points.size() < limit; i += step) {
    const Triangle& t = group.triangles[i];
    points.push_back((surface.points[t[0]] + surface.points[t[1]] + surface.points[t[2]]) / 3);
  }
  return points;
}

// Joins groups that lie in the solid of others; turns inverted ones. Whether a group lies in solid or in a
// cavity is the sum over all groups around it, a cavity's shell counting -1.
void joinNestedGroups(const WeldedSurface& surface, std::vector<PartGroup>& groups, geometry::Sets& sets) {
  std::vector<std::uint32_t> solids;
  for (std::uint32_t g = 0; g < groups.size(); ++g) {
    if (groups[g].enclosure.encloses) solids.push_back(g);
  }
  for (const std::uint32_t a : solids) {
    const std::vector<Vector3d> points = samplePoints(surface, groups[a], 7);
    double around = 0;
    std::uint32_t innermost = formats::kNone;
    for (const std::uint32_t b : solids) {
      if (a == b || !groups[b].bounds.contains(groups[a].bounds)) continue;
      if (std::abs(groups[b].enclosure.volume) <= std::abs(groups[a].enclosure.volume)) continue;
      double mean = 0;
      for (const Vector3d& p : points) mean += groups[b].winding.at(p) / double(points.size());
      // A group inside out as a whole, within no other, is turned below, so its sign counts as turned.
      around += std::round(mean);
      if (std::abs(mean) > 0.5 && (innermost == formats::kNone || std::abs(groups[b].enclosure.volume) <
                                                                      std::abs(groups[innermost].enclosure.volume))) {
        innermost = b;
      }
    }
    if (innermost != formats::kNone && std::abs(around) > 0.5) {
      sets.join(a, innermost);
    } else if (groups[a].enclosure.volume < 0) {
      // Outermost, or in a cavity, and inside out.
      for (Triangle& t : groups[a].triangles) std::swap(t[1], t[2]);
      groups[a].enclosure.volume = -groups[a].enclosure.volume;
      groups[a].winding = WindingNumber(surface.points, groups[a].triangles);
    }
  }
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

PieceSet findPieces(const VisualMesh& mesh, const Topology& topology, double join_distance,
                    const ParallelFor& parallel_for) {
  PieceSet set;
  const auto part_count = static_cast<std::uint32_t>(topology.parts.size());
  set.part_piece.assign(part_count, formats::kNone);
  if (part_count == 0) return set;
  const WeldedSurface surface = weldedSurface(mesh, topology);

  // 1. Parts that touch are one group.
  geometry::Sets near(part_count);
  if (part_count > 1) joinNearParts(surface, topology, std::max(join_distance, mesh.weld_tolerance), near);
  std::vector<std::vector<std::uint32_t>> members(part_count);
  for (std::uint32_t p = 0; p < part_count; ++p) members[near.find(p)].push_back(p);
  std::vector<PartGroup> groups;
  for (const auto& parts : members) {
    if (!parts.empty()) groups.push_back(makePartGroup(topology, surface, parts));
  }
  const auto group_count = static_cast<std::uint32_t>(groups.size());
  for (const PartGroup& group : groups) {
    set.turned_parts.insert(set.turned_parts.end(), group.turned.begin(), group.turned.end());
  }

  // 2. Groups inside the solid of others belong to them.
  geometry::Sets nested(group_count);
  if (group_count > 1) {
    for (PartGroup& group : groups) {
      if (group.enclosure.encloses) {
        group.winding = WindingNumber(surface.points, group.triangles);
      }
    }
  }
  joinNestedGroups(surface, groups, nested);

  // 3. Small solids close to a much larger one (a tongue, a tooth, a button) move with it: as pieces of their own they
  // would fall off it.
  const auto enclosedVolume = [&](std::uint32_t g) { return std::abs(groups[g].enclosure.volume); };
  std::vector<std::uint32_t> small;
  for (std::uint32_t g = 0; g < group_count; ++g) {
    if (!groups[g].enclosure.encloses || nested.find(g) != g) continue;
    for (std::uint32_t h = 0; h < group_count; ++h) {
      if (h == g || !groups[h].enclosure.encloses || enclosedVolume(g) > kAccessoryVolume * enclosedVolume(h)) continue;
      const double reach = kAccessoryReach * groups[h].bounds.diagonal().norm();
      const std::vector<Vector3d> points = samplePoints(surface, groups[g], 64);
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
  const bool any = std::any_of(groups.begin(), groups.end(), [](const PartGroup& g) { return g.enclosure.encloses; });
  for (std::uint32_t g = 0; g < group_count && any; ++g) {
    if (groups[g].enclosure.encloses) continue;
    double nearest = std::numeric_limits<double>::infinity();
    std::uint32_t target = formats::kNone;
    const std::vector<Vector3d> points = samplePoints(surface, groups[g], 64);
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
    if (target == formats::kNone)
      target = std::uint32_t(
          std::find_if(groups.begin(), groups.end(), [](const PartGroup& x) { return x.enclosure.encloses; }) -
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
  std::vector<std::uint32_t> number(surface.points.size(),
                                    formats::kNone);  // of a point in its piece; cleared after each
  for (const auto& list : piece_groups) {
    if (list.empty()) continue;
    SolidPiece piece;
    std::vector<Triangle> triangles;
    double divergence_volume = 0;
    for (const std::uint32_t g : list) {
      const PartGroup& group = groups[g];
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
    triangles = withoutCrowds(surface.points, std::move(triangles));
    piece.crowded = triangles.size() < given;
    std::sort(piece.parts.begin(), piece.parts.end());
    std::sort(piece.sheets.begin(), piece.sheets.end());
    piece.name = pieceName(mesh, topology, piece.parts);

    AlignedBox3d bounds;
    for (const Triangle& t : triangles) {
      for (const std::uint32_t v : t) bounds.extend(surface.points[v]);
    }
    piece.center = surface.center + bounds.center();
    piece.bounds = AlignedBox3d(bounds.min() - bounds.center(), bounds.max() - bounds.center());
    for (const Triangle& t : triangles) {
      geometry::Triangle local{};
      for (std::size_t i = 0; i < 3; ++i) {
        std::uint32_t& n = number[t[i]];
        if (n == formats::kNone) {
          n = static_cast<std::uint32_t>(piece.positions.size());
          piece.positions.emplace_back(surface.points[t[i]] - bounds.center());
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
      for (const std::uint32_t v : t) number[v] = formats::kNone;
    }
    piece.winding = WindingNumber(piece.positions, piece.triangles);
    piece.balanced = piece.encloses && piece.winding.closed();
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

}  // namespace sinew::tools

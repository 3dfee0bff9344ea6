// SPDX-License-Identifier: MIT
#include "runtime/cut/parts.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "runtime/cut/crossing.h"
#include "runtime/geometry/sets.h"

namespace sinew::cutting {
namespace {

/// Share of its mass that a vertex has in each of its copies at least.
constexpr double kLeastShare = 1e-6;

class Finder {
 public:
  Finder(const formats::PackageView& package, const Surface& surface, const Section& section,
         const std::vector<Hung>& nodes, Sides& sides)
      : package_(package),
        surface_(surface),
        section_(section),
        nodes_(nodes),
        sides_(sides),
        vertices_(std::uint32_t(sides.side.size())),
        tetrahedra_(std::uint32_t(package.tetrahedra().size())),
        together_(2 * std::size_t(vertices_) + 2 * std::size_t(tetrahedra_)) {
    joinTetrahedra();
    joinRiders();
    joinSurface();
  }

  Partition find(double least, bool last) {
    measure();
    Partition partition;
    if (!last && giveBack(least)) {
      partition.again = true;
      return partition;
    }
    joinRemains(last ? least : 0);
    collect(partition);
    shareMasses(package_, shares_, partition);
    return partition;
  }

 private:
  std::uint32_t vertexAt(Side side, std::uint32_t v) const { return std::uint32_t(placeOf(side)) * vertices_ + v; }
  std::uint32_t tetrahedronAt(Side side, std::uint32_t t) const {
    return 2 * vertices_ + std::uint32_t(placeOf(side)) * tetrahedra_ + t;
  }
  const Corners4& cornersOf(std::uint32_t t) const { return package_.tetrahedra()[t].vertex; }

  void joinTetrahedra() {
    has_.resize(2 * std::size_t(tetrahedra_), 0);
    for (std::uint32_t t = 0; t < tetrahedra_; ++t) {
      bool flat = true;
      for (const std::uint32_t v : cornersOf(t)) flat = flat && sides_.side[v] == 0;
      for (const Side side : kSides) {
        bool strict = flat && side < 0;
        for (const std::uint32_t v : cornersOf(t)) strict = strict || sides_.side[v] == side;
        if (!strict) continue;
        has_[placeOf(side) * tetrahedra_ + t] = 1;
        for (const std::uint32_t v : cornersOf(t)) {
          if (sides_.side[v] != -side) together_.join(tetrahedronAt(side, t), vertexAt(side, v));
        }
      }
    }
  }

  /// An accessory's tetrahedron hangs together with what carries it.
  void joinRiders() {
    for (std::uint32_t p = 0; p < package_.parts().size(); ++p) {
      if (package_.parts()[p].cluster == formats::kNone) continue;
      const formats::Cluster& cluster = package_.clusters()[package_.parts()[p].cluster];
      const auto members = package_.memberships().subspan(cluster.first_member, cluster.member_count);
      Side side = 0;
      for (const formats::Membership& m : members) {
        if (m.share > 0) side = sides_.side[m.vertex];
      }
      if (side == 0) continue;
      const formats::Membership* host = nullptr;
      for (const formats::Membership& m : members) {
        if (!(m.share > 0) && sides_.side[m.vertex] != -side && (host == nullptr || m.mu > host->mu)) host = &m;
      }
      for (const formats::Membership& m : members) {
        if (m.share > 0 && host != nullptr) together_.join(vertexAt(side, m.vertex), vertexAt(side, host->vertex));
      }
    }
  }

  std::uint32_t tetrahedronOfCorner(std::uint32_t corner) const {
    const auto visual = std::uint32_t(package_.visualPositions().size());
    return corner < visual ? package_.barycentric()[corner].tetrahedron
                           : nodes_[surface_.vertices[corner - visual].node].tetrahedron;
  }

  /// Tetrahedra that carry the surface are needed on the surface's side.
  void joinSurface() {
    for (const Fragment& fragment : surface_.fragments) {
      const std::uint32_t first = tetrahedronOfCorner(fragment.corner[0]);
      for (const std::uint32_t corner : fragment.corner) need(fragment.side, first, tetrahedronOfCorner(corner));
    }
    for (const Polygon& polygon : section_.polygons) {
      const std::uint32_t first = nodes_[polygon.nodes[0]].tetrahedron;
      for (const Side side : kSides) {
        for (const std::uint32_t n : polygon.nodes) need(side, first, nodes_[n].tetrahedron);
        for (const Interior& point : polygon.interior) need(side, first, point.hung.tetrahedron);
      }
    }
  }

  void need(Side side, std::uint32_t first, std::uint32_t t) {
    has_[placeOf(side) * tetrahedra_ + t] = 1;
    if (t != first) together_.join(tetrahedronAt(side, first), tetrahedronAt(side, t));
  }

  void measure() {
    shares_ = findShares(package_, sides_);
    mass_of_.assign(2 * std::size_t(vertices_) + 2 * std::size_t(tetrahedra_), 0);
    for (std::uint32_t t = 0; t < tetrahedra_; ++t) {
      for (const Side side : kSides) {
        if (has_[placeOf(side) * tetrahedra_ + t] == 0) continue;
        mass_of_[together_.find(tetrahedronAt(side, t))] += shares_.massOf(package_, t, side);
      }
    }
  }

  /// Roots of what has a surface.
  std::vector<char> drawn() {
    std::vector<char> result(mass_of_.size(), 0);
    for (const Fragment& fragment : surface_.fragments) {
      result[together_.find(tetrahedronAt(fragment.side, tetrahedronOfCorner(fragment.corner[0])))] = 1;
    }
    return result;
  }

  /// Parts of pieces that the plane passes through, which have no surface or next to no mass, go to the other side.
  bool giveBack(double least) {
    const std::vector<char> has_surface = drawn();
    const double all = double(package_.info().total_mass);
    // Whole pieces are no such parts.
    std::vector<char> whole(mass_of_.size(), 0);
    for (const formats::PieceRange& piece : package_.pieces()) {
      std::uint32_t root = formats::kNone;
      bool one = true;
      for (std::uint32_t t = piece.first_tetrahedron; t < piece.first_tetrahedron + piece.tetrahedron_count; ++t) {
        for (const Side side : kSides) {
          if (has_[placeOf(side) * tetrahedra_ + t] == 0) continue;
          const std::uint32_t r = together_.find(tetrahedronAt(side, t));
          one = one && (root == formats::kNone || root == r);
          root = r;
        }
      }
      if (one && root != formats::kNone) whole[root] = 1;
    }
    const auto isSmall = [&](std::uint32_t root) {
      return whole[root] == 0 && (has_surface[root] == 0 || mass_of_[root] < least * all);
    };
    bool some = false;
    std::vector<Side> to = sides_.side, visual_to = sides_.visual_side;
    for (std::uint32_t v = 0; v < vertices_; ++v) {
      const Side side = sides_.side[v];
      if (side == 0 || !isSmall(together_.find(vertexAt(side, v)))) continue;
      to[v] = Side(-side);
      some = true;
    }
    for (std::uint32_t v = 0; v < sides_.visual_side.size(); ++v) {
      const Side side = sides_.visual_side[v];
      const std::uint32_t t = package_.barycentric()[v].tetrahedron;
      if (side == 0 || has_[placeOf(side) * tetrahedra_ + t] == 0) continue;
      if (!isSmall(together_.find(tetrahedronAt(side, t)))) continue;
      for_points_.push_back(sides_.weld[v]);
      some = true;
    }
    // Welded vertices go together.
    std::vector<char> turned(sides_.face.size(), 0);
    for (const std::uint32_t point : for_points_) turned[point] = 1;
    for (std::uint32_t v = 0; v < visual_to.size(); ++v) {
      if (turned[sides_.weld[v]] != 0) visual_to[v] = Side(-sides_.visual_side[v]);
    }
    sides_.side = std::move(to);
    sides_.visual_side = std::move(visual_to);
    return some;
  }

  /// A rest without a surface, or too small, joins the largest part.
  void joinRemains(double least) {
    const std::vector<char> has_surface = drawn();
    const double all = double(package_.info().total_mass);
    std::uint32_t largest = 0;
    for (std::uint32_t r = 0; r < mass_of_.size(); ++r) {
      if (mass_of_[r] > mass_of_[largest]) largest = r;
    }
    for (std::uint32_t t = 0; t < tetrahedra_; ++t) {
      for (const Side side : kSides) {
        if (has_[placeOf(side) * tetrahedra_ + t] == 0) continue;
        const std::uint32_t root = together_.find(tetrahedronAt(side, t));
        if (root != together_.find(largest) && (has_surface[root] == 0 || mass_of_[root] < least * all)) {
          together_.join(root, largest);
        }
      }
    }
  }

  void collect(Partition& partition) {
    std::vector<std::uint32_t> part_of_root(mass_of_.size(), formats::kNone);
    const auto partOf = [&](std::uint32_t root, Side side) {
      std::uint32_t& part = part_of_root[root];
      if (part == formats::kNone) {
        part = std::uint32_t(partition.parts.size());
        partition.parts.emplace_back().side = side;
      }
      return part;
    };
    for (const Side side : kSides) {
      const std::size_t place = placeOf(side);
      for (std::uint32_t t = 0; t < tetrahedra_; ++t) {
        if (has_[place * tetrahedra_ + t] == 0) continue;
        PartMesh& part = partition.parts[partOf(together_.find(tetrahedronAt(side, t)), side)];
        PartTetrahedron& tetrahedron = part.tetrahedra.emplace_back();
        tetrahedron.source = t;
        shares_.take(side, tetrahedron);
      }
    }
    // A part of both sides (joined remains) may list a tetrahedron twice.
    for (PartMesh& part : partition.parts) {
      const auto comes_before = [](const auto& a, const auto& b) { return a.source < b.source; };
      const auto twice =
          std::ranges::adjacent_find(part.tetrahedra, std::ranges::greater_equal{}, &PartTetrahedron::source);
      if (twice == part.tetrahedra.end()) continue;
      std::stable_sort(part.tetrahedra.begin(), part.tetrahedra.end(), comes_before);
      std::size_t kept = 0;
      for (const PartTetrahedron& t : part.tetrahedra) {
        if (kept > 0 && part.tetrahedra[kept - 1].source == t.source) {
          PartTetrahedron& one = part.tetrahedra[kept - 1];
          const double sum = std::max(1e-300, one.volume + t.volume);
          for (std::size_t k = 0; k < 4; ++k)
            one.center[k] = (one.center[k] * one.volume + t.center[k] * t.volume) / sum;
          one.volume += t.volume;
        } else {
          part.tetrahedra[kept++] = t;
        }
      }
      part.tetrahedra.resize(kept);
    }
    partition.part_of.assign(2 * std::size_t(vertices_), formats::kNone);
    for (const Side side : kSides) {
      for (std::uint32_t v = 0; v < vertices_; ++v) {
        if (sides_.side[v] != -side) {
          partition.part_of[vertexAt(side, v)] = part_of_root[together_.find(vertexAt(side, v))];
        }
      }
    }
    for (std::uint32_t f = 0; f < surface_.fragments.size(); ++f) {
      const Fragment& fragment = surface_.fragments[f];
      const std::uint32_t root = together_.find(tetrahedronAt(fragment.side, tetrahedronOfCorner(fragment.corner[0])));
      partition.parts[part_of_root[root]].fragments.push_back(f);
    }
    for (std::uint32_t p = 0; p < section_.polygons.size(); ++p) {
      const std::uint32_t t = nodes_[section_.polygons[p].nodes[0]].tetrahedron;
      for (const Side side : kSides) {
        std::vector<PartPolygon>& list = partition.parts[part_of_root[together_.find(tetrahedronAt(side, t))]].polygons;
        list.push_back({p, side});
      }
    }
    // Vertices: those of its tetrahedra.
    std::vector<std::uint32_t> seen(vertices_, formats::kNone);
    for (std::uint32_t p = 0; p < partition.parts.size(); ++p) {
      PartMesh& part = partition.parts[p];
      for (const PartTetrahedron& t : part.tetrahedra) {
        for (const std::uint32_t v : cornersOf(t.source)) {
          if (seen[v] != p) seen[v] = p, part.vertices.push_back(v);
        }
      }
      std::sort(part.vertices.begin(), part.vertices.end());
      for (const std::uint32_t v : part.vertices) {
        part.own.push_back(partition.part_of[v] == p || partition.part_of[vertices_ + v] == p ? 1 : 0);
      }
    }
    addLoose(package_, partition);
    std::vector<std::uint32_t> place(vertices_, 0);
    for (PartMesh& part : partition.parts) {
      for (std::uint32_t i = 0; i < part.vertices.size(); ++i) place[part.vertices[i]] = i;
      for (PartTetrahedron& t : part.tetrahedra) {
        for (std::size_t k = 0; k < 4; ++k) t.corner[k] = place[cornersOf(t.source)[k]];
      }
    }
  }

  const formats::PackageView& package_;
  const Surface& surface_;
  const Section& section_;
  const std::vector<Hung>& nodes_;
  Sides& sides_;
  const std::uint32_t vertices_, tetrahedra_;
  geometry::Sets together_;
  std::vector<char> has_;  // tetrahedra below, then above: some part there has them
  Shares shares_;
  std::vector<double> mass_of_;  // by root
  std::vector<std::uint32_t> for_points_;
};

}  // namespace

double Shares::massOf(const formats::PackageView& package, std::uint32_t tetrahedron, Side side) const {
  double mass = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const std::uint32_t v = package.tetrahedra()[tetrahedron].vertex[k];
    mass += double(package.physicalVertices()[v].mass) * volumes[tetrahedron] *
            fractions[tetrahedron].moments[placeOf(side)][k] / total[v];
  }
  return mass;
}

void Shares::take(Side side, PartTetrahedron& to) const {
  const Fraction& fraction = fractions[to.source];
  const double share = fraction.volume[placeOf(side)];
  to.volume = share * volumes[to.source];
  for (std::size_t k = 0; k < 4; ++k) {
    to.center[k] = share > 1e-12 ? fraction.moments[placeOf(side)][k] / share : 0.25;
  }
}

Shares findShares(const formats::PackageView& package, const Sides& sides) {
  Shares shares;
  const auto tetrahedra = package.tetrahedra();
  shares.fractions.resize(tetrahedra.size());
  shares.volumes.resize(tetrahedra.size());
  shares.total.assign(package.physicalVertices().size(), 0);
  const auto rest = [&](std::uint32_t v) { return asVector(package.physicalVertices()[v].rest_position); };
  for (std::uint32_t t = 0; t < tetrahedra.size(); ++t) {
    const Corners4& corners = tetrahedra[t].vertex;
    std::array<double, 4> height = {};
    std::array<Side, 4> side = {};
    for (std::size_t k = 0; k < 4; ++k) {
      height[k] = sides.heightOf(corners[k]);
      side[k] = sides.side[corners[k]];
    }
    shares.fractions[t] = fractionOf(height, side);
    shares.volumes[t] = std::max(1e-300, std::abs(edgesOf(corners, rest).determinant()) / 6);
    for (const std::uint32_t v : corners) shares.total[v] += shares.volumes[t] / 4;
  }
  return shares;
}

void addLoose(const formats::PackageView& package, Partition& partition) {
  std::vector<char> used(package.physicalVertices().size(), 0);
  for (const formats::Tetrahedron& t : package.tetrahedra()) {
    for (const std::uint32_t v : t.vertex) used[v] = 1;
  }
  for (const formats::PieceRange& piece : package.pieces()) {
    for (std::uint32_t v = piece.first_vertex; v < piece.first_vertex + piece.vertex_count; ++v) {
      if (used[v] != 0) continue;
      PartMesh* best = nullptr;
      std::size_t most = 0;
      for (PartMesh& part : partition.parts) {
        const auto low = std::lower_bound(part.vertices.begin(), part.vertices.end(), piece.first_vertex);
        const auto high = std::lower_bound(low, part.vertices.end(), piece.first_vertex + piece.vertex_count);
        if (best == nullptr || std::size_t(high - low) > most) best = &part, most = std::size_t(high - low);
      }
      if (best == nullptr) continue;
      const auto at = std::lower_bound(best->vertices.begin(), best->vertices.end(), v);
      best->own.insert(best->own.begin() + (at - best->vertices.begin()), 1);
      const auto place = std::uint32_t(at - best->vertices.begin());
      best->vertices.insert(at, v);
      for (PartTetrahedron& t : best->tetrahedra) {
        for (std::uint32_t& corner : t.corner) corner += corner >= place ? 1U : 0U;
      }
    }
  }
}

void shareMasses(const formats::PackageView& package, const Shares& shares, Partition& partition) {
  std::vector<std::uint32_t> copies(package.physicalVertices().size(), 0);
  std::vector<std::vector<double>> parts;
  for (PartMesh& part : partition.parts) {
    for (const std::uint32_t v : part.vertices) ++copies[v];
    std::vector<double>& volume = parts.emplace_back(part.vertices.size(), 0.0);
    for (const PartTetrahedron& t : part.tetrahedra) {
      for (std::size_t k = 0; k < 4; ++k) volume[t.corner[k]] += t.volume * t.center[k];
    }
    part.masses.resize(part.vertices.size());
  }
  struct Copy {
    std::uint32_t vertex, part, place;
  };
  std::vector<Copy> shared;
  for (std::uint32_t p = 0; p < partition.parts.size(); ++p) {
    PartMesh& part = partition.parts[p];
    for (std::uint32_t i = 0; i < part.vertices.size(); ++i) {
      const std::uint32_t v = part.vertices[i];
      part.masses[i] = package.physicalVertices()[v].mass;
      if (copies[v] > 1) shared.push_back({v, p, i});
    }
  }
  std::stable_sort(shared.begin(), shared.end(), [](const Copy& a, const Copy& b) { return a.vertex < b.vertex; });
  for (std::size_t first = 0, end = 0; first < shared.size(); first = end) {
    while (end < shared.size() && shared[end].vertex == shared[first].vertex) ++end;
    const double mass = double(package.physicalVertices()[shared[first].vertex].mass);
    double sum = 0, most = -1;
    std::size_t largest = first;
    for (std::size_t i = first; i < end; ++i) {
      double& share = parts[shared[i].part][shared[i].place];
      share = std::max(share / std::max(1e-300, shares.total[shared[i].vertex]), kLeastShare);
      sum += share;
      if (share > most) most = share, largest = i;
    }
    // Whole numbers of the last digit of the mass, so that the copies sum to it exactly.
    const double digit = double(std::nextafter(float(mass), std::numeric_limits<float>::infinity())) - mass;
    double left = mass;
    for (std::size_t i = first; i < end; ++i) {
      if (i == largest) continue;
      const double share = mass * parts[shared[i].part][shared[i].place] / sum;
      const double part_mass = std::max(1.0, std::round(share / digit)) * digit;
      partition.parts[shared[i].part].masses[shared[i].place] = float(part_mass);
      left -= part_mass;
    }
    partition.parts[shared[largest].part].masses[shared[largest].place] = float(left);
  }
}

Partition findParts(const formats::PackageView& package, const Surface& surface, const Section& section,
                    const std::vector<Hung>& nodes, double least, bool last, Sides& sides) {
  return Finder(package, surface, section, nodes, sides).find(least, last);
}

}  // namespace sinew::cutting

// SPDX-License-Identifier: MIT
#include <Eigen/Geometry>
#include <algorithm>

#include "runtime/cut/crossing.h"
#include "runtime/cut/parts.h"
#include "runtime/geometry/sets.h"

namespace sinew::cutting {
namespace {

using formats::kNone;

class Opening {
 public:
  Opening(const formats::PackageView& package, const Surface& surface, const Section& section,
          const std::vector<Hung>& nodes, const Sides& sides)
      : package_(package),
        surface_(surface),
        section_(section),
        nodes_(nodes),
        sides_(sides),
        vertices_(std::uint32_t(sides.side.size())),
        tetrahedra_(std::uint32_t(package.tetrahedra().size())),
        crossed_of_(tetrahedra_, kNone) {
    shares_ = findShares(package, sides);
    listCrossed();
    listFaces();
  }

  Partition find(double least) {
    do {
      hang();
      join();
    } while (mend(least));
    Partition partition;
    collect(partition);
    addLoose(package_, partition);
    shareMasses(package_, shares_, partition);
    return partition;
  }

 private:
  /// A tetrahedron that the plane passes through.
  struct Crossed {
    Gap gap;
    bool cut = false;
    bool severed = false;  ///< no tetrahedra lead from one side of it to the other
    /// Of the corners, on the side on which they do not lie.
    std::array<std::uint32_t, 4> ghost = {};
  };
  struct Face {
    std::uint32_t a, b;                   // of crossed_
    std::array<std::uint32_t, 3> corner;  // of the package
  };

  const Corners4& cornersOf(std::uint32_t t) const { return package_.tetrahedra()[t].vertex; }
  Vector3d restOf(std::uint32_t v) const { return asVector(package_.physicalVertices()[v].rest_position); }

  void listCrossed() {
    for (std::uint32_t t = 0; t < tetrahedra_; ++t) {
      const Corners4& corners = cornersOf(t);
      std::array<std::size_t, 4> up = {}, down = {};
      std::size_t above = 0, below = 0;
      for (std::size_t k = 0; k < 4; ++k) (sides_.side[corners[k]] > 0 ? up[above++] : down[below++]) = k;
      if (above == 0 || below == 0 || sides_.rider[corners[0]] != kNone) continue;
      // Around the plane in it: from edge to edge over a common corner.
      std::vector<std::array<double, 4>> around;
      Vector2d middle = Vector2d::Zero();
      const auto add = [&](std::size_t a, std::size_t b) {
        const double from = sides_.heightOf(corners[a]), to = sides_.heightOf(corners[b]), share = from / (from - to);
        std::array<double, 4>& p = around.emplace_back();
        p[a] = 1 - share;
        p[b] = share;
        middle += sides_.plane.flat(sides_.at[corners[a]] + share * (sides_.at[corners[b]] - sides_.at[corners[a]]));
      };
      for (std::size_t i = 0; i < above; ++i) {
        for (std::size_t j = 0; j < below; ++j) add(up[i], down[i % 2 == 0 ? j : below - 1 - j]);
      }
      Crossed made;
      made.cut = isWithin(*sides_.plane.outline, middle / double(around.size()));
      made.gap = gapOf(t, around);
      crossed_of_[t] = std::uint32_t(crossed_.size());
      crossed_.push_back(made);
    }
  }

  Gap gapOf(std::uint32_t t, const std::vector<std::array<double, 4>>& around) const {
    Gap gap;
    gap.tetrahedron = t;
    const auto place = [&](const std::array<double, 4>& p) {
      Vector3d x = Vector3d::Zero();
      for (std::size_t k = 0; k < 4; ++k) x += p[k] * restOf(cornersOf(t)[k]);
      return x;
    };
    const Vector3d first = place(around[0]);
    for (std::size_t i = 1; i + 1 < around.size(); ++i) {
      const double area = 0.5 * (place(around[i]) - first).cross(place(around[i + 1]) - first).norm();
      gap.area += area;
      for (std::size_t k = 0; k < 4; ++k) gap.center[k] += area / 3 * (around[0][k] + around[i][k] + around[i + 1][k]);
    }
    if (gap.area > 0) {
      for (double& c : gap.center) c /= gap.area;
    }
    return gap;
  }

  /// Faces between crossed tetrahedra that the plane passes through.
  void listFaces() {
    std::vector<Face> all;
    for (std::uint32_t i = 0; i < crossed_.size(); ++i) {
      const Corners4& corners = cornersOf(crossed_[i].gap.tetrahedron);
      for (std::size_t out = 0; out < 4; ++out) {
        Face face = {i, kNone, {}};
        int sum = 0;
        for (std::size_t k = 0, n = 0; k < 4; ++k) {
          if (k == out) continue;
          face.corner[n++] = corners[k];
          sum += sides_.side[corners[k]];
        }
        if (sum == 3 || sum == -3) continue;
        std::sort(face.corner.begin(), face.corner.end());
        all.push_back(face);
      }
    }
    std::stable_sort(all.begin(), all.end(), [](const Face& a, const Face& b) { return a.corner < b.corner; });
    for (std::size_t i = 0; i + 1 < all.size(); ++i) {
      if (all[i].corner != all[i + 1].corner) continue;
      faces_.push_back({all[i].a, all[i + 1].a, all[i].corner});
    }
  }

  /// Copies of vertices: number v is vertex v with what lies about it; from vertices_ on those of ghosts.
  void hang() {
    const std::size_t ghosts = 4 * crossed_.size();
    geometry::Sets same(std::size_t(vertices_) + ghosts);
    const auto ghostOf = [&](std::uint32_t i, std::uint32_t v) {
      const Corners4& corners = cornersOf(crossed_[i].gap.tetrahedron);
      const auto k = std::uint32_t(std::find(corners.begin(), corners.end(), v) - corners.begin());
      return crossed_[i].cut ? vertices_ + 4 * i + k : v;
    };
    for (const Face& face : faces_) {
      for (const std::uint32_t v : face.corner) same.join(ghostOf(face.a, v), ghostOf(face.b, v));
    }
    for (std::uint32_t i = 0; i < crossed_.size(); ++i) {
      for (std::size_t k = 0; k < 4; ++k) {
        crossed_[i].ghost[k] = same.find(ghostOf(i, cornersOf(crossed_[i].gap.tetrahedron)[k]));
      }
    }
  }

  bool isCut(std::uint32_t t) const { return crossed_of_[t] != kNone && crossed_[crossed_of_[t]].cut; }
  /// The copy of a tetrahedron on a side: a number from 0 to twice theirs.
  std::uint32_t copyOf(std::uint32_t t, Side side) const { return 2 * t + (isCut(t) && side > 0 ? 1 : 0); }
  std::uint32_t cornerOf(std::uint32_t t, Side side, std::size_t k) const {
    const std::uint32_t v = cornersOf(t)[k];
    return isCut(t) && sides_.side[v] != side ? crossed_[crossed_of_[t]].ghost[k] : v;
  }
  template <class Visit>
  void forEachCopy(const Visit& visit) const {
    for (std::uint32_t t = 0; t < tetrahedra_; ++t) {
      if (isCut(t)) {
        for (const Side side : kSides) visit(t, side);
      } else {
        visit(t, Side(0));
      }
    }
  }

  /// Joins copies that hang together: vertices, then tetrahedra.
  void join() {
    const std::uint32_t first = vertices_ + 4 * std::uint32_t(crossed_.size());
    together_.emplace(std::size_t(first) + 2 * std::size_t(tetrahedra_));
    forEachCopy([&](std::uint32_t t, Side side) {
      for (std::size_t k = 0; k < 4; ++k) together_->join(first + copyOf(t, side), cornerOf(t, side, k));
    });
    for (std::uint32_t p = 0; p < package_.parts().size(); ++p) joinRider(p);
    for (Crossed& one : crossed_) one.severed = one.cut && !isOne(one);
    for (const Fragment& fragment : surface_.fragments) {
      for (const std::uint32_t corner : fragment.corner)
        together_->join(rootOf(fragment, fragment.corner[0]), rootOf(fragment, corner));
    }
    for (const Polygon& polygon : section_.polygons) {
      for (const Side side : kSides) {
        const std::uint32_t root = rootOf(nodes_[polygon.nodes[0]].tetrahedron, side);
        for (const std::uint32_t n : polygon.nodes) together_->join(root, rootOf(nodes_[n].tetrahedron, side));
        for (const Interior& point : polygon.interior) together_->join(root, rootOf(point.hung.tetrahedron, side));
      }
    }
  }

  /// Whether both sides hang together.
  bool isOne(const Crossed& one) { return rootOf(one.gap.tetrahedron, -1) == rootOf(one.gap.tetrahedron, 1); }
  std::uint32_t rootOf(std::uint32_t t, Side side) {
    return together_->find(vertices_ + 4 * std::uint32_t(crossed_.size()) + copyOf(t, side));
  }
  std::uint32_t rootOf(const Fragment& fragment, std::uint32_t corner) {
    const auto visual = std::uint32_t(package_.visualPositions().size());
    if (corner < visual) return rootOf(package_.barycentric()[corner].tetrahedron, sides_.visual_side[corner]);
    return rootOf(nodes_[surface_.vertices[corner - visual].node].tetrahedron, fragment.side);
  }

  /// An accessory's tetrahedron hangs together with what carries it most.
  void joinRider(std::uint32_t p) {
    if (package_.parts()[p].cluster == kNone) return;
    const formats::Cluster& cluster = package_.clusters()[package_.parts()[p].cluster];
    const formats::Membership* host = nullptr;
    const auto members = package_.memberships().subspan(cluster.first_member, cluster.member_count);
    for (const formats::Membership& m : members) {
      if (!(m.share > 0) && (host == nullptr || m.mu > host->mu)) host = &m;
    }
    for (const formats::Membership& m : members) {
      if (m.share > 0 && host != nullptr) together_->join(m.vertex, host->vertex);
    }
  }

  /// Takes back cuts that open nothing, leave what is too small, or sever what the drawn surface does not: nothing
  /// would hold that. \return whether there were any.
  bool mend(double least) {
    const std::uint32_t first = vertices_ + 4 * std::uint32_t(crossed_.size());
    std::vector<double> mass(std::size_t(first) + 2 * std::size_t(tetrahedra_), 0);
    std::vector<char> drawn(mass.size(), 0);
    forEachCopy([&](std::uint32_t t, Side side) {
      for (const Side part : kSides) {
        if (side == 0 || side == part) mass[rootOf(t, side)] += shares_.massOf(package_, t, part);
      }
    });
    for (const Fragment& fragment : surface_.fragments) drawn[rootOf(fragment, fragment.corner[0])] = 1;
    const double enough = least * double(package_.info().total_mass);
    bool some = false;
    for (Crossed& one : crossed_) {
      if (!one.cut) continue;
      const std::uint32_t t = one.gap.tetrahedron;
      bool opens = false;
      const bool hangs = one.severed && isOne(one);
      for (std::size_t k = 0; k < 4 && !hangs; ++k) opens = opens || one.ghost[k] != cornersOf(t)[k];
      for (const Side side : kSides) {
        const std::uint32_t root = rootOf(t, side);
        opens = opens && drawn[root] != 0 && !(mass[root] < enough);
      }
      to_mend_.push_back(opens ? 0 : 1);
      some = some || !opens;
    }
    std::size_t n = 0;
    for (Crossed& one : crossed_) {
      if (one.cut) one.cut = to_mend_[n++] == 0;
    }
    to_mend_.clear();
    return some;
  }

  void collect(Partition& partition) {
    std::vector<std::uint32_t> part_of_root(vertices_ + 4 * crossed_.size() + 2 * std::size_t(tetrahedra_), kNone);
    std::vector<std::array<bool, 2>> reaches;
    const auto partOf = [&](std::uint32_t root) {
      if (part_of_root[root] == kNone) {
        part_of_root[root] = std::uint32_t(partition.parts.size());
        partition.parts.emplace_back();
        reaches.push_back({false, false});
      }
      return part_of_root[root];
    };
    forEachCopy([&](std::uint32_t t, Side side) {
      const std::uint32_t p = partOf(rootOf(t, side));
      PartTetrahedron& made = partition.parts[p].tetrahedra.emplace_back();
      made.source = t;
      made.side = side;
      for (std::size_t k = 0; k < 4; ++k) {
        made.corner[k] = cornerOf(t, side, k);
        if (side == 0) reaches[p][placeOf(sides_.side[made.corner[k]])] = true;
      }
      if (side != 0) {
        shares_.take(side, made);
        reaches[p][placeOf(side)] = true;
      } else {
        made.volume = shares_.volumes[t];
        made.center.fill(0.25);
      }
    });
    for (std::size_t p = 0; p < partition.parts.size(); ++p) {
      if (reaches[p][0] != reaches[p][1]) partition.parts[p].side = reaches[p][1] ? 1 : -1;
    }
    for (std::uint32_t f = 0; f < surface_.fragments.size(); ++f) {
      const Fragment& fragment = surface_.fragments[f];
      partition.parts[partOf(rootOf(fragment, fragment.corner[0]))].fragments.push_back(f);
    }
    for (std::uint32_t p = 0; p < section_.polygons.size(); ++p) {
      for (const Side side : kSides) {
        const std::uint32_t root = rootOf(nodes_[section_.polygons[p].nodes[0]].tetrahedron, side);
        partition.parts[partOf(root)].polygons.push_back({p, side});
      }
    }
    std::stable_sort(partition.parts.begin(), partition.parts.end(),
                     [](const PartMesh& a, const PartMesh& b) { return a.side <= 0 && b.side > 0; });
    partition.part_of.assign(2 * std::size_t(vertices_), kNone);
    for (std::uint32_t p = 0; p < partition.parts.size(); ++p) numberVertices(p, partition);
    for (const Crossed& one : crossed_) {
      if (one.cut) partition.gaps.push_back(one.gap);
    }
  }

  /// Copies become places in the part's list of vertices: by vertex of the package, the one that lies there first.
  void numberVertices(std::uint32_t p, Partition& partition) const {
    PartMesh& part = partition.parts[p];
    std::vector<std::array<std::uint32_t, 2>> list;  // vertex, copy
    for (const PartTetrahedron& t : part.tetrahedra) {
      for (std::size_t k = 0; k < 4; ++k) list.push_back({cornersOf(t.source)[k], t.corner[k]});
    }
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    for (const auto& [vertex, copy] : list) {
      part.vertices.push_back(vertex);
      part.own.push_back(vertex == copy ? 1 : 0);
      if (vertex == copy) partition.part_of[vertex] = partition.part_of[vertices_ + vertex] = p;
    }
    for (PartTetrahedron& t : part.tetrahedra) {
      for (std::size_t k = 0; k < 4; ++k) {
        const std::array<std::uint32_t, 2> one = {cornersOf(t.source)[k], t.corner[k]};
        t.corner[k] = std::uint32_t(std::lower_bound(list.begin(), list.end(), one) - list.begin());
      }
    }
  }

  const formats::PackageView& package_;
  const Surface& surface_;
  const Section& section_;
  const std::vector<Hung>& nodes_;
  const Sides& sides_;
  const std::uint32_t vertices_, tetrahedra_;
  std::vector<std::uint32_t> crossed_of_;  // of tetrahedra
  std::vector<Crossed> crossed_;
  std::vector<Face> faces_;
  Shares shares_;
  std::optional<geometry::Sets> together_;
  std::vector<char> to_mend_;
};

}  // namespace

Partition openSlit(const formats::PackageView& package, const Surface& surface, const Section& section,
                   const std::vector<Hung>& nodes, double least, const Sides& sides) {
  return Opening(package, surface, section, nodes, sides).find(least);
}

}  // namespace sinew::cutting

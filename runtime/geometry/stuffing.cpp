// SPDX-License-Identifier: MIT
#include "runtime/geometry/stuffing.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include "sinew/formats/sections.h"

namespace sinew::geometry {

using formats::kNone;
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

// Warp thresholds, as fractions of the edge (Labelle & Shewchuk 2007, table 1, uniform lattice).
constexpr double kWarpLong = 0.24999;
constexpr double kWarpShort = 0.41189;

// Edges owned by a lattice point: 3 long ones towards +x, +y, +z within its sublattice; and for points of the even
// sublattice 8 short ones towards the corners (+-1, +-1, +-1), numbered 3 + bits.
constexpr int kEdges = 11;

Vector3i edgeOffset(int edge) {
  if (edge < 3) return 2 * Vector3i::Unit(edge);
  const int bits = edge - 3;
  return {(bits & 1) != 0 ? 1 : -1, (bits & 2) != 0 ? 1 : -1, (bits & 4) != 0 ? 1 : -1};
}

// A vertex of a stencil: a lattice point (b == kNone), or the cut of the edge from a (inside) to b (outside).
struct Corner {
  std::uint32_t a = kNone, b = kNone;
};

class Stuffing {
 public:
  Stuffing(const StuffingDomain& domain, const Eigen::AlignedBox3d& bounds, double spacing,
           const ParallelFor& parallel_for)
      : domain_(domain), parallel_for_(parallel_for), half_(spacing / 2) {
    // One cell of margin all round, so that no point on the rim is inside. The lattice is centred on the bounds: a
    // symmetric body gets a symmetric mesh.
    for (int axis = 0; axis < 3; ++axis) {
      cells_[axis] = std::max(1, int(std::ceil(bounds.sizes()[axis] / spacing))) + 2;
    }
    points_ = cells_ + Vector3i::Ones();
    origin_ = bounds.center() - half_ * cells_.cast<double>();
    per_lattice_ = std::size_t(points_.x()) * std::size_t(points_.y()) * std::size_t(points_.z());
  }

  TetMesh run() {
    classify();
    findCuts();
    warp();
    fill();
    return std::move(mesh_);
  }

 private:
  // Lattice coordinates are doubled: even points have three even ones, odd points three odd ones.
  Vector3i coordinate(std::uint32_t id) const {
    const bool odd = id >= per_lattice_;
    const auto i = int(odd ? id - per_lattice_ : id);
    const int x = i % points_.x(), y = i / points_.x() % points_.y(), z = i / points_.x() / points_.y();
    return 2 * Vector3i(x, y, z) + (odd ? Vector3i::Ones().eval() : Vector3i::Zero().eval());
  }
  std::uint32_t pointAt(const Vector3i& c) const {
    for (int axis = 0; axis < 3; ++axis) {
      if (c[axis] < 0 || c[axis] / 2 >= points_[axis]) return kNone;
    }
    const std::size_t base = (c.x() & 1) != 0 ? per_lattice_ : 0;
    const auto at = [](int i) { return std::size_t(i); };
    const std::size_t index = (at(c.z() / 2) * at(points_.y()) + at(c.y() / 2)) * at(points_.x()) + at(c.x() / 2);
    return static_cast<std::uint32_t>(base + index);
  }
  Vector3d latticePosition(const Vector3i& c) const { return origin_ + half_ * c.cast<double>(); }

  void classify() {
    const std::size_t count = 2 * per_lattice_;
    sign_.resize(count);
    parallel_for_(count, 256, [&](std::size_t begin, std::size_t end) {
      std::vector<Vector3d> points;
      points.reserve(end - begin);
      for (std::size_t i = begin; i < end; ++i) points.push_back(latticePosition(coordinate(std::uint32_t(i))));
      std::vector<char> inside(points.size());
      WindingNumber::Walk walk;
      domain_.inside(points, inside, walk);
      for (std::size_t i = begin; i < end; ++i) sign_[i] = inside[i - begin] != 0 ? 1 : -1;
    });
  }

  void findCuts() {
    const std::size_t count = 2 * per_lattice_;
    first_cut_.assign(count + 1, 0);
    cut_mask_.assign(count, 0);
    parallel_for_(count, 1024, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Vector3i c = coordinate(std::uint32_t(i));
        const int edges = i < per_lattice_ ? kEdges : 3;
        for (int e = 0; e < edges; ++e) {
          const std::uint32_t other = pointAt(c + edgeOffset(e));
          if (other != kNone && sign_[other] != sign_[i]) cut_mask_[i] = std::uint16_t(cut_mask_[i] | 1U << e);
        }
      }
    });
    for (std::size_t i = 0; i < count; ++i)
      first_cut_[i + 1] = first_cut_[i] + std::uint32_t(std::popcount(cut_mask_[i]));
    cut_fraction_.resize(first_cut_[count]);
    parallel_for_(count, 1024, [&](std::size_t begin, std::size_t end) {
      WindingNumber::Walk walk;
      for (std::size_t i = begin; i < end; ++i) {
        if (cut_mask_[i] == 0) continue;
        const Vector3i c = coordinate(std::uint32_t(i));
        std::uint32_t cut = first_cut_[i];
        for (int e = 0; e < kEdges; ++e) {
          if ((cut_mask_[i] & 1U << e) == 0) continue;
          const Vector3d p = latticePosition(c), q = latticePosition(c + edgeOffset(e));
          const bool outwards = sign_[i] > 0;
          const double t = std::clamp(domain_.crossing(outwards ? p : q, outwards ? q : p, walk), 0.0, 1.0);
          cut_fraction_[cut++] = outwards ? t : 1 - t;
        }
      }
    });
  }

  // Number of the cut on the edge between two lattice points, and its fraction from `from`.
  std::uint32_t cutBetween(std::uint32_t from, std::uint32_t to, double* fraction) const {
    Vector3i d = coordinate(to) - coordinate(from);
    bool reversed = false;
    std::uint32_t owner = from;
    const bool is_long = (d.array() == 0).count() == 2;
    if (is_long ? d.sum() < 0 : from >= per_lattice_) {
      reversed = true;
      owner = to;
      d = -d;
    }
    const int edge = is_long ? (d.x() != 0   ? 0
                                : d.y() != 0 ? 1
                                             : 2)
                             : 3 + (d.x() > 0 ? 1 : 0) + (d.y() > 0 ? 2 : 0) + (d.z() > 0 ? 4 : 0);
    const std::uint32_t bit = 1U << edge;
    const std::uint32_t cut = first_cut_[owner] + std::uint32_t(std::popcount(cut_mask_[owner] & (bit - 1U)));
    if (fraction != nullptr) *fraction = reversed ? 1 - cut_fraction_[cut] : cut_fraction_[cut];
    return cut;
  }

  // One after another, in order: a warped point takes the cuts of its edges away from its neighbours.
  void warp() {
    const std::size_t count = 2 * per_lattice_;
    warp_to_.assign(count, kNone);
    for (std::uint32_t i = 0; i < count; ++i) {
      const Vector3i c = coordinate(i);
      double nearest = std::numeric_limits<double>::infinity();
      std::uint32_t target = kNone;
      const auto visit = [&](const Vector3i& offset) {
        const std::uint32_t other = pointAt(c + offset);
        if (other == kNone || sign_[other] * sign_[i] >= 0) return;
        double fraction = 0;
        cutBetween(i, other, &fraction);
        const bool is_long = offset.cwiseAbs().sum() == 2;
        if (fraction >= (is_long ? kWarpLong : kWarpShort)) return;
        const double distance = fraction * (is_long ? 2.0 : std::sqrt(3.0));
        if (distance < nearest) {
          nearest = distance;
          target = other;
        }
      };
      for (int e = 0; e < 3; ++e) {
        visit(edgeOffset(e));
        visit(-edgeOffset(e));
      }
      for (int e = 3; e < kEdges; ++e) visit(edgeOffset(e));
      if (target == kNone) continue;
      warp_to_[i] = target;
      sign_[i] = 0;
    }
  }

  Vector3d cutPosition(std::uint32_t from, std::uint32_t to) const {
    double fraction = 0;
    cutBetween(from, to, &fraction);
    const Vector3d p = latticePosition(coordinate(from)), q = latticePosition(coordinate(to));
    return p + (q - p) * fraction;
  }

  Vector3d position(const Corner& corner) const {
    if (corner.b != kNone) return cutPosition(corner.a, corner.b);
    if (warp_to_[corner.a] != kNone) return cutPosition(corner.a, warp_to_[corner.a]);
    return latticePosition(coordinate(corner.a));
  }

  std::uint32_t vertex(const Corner& corner) {
    std::uint32_t& number =
        corner.b == kNone ? lattice_vertex_[corner.a] : cut_vertex_[cutBetween(corner.a, corner.b, nullptr)];
    if (number == kNone) {
      number = static_cast<std::uint32_t>(mesh_.positions.size());
      mesh_.positions.push_back(position(corner));
    }
    return number;
  }

  // Emits a tetrahedron whose corners may come in either order. Which order is positive is read off the unwarped
  // lattice with cuts at the midpoints (exact in integers), never off the result: an inverted one must stay visible.
  void emit(const std::array<Corner, 4>& corners) {
    std::array<Vector3i, 4> x;
    for (std::size_t i = 0; i < 4; ++i) {
      x[i] = 2 * coordinate(corners[i].a);
      if (corners[i].b != kNone) x[i] = coordinate(corners[i].a) + coordinate(corners[i].b);
    }
    const Vector3i u = x[1] - x[0], v = x[2] - x[0], w = x[3] - x[0];
    const int volume = u.x() * (v.y() * w.z() - v.z() * w.y()) - u.y() * (v.x() * w.z() - v.z() * w.x()) +
                       u.z() * (v.x() * w.y() - v.y() * w.x());
    Tetrahedron t = {vertex(corners[0]), vertex(corners[1]), vertex(corners[2]), vertex(corners[3])};
    if (volume < 0) std::swap(t[2], t[3]);
    mesh_.tetrahedra.push_back(t);
  }

  // The quadrilateral p, q, cut(q,m), cut(p,m) on the lattice face p, q, m, shared with a neighbour: whether its
  // diagonal starts at p (then it ends at cut(q,m)) or at q.
  bool diagonalAtFirst(std::uint32_t p, std::uint32_t q, std::uint32_t m) const {
    const Vector3i cp = coordinate(p), cq = coordinate(q), cm = coordinate(m);
    const bool pm_long = (cp - cm).cwiseAbs().sum() == 2, qm_long = (cq - cm).cwiseAbs().sum() == 2;
    if (pm_long != qm_long) return qm_long;  // it ends at the cut of the long edge
    // Both cut edges are short: the parity rule. Of the ends of the long edge, the one from which m lies towards
    // larger values along an even number of axes; exactly one end has that, and around the edge it alternates.
    return (((cm - cp).array() > 0).count() & 1) == 0;
  }

  double smallestAngle(const Corner& a, const Corner& b, const Corner& c, const Corner& d) const {
    return dihedralRange(position(a), position(b), position(c), position(d))[0];
  }

  // The prism over the triangle a0 a1 a2 with b_i above a_i. diagonal[i]: the side a_i a_j b_j b_i (j = i + 1) is split
  // from a_i to b_j (else from a_j to b_i).
  void emitPrism(const std::array<Corner, 3>& a, const std::array<Corner, 3>& b, const std::array<bool, 3>& diagonal) {
    for (std::size_t i = 0; i < 3; ++i) {
      // A corner of the bottom at which both diagonals of its sides end: three tetrahedra fan out.
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      if (!diagonal[i] || diagonal[k]) continue;  // want diagonals a_i b_j and a_i b_k
      emit({a[i], b[0], b[1], b[2]});
      if (diagonal[j]) {  // a_j b_k
        emit({a[i], a[j], b[j], b[k]});
        emit({a[i], a[j], a[k], b[k]});
      } else {  // a_k b_j
        emit({a[i], a[k], b[j], b[k]});
        emit({a[i], a[j], a[k], b[j]});
      }
      return;
    }
  }

  double prismAngle(const std::array<Corner, 3>& a, const std::array<Corner, 3>& b,
                    const std::array<bool, 3>& diagonal) const {
    if (diagonal[0] == diagonal[1] && diagonal[1] == diagonal[2]) return -1;  // no such subdivision
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      if (!diagonal[i] || diagonal[k]) continue;
      const double first = smallestAngle(a[i], b[0], b[1], b[2]);
      if (diagonal[j]) {
        return std::min({first, smallestAngle(a[i], a[j], b[j], b[k]), smallestAngle(a[i], a[j], a[k], b[k])});
      }
      return std::min({first, smallestAngle(a[i], a[k], b[j], b[k]), smallestAngle(a[i], a[j], a[k], b[j])});
    }
    return -1;
  }

  void stuff(const std::array<std::uint32_t, 4>& tetrahedron) {
    std::array<std::uint32_t, 4> plus{}, zero{}, minus{};
    std::size_t pluses = 0, zeros = 0, minuses = 0;
    for (const std::uint32_t v : tetrahedron) {
      if (sign_[v] > 0) plus[pluses++] = v;
      if (sign_[v] == 0) zero[zeros++] = v;
      if (sign_[v] < 0) minus[minuses++] = v;
    }
    if (pluses == 0) return;
    if (minuses == 0) {
      emit({Corner{tetrahedron[0]}, Corner{tetrahedron[1]}, Corner{tetrahedron[2]}, Corner{tetrahedron[3]}});
      return;
    }
    if (pluses == 1) {
      std::array<Corner, 4> corners = {Corner{plus[0]}};
      for (std::size_t i = 0; i < zeros; ++i) corners[1 + i] = {zero[i]};
      for (std::size_t i = 0; i < minuses; ++i) corners[1 + zeros + i] = {plus[0], minus[i]};
      emit(corners);
      return;
    }
    const std::uint32_t p = plus[0], q = plus[1];
    if (pluses == 2 && minuses == 1) {
      const Corner z{zero[0]}, pm{p, minus[0]}, qm{q, minus[0]};
      if (diagonalAtFirst(p, q, minus[0])) {
        emit({Corner{p}, Corner{q}, qm, z});
        emit({Corner{p}, qm, pm, z});
      } else {
        emit({Corner{p}, Corner{q}, pm, z});
        emit({Corner{q}, qm, pm, z});
      }
      return;
    }
    if (pluses == 2) {
      const std::array<Corner, 3> a = {Corner{p}, Corner{p, minus[0]}, Corner{p, minus[1]}};
      const std::array<Corner, 3> b = {Corner{q}, Corner{q, minus[0]}, Corner{q, minus[1]}};
      std::array<bool, 3> diagonal = {diagonalAtFirst(p, q, minus[0]), true, !diagonalAtFirst(p, q, minus[1])};
      std::array<bool, 3> other = diagonal;
      other[1] = false;
      if (prismAngle(a, b, other) > prismAngle(a, b, diagonal)) diagonal = other;
      emitPrism(a, b, diagonal);
      return;
    }
    const std::uint32_t r = plus[2], m = minus[0];
    emitPrism({Corner{p}, Corner{q}, Corner{r}}, {Corner{p, m}, Corner{q, m}, Corner{r, m}},
              {diagonalAtFirst(p, q, m), diagonalAtFirst(q, r, m), diagonalAtFirst(r, p, m)});
  }

  void fill() {
    lattice_vertex_.assign(2 * per_lattice_, kNone);
    cut_vertex_.assign(cut_fraction_.size(), kNone);
    // Each tetrahedron has one long edge on the even sublattice, and one of the four long odd edges around it.
    for (std::uint32_t p = 0; p < per_lattice_; ++p) {
      const Vector3i c = coordinate(p);
      for (int axis = 0; axis < 3; ++axis) {
        const std::uint32_t q = pointAt(c + 2 * Vector3i::Unit(axis));
        if (q == kNone) continue;
        const Vector3i j = Vector3i::Unit((axis + 1) % 3), k = Vector3i::Unit((axis + 2) % 3);
        const Vector3i middle = c + Vector3i::Unit(axis);
        const std::array<Vector3i, 4> ring = {middle + j + k, middle - j + k, middle - j - k, middle + j - k};
        for (std::size_t i = 0; i < 4; ++i) {
          const std::uint32_t r = pointAt(ring[i]), s = pointAt(ring[(i + 1) % 4]);
          if (r != kNone && s != kNone) stuff({p, q, r, s});
        }
      }
    }
  }

  const StuffingDomain& domain_;
  const ParallelFor& parallel_for_;
  double half_;
  Vector3i cells_, points_;
  Vector3d origin_;
  std::size_t per_lattice_ = 0;
  std::vector<std::int8_t> sign_;         // of each lattice point: 1 inside, -1 outside, 0 warped onto the surface
  std::vector<std::uint16_t> cut_mask_;   // edges, of those a point owns, that the surface cuts
  std::vector<std::uint32_t> first_cut_;  // of each owner
  std::vector<double> cut_fraction_;      // from the owner
  std::vector<std::uint32_t> warp_to_;    // neighbour along whose edge a point was warped
  std::vector<std::uint32_t> lattice_vertex_, cut_vertex_;
  TetMesh mesh_;
};

}  // namespace

TetMesh stuffIsosurface(const StuffingDomain& domain, const Eigen::AlignedBox3d& bounds, double spacing,
                        const ParallelFor& parallel_for) {
  return Stuffing(domain, bounds, spacing, parallel_for).run();
}

}  // namespace sinew::geometry

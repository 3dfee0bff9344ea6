// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/split.h"

#include <algorithm>
#include <array>
#include <limits>

#include "runtime/geometry/sets.h"
#include "tools/tetrahedralize/cell_fragments.h"
#include "tools/tetrahedralize/lattice_faces.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using geometry::ParallelFor;
using geometry::TetMesh;
using geometry::Tetrahedron;
using Pairs = std::vector<std::array<std::uint32_t, 2>>;

// Fragments of up to so many cells are not worth a join across a gap.
constexpr std::uint32_t kCrumb = 12;

// Pairs of fragments of two neighbours that meet on their face.
Pairs meetings(const SolidPiece& piece, const LatticeFaces& faces, const InnerFace& face, const LatticeCell& first,
               const LatticeCell& second, geometry::WindingNumber::Walk& walk) {
  Pairs pairs;
  const auto add = [&](std::uint32_t a, std::uint32_t b) {
    if (std::find(pairs.begin(), pairs.end(), std::array{a, b}) == pairs.end()) pairs.push_back({a, b});
  };
  if ((first.triangles.empty() && !first.solid) || (second.triangles.empty() && !second.solid)) return pairs;  // air
  const bool simple = first.fragments == 1 && second.fragments == 1;
  // Where a neighbour is all solid, so is the face.
  if (simple && (first.triangles.empty() || second.triangles.empty())) return {{0, 0}};
  // A triangle that crosses the face.
  for (std::size_t i = 0, j = 0; i < first.triangles.size() && j < second.triangles.size();) {
    if (first.triangles[i] < second.triangles[j]) {
      ++i;
    } else if (second.triangles[j] < first.triangles[i]) {
      ++j;
    } else {
      if ((first.faces[i] & 1U << face.first_face) != 0 || (second.faces[j] & 1U << face.second_face) != 0) {
        add(first.fragment[i], second.fragment[j]);
        if (simple) return pairs;
      }
      ++i;
      ++j;
    }
  }
  if (!piece.encloses) return pairs;
  if (simple) {
    if (faces.solid(face.first, face.first_face, std::numeric_limits<double>::infinity(), walk) != 0) return {{0, 0}};
    return pairs;
  }
  for (std::size_t k = 0; k < kFaceSamples; ++k) {
    const std::int32_t a = first.fragments > 1 ? first.face_fragment[face.first_face][k] : 0;
    const std::int32_t b = second.fragments > 1 ? second.face_fragment[face.second_face][k] : 0;
    if (a >= 0 && b >= 0) add(std::uint32_t(a), std::uint32_t(b));
  }
  return pairs;
}

// One copy of a cell for each fragment in it; corners of copies that meet are one vertex. Phases in this order: each
// relies on the joins before it.
class Copies {
 public:
  Copies(const SolidPiece& piece, const TetMesh& lattice, const std::vector<LatticeCell>& cells)
      : piece_(piece), lattice_(lattice), cells_(cells), count_(std::uint32_t(cells.size())) {
    first_copy_.assign(count_ + 1, 0);
    for (std::uint32_t t = 0; t < count_; ++t) first_copy_[t + 1] = first_copy_[t] + cells_[t].fragments;
    copies_ = first_copy_[count_];
    corners_ = geometry::Sets(std::size_t(copies_) * 4);
    pieces_ = geometry::Sets(copies_);
    air_.assign(count_, 0);
    dropped_.assign(copies_, 0);
  }

  // Fragments a and b of the cells of a face meet there.
  void joinFace(const InnerFace& face, std::uint32_t a, std::uint32_t b) {
    const Tetrahedron &s = lattice_.tetrahedra[face.first], &t = lattice_.tetrahedra[face.second];
    const std::uint32_t copy_a = first_copy_[face.first] + a, copy_b = first_copy_[face.second] + b;
    for (const std::size_t i : kTetrahedronFaces[face.first_face]) {
      const auto j = std::uint32_t(std::find(t.begin(), t.end(), s[i]) - t.begin());
      corners_.join(4 * copy_a + std::uint32_t(i), 4 * copy_b + j);
    }
    pieces_.join(copy_a, copy_b);
  }

  // Cells of air fall away, unless they hold the piece together.
  void dropAir() {
    for (std::uint32_t t = 0; t < count_; ++t) air_[t] = cells_[t].triangles.empty() && !cells_[t].solid ? 1 : 0;
    std::vector<std::uint32_t> holder(std::size_t(copies_) * 4, formats::kNone);
    for (std::uint32_t t = 0; t < count_; ++t) {
      if (air_[t] != 0) continue;
      for (std::uint32_t copy = first_copy_[t]; copy < first_copy_[t + 1]; ++copy) {
        for (std::uint32_t k = 0; k < 4; ++k) {
          std::uint32_t& h = holder[corners_.find(4 * copy + k)];
          if (h == formats::kNone) h = copy;
          pieces_.join(h, copy);
        }
      }
    }
    for (std::uint32_t t = 0; t < count_; ++t) {
      for (std::uint32_t copy = first_copy_[t]; copy < first_copy_[t + 1] && air_[t] == 0; ++copy) {
        number_ += std::uint32_t(pieces_.find(copy) == copy);
      }
    }
  }

  // Joins copies that share a point of the surface and a corner: they meet where the lattice has no cell.
  void joinAlongSurface() {
    if (number_ <= 1) return;
    std::vector<std::array<std::uint32_t, 3>> copies_at;  // point, copy, cell
    for (std::uint32_t t = 0; t < count_; ++t) {
      for (std::size_t n = 0; n < cells_[t].triangles.size(); ++n) {
        for (const std::uint32_t point : piece_.triangles[cells_[t].triangles[n]]) {
          copies_at.push_back({point, first_copy_[t] + cells_[t].fragment[n], t});
        }
      }
    }
    std::sort(copies_at.begin(), copies_at.end());
    copies_at.erase(std::unique(copies_at.begin(), copies_at.end()), copies_at.end());
    for (std::size_t i = 0; i < copies_at.size();) {
      std::size_t end = i + 1;
      while (end < copies_at.size() && copies_at[end][0] == copies_at[i][0]) ++end;
      const auto apart = [&](std::size_t k) { return pieces_.find(copies_at[k][1]) != pieces_.find(copies_at[i][1]); };
      for (std::size_t k = i + 1; k < end; ++k) {
        for (std::size_t m = i; m < k && apart(k); ++m) {
          const std::uint32_t a = copies_at[m][1], b = copies_at[k][1];
          const Tetrahedron &s = lattice_.tetrahedra[copies_at[m][2]], &t = lattice_.tetrahedra[copies_at[k][2]];
          if (copies_at[m][2] == copies_at[k][2] || pieces_.find(a) == pieces_.find(b)) continue;
          for (std::uint32_t p = 0; p < 4; ++p) {
            const auto q = std::uint32_t(std::find(t.begin(), t.end(), s[p]) - t.begin());
            if (q == 4) continue;
            corners_.join(4 * a + p, 4 * b + q);
            if (pieces_.join(a, b)) --number_;
          }
        }
      }
      i = end;
    }
  }

  // A few cells that nothing holds but cells of air are left out: joined elsewhere they would hang across a gap.
  void dropCrumbs() {
    if (number_ <= 1) return;
    std::vector<std::uint32_t> size(copies_, 0);
    for (std::uint32_t copy = 0; copy < copies_; ++copy) ++size[pieces_.find(copy)];
    const std::uint32_t largest = *std::max_element(size.begin(), size.end());
    for (std::uint32_t t = 0; t < count_; ++t) {
      for (std::uint32_t copy = first_copy_[t]; copy < first_copy_[t + 1] && air_[t] == 0; ++copy) {
        const std::uint32_t root = pieces_.find(copy);
        if (size[root] > kCrumb || size[root] == largest) continue;
        dropped_[copy] = 1;
        if (root == copy) --number_;
      }
    }
  }

  // Splits taken back, until the piece hangs together: within cells, across faces, at last where cells of a cage share
  // only an edge or a corner. \return how many.
  std::uint32_t takeBack(const std::vector<InnerFace>& faces) {
    std::uint32_t joined = 0;
    for (std::uint32_t t = 0; t < count_ && number_ > 1; ++t) {
      for (std::uint32_t copy = first_copy_[t] + 1; copy < first_copy_[t + 1]; ++copy) {
        if (dropped_[copy] != 0 || dropped_[copy - 1] != 0 || !pieces_.join(copy - 1, copy)) continue;
        for (std::uint32_t k = 0; k < 4; ++k) corners_.join(4 * (copy - 1) + k, 4 * copy + k);
        ++joined;
        --number_;
      }
    }
    for (std::size_t f = 0; f < faces.size() && number_ > 1; ++f) {
      const InnerFace& face = faces[f];
      const std::uint32_t a = first_copy_[face.first], b = first_copy_[face.second];
      if (air_[face.first] != 0 || air_[face.second] != 0) continue;
      if (dropped_[a] != 0 || dropped_[b] != 0 || pieces_.find(a) == pieces_.find(b)) continue;
      joinFace(face, 0, 0);
      ++joined;
      --number_;
    }
    std::vector<std::uint32_t> holder(number_ > 1 ? lattice_.positions.size() : 0, formats::kNone);
    for (std::uint32_t corner = 0; corner < 4 * count_ && number_ > 1; ++corner) {
      const std::uint32_t t = corner / 4, k = corner % 4;
      if (air_[t] != 0 || dropped_[first_copy_[t]] != 0) continue;
      std::uint32_t& held = holder[lattice_.tetrahedra[t][k]];
      if (held == formats::kNone) held = 4 * first_copy_[t] + k;
      if (!pieces_.join(held / 4, first_copy_[t])) continue;
      corners_.join(held, 4 * first_copy_[t] + k);
      ++joined;
      --number_;
    }
    return joined;
  }

  // The cells of air, where nothing else makes it one piece.
  void restoreAir(const std::vector<InnerFace>& faces) {
    if (number_ == 1) return;
    std::fill(air_.begin(), air_.end(), char(0));
    std::fill(dropped_.begin(), dropped_.end(), char(0));
    for (const InnerFace& face : faces) {
      if (cells_[face.first].triangles.empty() || cells_[face.second].triangles.empty()) joinFace(face, 0, 0);
    }
  }

  // The first copy's vertices keep the lattice's numbers.
  void makeMesh(SplitMesh& result) {
    result.mesh.positions = lattice_.positions;
    std::vector<std::uint32_t> vertex(std::size_t(copies_) * 4, formats::kNone);
    tetrahedron_of_.assign(copies_, formats::kNone);
    std::vector<char> taken(lattice_.positions.size(), 0);
    for (std::uint32_t t = 0; t < count_; ++t) {
      if (air_[t] != 0) continue;
      const std::size_t begin = result.mesh.tetrahedra.size();
      for (std::uint32_t p = 0; p < cells_[t].fragments; ++p) {
        const std::uint32_t copy = first_copy_[t] + p;
        if (dropped_[copy] != 0) continue;
        Tetrahedron tetrahedron{};
        for (std::uint32_t k = 0; k < 4; ++k) {
          std::uint32_t& v = vertex[corners_.find(4 * copy + k)];
          const std::uint32_t original = lattice_.tetrahedra[t][k];
          if (v == formats::kNone && taken[original] == 0) {
            taken[original] = 1;
            v = original;
          } else if (v == formats::kNone) {
            v = std::uint32_t(result.mesh.positions.size());
            result.mesh.positions.push_back(Vector3d(lattice_.positions[original]));
            ++result.vertices;
          }
          tetrahedron[k] = v;
        }
        const double inside = cells_[t].fragments > 1 ? cells_[t].inside[p] : -1;
        // Fragments whose copies met all round are one again.
        const auto same = std::find(result.mesh.tetrahedra.begin() + std::ptrdiff_t(begin),
                                    result.mesh.tetrahedra.end(), tetrahedron);
        tetrahedron_of_[copy] = std::uint32_t(same - result.mesh.tetrahedra.begin());
        if (same == result.mesh.tetrahedra.end()) {
          result.mesh.tetrahedra.push_back(tetrahedron);
          result.inside.push_back(inside);
        } else if (inside > 0) {
          result.inside[tetrahedron_of_[copy]] += inside;
        }
      }
      const std::size_t made = result.mesh.tetrahedra.size() - begin;
      if (made > 0) result.volume += geometry::volume(lattice_, lattice_.tetrahedra[t]);
      if (made > 1) ++result.cells;
      if (made == 1 && cells_[t].fragments > 1 && !hasDropped(t)) result.inside[begin] = -1;
      if (cells_[t].doubtful) result.doubtful.push_back(cells_[t].triangles.front());
    }
    // Vertices of cells that fell away.
    if (std::find(taken.begin(), taken.end(), char(0)) != taken.end()) {
      result.mesh = geometry::compact(result.mesh, std::vector<char>(result.mesh.tetrahedra.size(), 1));
    }
  }

  // Where the points of the surface lie. To be called once there are tetrahedra.
  std::vector<std::uint32_t> homes() const {
    std::vector<std::uint32_t> home(piece_.positions.size(), formats::kNone);
    for (std::uint32_t t = 0; t < count_; ++t) {
      if (air_[t] != 0) continue;
      for (const auto& [point, fragment] : cells_[t].points) {
        if (home[point] == formats::kNone) home[point] = tetrahedron_of_[first_copy_[t] + fragment];
      }
    }
    // Points outside: where their own triangles enter the cells, the nearest place.
    std::vector<double> nearest(home.size(), std::numeric_limits<double>::infinity());
    for (std::uint32_t p = 0; p < nearest.size(); ++p) nearest[p] = home[p] == formats::kNone ? nearest[p] : -1;
    for (std::uint32_t t = 0; t < count_; ++t) {
      if (air_[t] != 0) continue;
      const Tetrahedron& v = lattice_.tetrahedra[t];
      for (std::size_t n = 0; n < cells_[t].triangles.size(); ++n) {
        for (const std::uint32_t point : piece_.triangles[cells_[t].triangles[n]]) {
          if (nearest[point] < 0) continue;
          double distance = std::numeric_limits<double>::infinity();
          for (const auto& f : kTetrahedronFaces) {
            const Vector3d& p = piece_.positions[point];
            const Vector3d q = geometry::closestPointOnTriangle(
                p, lattice_.positions[v[f[0]]], lattice_.positions[v[f[1]]], lattice_.positions[v[f[2]]]);
            distance = std::min(distance, (q - p).squaredNorm());
          }
          if (distance >= nearest[point]) continue;
          const std::uint32_t copy = first_copy_[t] + cells_[t].fragment[n];
          if (dropped_[copy] != 0) continue;
          nearest[point] = distance;
          home[point] = tetrahedron_of_[copy];
        }
      }
    }
    return home;
  }

 private:
  bool hasDropped(std::uint32_t t) const {
    const auto end = dropped_.begin() + first_copy_[t + 1];
    return std::find(dropped_.begin() + first_copy_[t], end, char(1)) != end;
  }

  const SolidPiece& piece_;
  const TetMesh& lattice_;
  const std::vector<LatticeCell>& cells_;
  const std::uint32_t count_;
  std::uint32_t copies_ = 0, number_ = 0;  // of all cells; of what hangs together
  std::vector<std::uint32_t> first_copy_;  // of each cell
  geometry::Sets corners_{0}, pieces_{0};  // of copies
  std::vector<char> air_, dropped_;        // cells; copies
  std::vector<std::uint32_t> tetrahedron_of_;
};

}  // namespace

SplitMesh splitAtGaps(const SolidPiece& piece, const TetMesh& lattice, double join_distance,
                      const ParallelFor& parallel_for) {
  const LatticeFaces lattice_faces(piece, lattice);
  const std::vector<LatticeCell> cells = cellFragments(piece, lattice, lattice_faces, join_distance, parallel_for);
  const std::vector<InnerFace>& faces = lattice_faces.inner();
  std::vector<Pairs> pairs(faces.size());
  parallel_for(faces.size(), 256, [&](std::size_t begin, std::size_t end) {
    geometry::WindingNumber::Walk walk;
    for (std::size_t f = begin; f < end; ++f) {
      pairs[f] = meetings(piece, lattice_faces, faces[f], cells[faces[f].first], cells[faces[f].second], walk);
    }
  });

  Copies copies(piece, lattice, cells);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (const auto& pair : pairs[f]) copies.joinFace(faces[f], pair[0], pair[1]);
  }
  copies.dropAir();
  copies.joinAlongSurface();
  copies.dropCrumbs();
  SplitMesh result;
  result.joined = copies.takeBack(faces);
  copies.restoreAir(faces);
  copies.makeMesh(result);
  result.home = copies.homes();
  return result;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/cell_fragments.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "runtime/geometry/sets.h"

namespace sinew::tools {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using geometry::ParallelFor;
using geometry::TetMesh;

// In barycentric coordinates: what touches a cell within this is in it.
constexpr double kTouch = 1e-9;
// Triangles of a sheet, the largest in the cell, that look for others through the solid.
constexpr std::size_t kLookouts = 10;
// A part of at most this fraction of another's volume joins no two fragments of it.
constexpr double kSmallPart = 0.02;

// Points of a cell in sixths; with its middle 11.
constexpr std::size_t kSamples = 11;
std::array<Vector4d, kSamples> cellSamples() {
  std::array<Vector4d, kSamples> samples;
  std::size_t n = 0;
  samples[n++] = Vector4d::Constant(0.25);
  for (int a = 1; a <= 3; ++a) {
    for (int b = 1; a + b <= 4; ++b) {
      for (int c = 1; a + b + c <= 5; ++c) samples[n++] = Vector4d(a, b, c, 6 - a - b - c) / 6;
    }
  }
  return samples;
}

constexpr std::int32_t kAir = -1, kUnknown = -2;

// A triangle within a cell.
struct Clip {
  std::array<Vector4d, 8> corners;
  std::size_t count = 0;
};

Clip clip(const std::array<Vector4d, 3>& triangle) {
  Clip now;
  now.count = 3;
  std::copy(triangle.begin(), triangle.end(), now.corners.begin());
  for (int plane = 0; plane < 4 && now.count > 0; ++plane) {
    Clip next;
    for (std::size_t i = 0; i < now.count; ++i) {
      const Vector4d &p = now.corners[i], &q = now.corners[(i + 1) % now.count];
      const double a = p[plane] + kTouch, b = q[plane] + kTouch;
      if (a >= 0) next.corners[next.count++] = p;
      if ((a < 0) != (b < 0)) next.corners[next.count++] = p + (q - p) * (a / (a - b));
    }
    now = next;
  }
  return now;
}

bool segmentTouches(const Vector4d& p, const Vector4d& q) {
  double low = 0, high = 1;
  for (int plane = 0; plane < 4; ++plane) {
    const double a = p[plane] + kTouch, b = q[plane] + kTouch;
    if (a < 0 && b < 0) return false;
    if (a < 0) low = std::max(low, a / (a - b));
    if (b < 0) high = std::min(high, a / (a - b));
  }
  return low <= high;
}

// Facts about the surface that all cells share.
struct SurfaceParts {
  std::vector<std::uint32_t> of_triangle;
  std::vector<double> volume;  // enclosed, of each part, m^3
};

SurfaceParts surfaceParts(const SolidPiece& piece) {
  geometry::Sets sets(piece.positions.size());
  for (const auto& t : piece.triangles) {
    sets.join(t[0], t[1]);
    sets.join(t[0], t[2]);
  }
  SurfaceParts parts;
  std::vector<std::uint32_t> number(piece.positions.size(), formats::kNone);
  for (const auto& t : piece.triangles) {
    std::uint32_t& n = number[sets.find(t[0])];
    if (n == formats::kNone) {
      n = std::uint32_t(parts.volume.size());
      parts.volume.push_back(0);
    }
    parts.of_triangle.push_back(n);
    // About the part's first point, so that an open one counts as closed by a fan from there.
    const Vector3d& apex = piece.positions[sets.find(t[0])];
    const Vector3d a = piece.positions[t[0]] - apex, b = piece.positions[t[1]] - apex, c = piece.positions[t[2]] - apex;
    parts.volume[n] += a.dot(b.cross(c)) / 6;
  }
  for (double& v : parts.volume) v = std::abs(v);
  return parts;
}

class CellCutter {
 public:
  CellCutter(const SolidPiece& piece, const SurfaceParts& parts, const TetMesh& lattice, const LatticeFaces& faces,
             double join_distance)
      : piece_(piece), parts_(parts), lattice_(lattice), faces_(faces), join_(join_distance), samples_(cellSamples()) {}

  LatticeCell cut(std::uint32_t tetrahedron) {
    start(tetrahedron);
    LatticeCell cell;
    findTriangles(cell);
    if (cell.triangles.empty()) {
      cell.solid = !piece_.encloses || windingAt(samplePosition(0)) > 0.5;
      return cell;
    }
    geometry::Sets sets(cell.triangles.size());
    joinAlongSurface(cell, sets);
    sample_set_.fill(kAir);
    if (countPieces(cell, sets) > 1) {
      cell.doubtful = pierced(cell, sets);
      // Where solids of one part overlap, a sample between two sheets joins them only if its winding number is
      // below 1.5.
      most_winding_ = cell.doubtful ? kTwice : std::numeric_limits<double>::infinity();
      if (piece_.encloses) joinThroughSolid(cell, sets);
      if (countPieces(cell, sets) > 1) joinNearParts(cell, sets);
    }
    numberPieces(cell, sets);
    for (const auto& [point, triangle] : inside_points_) cell.points.push_back({point, cell.fragment[triangle]});
    std::sort(cell.points.begin(), cell.points.end());
    cell.points.erase(std::unique(cell.points.begin(), cell.points.end()), cell.points.end());
    if (cell.fragments > 1) labelSolid(cell, sets);
    return cell;
  }

 private:
  // A triangle of the cell.
  struct Local {
    std::array<Vector4d, 3> corners;  // barycentric
    Vector3d normal;                  // not of unit length
    Clip inside;                      // what of it is inside the cell
    Vector3d middle;                  // of that
    double area = 0;                  // of that, relative
  };

  void start(std::uint32_t tetrahedron) {
    number_ = tetrahedron;
    for (std::size_t i = 0; i < 4; ++i) x_[i] = lattice_.positions[lattice_.tetrahedra[tetrahedron][i]];
    Eigen::Matrix3d edges;
    edges << x_[0] - x_[3], x_[1] - x_[3], x_[2] - x_[3];
    to_barycentric_ = edges.inverse();
    local_.clear();
    planes_.clear();
    inside_points_.clear();
  }
  Vector4d barycentric(const Vector3d& p) const {
    const Vector3d w = to_barycentric_ * (p - x_[3]);
    return {w[0], w[1], w[2], 1 - w.sum()};
  }
  Vector3d position(const Vector4d& b) const { return b[0] * x_[0] + b[1] * x_[1] + b[2] * x_[2] + b[3] * x_[3]; }
  Vector3d samplePosition(std::size_t i) const { return position(samples_[i]); }

  void findTriangles(LatticeCell& cell) {
    AlignedBox3d box;
    for (const Vector3d& x : x_) box.extend(x);
    const double margin = 4 * kTouch * box.sizes().maxCoeff();
    box = AlignedBox3d(box.min().array() - margin, box.max().array() + margin);
    const auto& bvh = piece_.winding.bvh();
    candidates_.clear();
    bvh.tree().descend([&](const auto& node, std::uint32_t) { return node.box.intersects(box); },
                       [&](std::uint32_t i) { candidates_.push_back(bvh.order()[i]); });
    std::sort(candidates_.begin(), candidates_.end());
    for (const std::uint32_t t : candidates_) {
      const auto& triangle = piece_.triangles[t];
      Local local;
      for (std::size_t i = 0; i < 3; ++i) local.corners[i] = barycentric(piece_.positions[triangle[i]]);
      const Vector4d highest = local.corners[0].cwiseMax(local.corners[1]).cwiseMax(local.corners[2]);
      if (highest.minCoeff() < -kTouch) continue;
      local.inside = clip(local.corners);
      const Clip& inside = local.inside;
      if (inside.count == 0) continue;
      std::uint8_t faces = 0;
      Vector4d middle = Vector4d::Zero();
      for (std::size_t i = 0; i < inside.count; ++i) {
        middle += inside.corners[i];
        for (unsigned f = 0; f < 4; ++f) {
          if (inside.corners[i][f] <= kTouch) faces = std::uint8_t(faces | 1U << f);
        }
      }
      local.middle = position(middle / double(inside.count));
      for (std::size_t i = 2; i < inside.count; ++i) {
        const auto edge = [&](std::size_t k) { return (inside.corners[k] - inside.corners[0]).head<3>().eval(); };
        local.area += edge(i - 1).cross(edge(i)).norm();
      }
      const auto& p = piece_.positions;
      local.normal = (p[triangle[1]] - p[triangle[0]]).cross(p[triangle[2]] - p[triangle[0]]);
      const auto number = std::uint32_t(local_.size());
      for (std::size_t i = 0; i < 3; ++i) {
        if (local.corners[i].minCoeff() >= -kTouch) inside_points_.push_back({triangle[i], number});
      }
      local_.push_back(local);
      planes_.push_back({local.normal, {p[triangle[0]], p[triangle[1]], p[triangle[2]]}});
      cell.triangles.push_back(t);
      cell.faces.push_back(faces);
    }
  }

  void joinAlongSurface(const LatticeCell& cell, geometry::Sets& sets) {
    std::sort(inside_points_.begin(), inside_points_.end());
    for (std::size_t i = 1; i < inside_points_.size(); ++i) {
      if (inside_points_[i][0] == inside_points_[i - 1][0]) sets.join(inside_points_[i][1], inside_points_[i - 1][1]);
    }
    // Edges that pass through without an end inside.
    edges_.clear();
    for (std::uint32_t n = 0; n < cell.triangles.size(); ++n) {
      const auto& triangle = piece_.triangles[cell.triangles[n]];
      const auto& corners = local_[n].corners;
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t j = (i + 1) % 3;
        if (corners[i].minCoeff() >= -kTouch || corners[j].minCoeff() >= -kTouch) continue;
        if (!segmentTouches(corners[i], corners[j])) continue;
        edges_.push_back({std::min(triangle[i], triangle[j]), std::max(triangle[i], triangle[j]), n});
      }
    }
    std::sort(edges_.begin(), edges_.end());
    for (std::size_t i = 1; i < edges_.size(); ++i) {
      if (edges_[i][0] == edges_[i - 1][0] && edges_[i][1] == edges_[i - 1][1])
        sets.join(edges_[i][2], edges_[i - 1][2]);
    }
  }

  static std::size_t countPieces(const LatticeCell& cell, geometry::Sets& sets) { return roots(cell, sets).size(); }

  std::uint32_t part(const LatticeCell& cell, std::uint32_t n) const { return parts_.of_triangle[cell.triangles[n]]; }
  static std::vector<std::uint32_t> roots(const LatticeCell& cell, geometry::Sets& sets) {
    std::vector<std::uint32_t> roots;
    for (std::uint32_t n = 0; n < cell.triangles.size(); ++n) {
      if (sets.find(n) == n) roots.push_back(n);
    }
    return roots;
  }
  // Whether sheets of one part cross in the cell.
  bool pierced(const LatticeCell& cell, geometry::Sets& sets) const {
    const auto all = roots(cell, sets);
    const auto sheets = sheetsOf(sets);
    for (std::size_t i = 0; i < all.size(); ++i) {
      for (std::size_t j = i + 1; j < all.size(); ++j) {
        if (part(cell, all[i]) != part(cell, all[j])) continue;
        if (near(sheets.at(all[i]), sheets.at(all[j]), 0)) return true;
      }
    }
    return false;
  }
  void joinNearParts(const LatticeCell& cell, geometry::Sets& sets) const {
    const auto all = roots(cell, sets);
    auto sheets = sheetsOf(sets);
    const auto severalPieces = [&](std::uint32_t p) {
      return std::count_if(all.begin(), all.end(), [&](std::uint32_t r) { return part(cell, r) == p; }) > 1;
    };
    for (std::size_t i = 0; i < all.size(); ++i) {
      for (std::size_t j = i + 1; j < all.size(); ++j) {
        std::uint32_t small = part(cell, all[i]), large = part(cell, all[j]);
        if (small == large || sets.find(all[i]) == sets.find(all[j])) continue;
        if (parts_.volume[small] > parts_.volume[large]) std::swap(small, large);
        if (parts_.volume[small] <= kSmallPart * parts_.volume[large] && severalPieces(large)) continue;
        const std::uint32_t a = sets.find(all[i]), b = sets.find(all[j]);
        if (!near(sheets[a], sheets[b], join_)) continue;
        sets.join(a, b);
        Sheet &whole = sheets[sets.find(a)], &other = sheets[sets.find(a) == a ? b : a];
        whole.triangles.insert(whole.triangles.end(), other.triangles.begin(), other.triangles.end());
        whole.box.extend(other.box);
      }
    }
  }
  // One set's part inside the cell.
  struct Sheet {
    std::vector<std::array<Vector3d, 3>> triangles;
    AlignedBox3d box;
  };
  static AlignedBox3d boxOf(const std::array<Vector3d, 3>& t) {
    return {t[0].cwiseMin(t[1]).cwiseMin(t[2]), t[0].cwiseMax(t[1]).cwiseMax(t[2])};
  }
  // By root, gathered once: pairs of sheets are many.
  std::map<std::uint32_t, Sheet> sheetsOf(geometry::Sets& sets) const {
    std::map<std::uint32_t, Sheet> sheets;
    for (std::uint32_t n = 0; n < local_.size(); ++n) {
      Sheet& sheet = sheets[sets.find(n)];
      const Clip& inside = local_[n].inside;
      for (std::size_t i = 2; i < inside.count; ++i) {
        sheet.triangles.push_back(
            {position(inside.corners[0]), position(inside.corners[i - 1]), position(inside.corners[i])});
        sheet.box.extend(boxOf(sheet.triangles.back()));
      }
    }
    return sheets;
  }
  // Whether something of two sheets is as close.
  static bool near(const Sheet& a, const Sheet& b, double distance) {
    const auto wide = [&](const AlignedBox3d& box) {
      return AlignedBox3d(box.min().array() - distance, box.max().array() + distance);
    };
    const AlignedBox3d about_a = wide(a.box), about_b = wide(b.box);
    std::vector<std::size_t> others;
    for (std::size_t t = 0; t < b.triangles.size(); ++t) {
      if (about_a.intersects(boxOf(b.triangles[t]))) others.push_back(t);
    }
    if (others.empty()) return false;
    for (const auto& s : a.triangles) {
      const AlignedBox3d reach = wide(boxOf(s));
      if (!about_b.intersects(reach)) continue;
      for (const std::size_t t : others) {
        if (!reach.intersects(boxOf(b.triangles[t]))) continue;
        if (geometry::squaredDistance(s, b.triangles[t]) <= distance * distance) return true;
      }
    }
    return false;
  }

  // Whether a triangle of the cell lies between two points of it.
  bool blocked(const Vector3d& a, const Vector3d& b) const {
    double nearest = 1;
    return crossing(a, b, true, nearest) != formats::kNone;
  }
  // The first triangle of the cell that the segment crosses, or any one of them, and where (fraction).
  std::uint32_t crossing(const Vector3d& a, const Vector3d& b, bool any, double& nearest) const {
    constexpr double kEnd = 1e-7;  // a segment starts on triangles
    std::uint32_t first = formats::kNone;
    const Vector3d d = b - a;
    for (std::uint32_t n = 0; n < planes_.size(); ++n) {
      const auto& [normal, corners] = planes_[n];
      const auto& [p, q, r] = corners;
      const double slope = normal.dot(d);
      if (slope == 0) continue;
      const double at = normal.dot(p - a) / slope;
      if (!(at > kEnd && at < 1 - kEnd && at < nearest)) continue;
      const Vector3d x = a + at * d;
      // A line through an edge must not slip between its triangles.
      const double slack = -1e-9 * normal.squaredNorm();
      const double u = (q - p).cross(x - p).dot(normal), v = (r - q).cross(x - q).dot(normal),
                   w = (p - r).cross(x - r).dot(normal);
      if (u < slack || v < slack || w < slack) continue;
      nearest = at;
      first = n;
      if (any) break;
    }
    return first;
  }

  double windingAt(const Vector3d& p) const {
    double result = 0;
    piece_.winding.at({&p, 1}, {&result, 1}, walk_);
    return result;
  }
  bool solidOnce(double winding) const { return winding > kSolid && winding < most_winding_; }
  bool between(const Vector3d& a, const Vector3d& b) const {
    return std::isinf(most_winding_) || solidOnce(windingAt((a + b) / 2));
  }
  void chooseLookouts(const LatticeCell& cell, geometry::Sets& sets) {
    lookouts_.clear();
    for (std::uint32_t n = 0; n < cell.triangles.size(); ++n) {
      if (local_[n].normal.squaredNorm() > 0) lookouts_.push_back(n);
    }
    std::stable_sort(lookouts_.begin(), lookouts_.end(), [&](std::uint32_t a, std::uint32_t b) {
      const std::uint32_t ra = sets.find(a), rb = sets.find(b);
      return ra != rb ? ra < rb : local_[a].area > local_[b].area;
    });
    std::size_t run = 0;
    std::uint32_t last = formats::kNone;
    std::erase_if(lookouts_, [&](std::uint32_t n) {
      const std::uint32_t root = sets.find(n);
      run = root == last ? run + 1 : 0;
      last = root;
      return run >= kLookouts;
    });
  }
  // Whether a triangle has the point on its inner side, in plain sight.
  bool sees(std::uint32_t n, const Vector3d& p) const {
    return local_[n].normal.dot(p - local_[n].middle) < 0 && !blocked(local_[n].middle, p);
  }

  // Sheets that bound the same solid. sample_set_ receives which sheet a sample of the solid belongs to.
  void joinThroughSolid(LatticeCell& cell, geometry::Sets& sets) {
    chooseLookouts(cell, sets);
    std::array<Vector3d, kSamples> points;
    std::array<double, kSamples> winding{};
    for (std::size_t s = 0; s < kSamples; ++s) points[s] = samplePosition(s);
    piece_.winding.at(points, winding, walk_);
    for (std::size_t s = 0; s < kSamples; ++s) {
      if (solidOnce(winding[s])) sample_set_[s] = kUnknown;
    }
    for (std::size_t s = 0; s < kSamples; ++s) {
      if (sample_set_[s] == kAir) continue;
      const Vector3d p = samplePosition(s);
      for (const std::uint32_t n : lookouts_) {
        if (sample_set_[s] >= 0 && sets.find(std::uint32_t(sample_set_[s])) == sets.find(n)) continue;
        if (!sees(n, p)) continue;
        if (sample_set_[s] >= 0) sets.join(std::uint32_t(sample_set_[s]), n);
        sample_set_[s] = std::int32_t(n);
      }
    }
    // Twice: a sample that no sheet sees takes the sheet of one that it sees.
    for (int round = 0; round < 2; ++round) {
      for (std::size_t s = 0; s < kSamples; ++s) {
        for (std::size_t r = 0; r < s; ++r) {
          if (sample_set_[s] == kAir || sample_set_[r] == kAir || (sample_set_[s] < 0 && sample_set_[r] < 0)) continue;
          if (sample_set_[s] >= 0 && sample_set_[r] >= 0 &&
              sets.find(std::uint32_t(sample_set_[s])) == sets.find(std::uint32_t(sample_set_[r]))) {
            continue;
          }
          if (blocked(samplePosition(s), samplePosition(r))) continue;
          if (sample_set_[s] < 0) sample_set_[s] = sample_set_[r];
          if (sample_set_[r] < 0) sample_set_[r] = sample_set_[s];
          sets.join(std::uint32_t(sample_set_[s]), std::uint32_t(sample_set_[r]));
        }
      }
    }
    const double length = (x_[0] - x_[1]).norm() + (x_[2] - x_[3]).norm();
    for (std::size_t i = 0; i < lookouts_.size(); ++i) {
      const std::uint32_t m = lookouts_[i];
      const Local& mine = local_[m];
      for (std::size_t j = 0; j < i; ++j) {
        const std::uint32_t n = lookouts_[j];
        if (sets.find(m) == sets.find(n)) continue;
        if (mine.normal.dot(local_[n].middle - mine.middle) < 0 && sees(n, mine.middle) &&
            between(mine.middle, local_[n].middle)) {
          sets.join(m, n);
        }
      }
      // Straight inwards: a triangle met from behind is the other side of the same solid.
      const Vector3d inwards = mine.middle - length * mine.normal.normalized();
      double at = 1;
      const std::uint32_t n = crossing(mine.middle, inwards, false, at);
      if (n == formats::kNone || local_[n].normal.dot(inwards - mine.middle) <= 0) continue;
      const Vector3d met = mine.middle + at * (inwards - mine.middle);
      if (barycentric(met).minCoeff() >= -kTouch && between(mine.middle, met)) sets.join(m, n);
    }
  }

  static void numberPieces(LatticeCell& cell, geometry::Sets& sets) {
    cell.fragments = 0;
    cell.fragment.assign(cell.triangles.size(), 0);
    for (std::uint32_t n = 0; n < cell.triangles.size(); ++n) {
      const std::uint32_t root = sets.find(n);
      cell.fragment[n] = root == n ? cell.fragments++ : cell.fragment[root];
    }
  }

  void labelSolid(LatticeCell& cell, geometry::Sets& sets) {
    for (auto& face : cell.face_fragment) face.fill(kAir);
    cell.inside.assign(cell.fragments, -1);
    if (!piece_.encloses) return;
    chooseLookouts(cell, sets);
    std::fill(cell.inside.begin(), cell.inside.end(), 0);
    // The middle is one more point than the ten that fill fractions are made from.
    for (std::size_t s = 1; s < kSamples; ++s) {
      if (sample_set_[s] >= 0) cell.inside[cell.fragment[std::size_t(sample_set_[s])]] += 1.0 / (kSamples - 1);
    }
    for (std::size_t f = 0; f < 4; ++f) {
      const auto points = faces_.points(number_, f);
      const std::uint32_t solid = faces_.solid(number_, f, most_winding_, walk_);
      for (std::size_t k = 0; k < kFaceSamples; ++k) {
        if ((solid & 1U << k) != 0) cell.face_fragment[f][k] = pieceAt(cell, points[k]);
      }
    }
  }
  std::int32_t pieceAt(const LatticeCell& cell, const Vector3d& p) const {
    for (std::size_t s = 0; s < kSamples; ++s) {
      if (sample_set_[s] >= 0 && !blocked(samplePosition(s), p)) {
        return std::int32_t(cell.fragment[std::size_t(sample_set_[s])]);
      }
    }
    for (const std::uint32_t n : lookouts_) {
      if (sees(n, p)) return std::int32_t(cell.fragment[n]);
    }
    return kUnknown;
  }

  const SolidPiece& piece_;
  const SurfaceParts& parts_;
  const TetMesh& lattice_;
  const LatticeFaces& faces_;
  const double join_;
  const std::array<Vector4d, kSamples> samples_;
  // Of the present cell.
  std::uint32_t number_ = 0;
  std::array<Vector3d, 4> x_;
  Eigen::Matrix3d to_barycentric_;
  std::vector<Local> local_;
  // Data of each for crossing(): cells of thousands of triangles are asked hundreds of times.
  struct Plane {
    Vector3d normal;
    std::array<Vector3d, 3> corners;
  };
  std::vector<Plane> planes_;
  std::vector<std::array<std::uint32_t, 2>> inside_points_;  // point, triangle of the cell
  std::vector<std::array<std::uint32_t, 3>> edges_;
  std::vector<std::uint32_t> candidates_, lookouts_;
  double most_winding_ = 0;
  mutable geometry::WindingNumber::Walk walk_;       // cells follow one another in space
  std::array<std::int32_t, kSamples> sample_set_{};  // triangle of the cell whose solid it is, or kAir, kUnknown
};

}  // namespace

std::vector<LatticeCell> cellFragments(const SolidPiece& piece, const TetMesh& lattice, const LatticeFaces& faces,
                                       double join_distance, const ParallelFor& parallel_for) {
  const SurfaceParts parts = surfaceParts(piece);
  std::vector<LatticeCell> cells(lattice.tetrahedra.size());
  parallel_for(cells.size(), 64, [&](std::size_t begin, std::size_t end) {
    CellCutter cutter(piece, parts, lattice, faces, join_distance);
    for (std::size_t t = begin; t < end; ++t) cells[t] = cutter.cut(std::uint32_t(t));
  });
  return cells;
}

}  // namespace sinew::tools

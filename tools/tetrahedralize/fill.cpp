// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/fill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "runtime/geometry/grid_tetrahedra.h"
#include "runtime/geometry/stuffing.h"

namespace sinew::tools {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;
using geometry::ParallelFor;
using geometry::TetMesh;

// Full cells have at least 30 degrees; a little above, against rounding.
constexpr double kGridDihedral = 30.5;
// Masses come from fill: below this a vertex of the cage could weigh nothing.
constexpr double kLeastFill = 0.02;

// Points of a lattice, which takes time and memory for all of the bounds however little of them is solid.
constexpr double kMostLattice = 2e6, kMostLatticePerVertex = 256;

// The spacing at which the lattice of stuffing has at most that many points.
double finestSpacing(const AlignedBox3d& bounds, std::uint32_t target) {
  const double most = std::max(kMostLattice, kMostLatticePerVertex * target);
  double low = 1e-9 * bounds.sizes().maxCoeff(), high = bounds.sizes().maxCoeff();
  for (int i = 0; i < 60; ++i) {
    const double h = std::sqrt(low * high);
    const double count = 2 * (bounds.sizes() / h + Vector3d::Constant(4)).prod();  // with its margins
    (count > most ? low : high) = h;
  }
  return high;
}

// Spacing at which `build` gives about `target` vertices: a few steps of the secant method on logarithms, the best one
// met is kept. Counts jump with the spacing, so an exact hit is neither possible nor needed.
// \param least spacing to try.
FilledPiece searchSpacing(double spacing, double least, std::uint32_t target,
                          const std::function<FilledPiece(double)>& build) {
  FilledPiece best;
  double best_error = std::numeric_limits<double>::infinity();
  double last_log_spacing = 0, last_log_count = 0, slope = -2.5;
  // Trusted range of the spacing's estimate: thin pieces that a lattice misses must not be chased down to
  // theirs.
  const double finest = std::max(0.55 * spacing, least), coarsest = 4 * spacing;
  for (int step = 0; step < 8; ++step) {
    FilledPiece filled = build(spacing);
    const double count = double(std::max<std::size_t>(filled.mesh.positions.size(), 1));
    const double log_count = std::log(count / target), log_spacing = std::log(spacing);
    if (step > 0 && log_spacing != last_log_spacing) {
      slope = std::clamp((log_count - last_log_count) / (log_spacing - last_log_spacing), -3.5, -1.0);
    }
    last_log_spacing = log_spacing;
    last_log_count = log_count;
    // Too many is worse than too few: it costs at run time.
    const double error = log_count > 0 ? 1.2 * log_count : -log_count;
    if (error < best_error) {
      best_error = error;
      best = std::move(filled);
    }
    if (best_error < 0.1) break;
    const double next = std::clamp(spacing * std::exp(log_count / -slope), finest, coarsest);
    if (next == spacing) break;
    spacing = next;
  }
  return best;
}

// Cells that a solid of this volume and area takes: V/h^3 inside and a layer over half of the area.
double firstSpacing(const SolidPiece& piece, double target, double vertices_per_cell) {
  const double volume = std::max(piece.volume, 0.0), area = piece.area;
  double low = 1e-6 * std::sqrt(area), high = 10 * std::sqrt(area);
  for (int i = 0; i < 60; ++i) {
    const double h = std::sqrt(low * high);
    const double count = vertices_per_cell * volume / (h * h * h) + 1.2 * area / (h * h);
    (count > target ? low : high) = h;
  }
  return high;
}

// Every point of space has a lattice point within this many cells (the piece-centred lattice's covering radius), so a
// feature with that much around it is caught.
const double kCoveringRadius = std::sqrt(5.0) / 4;

// How far surface samples lie outside the tetrahedra.
struct Outside {
  std::vector<std::uint32_t> triangles;  // with a sample further out than the reach, ascending
  double fraction = 0;                   // of the area
};

Outside findOutside(const SolidPiece& piece, const TetMesh& mesh, double reach, std::size_t limit,
                    const ParallelFor& parallel_for) {
  Outside outside;
  const std::vector<geometry::Triangle> border = geometry::boundaryFaces(mesh);
  const geometry::WindingNumber cage(mesh.positions, border);
  // At most `limit` triangles, evenly over their order.
  const std::size_t step = std::max<std::size_t>(1, piece.triangles.size() / limit);
  const std::size_t samples = (piece.triangles.size() + step - 1) / step;
  std::vector<double> missed(samples, 0), all(samples, 0);
  parallel_for(samples, 256, [&](std::size_t begin, std::size_t end) {
    // The winding number is asked for many points at once.
    std::vector<Vector3d> far;
    std::vector<std::size_t> sample_of;
    for (std::size_t s = begin; s < end; ++s) {
      const geometry::Triangle& t = piece.triangles[s * step];
      const Vector3d &a = piece.positions[t[0]], &b = piece.positions[t[1]], &c = piece.positions[t[2]];
      all[s] = (b - a).cross(c - a).norm();
      for (const Vector3d& p :
           {Vector3d((4 * a + b + c) / 6), Vector3d((a + 4 * b + c) / 6), Vector3d((a + b + 4 * c) / 6)}) {
        if (cage.bvh().within(p, reach)) continue;
        far.push_back(p);
        sample_of.push_back(s);
      }
    }
    std::vector<char> inside(far.size());
    cage.inside(far, inside);
    for (std::size_t i = 0; i < far.size(); ++i) {
      if (inside[i] == 0) missed[sample_of[i]] += all[sample_of[i]] / 3;
    }
  });
  double missed_area = 0, area = 0;
  for (std::size_t s = 0; s < samples; ++s) {
    missed_area += missed[s];
    area += all[s];
    if (missed[s] > 0) outside.triangles.push_back(static_cast<std::uint32_t>(s * step));
  }
  outside.fraction = area > 0 ? missed_area / area : 0;
  return outside;
}

// The solid, thickened around some of its triangles.
class ThickenedSolid {
 public:
  explicit ThickenedSolid(const SolidPiece& piece) : piece_(piece) {}

  /// \return whether any of the triangles is new.
  bool thicken(const std::vector<std::uint32_t>& triangles) {
    const std::size_t before = chosen_.size();
    chosen_.insert(triangles.begin(), triangles.end());
    if (chosen_.size() == before) return false;
    std::vector<geometry::Triangle> thin;
    for (const std::uint32_t t : chosen_) thin.push_back(piece_.triangles[t]);
    thin_ = geometry::TriangleBvh(piece_.positions, thin);
    return true;
  }
  /// Of the area, what was thickened.
  double fraction() const {
    double thin = 0, all = 0;
    for (std::uint32_t t = 0; t < piece_.triangles.size(); ++t) {
      const auto& [a, b, c] = piece_.triangles[t];
      const double area =
          (piece_.positions[b] - piece_.positions[a]).cross(piece_.positions[c] - piece_.positions[a]).norm();
      all += area;
      if (chosen_.count(t) != 0) thin += area;
    }
    return all > 0 ? thin / all : 0;
  }
  geometry::StuffingDomain domain(double spacing) const {
    const double radius = kCoveringRadius * spacing;
    return {[this, radius](std::span<const Vector3d> points, std::span<char> result, Walk& walk) {
              inside(points, radius, result, walk);
            },
            [this, radius](const Vector3d& a, const Vector3d& b, Walk& walk) { return crossing(a, b, radius, walk); }};
  }

 private:
  using Walk = geometry::WindingNumber::Walk;
  void inside(std::span<const Vector3d> points, double radius, std::span<char> inside, Walk& walk) const {
    std::vector<Vector3d> others;
    for (std::size_t i = 0; i < points.size(); ++i) {
      inside[i] = thin_.within(points[i], radius) ? 1 : 0;
      if (inside[i] == 0) others.push_back(points[i]);
    }
    std::vector<char> answers(others.size());
    piece_.winding.inside(others, answers, walk);
    auto answer = answers.begin();
    for (char& i : inside) {
      if (i == 0) i = *answer++;
    }
  }
  double crossing(const Vector3d& a, const Vector3d& b, double radius, Walk& walk) const {
    // No point of the edge is further than its length from its end.
    if (!thin_.within(a, radius + (b - a).norm())) return piece_.winding.crossing(a, b, walk);
    constexpr int kRounds = 6;  // 1e-4 of the edge
    return geometry::leavingPoint(a, b, kRounds, [&](std::span<const Vector3d> points, std::span<char> result) {
      inside(points, radius, result, walk);
    });
  }

  const SolidPiece& piece_;
  std::set<std::uint32_t> chosen_;
  geometry::TriangleBvh thin_;
};

// Drops components that no face joins to the largest and whose absence nothing shows: that one covers the surface near
// them.
void dropCrumbs(const SolidPiece& piece, FilledPiece& filled, const ParallelFor& parallel_for) {
  std::vector<std::uint32_t> component;
  const std::uint32_t count = geometry::connectedComponents(filled.mesh, geometry::JoinedBy::faces, component);
  if (count < 2) return;
  std::vector<double> volumes(count, 0);
  for (std::size_t t = 0; t < component.size(); ++t) {
    volumes[component[t]] += geometry::volume(filled.mesh, filled.mesh.tetrahedra[t]);
  }
  const auto largest = std::uint32_t(std::max_element(volumes.begin(), volumes.end()) - volumes.begin());
  std::vector<char> keep(component.size());
  for (std::size_t t = 0; t < component.size(); ++t) keep[t] = component[t] == largest ? 1 : 0;
  FilledPiece without = filled;
  without.mesh = geometry::compact(filled.mesh, keep);
  measureFill(piece, filled, parallel_for);
  measureFill(piece, without, parallel_for);
  if (without.uncovered <= filled.uncovered + 1e-3) filled = std::move(without);
}

}  // namespace

FilledPiece fillWithGrid(const SolidPiece& piece, std::uint32_t target, const ParallelFor& parallel_for) {
  const auto build = [&](double spacing) {
    FilledPiece filled;
    AlignedBox3d bounds = piece.bounds;
    // A point or a line has no size of its own.
    const Vector3d least = Vector3d::Constant(std::max(1e-6 * bounds.sizes().maxCoeff(), 1e-300));
    bounds.extend(bounds.center() - least / 2);
    bounds.extend(bounds.center() + least / 2);
    geometry::CellGrid grid = geometry::fitGrid(bounds, spacing, kGridDihedral);
    filled.spacing = grid.spacing.maxCoeff();
    for (int axis = 0; axis < 3; ++axis) {
      const double extent = grid.spacing[axis] * grid.size[std::size_t(axis)];
      filled.widened = std::max(filled.widened, extent / bounds.sizes()[axis]);
    }
    geometry::keepTouchedCells(grid, piece.winding.bvh(), piece.encloses ? &piece.winding : nullptr, parallel_for);
    filled.bridges = static_cast<std::uint32_t>(geometry::bridgeCells(grid));
    filled.mesh = geometry::gridTetrahedra(grid);
    return filled;
  };
  FilledPiece filled = searchSpacing(firstSpacing(piece, target, 1), 0, target, build);
  measureFill(piece, filled, parallel_for);
  return filled;
}

FilledPiece fillWithStuffing(const SolidPiece& piece, std::uint32_t target, const std::vector<std::uint32_t>& thin,
                             const ParallelFor& parallel_for) {
  ThickenedSolid solid(piece);
  solid.thicken(thin);
  const auto build = [&](double spacing) {
    FilledPiece filled;
    filled.spacing = spacing;
    filled.mesh = geometry::stuffIsosurface(solid.domain(spacing), piece.bounds, spacing, parallel_for);
    return filled;
  };
  const double least = finestSpacing(piece.bounds, target);
  FilledPiece filled = searchSpacing(std::max(firstSpacing(piece, target, 2), least), least, target, build);
  // Triangles half a cell outside would follow stiffly, by extrapolation: they are thickened.
  const std::size_t every = piece.triangles.size();
  const Outside lost = findOutside(piece, filled.mesh, filled.spacing / 2, every, parallel_for);
  if (lost.fraction > 1e-3 && solid.thicken(lost.triangles)) {
    filled = searchSpacing(filled.spacing, least, target, build);
  }
  filled.thickened = solid.fraction();
  if (filled.mesh.tetrahedra.empty()) return filled;
  dropCrumbs(piece, filled, parallel_for);
  measureFill(piece, filled, parallel_for);
  return filled;
}

// Triangles near vertices and edges that alone hold parts of the tetrahedra together: the lattice missed what is
// between.
std::vector<std::uint32_t> trianglesAtJoints(const SolidPiece& piece, const TetMesh& mesh, double reach) {
  std::vector<std::uint32_t> component;
  if (geometry::connectedComponents(mesh, geometry::JoinedBy::faces, component) < 2) return {};
  std::vector<std::uint32_t> of_vertex(mesh.positions.size(), formats::kNone);
  std::vector<char> is_joint(mesh.positions.size(), 0);
  for (std::size_t t = 0; t < component.size(); ++t) {
    for (const std::uint32_t v : mesh.tetrahedra[t]) {
      if (of_vertex[v] == formats::kNone) of_vertex[v] = component[t];
      if (of_vertex[v] != component[t]) is_joint[v] = 1;
    }
  }
  std::vector<Vector3d> joints;
  std::vector<geometry::Triangle> points;  // each a triangle of one place
  for (std::size_t v = 0; v < is_joint.size(); ++v) {
    if (is_joint[v] == 0) continue;
    const auto number = std::uint32_t(joints.size());
    points.push_back({number, number, number});
    joints.push_back(mesh.positions[v]);
  }
  const geometry::TriangleBvh around(joints, points);
  std::vector<std::uint32_t> result;
  for (std::uint32_t t = 0; t < piece.triangles.size(); ++t) {
    const Vector3d &a = piece.positions[piece.triangles[t][0]], &b = piece.positions[piece.triangles[t][1]],
                   &c = piece.positions[piece.triangles[t][2]];
    const Vector3d middle = (a + b + c) / 3;
    const double radius = std::max({(a - middle).norm(), (b - middle).norm(), (c - middle).norm()});
    if (!around.within(middle, reach + radius)) continue;
    const bool near = std::any_of(joints.begin(), joints.end(), [&](const Vector3d& joint) {
      return (geometry::closestPointOnTriangle(joint, a, b, c) - joint).squaredNorm() <= reach * reach;
    });
    if (near) result.push_back(t);
  }
  return result;
}

void measureFill(const SolidPiece& piece, FilledPiece& filled, const ParallelFor& parallel_for) {
  std::vector<std::uint32_t> component;
  filled.components = geometry::connectedComponents(filled.mesh, geometry::JoinedBy::vertices, component);
  filled.volume = geometry::volume(filled.mesh);
  filled.uncovered = 1;
  if (filled.mesh.tetrahedra.empty()) return;
  filled.uncovered = findOutside(piece, filled.mesh, filled.spacing, 20000, parallel_for).fraction;
}

std::vector<double> fillFractions(const SolidPiece& piece, const TetMesh& mesh, std::span<const double> known,
                                  const ParallelFor& parallel_for) {
  std::vector<double> fill(mesh.tetrahedra.size(), 1);
  // Barycentric coordinates in positive sixths: 10 points inside.
  std::vector<std::array<double, 4>> points;
  for (int a = 1; a <= 3; ++a) {
    for (int b = 1; a + b <= 4; ++b) {
      for (int c = 1; a + b + c <= 5; ++c) points.push_back({a / 6.0, b / 6.0, c / 6.0, (6 - a - b - c) / 6.0});
    }
  }
  parallel_for(fill.size(), 32, [&](std::size_t begin, std::size_t end) {
    geometry::WindingNumber::Walk walk;
    for (std::size_t i = begin; i < end; ++i) {
      if (!known.empty() && known[i] >= 0) {
        fill[i] = std::max(kLeastFill, known[i]);
        continue;
      }
      const geometry::Tetrahedron& t = mesh.tetrahedra[i];
      const auto& x = mesh.positions;
      AlignedBox3d box;
      for (const std::uint32_t v : t) box.extend(x[v]);
      std::size_t inside = 0;
      const Vector3d center = (x[t[0]] + x[t[1]] + x[t[2]] + x[t[3]]) / 4;
      double middle = 0;
      piece.winding.at({&center, 1}, {&middle, 1}, walk);
      // Away from the triangles the winding number is whole, but for the neighbourhood of holes.
      if ((piece.balanced || std::abs(middle - 0.5) > 0.25) && !piece.winding.bvh().touches(box)) {
        inside = middle > 0.5 ? points.size() : 0;
      } else {
        std::array<Vector3d, 10> samples;
        std::array<char, 10> answers{};
        std::transform(points.begin(), points.end(), samples.begin(), [&](const auto& w) {
          return Vector3d(w[0] * x[t[0]] + w[1] * x[t[1]] + w[2] * x[t[2]] + w[3] * x[t[3]]);
        });
        piece.winding.inside(samples, answers, walk);
        inside = std::size_t(std::count(answers.begin(), answers.end(), char(1)));
      }
      fill[i] = std::max(kLeastFill, double(inside) / double(points.size()));
    }
  });
  double sum = 0;
  for (std::size_t i = 0; i < fill.size(); ++i) sum += fill[i] * geometry::volume(mesh, mesh.tetrahedra[i]);
  const double scale = sum > 0 && piece.volume > 0 ? piece.volume / sum : 1;
  for (double& f : fill) f *= scale;
  return fill;
}

}  // namespace sinew::tools

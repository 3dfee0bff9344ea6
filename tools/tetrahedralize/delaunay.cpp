// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/delaunay.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>

#include "tools/tetrahedralize/cgal_mesh3.h"
#include "tools/tetrahedralize/cgal_wrap.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using geometry::ParallelFor;
using geometry::TetMesh;
using geometry::Tetrahedron;

// Ratio of a wrap's volume to the solid's: an entered hole leaves a shell, far below.
constexpr double kLeastWrap = 0.85, kMostWrap = 1.35;

double enclosedVolume(const PlainSurface& s) {
  double sum = 0;
  for (const auto& t : s.triangles) sum += s.positions[t[0]].dot(s.positions[t[1]].cross(s.positions[t[2]])) / 6;
  return sum;
}

double smallestAngle(const TetMesh& mesh) {
  double smallest = 180;
  const auto& x = mesh.positions;
  for (const Tetrahedron& t : mesh.tetrahedra) {
    smallest = std::min(smallest, geometry::dihedralRange(x[t[0]], x[t[1]], x[t[2]], x[t[3]])[0]);
  }
  return smallest;
}

// Smallest angle of the tetrahedra around a vertex; -1 if one is not positive.
double starAngle(const TetMesh& mesh, const std::vector<std::uint32_t>& star) {
  double smallest = 180;
  const auto& x = mesh.positions;
  for (const std::uint32_t i : star) {
    const Tetrahedron& t = mesh.tetrahedra[i];
    if (!(geometry::signedVolume6(x[t[0]], x[t[1]], x[t[2]], x[t[3]]) > 0)) return -1;
    smallest = std::min(smallest, geometry::dihedralRange(x[t[0]], x[t[1]], x[t[2]], x[t[3]])[0]);
  }
  return smallest;
}

// A closed surface around the solid, finest first: an alpha that fits through no hole keeps the volume.
PlainSurface seal(const SolidPiece& piece, const PlainSurface& soup, double cell, std::string& reason,
                  std::string& note) {
  const double diagonal = piece.bounds.sizes().norm();
  double alpha = std::clamp(cell / 2, diagonal / 100, diagonal / 10);
  std::string volumes;
  for (int attempt = 0; attempt < 4 && alpha < diagonal; ++attempt, alpha *= 2.2) {
    std::string failure;
    PlainSurface wrap = alphaWrap(soup, alpha, std::min(alpha / 20, diagonal / 500), failure);
    if (wrap.triangles.empty()) {
      reason = "the alpha wrap failed: " + failure;
      return {};
    }
    const double ratio = enclosedVolume(wrap) / piece.volume;
    char text[96];
    std::snprintf(text, sizeof text, "%s%.2f", volumes.empty() ? "" : ", ", ratio);
    volumes += text;
    if (ratio >= kLeastWrap && ratio <= kMostWrap) {
      std::snprintf(text, sizeof text, "sealed by an alpha wrap of %.3g m, %.2f times the volume", alpha, ratio);
      note = text;
      return wrap;
    }
  }
  reason = "an alpha wrap encloses " + volumes +
           " times the volume that the surface does: it enters holes or fills cavities";
  return {};
}

}  // namespace

void smoothBadTetrahedra(TetMesh& mesh, double wanted, double reach) {
  std::vector<std::vector<std::uint32_t>> stars(mesh.positions.size());
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (const std::uint32_t v : mesh.tetrahedra[t]) stars[v].push_back(t);
  }
  const std::vector<Vector3d> start = mesh.positions;
  std::vector<Vector3d> directions;
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x != 0 || y != 0 || z != 0) directions.push_back(Vector3d(x, y, z).normalized());
      }
    }
  }
  for (int sweep = 0; sweep < 12; ++sweep) {
    bool any = false;
    for (std::size_t i = 0; i < mesh.tetrahedra.size(); ++i) {
      const Tetrahedron t = mesh.tetrahedra[i];
      const auto& x = mesh.positions;
      if (geometry::dihedralRange(x[t[0]], x[t[1]], x[t[2]], x[t[3]])[0] >= wanted) continue;
      any = true;
      for (const std::uint32_t v : t) {
        double best = starAngle(mesh, stars[v]);
        for (double step = reach / 2; step > reach / 100; step /= 2) {
          const Vector3d from = mesh.positions[v];
          Vector3d to = from;
          for (const Vector3d& direction : directions) {
            const Vector3d candidate = from + step * direction;
            if ((candidate - start[v]).norm() > reach) continue;
            mesh.positions[v] = candidate;
            const double angle = starAngle(mesh, stars[v]);
            if (angle > best) {
              best = angle;
              to = candidate;
            }
          }
          mesh.positions[v] = to;
        }
      }
    }
    if (!any) return;
  }
}

FilledPiece fillWithDelaunay(const SolidPiece& piece, std::uint32_t target, bool crosses_itself,
                             const ParallelFor& parallel_for, DelaunayOutcome& outcome) {
  FilledPiece result;
  // Edge length of a mesh of about this many vertices: nearly equilateral tetrahedra inside, triangles on the surface.
  double low = 1e-6 * std::sqrt(piece.area), high = 10 * std::sqrt(piece.area);
  for (int i = 0; i < 60; ++i) {
    const double h = std::sqrt(low * high);
    (1.2 * piece.volume / (h * h * h) + 0.7 * piece.area / (h * h) > target ? low : high) = h;
  }
  double size = high;
  // Refinement must go down to the thickness. A plate far thinner than the cells would take very many of them.
  const double thickness = 2 * piece.volume / piece.area;
  const double needed = piece.area / (4 * thickness * thickness);
  if (thickness < size / 4 && needed > 4.0 * target) {
    char text[160];
    std::snprintf(text, sizeof text, "it is about %.2g m thick, which would take some %.0f vertices instead of %u",
                  thickness, needed, target);
    outcome.reason = text;
    return result;
  }
  PlainSurface surface{piece.positions, piece.triangles};
  if (crosses_itself || !piece.balanced || !isClosedManifold(surface)) {
    surface = seal(piece, surface, size, outcome.reason, outcome.note);
    if (surface.triangles.empty()) return result;
  }
  double best_error = std::numeric_limits<double>::infinity(), best_angle = 0;
  for (int attempt = 0; attempt < 3; ++attempt) {
    std::string failure;
    TetMesh mesh = delaunayTetrahedra(surface, size, size / 6, failure);
    if (mesh.tetrahedra.empty()) {
      outcome.reason = "refinement failed: " + failure;
      size *= 0.7;
      continue;
    }
    // The complex may hold crumbs of its own; the largest piece is the piece.
    std::vector<std::uint32_t> component;
    if (geometry::connectedComponents(mesh, geometry::JoinedBy::faces, component) > 1) {
      std::vector<std::size_t> count;
      for (const std::uint32_t c : component) {
        if (c >= count.size()) count.resize(c + 1, 0);
        ++count[c];
      }
      const auto largest = std::uint32_t(std::max_element(count.begin(), count.end()) - count.begin());
      std::vector<char> keep(component.size());
      for (std::size_t t = 0; t < keep.size(); ++t) keep[t] = component[t] == largest ? 1 : 0;
      mesh = geometry::compact(mesh, keep);
    }
    for (Tetrahedron& t : mesh.tetrahedra) {
      const auto& x = mesh.positions;
      if (geometry::signedVolume6(x[t[0]], x[t[1]], x[t[2]], x[t[3]]) < 0) std::swap(t[2], t[3]);
    }
    // A margin, because world coordinates round.
    smoothBadTetrahedra(mesh, kDelaunayDihedral + 0.5, size / 4);
    const double angle = smallestAngle(mesh);
    const double log_count = std::log(double(mesh.positions.size()) / target);
    const bool good = angle >= kDelaunayDihedral;
    // Angles first: no mesh below the least is returned.
    const double error = std::abs(log_count) + (good ? 0 : 100);
    best_angle = std::max(best_angle, angle);
    if (error < best_error) {
      best_error = error;
      result.mesh = std::move(mesh);
      result.spacing = size;
    }
    if (best_error < 0.2) break;
    size *= good || std::abs(log_count) > 0.2 ? std::exp(std::clamp(log_count / 2.3, -1.0, 1.0)) : 0.93;
  }
  if (best_error >= 100) {
    if (!result.mesh.tetrahedra.empty()) {
      char text[96];
      std::snprintf(text, sizeof text, "its smallest dihedral angle stays at %.1f degrees", best_angle);
      outcome.reason = text;
      outcome.only_angles = true;
    }
    result.mesh = {};
    return result;
  }
  measureFill(piece, result, parallel_for);
  return result;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/piece_findings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "runtime/geometry/sets.h"
#include "tools/core/text.h"
#include "tools/tetrahedralize/near_triangles.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// Pieces within this multiple of the distance that would join them are reported.
constexpr double kNearPieces = 4;
// A sheet that rides along is reported if it has this part of all area, or reaches this part of the model's diagonal
// away from its piece.
constexpr double kLargeSheet = 0.25;
constexpr double kFarSheet = 0.15;

// A person's name for a part.
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
  // The widest gap needed to join all of them.
  geometry::Sets sets(set.pieces.size());
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

}  // namespace

std::vector<Finding> pieceFindings(const VisualMesh& mesh, const Topology& topology, const PieceSet& set,
                                   double join_distance) {
  std::vector<Finding> findings;
  reportNearPieces(mesh, topology, set, join_distance, findings);
  reportLargeSheets(mesh, topology, set, findings);
  reportTurned(mesh, topology, set, findings);
  return findings;
}

}  // namespace sinew::tools

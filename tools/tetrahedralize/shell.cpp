// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/shell.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

#include "runtime/geometry/sets.h"
#include "runtime/geometry/triangle_bvh.h"
#include "tools/tetrahedralize/cgal_simplify.h"
#include "tools/tetrahedralize/crowds.h"
#include "tools/tetrahedralize/layer_normal.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using geometry::TetMesh;

// Least offset left at a crease, of the whole one without factors above 1.
constexpr double kLeastOffset = 0.005;
// Roundings to a float in half of the thickness that is left where nothing else helps: a flat tetrahedron of that
// height survives() from sqrt(3) on, one whose edges lean as far as normals may from sqrt(3) / LayerNormal::kLeastLean.
constexpr double kLeastRoundings = 40;
// Least volume of a prism's tetrahedron, of that over a flat triangle with the same offsets.
constexpr double kLeastVolume = 0.02;
// Of the mean edge, where no thickness is given: thinner skins have flat tetrahedra, thicker ones fill creases.
constexpr double kAutomaticThickness = 0.5;
// Attempts at one coarseness, each leaving fine what folded in the one before.
constexpr int kAttempts = 4;
// Vertices of the surface that attempts start from, of those wanted: the source's own are visited once.
constexpr double kFineness = 4;
// Of a surface; each is joined to what lies nearest, so the work grows with their square.
constexpr std::size_t kMostParts = 1000;
// Points of a part at most this share of the mean edge farther from another than its nearest one hold it there.
constexpr double kJoinedBand = 0.5;

// Each collapse at a crowd visits all of its faces, so the work grows with their square; and where points of its rim
// were merged, slivers as long as the fan are left, which bend only at their ends.
std::string crowdComplaint() { return "has a point where more than " + std::to_string(kCrowd) + " faces meet"; }

// Why a surface carries no layer of prisms, or nothing.
std::string complaint(const PlainSurface& surface, std::uint32_t& triangle) {
  struct Side {
    std::uint32_t low, high, triangle;
    bool forwards;
  };
  std::vector<Side> sides;
  for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = surface.triangles[t][i], b = surface.triangles[t][(i + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), t, a < b});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  // Corners of triangles that meet along an edge belong to one fan.
  geometry::Sets fans(surface.triangles.size() * 3);
  const auto corner = [&](std::uint32_t t, std::uint32_t v) {
    const auto& corners = surface.triangles[t];
    return 3 * t + std::uint32_t(std::find(corners.begin(), corners.end(), v) - corners.begin());
  };
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i + 1;
    while (end < sides.size() && sides[end].low == sides[i].low && sides[end].high == sides[i].high) ++end;
    triangle = sides[i].triangle;
    if (end - i > 2) return "has an edge of " + std::to_string(end - i) + " faces";
    if (end - i == 2) {
      if (sides[i].forwards == sides[i + 1].forwards) return "has only one side (its faces cannot be turned alike)";
      for (const std::uint32_t v : {sides[i].low, sides[i].high}) {
        fans.join(corner(sides[i].triangle, v), corner(sides[i + 1].triangle, v));
      }
    }
    i = end;
  }
  std::vector<std::uint32_t> faces(surface.positions.size(), 0);
  std::vector<std::uint32_t> fan(surface.positions.size(), formats::kNone);
  for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
    triangle = t;
    for (std::uint32_t i = 0; i < 3; ++i) {
      if (++faces[surface.triangles[t][i]] > kCrowd) return crowdComplaint();
      std::uint32_t& first = fan[surface.triangles[t][i]];
      if (first == formats::kNone) first = fans.find(3 * t + i);
      if (first != fans.find(3 * t + i)) return "has a point where faces meet without a common edge";
    }
  }
  return "";
}

// A triangle at the point of the most faces.
std::uint32_t crowdedTriangle(const PlainSurface& surface) {
  std::vector<std::uint32_t> faces(surface.positions.size(), 0);
  for (const auto& t : surface.triangles) {
    for (const std::uint32_t v : t) ++faces[v];
  }
  const auto hub = std::uint32_t(std::max_element(faces.begin(), faces.end()) - faces.begin());
  const auto at = std::find_if(surface.triangles.begin(), surface.triangles.end(),
                               [&](const auto& t) { return std::find(t.begin(), t.end(), hub) != t.end(); });
  return std::uint32_t(at - surface.triangles.begin());
}

std::vector<Vector3d> unitNormals(const PlainSurface& surface) {
  std::vector<Vector3d> normals;
  for (const auto& t : surface.triangles) {
    const Vector3d& a = surface.positions[t[0]];
    const Vector3d n = (surface.positions[t[1]] - a).cross(surface.positions[t[2]] - a);
    normals.push_back(n.norm() > 0 ? Vector3d(n.normalized()) : Vector3d::Zero());
  }
  return normals;
}

// Whether a tetrahedron keeps its volume when each coordinate of its corners moves by at most `rounding`: the volume
// changes by a third of the area of the face opposite to a corner for each metre that this one moves.
bool survives(const TetMesh& mesh, const geometry::Tetrahedron& tetrahedron, double rounding) {
  double areas = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto x = [&](std::size_t k) { return mesh.positions[tetrahedron[(i + k) % 4]]; };
    areas += (x(2) - x(1)).cross(x(3) - x(1)).norm() / 2;
  }
  return geometry::volume(mesh, tetrahedron) > std::sqrt(3.0) * rounding * areas / 3;
}

// The three tetrahedra of the prism over a triangle: vertex v below is 2 v, above 2 v + 1. The diagonal of a side runs
// from its lower number below to its higher one above, so neighbours agree.
std::array<geometry::Tetrahedron, 3> prism(std::array<std::uint32_t, 3> t) {
  const bool odd = (t[0] < t[1]) != ((t[1] < t[2]) == (t[0] < t[2]));
  std::sort(t.begin(), t.end());
  const auto below = [&](std::size_t i) { return 2 * t[i]; };
  const auto above = [&](std::size_t i) { return 2 * t[i] + 1; };
  std::array<geometry::Tetrahedron, 3> three = {{{below(0), below(1), below(2), above(2)},
                                                 {below(0), below(1), above(2), above(1)},
                                                 {below(0), above(1), above(2), above(0)}}};
  for (auto& tetrahedron : three) {
    if (odd) std::swap(tetrahedron[2], tetrahedron[3]);
  }
  return three;
}

// Points that triangles lead between.
geometry::Sets partsOf(const PlainSurface& surface) {
  geometry::Sets parts(surface.positions.size());
  for (const auto& t : surface.triangles) {
    parts.join(t[0], t[1]);
    parts.join(t[0], t[2]);
  }
  return parts;
}

std::vector<std::uint32_t> representatives(const PlainSurface& surface, geometry::Sets& parts) {
  std::vector<std::uint32_t> list;
  for (const auto& t : surface.triangles) list.push_back(parts.find(t[0]));
  std::sort(list.begin(), list.end());
  list.erase(std::unique(list.begin(), list.end()), list.end());
  return list;
}

// The best shaped tetrahedron between the two vertices of a point and the prism over a triangle.
geometry::Tetrahedron between(const TetMesh& mesh, std::uint32_t point, const geometry::Triangle& triangle) {
  const std::array<std::uint32_t, 2> mine = {2 * point, 2 * point + 1};
  std::array<std::uint32_t, 6> theirs{};
  for (std::size_t i = 0; i < 6; ++i) theirs[i] = 2 * triangle[i / 2] + std::uint32_t(i % 2);
  geometry::Tetrahedron best{};
  double widest = -1;
  const auto consider = [&](geometry::Tetrahedron t) {
    const auto& x = mesh.positions;
    if (geometry::signedVolume6(x[t[0]], x[t[1]], x[t[2]], x[t[3]]) < 0) std::swap(t[2], t[3]);
    const double angle = geometry::dihedralRange(x[t[0]], x[t[1]], x[t[2]], x[t[3]])[0];
    if (angle <= widest) return;
    widest = angle;
    best = t;
  };
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = i + 1; j < 6; ++j) {
      consider({mine[0], mine[1], theirs[i], theirs[j]});
      for (std::size_t k = j + 1; k < 6; ++k) {
        for (const std::uint32_t m : mine) consider({m, theirs[i], theirs[j], theirs[k]});
      }
    }
  }
  return best;
}

// Ties parts that share no vertex to what lies nearest, by tetrahedra along where they cross or come closest: they
// are one piece, and would part at once. \return how many parts there were; 0 where that is not possible.
std::uint32_t joinParts(const PlainSurface& surface, double mean_edge, double rounding, TetMesh& mesh) {
  geometry::Sets parts = partsOf(surface);
  std::vector<std::uint32_t> list = representatives(surface, parts);
  const auto count = std::uint32_t(list.size());
  std::vector<char> tied(surface.positions.size(), 0);
  std::vector<std::array<std::uint32_t, 2>> joins;  // point, triangle
  for (; list.size() > 1; list = representatives(surface, parts)) {
    joins.clear();
    for (const std::uint32_t part : list) {
      std::vector<std::uint32_t> number;
      std::vector<geometry::Triangle> others;
      std::vector<std::uint32_t> points;
      for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
        const auto& corners = surface.triangles[t];
        if (parts.find(corners[0]) == part) {
          points.insert(points.end(), corners.begin(), corners.end());
          continue;
        }
        number.push_back(t);
        others.push_back(corners);
      }
      std::sort(points.begin(), points.end());
      points.erase(std::unique(points.begin(), points.end()), points.end());
      const geometry::TriangleBvh bvh(surface.positions, others);
      std::vector<std::pair<double, std::array<std::uint32_t, 2>>> near;
      double least = std::numeric_limits<double>::infinity();
      for (const std::uint32_t p : points) {
        const auto hit = bvh.closest(surface.positions[p], least + kJoinedBand * mean_edge);
        if (hit.triangle == formats::kNone) continue;
        const double distance = std::sqrt(hit.squared_distance);
        least = std::min(least, distance);
        near.push_back({distance, {p, number[hit.triangle]}});
      }
      for (const auto& [distance, join] : near) {
        if (distance <= least + kJoinedBand * mean_edge) joins.push_back(join);
      }
    }
    bool joined = false;
    for (const auto& [p, t] : joins) {
      const geometry::Tetrahedron tie = between(mesh, p, surface.triangles[t]);
      if (!survives(mesh, tie, rounding)) continue;
      parts.join(p, surface.triangles[t][0]);
      if (tied[p] == 0) mesh.tetrahedra.push_back(tie);
      tied[p] = 1;
      joined = true;
    }
    if (!joined) return 0;
  }
  return count;
}

// A piece's surface as attempts coarsen it.
struct Prepared {
  PlainSurface surface;
  std::vector<std::uint32_t> vertex_of;  // of each position of the piece
  std::vector<char> folded;              // per vertex: the surface folds there before any coarsening
};

std::vector<std::vector<Vector3d>> normalsAround(const PlainSurface& surface) {
  const std::vector<Vector3d> face_normals = unitNormals(surface);
  std::vector<std::vector<Vector3d>> around(surface.positions.size());
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    if (face_normals[t].squaredNorm() == 0) continue;
    for (const std::uint32_t v : surface.triangles[t]) around[v].push_back(face_normals[t]);
  }
  return around;
}

// The surface without flat faces, at most `most` vertices where edges may be collapsed. False with a reason where it
// carries no layer at any coarseness.
bool prepare(const SolidPiece& piece, std::uint32_t most, Prepared& prepared, ShellOutcome& outcome) {
  PlainSurface fine;
  fine.positions = piece.positions;
  std::vector<std::uint32_t> source;  // triangle of the piece
  for (std::uint32_t t = 0; t < piece.triangles.size(); ++t) {
    const auto& v = piece.triangles[t];
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    fine.triangles.push_back(v);
    source.push_back(t);
  }
  std::uint32_t where = 0;
  outcome.reason = complaint(fine, where);
  if (outcome.reason.empty() && piece.crowded) {
    outcome.reason = crowdComplaint();
    where = crowdedTriangle(fine);
  }
  if (!outcome.reason.empty()) {
    outcome.triangle = source[where];
    return false;
  }
  geometry::Sets parts = partsOf(fine);
  if (const std::size_t count = representatives(fine, parts).size(); count > kMostParts) {
    outcome.reason = "has " + std::to_string(count) + " parts, too many to tie to one another";
    return false;
  }
  if (fine.positions.size() > most) {
    SimplifiedSurface coarse = simplifySurface(fine, most, {}, outcome.reason);
    if (!outcome.reason.empty()) return false;
    prepared.surface = std::move(coarse.surface);
    prepared.vertex_of = std::move(coarse.vertex_of);
  } else {
    prepared.vertex_of.resize(fine.positions.size());
    std::iota(prepared.vertex_of.begin(), prepared.vertex_of.end(), 0U);
    prepared.surface = std::move(fine);
  }
  for (const auto& normals : normalsAround(prepared.surface)) {
    prepared.folded.push_back(layerNormal(normals).folds() ? 1 : 0);
  }
  return true;
}

// The faces around a vertex, in the order in which they follow each other; of a closed fan from its sharpest edge.
std::vector<std::uint32_t> fanOf(const PlainSurface& surface, std::uint32_t v, std::span<const std::uint32_t> faces,
                                 std::span<const Vector3d> normals) {
  const auto neighbour = [&](std::uint32_t t, std::size_t step) {
    const auto& corners = surface.triangles[t];
    return corners[(std::size_t(std::find(corners.begin(), corners.end(), v) - corners.begin()) + step) % 3];
  };
  const auto walk = [&](std::uint32_t first) {
    std::vector<std::uint32_t> fan = {first};
    while (fan.size() < faces.size()) {
      const std::uint32_t last = neighbour(fan.back(), 2);
      const auto next =
          std::find_if(faces.begin(), faces.end(), [&](std::uint32_t t) { return neighbour(t, 1) == last; });
      if (next == faces.end() || *next == first) break;
      fan.push_back(*next);
    }
    return fan;
  };
  const auto begins = [&](std::uint32_t t) {
    return std::none_of(faces.begin(), faces.end(),
                        [&](std::uint32_t u) { return neighbour(u, 2) == neighbour(t, 1); });
  };
  const auto border = std::find_if(faces.begin(), faces.end(), begins);
  if (border != faces.end()) return walk(*border);
  const std::vector<std::uint32_t> fan = walk(faces.front());
  std::size_t sharpest = 0;
  double least = 2;
  for (std::size_t i = 0; i < fan.size(); ++i) {
    const double cosine = normals[fan[i]].dot(normals[fan[(i + 1) % fan.size()]]);
    if (cosine < least) sharpest = (i + 1) % fan.size();
    least = std::min(least, cosine);
  }
  return walk(fan[sharpest]);
}

// Cuts a surface apart at vertices around which no normal serves all faces: each run of faces that one serves has a
// copy of the vertex. \return which vertex each one was before.
std::vector<std::uint32_t> cutFolds(PlainSurface& surface, std::span<const char> folded) {
  const std::vector<Vector3d> normals = unitNormals(surface);
  std::vector<std::vector<std::uint32_t>> faces(surface.positions.size());
  for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
    for (const std::uint32_t v : surface.triangles[t]) {
      if (folded[v] != 0) faces[v].push_back(t);
    }
  }
  std::vector<std::uint32_t> origin(surface.positions.size());
  std::iota(origin.begin(), origin.end(), 0U);
  std::vector<geometry::Triangle> triangles = surface.triangles;
  for (std::uint32_t v = 0; v < faces.size(); ++v) {
    if (faces[v].empty()) continue;
    std::uint32_t now = v;
    std::vector<Vector3d> run;
    for (const std::uint32_t t : fanOf(surface, v, faces[v], normals)) {
      run.push_back(normals[t]);
      if (run.size() > 1 && layerNormal(run).folds()) {
        run = {normals[t]};
        now = std::uint32_t(origin.size());
        origin.push_back(v);
      }
      std::replace(triangles[t].begin(), triangles[t].end(), v, now);
    }
  }
  surface.triangles = std::move(triangles);
  for (std::size_t v = surface.positions.size(); v < origin.size(); ++v) {
    const Vector3d x = surface.positions[origin[v]];
    surface.positions.push_back(x);
  }
  return origin;
}

// An attempt's way out where a surface leaves no room for the layer.
enum class Resort {
  finer,  // refuses: less of it is to be coarsened
  cut,    // cuts folds of the uncoarsened surface apart
  thin,   // and is at creases as thin as numbers can be
};

// \param keep per prepared vertex: nonzero where it stays as fine as it is.
// \param folds receives the prepared vertices that were brought to where the result folds.
FilledPiece fillOnce(const SolidPiece& piece, const Prepared& prepared, std::uint32_t wanted,
                     std::span<const char> keep, double thickness, std::span<const double> factors, double rounding,
                     Resort resort, ShellOutcome& outcome, std::vector<std::uint32_t>& folds) {
  FilledPiece filled;

  // 1. Coarsen.
  SimplifiedSurface coarse;
  if (prepared.surface.positions.size() > wanted) {
    coarse = simplifySurface(prepared.surface, wanted, keep, outcome.reason);
    if (!outcome.reason.empty()) return filled;
  } else {
    coarse.surface = prepared.surface;
    coarse.vertex_of.resize(prepared.surface.positions.size());
    std::iota(coarse.vertex_of.begin(), coarse.vertex_of.end(), 0U);
  }
  PlainSurface& surface = coarse.surface;
  std::vector<std::uint32_t> vertex_of;  // of each position of the piece
  for (const std::uint32_t v : prepared.vertex_of) vertex_of.push_back(coarse.vertex_of[v]);

  // 2. Normals.
  std::vector<char> folded;
  for (const auto& normals : normalsAround(surface)) folded.push_back(layerNormal(normals).folds() ? 1 : 0);
  const auto folds_somewhere = [&] { return std::find(folded.begin(), folded.end(), char(1)) != folded.end(); };
  // Where it folds: all vertices, for the next attempt, and one triangle, for the report.
  const auto note = [&] {
    for (std::uint32_t v = 0; v < coarse.vertex_of.size(); ++v) {
      if (folded[coarse.vertex_of[v]] != 0) folds.push_back(v);
    }
    const auto at = std::find_if(piece.triangles.begin(), piece.triangles.end(),
                                 [&](const auto& corners) { return folded[vertex_of[corners[0]]] != 0; });
    if (at != piece.triangles.end()) outcome.triangle = std::uint32_t(at - piece.triangles.begin());
  };
  if (folds_somewhere()) {
    note();
    std::vector<char> coarsened = folded;
    for (std::uint32_t v = 0; v < coarse.vertex_of.size(); ++v) {
      if (prepared.folded[v] != 0) coarsened[coarse.vertex_of[v]] = 0;
    }
    if (resort == Resort::finer || std::find(coarsened.begin(), coarsened.end(), char(1)) != coarsened.end()) {
      outcome.reason = "folds back onto itself";
      return filled;
    }
    outcome.cut = std::uint32_t(std::count(folded.begin(), folded.end(), char(1)));
  }
  const std::vector<std::uint32_t> origin = cutFolds(surface, folded);
  std::fill(folded.begin(), folded.end(), char(0));
  const auto count = std::uint32_t(surface.positions.size());
  std::vector<Vector3d> normals;
  for (const auto& around : normalsAround(surface)) normals.push_back(layerNormal(around).direction);
  std::vector<std::uint32_t> some_triangle(count, 0);
  for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
    for (const std::uint32_t v : surface.triangles[t]) some_triangle[v] = t;
  }

  // 3. Half of the thickness at each vertex.
  double mean_edge = 0;
  for (const auto& t : surface.triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      mean_edge +=
          (surface.positions[t[i]] - surface.positions[t[(i + 1) % 3]]).norm() / (3 * double(surface.triangles.size()));
    }
  }
  std::vector<double> half(count, (thickness > 0 ? thickness : kAutomaticThickness * mean_edge) / 2);
  std::vector<double> least_part(count, kLeastOffset);
  if (!factors.empty()) {
    std::vector<double> sum(folded.size(), 0), merged(folded.size(), 0);
    for (std::size_t p = 0; p < vertex_of.size(); ++p) {
      sum[vertex_of[p]] += factors[p];
      merged[vertex_of[p]] += 1;
    }
    for (std::uint32_t v = 0; v < count; ++v) {
      const double factor = sum[origin[v]] / merged[origin[v]];
      half[v] *= factor;
      least_part[v] /= std::max(factor, 1.0);
    }
  }

  if (resort == Resort::thin) {
    for (std::uint32_t v = 0; v < count; ++v)
      least_part[v] = std::min(least_part[v], kLeastRoundings * rounding / half[v]);
  }

  // 4. Offset; shorten where a prism would turn over.
  TetMesh& mesh = filled.mesh;
  mesh.positions.resize(std::size_t(count) * 2);
  for (const auto& t : surface.triangles) {
    for (const auto& tetrahedron : prism(t)) mesh.tetrahedra.push_back(tetrahedron);
  }
  std::vector<double> part(count, 1);
  const auto place = [&](std::uint32_t v) {
    mesh.positions[2 * v] = surface.positions[v] - part[v] * half[v] * normals[v];
    mesh.positions[2 * v + 1] = surface.positions[v] + part[v] * half[v] * normals[v];
  };
  for (std::uint32_t v = 0; v < count; ++v) place(v);
  bool sound = false;
  for (int round = 0; round < 60 && !sound; ++round) {
    sound = true;
    std::vector<char> shorten(count, 0);
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
      const auto& corners = surface.triangles[t];
      const Vector3d& a = surface.positions[corners[0]];
      const double area = (surface.positions[corners[1]] - a).cross(surface.positions[corners[2]] - a).norm() / 2;
      double offset = 0;
      for (const std::uint32_t v : corners) offset += 2 * part[v] * half[v] / 3;
      for (std::size_t k = 3 * t; k < 3 * t + 3; ++k) {
        if (geometry::volume(mesh, mesh.tetrahedra[k]) > kLeastVolume * area * offset / 3) continue;
        sound = false;
        for (const std::uint32_t v : corners) shorten[v] = 1;
      }
    }
    for (std::uint32_t v = 0; v < count; ++v) {
      if (shorten[v] == 0 || part[v] <= least_part[v]) continue;
      part[v] = std::max(least_part[v], 0.8 * part[v]);
      place(v);
    }
  }
  for (std::size_t k = 0; k < mesh.tetrahedra.size(); ++k) {
    if (survives(mesh, mesh.tetrahedra[k], rounding)) continue;
    for (const std::uint32_t v : surface.triangles[k / 3]) folded[origin[v]] = 1;
  }
  if (folds_somewhere()) {
    note();
    outcome.reason = "is too sharply creased for its thickness, or too thin for single precision";
    return {};
  }

  // 5. One piece, not several that fall apart.
  outcome.parts = joinParts(surface, mean_edge, rounding, mesh);
  if (outcome.parts == 0) {
    outcome.reason = "has parts that no tetrahedron can tie to one another";
    return {};
  }

  // 6. Data for the report and the attachment.
  for (std::uint32_t v = 0; v < count; ++v) {
    outcome.thickness += 2 * part[v] * half[v] / count;
    if (part[v] < 1) ++outcome.thinned;
  }
  for (const std::uint32_t v : vertex_of) outcome.home.push_back(3 * some_triangle[v]);
  filled.spacing = mean_edge;
  filled.ties = std::uint32_t(mesh.tetrahedra.size() - 3 * surface.triangles.size());
  filled.components = 1;
  filled.volume = geometry::volume(mesh);
  return filled;
}

}  // namespace

FilledPiece fillWithShell(const SolidPiece& piece, std::uint32_t target, double thickness,
                          std::span<const double> factors, double rounding, ShellOutcome& outcome) {
  const double least = target / 2.0;
  Prepared prepared;
  if (!prepare(piece, std::uint32_t(kFineness * least), prepared, outcome)) return {};
  const auto all = double(prepared.surface.positions.size());
  // Surface too sharply creased where it is coarse stays fine; where that does not help, less of it is coarsened.
  for (double wanted = least;; wanted *= 2) {
    std::vector<char> keep(prepared.surface.positions.size(), 0);
    double kept = 0;
    bool stuck = false;
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      outcome = {};
      std::vector<std::uint32_t> folds;
      // The rest is made as coarse as it would be otherwise.
      const auto aim = std::uint32_t(std::max(4.0, kept < all ? kept + wanted * (all - kept) / all : all));
      const Resort resort = aim >= all ? Resort::thin : stuck || attempt + 1 == kAttempts ? Resort::cut : Resort::finer;
      FilledPiece filled = fillOnce(piece, prepared, aim, keep, thickness, factors, rounding, resort, outcome, folds);
      if (!filled.mesh.tetrahedra.empty() || aim >= all) return filled;
      std::vector<char> around(keep.size(), 0);
      for (const std::uint32_t v : folds) around[v] = 1;
      for (const auto& t : prepared.surface.triangles) {
        if (around[t[0]] == 0 && around[t[1]] == 0 && around[t[2]] == 0) continue;
        for (const std::uint32_t v : t) keep[v] = prepared.folded[v] != 0 ? 0 : 1;
      }
      const auto more = double(std::count(keep.begin(), keep.end(), char(1)));
      if (more == kept && stuck) break;
      stuck = more == kept;
      kept = more;
    }
  }
}

}  // namespace sinew::tools

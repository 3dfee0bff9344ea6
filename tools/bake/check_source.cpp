// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/check_source.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <span>
#include <utility>

#include "runtime/geometry/triangle_bvh.h"
#include "tools/core/text.h"
#include "tools/tetrahedralize/piece_findings.h"
#include "tools/tetrahedralize/pieces.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// Two parts lie near each other where this part of the smaller one's area runs along the other within kNear of the
// diagonal, turned by less than 25 degrees. Less is where parts merely meet.
constexpr double kNear = 1e-3;
constexpr double kNearCosine = 0.9;
constexpr double kNearShare = 0.01;
// A part is thin if 2 V / A is below this part of the model's diagonal and of its own.
constexpr double kThinModel = 0.01;
constexpr double kThinPart = 0.1;

class SourceCheck {
 public:
  SourceCheck(const VisualMesh& mesh, const Topology& topology, const CheckOptions& options)
      : mesh_(mesh), topology_(topology), options_(options) {
    // The smallest source vertex at each point stands for it.
    source_at_.assign(mesh.welded_positions.size(), formats::kNone);
    for (std::size_t v = 0; v < mesh.welded.size(); ++v) {
      std::uint32_t& at = source_at_[mesh.welded[v]];
      at = std::min(at, mesh.source_vertex[v]);
    }
  }

  std::vector<Finding> ofFaces() {
    findings_ = mesh_.findings;
    degenerateFaces();
    duplicateFaces();
    nonManifold();
    flipped();
    return std::move(findings_);
  }

  std::vector<Finding> ofFilling() {
    selfIntersections();
    if (topology_.parts.empty()) {
      add("no-area", Severity::error, kNoArea, mesh_.source_face_count, kNoAreaCure);
    } else {
      enclosure();
      holes();
      nearParts();
      parts();
    }
    return std::move(findings_);
  }

 private:
  Finding& add(const char* id, Severity severity, std::string message, std::uint64_t count, const char* cure) {
    findings_.push_back({id, severity, std::move(message), count, "", {}, "", cure});
    return findings_.back();
  }

  // The first source faces, ascending. \return how many there are.
  std::size_t faces(std::span<const std::uint32_t> triangles, std::vector<std::uint32_t>& places) const {
    std::vector<std::uint32_t> list;
    list.reserve(triangles.size());
    for (const std::uint32_t t : triangles) list.push_back(mesh_.triangle_face[t]);
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    const std::size_t count = list.size();
    list.resize(std::min(count, Finding::kMaxPlaces));
    places = std::move(list);
    return count;
  }
  void placeFaces(Finding& finding, std::span<const std::uint32_t> triangles) const {
    finding.place_kind = "face";
    faces(triangles, finding.places);
  }
  void placePoint(Finding& finding, std::uint32_t point) const {
    finding.place_kind = "vertex";
    const auto& list = finding.places;
    if (list.size() < Finding::kMaxPlaces && std::find(list.begin(), list.end(), source_at_[point]) == list.end()) {
      finding.places.push_back(source_at_[point]);
    }
  }
  void placeEdges(Finding& finding, std::span<const std::array<std::uint32_t, 2>> edges) const {
    for (const auto& edge : edges) {
      placePoint(finding, edge[0]);
      placePoint(finding, edge[1]);
    }
  }
  // Names of the sub-mesh a triangle lies in.
  std::string nameOf(std::uint32_t triangle) const {
    for (const SubMeshSource& sub : mesh_.sub_meshes) {
      if (triangle - sub.first_triangle >= sub.triangle_count) continue;
      return sub.mesh.empty() ? sub.node : sub.mesh;
    }
    return {};
  }
  std::string partNames(std::span<const std::uint32_t> parts) const {
    std::vector<std::string> names;
    for (const std::uint32_t p : parts) {
      const std::string name = nameOf(topology_.parts[p].triangles.front());
      if (!name.empty() && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
    std::string text;
    for (std::size_t i = 0; i < names.size() && i < 6; ++i) text += (i == 0 ? "in " : ", ") + names[i];
    return names.size() > 6 ? text + ", ..." : text;
  }

  void degenerateFaces() {
    // Import has named faces that repeat a vertex.
    std::vector<std::uint32_t> flat, collapsed;
    for (const std::uint32_t t : topology_.degenerate_triangles) {
      const Triangle& v = mesh_.triangles[t];
      const std::array s = {mesh_.source_vertex[v[0]], mesh_.source_vertex[v[1]], mesh_.source_vertex[v[2]]};
      if (s[0] == s[1] || s[1] == s[2] || s[2] == s[0]) continue;
      const Triangle p = mesh_.weldedTriangle(t);
      (p[0] == p[1] || p[1] == p[2] || p[2] == p[0] ? collapsed : flat).push_back(t);
    }
    std::vector<std::uint32_t> places;
    if (const std::size_t n = faces(flat, places); n > 0) {
      Finding& f = add(
          "zero-area-faces", Severity::warning,
          counted(n, "face is", "faces are") + " a line without area (at least in part)", n,
          "Dissolve degenerate faces in the program that made the file; they are not drawn and the bake skips them.");
      placeFaces(f, flat);
    }
    if (const std::size_t n = faces(collapsed, places); n > 0) {
      Finding& f = add("collapsed-faces", Severity::warning,
                       counted(n, "face has", "faces have") + " two corners in one place (within " +
                           lengthText(mesh_.weld_tolerance) + ") and no area left",
                       n, "Dissolve degenerate faces, or lower import.weld if that detail matters.");
      placeFaces(f, collapsed);
    }
  }

  void duplicateFaces() {
    std::vector<std::uint32_t> places;
    const std::size_t n = faces(topology_.duplicate_triangles, places);
    if (n == 0) return;
    Finding& f = add("duplicate-faces", Severity::warning,
                     counted(n, "face has", "faces have") + " the same corners as an earlier one (either way round)", n,
                     "Remove doubles; for two-sided sheets use a double-sided material instead of doubled faces.");
    placeFaces(f, topology_.duplicate_triangles);
  }

  void nonManifold() {
    if (const std::size_t n = topology_.non_manifold_edges.size(); n > 0) {
      Finding& f = add(
          "non-manifold-edges", Severity::warning,
          counted(n, "edge has", "edges have") + " more than two faces (places are the edges' ends)", n,
          "Delete inner walls and stray faces; the inside is decided by the winding number, so a bake still works.");
      placeEdges(f, topology_.non_manifold_edges);
    }
    if (const std::size_t n = topology_.non_manifold_vertices.size(); n > 0) {
      Finding& f = add("non-manifold-vertices", Severity::warning,
                       counted(n, "vertex joins", "vertices join") + " surfaces that share no edge there", n,
                       "Split the vertex, or join the surfaces by an edge.");
      for (const std::uint32_t p : topology_.non_manifold_vertices) placePoint(f, p);
    }
  }

  void flipped() {
    // Import turns what can be turned, so what is left has one side only (a Moebius strip).
    if (topology_.flipped_edges.empty()) return;
    const bool turnable = !topology_.turned_triangles.empty();
    const std::size_t n = topology_.flipped_edges.size();
    Finding& f = add("flipped-edges", Severity::warning,
                     counted(n, "edge lies", "edges lie") + " between faces that run opposite ways round" +
                         (turnable ? "" : "; the surface is one-sided and cannot be turned consistently"),
                     n,
                     turnable ? "Recalculate the normals in the program that made the file."
                              : "Cut the surface along these edges, or remove the twist.");
    placeEdges(f, topology_.flipped_edges);
  }

  void selfIntersections() {
    const auto pairs = findSelfIntersections(mesh_, topology_, options_.self_intersection_limit, false);
    if (pairs.empty()) return;
    std::vector<std::uint32_t> triangles;
    std::size_t between_parts = 0;
    for (const auto& [a, b] : pairs) {
      triangles.push_back(a);
      triangles.push_back(b);
      between_parts += topology_.part_of_triangle[a] != topology_.part_of_triangle[b];
    }
    std::vector<std::uint32_t> places;
    const std::size_t n = faces(triangles, places);
    std::string pairs_text = counted(pairs.size(), "pair", "pairs") + " of triangles";
    if (pairs.size() >= options_.self_intersection_limit) pairs_text = "at least " + pairs_text;
    if (between_parts == pairs.size())
      pairs_text += ", all of two parts";
    else if (between_parts > 0)
      pairs_text += ", " + std::to_string(between_parts) + " of two parts";
    Finding& f = add("self-intersections", Severity::warning,
                     counted(n, "face crosses or overlaps", "faces cross or overlap") + " others (" + pairs_text + ")",
                     n, "Move the faces apart or join them; overlapping solids are baked as their union.");
    f.place_kind = "face";
    f.places = std::move(places);
  }

  // The bake's own grouping decides what encloses something.
  void enclosure() {
    const geometry::ParallelFor parallel = [](std::size_t count, std::size_t grain, const auto& body) {
      tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain),
                        [&](const tbb::blocked_range<std::size_t>& r) { body(r.begin(), r.end()); });
    };
    pieces_ = findPieces(mesh_, topology_, options_.join_distance * mesh_.diagonal, parallel);
    is_sheet_.assign(topology_.parts.size(), 0);
    std::vector<std::uint32_t> loose;
    std::size_t enclosing = 0;
    for (const SolidPiece& piece : pieces_.pieces) {
      enclosing += piece.encloses;
      const auto& sheets = piece.encloses ? piece.sheets : piece.parts;
      for (const std::uint32_t p : sheets) is_sheet_[p] = 1;
      loose.insert(loose.end(), sheets.begin(), sheets.end());
    }
    std::sort(loose.begin(), loose.end());
    std::vector<std::uint32_t> small = pieces_.attached_solids;
    if (!small.empty()) {
      std::sort(small.begin(), small.end());
      std::erase_if(loose, [&](std::uint32_t p) { return std::binary_search(small.begin(), small.end(), p); });
      Finding& f = add("small-parts", Severity::info,
                       counted(small.size(), "small closed part lies", "small closed parts lie") +
                           " close to a much larger one, and " + (small.size() == 1 ? "moves" : "move") + " with it",
                       small.size(), "Bake them as files of their own if they are to fall by themselves.");
      std::vector<std::uint32_t> triangles;
      for (const std::uint32_t p : small) triangles.push_back(topology_.parts[p].triangles.front());
      placeFaces(f, triangles);
      f.place = partNames(small);
    }
    if (!loose.empty()) {
      double area = 0, total = 0;
      std::vector<std::uint32_t> triangles;
      for (const std::uint32_t p : loose) {
        area += topology_.parts[p].area;
        // One face each shows where the sheet is; all faces of one.
        triangles.push_back(topology_.parts[p].triangles.front());
      }
      for (const SurfacePart& part : topology_.parts) total += part.area;
      if (loose.size() == 1) triangles = topology_.parts[loose[0]].triangles;
      const std::string share = rounded(total > 0 ? 100 * area / total : 0) + " % of the area";
      const bool nothing = enclosing == 0;
      Finding& f =
          add(nothing ? "encloses-nothing" : "loose-sheets", Severity::warning,
              nothing ? "no part of the surface encloses anything: the body will be a layer of tetrahedra around it"
                      : counted(loose.size(), "part is a sheet that encloses", "parts are sheets that enclose") +
                            " nothing (" + share + "); " + (loose.size() == 1 ? "it follows" : "they follow") +
                            " the nearest piece",
              loose.size(),
              nothing ? "Close the surface or give it thickness if it is meant to be solid."
                      : "Nothing to do for fins, hair and lashes; close a part that is meant to be solid.");
      placeFaces(f, triangles);
      f.place = partNames(loose);
    }
    if (pieces_.pieces.size() > 1) {
      const std::size_t n = pieces_.pieces.size();
      Finding& f =
          add("several-pieces", Severity::info,
              "the parts lie apart and become " + std::to_string(n) + " pieces that move on their own", n,
              "Raise tetrahedra.join, or join the parts, if they belong together. Pieces pass through each other "
              "unless self_contact is set, in a scene file or BodySettings.");
      std::vector<std::uint32_t> triangles;
      for (const SolidPiece& piece : pieces_.pieces)
        triangles.push_back(topology_.parts[piece.parts.front()].triangles.front());
      placeFaces(f, triangles);
      for (std::size_t i = 0; i < n && i < 6; ++i) f.place += (i == 0 ? "" : ", ") + pieces_.pieces[i].title;
      if (n > 6) f.place += ", ...";
    }
    for (Finding& f : pieceFindings(mesh_, topology_, pieces_, options_.join_distance * mesh_.diagonal)) {
      findings_.push_back(std::move(f));
    }
  }

  void holes() {
    std::vector<std::uint32_t> part_at(mesh_.welded_positions.size(), formats::kNone);
    for (std::uint32_t p = 0; p < topology_.parts.size(); ++p) {
      if (topology_.parts[p].closed) continue;
      for (const std::uint32_t t : topology_.parts[p].triangles) {
        for (const std::uint32_t point : mesh_.weldedTriangle(t)) part_at[point] = p;
      }
    }
    struct Hole {
      const std::vector<std::uint32_t>* rim;
      double width;
    };
    // The farthest from the farthest from its first point: of a circle its diameter.
    const auto widthOf = [&](const std::vector<std::uint32_t>& rim) {
      const auto farthest = [&](std::uint32_t from) {
        const auto far = [&](std::uint32_t p) {
          return (mesh_.welded_positions[p] - mesh_.welded_positions[from]).norm();
        };
        const std::uint32_t to =
            *std::max_element(rim.begin(), rim.end(), [&](auto a, auto b) { return far(a) < far(b); });
        return std::pair{to, far(to)};
      };
      return farthest(farthest(rim.front()).first).second;
    };
    std::vector<Hole> holes, cracks, flaps;
    for (const auto& rim : topology_.boundary_loops) {
      if (part_at[rim[0]] == formats::kNone || is_sheet_[part_at[rim[0]]]) continue;
      const std::array<std::uint32_t, 2> last = {std::min(rim.front(), rim.back()), std::max(rim.front(), rim.back())};
      // A rim that does not come back to its start ends on an edge with further faces.
      const bool comes_back =
          rim.size() > 2 && std::binary_search(topology_.boundary_edges.begin(), topology_.boundary_edges.end(), last);
      (!comes_back ? flaps : isCrack(rim) ? cracks : holes).push_back({&rim, widthOf(rim)});
    }
    const auto report = [&](std::vector<Hole>& list, const char* id, const char* one, const char* many,
                            const char* cure) {
      if (list.empty()) return;
      std::stable_sort(list.begin(), list.end(), [](const Hole& x, const Hole& y) { return x.width > y.width; });
      std::string sizes;
      for (std::size_t i = 0; i < list.size() && i < 4; ++i) {
        sizes += (i == 0 ? "" : ", ") + counted(list[i].rim->size(), "point", "points") + " on the rim, " +
                 lengthText(list[i].width) + " across";
      }
      if (list.size() > 4) sizes += "; ...";
      Finding& f = add(id, Severity::warning, "the surface has " + counted(list.size(), one, many) + " (" + sizes + ")",
                       list.size(), cure);
      for (const Hole& hole : list) {
        for (const std::uint32_t point : *hole.rim) placePoint(f, point);
      }
    };
    report(
        holes, "open-boundary", "hole", "holes",
        "Fill the hole in the program that made the file, else the bake closes it by the winding number; for an open "
        "garment set tetrahedra.method=shell.");
    report(cracks, "cracks", "crack without width, where a vertex lies on another face's edge",
           "cracks without width, where vertices lie on other faces' edges",
           "Split the long edge at the vertex, or merge the vertex into the edge's end; the bake closes the crack.");
    report(flaps, "open-flaps", "flap that hangs on an edge of other faces", "flaps that hang on edges of other faces",
           "Delete the stray faces if they are not wanted.");
  }

  // All points of the rim lie on one line.
  bool isCrack(const std::vector<std::uint32_t>& rim) const {
    const auto farthest = [&](const Vector3d& from) {
      Vector3d far = from;
      for (const std::uint32_t p : rim) {
        const Vector3d& x = mesh_.welded_positions[p];
        if ((x - from).squaredNorm() > (far - from).squaredNorm()) far = x;
      }
      return far;
    };
    const Vector3d a = farthest(mesh_.welded_positions[rim[0]]), b = farthest(a);
    const double length = (b - a).norm();
    const double most = std::max(mesh_.weld_tolerance, 1e-6 * length) * length;
    return std::all_of(rim.begin(), rim.end(),
                       [&](std::uint32_t p) { return (mesh_.welded_positions[p] - a).cross(b - a).norm() <= most; });
  }

  Vector3d corner(std::uint32_t triangle, std::size_t k) const {
    return mesh_.welded_positions[mesh_.weldedTriangle(triangle)[k]];
  }

  void nearParts() {
    if (topology_.parts.size() < 2) return;
    std::vector<std::uint32_t> triangle;
    std::vector<geometry::Triangle> corners;
    for (const SurfacePart& part : topology_.parts) {
      for (const std::uint32_t t : part.triangles) {
        triangle.push_back(t);
        corners.push_back(mesh_.weldedTriangle(t));
      }
    }
    const geometry::TriangleBvh bvh(mesh_.welded_positions, corners);
    const double reach = kNear * mesh_.diagonal;
    // For each triangle, the other parts that its middle lies along.
    std::vector<std::vector<std::uint32_t>> along(triangle.size());
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, triangle.size(), 256), [&](const tbb::blocked_range<std::size_t>& r) {
          for (std::size_t i = r.begin(); i != r.end(); ++i) {
            const Vector3d a = corner(triangle[i], 0), b = corner(triangle[i], 1), c = corner(triangle[i], 2);
            const Vector3d normal = (b - a).cross(c - a).normalized();
            const Vector3d middle = (a + b + c) / 3;
            const std::uint32_t part = topology_.part_of_triangle[triangle[i]];
            bvh.tree().descend(
                [&](const auto& node, std::uint32_t) {
                  return node.box.squaredExteriorDistance(middle) <= reach * reach;
                },
                [&](std::uint32_t k) {
                  const std::uint32_t other_part = topology_.part_of_triangle[triangle[bvh.order()[k]]];
                  if (other_part == part) return;
                  const auto& x = bvh.corners()[k];
                  const Vector3d other_normal = (x[1] - x[0]).cross(x[2] - x[0]).normalized();
                  if (std::abs(normal.dot(other_normal)) < kNearCosine) return;
                  const Vector3d closest = geometry::closestPointOnTriangle(middle, x[0], x[1], x[2]);
                  // Across the gap, not along the sheet.
                  const Vector3d gap = closest - middle;
                  if (gap.squaredNorm() > reach * reach || gap.cross(normal).squaredNorm() > 0.25 * gap.squaredNorm())
                    return;
                  if (std::find(along[i].begin(), along[i].end(), other_part) == along[i].end())
                    along[i].push_back(other_part);
                });
          }
        });
    std::map<std::pair<std::uint32_t, std::uint32_t>, double> near_area;  // part, other part
    for (std::size_t i = 0; i < triangle.size(); ++i) {
      const Vector3d a = corner(triangle[i], 0);
      const double area = (corner(triangle[i], 1) - a).cross(corner(triangle[i], 2) - a).norm() / 2;
      for (const std::uint32_t other : along[i]) near_area[{topology_.part_of_triangle[triangle[i]], other}] += area;
    }
    std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
    const auto isNear = [&](std::uint32_t p, std::uint32_t q) {
      const auto at = near_area.find({p, q});
      return at != near_area.end() &&
             at->second >= kNearShare * std::min(topology_.parts[p].area, topology_.parts[q].area);
    };
    for (const auto& entry : near_area) {
      const std::pair<std::uint32_t, std::uint32_t> pair = std::minmax(entry.first.first, entry.first.second);
      if (isNear(entry.first.first, entry.first.second)) pairs.push_back(pair);
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    if (pairs.empty()) return;
    std::vector<std::uint32_t> triangles, parts;
    for (std::size_t i = 0; i < triangle.size(); ++i) {
      const std::uint32_t part = topology_.part_of_triangle[triangle[i]];
      if (std::any_of(along[i].begin(), along[i].end(),
                      [&](std::uint32_t other) { return isNear(part, other) || isNear(other, part); })) {
        triangles.push_back(triangle[i]);
        parts.push_back(part);
      }
    }
    Finding& f =
        add("near-coincident-parts", Severity::warning,
            counted(pairs.size(), "pair of parts runs", "pairs of parts run") + " along each other closer than " +
                lengthText(reach) + " (" + rounded(100 * kNear) + " % of the size)",
            pairs.size(),
            "Move the sheets apart, or join them: they flicker when drawn, and share one piece within "
            "tetrahedra.join.");
    placeFaces(f, triangles);
    f.place = partNames(parts);
  }

  void parts() {
    const std::size_t count = topology_.parts.size();
    if (count > 1) {
      const auto closed =
          std::count_if(topology_.parts.begin(), topology_.parts.end(), [](const SurfacePart& p) { return p.closed; });
      std::vector<std::uint32_t> triangles;
      for (const SurfacePart& part : topology_.parts) triangles.push_back(part.triangles.front());
      Finding& f = add("several-parts", Severity::info,
                       "the surface has " + std::to_string(count) + " separate parts, " +
                           std::to_string(std::uint64_t(closed)) + " of them closed",
                       count, "");
      placeFaces(f, triangles);
    }
    std::vector<std::uint32_t> thin, triangles;
    double thinnest = mesh_.diagonal;
    for (std::uint32_t p = 0; p < count; ++p) {
      const SurfacePart& part = topology_.parts[p];
      if (is_sheet_[p] || !part.closed || !(part.area > 0)) continue;
      const double thickness = 2 * std::abs(part.signed_volume) / part.area;
      Eigen::AlignedBox3d box;
      for (const std::uint32_t t : part.triangles) {
        for (std::size_t k = 0; k < 3; ++k) box.extend(corner(t, k));
      }
      if (thickness >= kThinModel * mesh_.diagonal || thickness >= kThinPart * box.diagonal().norm()) continue;
      thin.push_back(p);
      triangles.push_back(part.triangles.front());
      thinnest = std::min(thinnest, thickness);
    }
    if (thin.empty()) return;
    if (thin.size() == 1) triangles = topology_.parts[thin[0]].triangles;
    Finding& f =
        add("thin-parts", Severity::warning,
            counted(thin.size(), "closed part is", "closed parts are") + " thin (mean thickness from " +
                lengthText(thinnest) + ", " + rounded(100 * thinnest / mesh_.diagonal) + " % of the size)",
            thin.size(), "Read the bake's volume ratio; raise tetrahedra.vertices if the part comes out too thick.");
    placeFaces(f, triangles);
    f.place = partNames(thin);
  }

  const VisualMesh& mesh_;
  const Topology& topology_;
  const CheckOptions& options_;
  std::vector<Finding> findings_;
  std::vector<std::uint32_t> source_at_;  // per welded point
  std::vector<std::uint8_t> is_sheet_;    // per part
  PieceSet pieces_;
};

}  // namespace

std::vector<Finding> checkFaces(const VisualMesh& mesh, const Topology& topology) {
  return SourceCheck(mesh, topology, {}).ofFaces();
}

std::vector<Finding> checkFilling(const VisualMesh& host, const Topology& topology, const CheckOptions& options) {
  return SourceCheck(host, topology, options).ofFilling();
}

std::vector<Finding> checkSource(const VisualMesh& mesh, const Topology& topology, const CheckOptions& options) {
  std::vector<Finding> findings = checkFaces(mesh, topology);
  appendNew(findings, checkFilling(mesh, topology, options));
  return findings;
}

void appendNew(std::vector<Finding>& findings, const std::vector<Finding>& more) {
  for (const Finding& f : more) {
    if (std::find(findings.begin(), findings.end(), f) == findings.end()) findings.push_back(f);
  }
}

bool hasErrors(const std::vector<Finding>& findings) {
  return std::any_of(findings.begin(), findings.end(), [](const Finding& f) { return f.severity == Severity::error; });
}

std::string countedSeverities(const std::vector<Finding>& findings) {
  std::array<std::size_t, 3> counts = {};
  for (const Finding& f : findings) ++counts[std::size_t(f.severity)];
  std::string text;
  const auto append = [&](Severity severity, const char* one, const char* many) {
    if (const std::size_t n = counts[std::size_t(severity)]; n > 0) {
      text += (text.empty() ? "" : ", ") + counted(n, one, many);
    }
  };
  append(Severity::error, "error", "errors");
  append(Severity::warning, "warning", "warnings");
  return text.empty() ? "no findings" : text;
}

std::string sourceVerdict(const std::vector<Finding>& findings) {
  const std::string counts = countedSeverities(findings);
  if (hasErrors(findings)) return counts + ": it cannot be baked as it is";
  return counts == "no findings" ? "sound: it can be baked" : counts + ": it can be baked";
}

}  // namespace sinew::tools

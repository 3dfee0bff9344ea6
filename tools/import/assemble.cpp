// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/assemble.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <future>
#include <limits>
#include <map>
#include <numeric>

#include "tools/core/error.h"
#include "tools/core/text.h"
#include "tools/core/units.h"
#include "tools/import/crease.h"
#include "tools/import/import_process.h"
#include "tools/import/orient.h"
#include "tools/import/outliers.h"
#include "tools/import/text_cursor.h"
#include "tools/import/textures.h"
#include "tools/import/triangulate.h"
#include "tools/import/weld.h"

namespace sinew::tools {
namespace {

constexpr double kSmallestPlausible = 1e-3;  // metres
constexpr double kLargestPlausible = 100;
constexpr double kLargestPossible = 1e12;  // beyond it single precision overflows in squares and cubes of lengths
constexpr double kWeightSumTolerance = 1e-3;

class Assembler {
 public:
  Assembler(RawScene scene, const std::filesystem::path& file, const std::string& format, const ImportOptions& options)
      : scene_(std::move(scene)), path_(file), options_(options) {
    mesh_.file = file.string();
    mesh_.format = format;
    mesh_.findings = std::move(scene_.findings);
  }

  VisualMesh run() {
    textures();
    takeUnitAndAxes();
    placePoints();
    if (!options_.keep_stray) leaveOutStrayFaces();
    makeVertices();
    measure();
    weld();
    const Turned turned = orientFaces(mesh_);
    normals(turned);
    attributes();
    groups();
    materials();
    mesh_.joints = std::move(scene_.joints);
    for (RawNode& node : scene_.nodes)
      mesh_.nodes.push_back({node.name, node.parent == formats::kNone ? "" : scene_.nodes[node.parent].name,
                             std::move(node.properties_json)});
    return std::move(mesh_);
  }

 private:
  void warn(const char* id, std::uint64_t count, const std::string& message, const std::string& cure,
            Severity severity = Severity::warning, const char* place_kind = "",
            std::vector<std::uint32_t> places = {}) {
    places.resize(std::min(places.size(), Finding::kMaxPlaces));
    mesh_.findings.push_back({id, severity, message, count, place_kind, std::move(places), "", cure});
  }
  [[noreturn]] void fail(const std::string& what, const std::string& cure) const {
    throw ToolError(ExitCode::bad_input, mesh_.file, what, cure);
  }

  void takeUnitAndAxes() {
    if (options_.unit != "auto") {
      mesh_.metres_per_unit = metresPerUnit(options_.unit);
      mesh_.unit_source = "the unit option says " + options_.unit;
    } else if (scene_.metres_per_unit > 0) {
      mesh_.metres_per_unit = scene_.metres_per_unit;
      mesh_.unit_source = scene_.unit_source;
    } else {
      mesh_.metres_per_unit = 1;
      mesh_.unit_source = "the format names no unit, so 1 unit is taken as 1 metre";
    }
    static constexpr const char* kAxis[] = {"x", "y", "z"};
    mesh_.up_axis = options_.up == "auto" ? kAxis[scene_.up_axis] : options_.up;
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    if (mesh_.up_axis == "z") turn << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    if (mesh_.up_axis == "x") turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    to_world_.setIdentity();
    to_world_.topLeftCorner<3, 3>() = turn * mesh_.metres_per_unit;
  }

  /// World positions of all source vertices, mesh after mesh.
  void placePoints() {
    for (const RawMesh& raw : scene_.meshes) {
      const std::uint32_t first = std::uint32_t(points_.size());
      first_point_.push_back(first);
      const Eigen::Matrix4d transform = to_world_ * raw.transform;
      const Eigen::Matrix3d linear = transform.topLeftCorner<3, 3>();
      const Eigen::Vector3d shift = transform.topRightCorner<3, 1>();
      // The common case must not lose a bit to a multiplication by 1.
      const bool identity = transform == Eigen::Matrix4d::Identity();
      points_.resize(first + raw.points.size());
      for (std::size_t i = 0; i < raw.points.size(); ++i)
        points_[first + i] = identity ? raw.points[i] : Eigen::Vector3d(linear * raw.points[i] + shift);
      for (std::size_t i = 0; i < raw.points.size(); ++i)
        if (!points_[first + i].allFinite())
          fail("vertex " + std::to_string(first + i) + " lies beyond all bounds after its node's transform",
               "Check the node transforms in the program that made the file.");
      if (raw.ranges.empty()) {
        if (!raw.points.empty()) mesh_.source_meshes.push_back({raw.name, first, std::uint32_t(raw.points.size())});
      } else {
        for (const SourceMeshRange& range : raw.ranges)
          mesh_.source_meshes.push_back({range.name, first + range.first_source_vertex, range.source_vertex_count});
      }
    }
    mesh_.source_vertex_count = std::uint32_t(points_.size());
  }

  /// Leaves out stray faces.
  void leaveOutStrayFaces() {
    const StrayFaces stray = findStrayFaces(scene_, points_, first_point_);
    if (stray.faces.empty()) return;
    left_out_.assign(stray.faces.back() + 1, false);
    for (const std::uint32_t face : stray.faces) left_out_[face] = true;
    const bool one = stray.faces.size() == 1;
    warn("stray-faces", stray.faces.size(),
         std::to_string(stray.faces.size()) + (one ? " face lies " : " faces lie ") + lengthText(stray.distance) +
             " from the middle of the model, which reaches out to " + lengthText(stray.reach) + "; " +
             (one ? "it was left out" : "they were left out"),
         "Delete them in the program that made the file, or keep them with --set import.keep_stray=true.",
         Severity::warning, "face", stray.faces);
  }
  bool isLeftOut(std::uint32_t face) const { return face < left_out_.size() && left_out_[face]; }

  /// Visual vertices and triangles, sub-mesh after sub-mesh; a sub-mesh's vertices keep the reader's order.
  void makeVertices() {
    Triangulator triangulator;
    std::vector<Eigen::Vector3d> polygon;
    std::vector<Triangle> cut;
    std::uint32_t first_face = 0;
    std::vector<std::uint32_t> repeated;
    for (std::uint32_t m = 0; m < scene_.meshes.size(); ++m) {
      const RawMesh& raw = scene_.meshes[m];
      const bool mirrored = raw.transform.topLeftCorner<3, 3>().determinant() < 0;
      const std::size_t face_count = raw.face_size.size();
      std::vector<std::uint32_t> begin(face_count + 1, 0);
      for (std::size_t f = 0; f < face_count; ++f) begin[f + 1] = begin[f] + raw.face_size[f];
      std::vector<std::uint32_t> order(face_count);
      std::iota(order.begin(), order.end(), 0U);
      if (!raw.face_part.empty() && !std::is_sorted(raw.face_part.begin(), raw.face_part.end()))
        std::stable_sort(order.begin(), order.end(),
                         [&](std::uint32_t a, std::uint32_t b) { return raw.face_part[a] < raw.face_part[b]; });
      std::vector<std::uint32_t> visual(raw.vertex_point.size(), formats::kNone);
      std::vector<std::uint32_t> used;
      for (std::size_t from = 0; from < face_count;) {
        const std::uint32_t part = raw.face_part.empty() ? 0 : raw.face_part[order[from]];
        std::size_t to = from;
        while (to < face_count && (raw.face_part.empty() || raw.face_part[order[to]] == part)) ++to;
        used.clear();
        for (std::size_t k = from; k < to; ++k)
          for (std::uint32_t c = begin[order[k]]; c < begin[order[k] + 1] && !isLeftOut(first_face + order[k]); ++c)
            if (std::uint32_t& seen = visual[raw.corners[c]]; seen == formats::kNone)
              seen = 0, used.push_back(raw.corners[c]);
        std::sort(used.begin(), used.end());
        for (std::uint32_t v : used) {
          visual[v] = std::uint32_t(mesh_.positions.size());
          origin_.push_back({m, v});
          mesh_.source_vertex.push_back(first_point_[m] + raw.vertex_point[v]);
          mesh_.positions.push_back(points_[mesh_.source_vertex.back()]);
        }
        SubMeshSource sub;
        sub.node = raw.node == formats::kNone ? "" : scene_.nodes[raw.node].name;
        sub.mesh = raw.parts[part].name;
        sub.material = raw.parts[part].material;
        sub.first_triangle = std::uint32_t(mesh_.triangles.size());
        for (std::size_t k = from; k < to; ++k) {
          const std::uint32_t f = order[k];
          const std::uint32_t size = raw.face_size[f];
          if (size < 3 || isLeftOut(first_face + f)) continue;
          const std::uint32_t* corner = raw.corners.data() + begin[f];
          cut.clear();
          if (size == 3) {
            cut.push_back({0, 1, 2});
          } else {
            polygon.clear();
            for (std::uint32_t c = 0; c < size; ++c) polygon.push_back(mesh_.positions[visual[corner[c]]]);
            triangulator.cut(polygon, cut);
          }
          bool repeats = false;
          for (Triangle t : cut) {
            for (std::uint32_t& c : t) c = visual[corner[c]];
            if (mirrored) std::swap(t[1], t[2]);
            const Triangle s = {mesh_.source_vertex[t[0]], mesh_.source_vertex[t[1]], mesh_.source_vertex[t[2]]};
            repeats = repeats || s[0] == s[1] || s[1] == s[2] || s[2] == s[0];
            mesh_.triangles.push_back(t);
            mesh_.triangle_face.push_back(first_face + f);
            if (!raw.face_groups.empty())
              triangle_groups_.resize(mesh_.triangles.size() - 1, formats::kNone),
                  triangle_groups_.push_back(raw.face_groups[f]);
          }
          if (repeats) repeated.push_back(first_face + f);
        }
        sub.triangle_count = std::uint32_t(mesh_.triangles.size()) - sub.first_triangle;
        if (sub.triangle_count > 0) mesh_.sub_meshes.push_back(std::move(sub));
        for (std::uint32_t v : used) visual[v] = formats::kNone;
        from = to;
      }
      first_face += std::uint32_t(face_count);
    }
    mesh_.source_face_count = first_face;
    if (mesh_.triangles.empty())
      fail("has no faces", "Export the surface as polygons; points, lines and curves have no inside.");
    std::vector<bool> referenced(mesh_.source_vertex_count, false);
    for (std::uint32_t v : mesh_.source_vertex) referenced[v] = true;
    for (std::uint32_t v = 0; v < mesh_.source_vertex_count; ++v)
      if (!referenced[v]) mesh_.unreferenced.push_back(v);
    if (!mesh_.unreferenced.empty())
      warn("unreferenced-vertices", mesh_.unreferenced.size(),
           std::to_string(mesh_.unreferenced.size()) + " vertices are used by no face; they take no part",
           "Delete loose vertices if they are not wanted.", Severity::info, "vertex", mesh_.unreferenced);
    std::sort(repeated.begin(), repeated.end());
    if (!repeated.empty())
      warn("repeated-index-faces", repeated.size(),
           std::to_string(repeated.size()) + " faces name a vertex twice and have no area",
           "Delete degenerate faces in the program that made the file.", Severity::warning, "face", repeated);
  }

  /// \return the diagonal of all vertices but those.
  double reportFlung(const std::vector<std::uint32_t>& flung) {
    Eigen::AlignedBox3d rest;
    std::vector<std::uint32_t> source;
    for (std::uint32_t v = 0, next = 0; v < mesh_.positions.size(); ++v) {
      if (next < flung.size() && flung[next] == v) {
        source.push_back(mesh_.source_vertex[v]);
        ++next;
      } else {
        rest.extend(mesh_.positions[v]);
      }
    }
    const double size = rest.diagonal().norm();
    if (flung.empty()) return size;
    std::sort(source.begin(), source.end());
    source.erase(std::unique(source.begin(), source.end()), source.end());
    const Eigen::Vector3d& at = points_[source[0]];
    const double times = (at - rest.center()).norm() / (size / 2);
    std::string name;
    for (const SourceMeshRange& range : mesh_.source_meshes)
      if (source[0] - range.first_source_vertex < range.source_vertex_count) name = range.name;
    char text[64];
    std::snprintf(text, sizeof text, "%.0f times further out than all the others", times);
    warn("flung-vertices", source.size(),
         std::to_string(source.size()) + (source.size() == 1 ? " vertex lies " : " vertices lie ") + text +
             " (vertex " + std::to_string(source[0]) + (name.empty() ? "" : " of " + name) + ")",
         "Move it back or delete it in the program that made the file: the bake fills all the way out to it.",
         Severity::warning, "vertex", source);
    std::snprintf(text, sizeof text, "at (%.4g, %.4g, %.4g) m", at.x(), at.y(), at.z());
    mesh_.findings.back().place = text;
    return size;
  }

  void measure() {
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& p : mesh_.positions) box.extend(p);
    mesh_.bounds_min = box.min();
    mesh_.bounds_max = box.max();
    mesh_.diagonal = box.diagonal().norm();
    if (!std::isfinite(mesh_.diagonal) || mesh_.diagonal > kLargestPossible)
      fail("has vertices too far apart to compute with", "Check its coordinates.");
    if (!(mesh_.diagonal > 0))
      fail("has no size: all its faces lie in one point", "Check its coordinates and node scales.");
    // A single vertex far out says nothing about the unit.
    const double size = reportFlung(findFlungVertices(mesh_.positions, mesh_.triangles));
    if (size >= kSmallestPlausible && size <= kLargestPlausible) return;
    std::string cure = "Pass the unit the file was made in.";
    if (options_.unit == "auto") {
      // The two units that bring the size nearest to a metre.
      const double units = size / mesh_.metres_per_unit;
      std::vector<std::pair<double, const char*>> guesses;
      for (const char* unit : {"mm", "cm", "in", "m"})
        guesses.emplace_back(std::abs(std::log10(units * metresPerUnit(unit))), unit);
      std::sort(guesses.begin(), guesses.end());
      const auto then = [&](const char* unit) { return lengthText(units * metresPerUnit(unit)); };
      if (guesses[0].first < 2)
        cure = std::string("If the file is in ") + guesses[0].second + ", pass --unit " + guesses[0].second +
               " (then " + then(guesses[0].second) + "; in " + guesses[1].second + " it would be " +
               then(guesses[1].second) + ").";
    }
    warn("implausible-size", 1, "the model is " + lengthText(size) + " across (" + mesh_.unit_source + ")", cure);
  }

  void weld() {
    mesh_.weld_tolerance = options_.weld_tolerance * mesh_.diagonal;
    Weld weld = weldPositions(mesh_.positions, mesh_.weld_tolerance);
    mesh_.welded_positions = std::move(weld.points);
    mesh_.welded = std::move(weld.of);
    // A seam: one point, several visual vertices. A merge: one point, several source vertices.
    std::vector<std::uint32_t> vertices_at(mesh_.welded_positions.size(), 0);
    std::vector<std::uint32_t> source_at(mesh_.welded_positions.size(), formats::kNone);
    std::vector<std::uint32_t> merged;
    for (std::uint32_t v = 0; v < mesh_.welded.size(); ++v) {
      const std::uint32_t point = mesh_.welded[v];
      ++vertices_at[point];
      const std::uint32_t source = mesh_.source_vertex[v];
      if (source_at[point] == formats::kNone) source_at[point] = source;
      if (source_at[point] != source) merged.push_back(source);
    }
    std::sort(merged.begin(), merged.end());
    merged.erase(std::unique(merged.begin(), merged.end()), merged.end());
    const auto seams = std::count_if(vertices_at.begin(), vertices_at.end(), [](std::uint32_t n) { return n > 1; });
    if (seams > 0)
      warn("seams", std::uint64_t(seams),
           counted(std::uint64_t(seams), "point carries", "points carry") +
               " several vertices (UV, normal, colour or material seams, or doubled vertices), which move as one",
           "", Severity::info);
    if (!merged.empty())
      warn("welded-vertices", merged.size(),
           counted(merged.size(), "vertex lies", "vertices lie") + " within " + lengthText(mesh_.weld_tolerance) +
               " of another and " + (merged.size() == 1 ? "was" : "were") + " welded to it",
           "", Severity::info, "vertex", merged);
  }

  void normals(const Turned& turned) {
    const std::size_t vertex_count = mesh_.positions.size();
    mesh_.normals.assign(vertex_count, Eigen::Vector3f::Zero());
    bool all = true;
    std::vector<Eigen::Matrix3d> cofactor;
    for (const RawMesh& raw : scene_.meshes) {
      const Eigen::Matrix3d m = (to_world_ * raw.transform).topLeftCorner<3, 3>();
      Eigen::Matrix3d c;
      for (int k = 0; k < 3; ++k) c.col(k) = m.col((k + 1) % 3).cross(m.col((k + 2) % 3));
      cofactor.push_back(m.determinant() < 0 ? Eigen::Matrix3d(-c) : c);
    }
    for (std::size_t v = 0; v < vertex_count; ++v) {
      const RawMesh& raw = scene_.meshes[origin_[v].mesh];
      Eigen::Vector3d n = Eigen::Vector3d::Zero();
      if (!raw.normals.empty()) n = cofactor[origin_[v].mesh] * raw.normals[origin_[v].vertex].cast<double>();
      const double length = n.norm();
      if (std::isfinite(length) && length > 0) {
        mesh_.normals[v] = (n / length).cast<float>();
        mesh_.had_normals = true;
      } else {
        all = false;
      }
    }
    if (all && !turned.any) return;
    // Area times angle at each corner (Max 1999 and Thuermer 1998 each weigh by one of them).
    std::vector<std::array<Eigen::Vector3d, 3>> corner(mesh_.triangles.size());
    tbb::parallel_for(std::size_t(0), mesh_.triangles.size(), [&](std::size_t t) {
      const Triangle p = mesh_.weldedTriangle(t);
      std::array<Eigen::Vector3d, 3> at = {mesh_.welded_positions[p[0]], mesh_.welded_positions[p[1]],
                                           mesh_.welded_positions[p[2]]};
      const Eigen::Vector3d area = (at[1] - at[0]).cross(at[2] - at[0]);
      for (std::size_t k = 0; k < 3; ++k) {
        const Eigen::Vector3d a = at[(k + 1) % 3] - at[k];
        const Eigen::Vector3d b = at[(k + 2) % 3] - at[k];
        corner[t][k] = area * std::atan2(a.cross(b).norm(), a.dot(b));
      }
    });
    if (!all) computeNormals(corner);
    if (mesh_.had_normals && turned.any) {
      // The source's normals of turned faces may point inward (the whole model was inside out) or outward (only its
      // winding was wrong): they go with the faces they light.
      std::vector<Eigen::Vector3d> sum(mesh_.positions.size(), Eigen::Vector3d::Zero());
      std::vector<std::uint8_t> touched(mesh_.positions.size(), 0);
      for (std::size_t t = 0; t < mesh_.triangles.size(); ++t)
        for (std::size_t k = 0; k < 3; ++k) {
          sum[mesh_.triangles[t][k]] += corner[t][k];
          touched[mesh_.triangles[t][k]] |= turned.triangle[t];
        }
      for (std::size_t v = 0; v < mesh_.positions.size(); ++v)
        if (touched[v] && sum[v].dot(mesh_.normals[v].cast<double>()) < 0) mesh_.normals[v] = -mesh_.normals[v];
    }
  }

  // Normals of vertices that the source gives none, one for each of their smooth fans: where a crease passes a vertex
  // becomes several, one behind the other. \param corner area times angle, by triangle and corner.
  void computeNormals(const std::vector<std::array<Eigen::Vector3d, 3>>& corner) {
    const std::vector<std::uint32_t> fan = smoothFans(mesh_, options_.crease_degrees);
    std::vector<Eigen::Vector3d> sum(fan.size(), Eigen::Vector3d::Zero());
    for (std::size_t c = 0; c < fan.size(); ++c) sum[fan[c]] += corner[c / 3][c % 3];
    // The fans of each vertex without a normal, as first met.
    std::vector<std::pair<std::uint32_t, std::uint32_t>> needed;  // vertex, fan
    for (std::size_t c = 0; c < fan.size(); ++c) {
      const std::uint32_t v = mesh_.triangles[c / 3][c % 3];
      if (mesh_.normals[v] == Eigen::Vector3f::Zero()) needed.emplace_back(v, fan[c]);
    }
    std::sort(needed.begin(), needed.end());
    needed.erase(std::unique(needed.begin(), needed.end()), needed.end());
    // Each vertex moves behind the copies that those before it got.
    const std::size_t old_count = mesh_.positions.size();
    std::vector<std::uint32_t> first(old_count), first_needed(old_count + 1, 0);
    for (const auto& [v, f] : needed) ++first_needed[v + 1];
    std::partial_sum(first_needed.begin(), first_needed.end(), first_needed.begin());
    std::uint32_t count = 0;
    for (std::size_t v = 0; v < old_count; ++v) {
      first[v] = count;
      count += std::max(1U, first_needed[v + 1] - first_needed[v]);
    }
    for (std::size_t c = 0; c < fan.size(); ++c) {
      std::uint32_t& v = mesh_.triangles[c / 3][c % 3];
      const auto begin = needed.begin() + first_needed[v], end = needed.begin() + first_needed[v + 1];
      const auto at = std::lower_bound(begin, end, std::pair(v, fan[c]));
      v = first[v] + (begin == end ? 0U : std::uint32_t(at - begin));
    }
    VisualMesh old;
    old.positions.swap(mesh_.positions);
    old.normals.swap(mesh_.normals);
    old.source_vertex.swap(mesh_.source_vertex);
    old.welded.swap(mesh_.welded);
    std::vector<Origin> origin;
    origin.swap(origin_);
    for (std::size_t v = 0; v < old_count; ++v) {
      const std::uint32_t begin = first_needed[v], end = std::max(first_needed[v + 1], begin + 1);
      for (std::uint32_t k = begin; k < end; ++k) {
        Eigen::Vector3f n = old.normals[v];
        if (n == Eigen::Vector3f::Zero()) {
          const Eigen::Vector3d wide = begin < first_needed[v + 1] ? sum[needed[k].second] : Eigen::Vector3d::Zero();
          n = wide.norm() > 0 ? Eigen::Vector3f(wide.normalized().cast<float>()) : Eigen::Vector3f(0, 1, 0);
        }
        mesh_.positions.push_back(old.positions[v]);
        mesh_.normals.push_back(n);
        mesh_.source_vertex.push_back(old.source_vertex[v]);
        mesh_.welded.push_back(old.welded[v]);
        origin_.push_back(origin[v]);
      }
    }
  }

  void attributes() {
    const std::size_t n = mesh_.positions.size();
    const auto any = [&](auto has) { return std::any_of(scene_.meshes.begin(), scene_.meshes.end(), has); };
    if (any([](const RawMesh& m) { return !m.uvs.empty(); })) mesh_.uvs.assign(n, Eigen::Vector2f::Zero());
    if (any([](const RawMesh& m) { return !m.colors.empty(); })) mesh_.colors.assign(n, {0, 0, 0, 0});
    if (any([](const RawMesh& m) { return !m.skin_count.empty(); })) mesh_.skin.resize(n);
    std::map<std::string, std::size_t> number;
    // For each raw mesh, where its attributes go.
    std::vector<std::vector<std::size_t>> target(scene_.meshes.size());
    for (std::size_t m = 0; m < scene_.meshes.size(); ++m)
      for (const AttributeSource& a : scene_.meshes[m].attributes) {
        const auto [at, fresh] = number.try_emplace(a.name, mesh_.attributes.size());
        if (fresh) mesh_.attributes.push_back({a.name, a.components, std::vector<float>(n * a.components, 0.0F)});
        target[m].push_back(at->second);
      }
    std::vector<std::vector<std::uint32_t>> skin_begin(scene_.meshes.size());
    for (std::size_t m = 0; m < scene_.meshes.size(); ++m) {
      skin_begin[m].push_back(0);
      for (std::uint32_t count : scene_.meshes[m].skin_count) skin_begin[m].push_back(skin_begin[m].back() + count);
    }
    std::uint64_t bad_numbers = 0;
    const auto finite = [&](float value, float most = std::numeric_limits<float>::max()) {
      if (std::abs(value) <= most) return value;
      ++bad_numbers;
      return 0.0F;
    };
    std::vector<std::uint32_t> unnormalized;
    std::vector<std::uint32_t> unweighted;
    std::vector<std::vector<std::uint32_t>> visual_of(scene_.meshes.size());
    for (std::size_t v = 0; v < n; ++v) {
      const auto [m, k] = origin_[v];
      const RawMesh& raw = scene_.meshes[m];
      if (!raw.uvs.empty())
        mesh_.uvs[v] = {finite(raw.uvs[k].x(), formats::kMostTexture), finite(raw.uvs[k].y(), formats::kMostTexture)};
      if (!raw.colors.empty())
        for (std::size_t c = 0; c < 4; ++c) mesh_.colors[v][c] = finite(raw.colors[k][c]);
      for (std::size_t a = 0; a < raw.attributes.size(); ++a) {
        AttributeSource& out = mesh_.attributes[target[m][a]];
        const std::uint32_t from = raw.attributes[a].components;
        for (std::uint32_t c = 0; c < std::min(from, out.components); ++c)
          out.values[v * out.components + c] = finite(raw.attributes[a].values[k * from + c]);
      }
      if (!raw.skin_count.empty()) skinOf(raw, skin_begin[m][k], skin_begin[m][k + 1], v, unnormalized, unweighted);
    }
    if (bad_numbers > 0)
      warn("bad-attribute-numbers", bad_numbers,
           std::to_string(bad_numbers) +
               " UV, colour or attribute values are not finite numbers, or texture coordinates beyond 1e9, and were "
               "set to 0",
           "Export the file again.");
    const auto distinct = [](std::vector<std::uint32_t>& list) {
      std::sort(list.begin(), list.end());
      list.erase(std::unique(list.begin(), list.end()), list.end());
      return list.size();
    };
    if (const std::size_t count = distinct(unnormalized); count > 0)
      warn("unnormalized-weights", count,
           "the skin weights of " + std::to_string(count) + " vertices do not sum to 1; they were normalized",
           "Normalize all weights in the program that made the file.", Severity::warning, "vertex", unnormalized);
    if (const std::size_t count = distinct(unweighted); count > 0)
      warn("unweighted-vertices", count, std::to_string(count) + " vertices of skinned meshes have no skin weight",
           "Assign them to a bone if they should follow one.", Severity::warning, "vertex", unweighted);
    morphs();
  }

  void skinOf(const RawMesh& raw, std::uint32_t from, std::uint32_t to, std::size_t v,
              std::vector<std::uint32_t>& unnormalized, std::vector<std::uint32_t>& unweighted) {
    std::vector<SkinInfluence>& out = mesh_.skin[v];
    double sum = 0;
    for (std::uint32_t i = from; i < to; ++i) {
      const SkinInfluence& influence = raw.skin[i];
      if (!std::isfinite(influence.weight) || influence.weight <= 0) continue;
      sum += double(influence.weight);
      const auto same =
          std::find_if(out.begin(), out.end(), [&](const SkinInfluence& s) { return s.joint == influence.joint; });
      if (same != out.end()) {
        same->weight += influence.weight;
      } else {
        out.push_back(influence);
      }
    }
    if (!(sum > 0)) {
      out.clear();
      unweighted.push_back(mesh_.source_vertex[v]);
      return;
    }
    if (std::abs(sum - 1) > kWeightSumTolerance) unnormalized.push_back(mesh_.source_vertex[v]);
    for (SkinInfluence& influence : out) influence.weight = float(double(influence.weight) / sum);
    std::sort(out.begin(), out.end(), [](const SkinInfluence& a, const SkinInfluence& b) {
      return a.weight != b.weight ? a.weight > b.weight : a.joint < b.joint;
    });
  }

  void morphs() {
    // Targets of one name on several meshes are one target.
    std::map<std::string, std::size_t> number;
    std::vector<std::vector<std::pair<std::uint32_t, Eigen::Vector3f>>> moved;
    std::vector<std::string> names;
    std::vector<std::uint32_t> visual;
    for (std::uint32_t m = 0; m < scene_.meshes.size(); ++m) {
      const RawMesh& raw = scene_.meshes[m];
      if (raw.morphs.empty()) continue;
      // A vertex is one visual vertex, and its copies at creases behind it, only where no two parts share it, which
      // holds for all readers with morphs.
      visual.assign(raw.vertex_point.size(), formats::kNone);
      for (std::uint32_t v = 0; v < origin_.size(); ++v)
        if (origin_[v].mesh == m && visual[origin_[v].vertex] == formats::kNone) visual[origin_[v].vertex] = v;
      const Eigen::Matrix3d linear = (to_world_ * raw.transform).topLeftCorner<3, 3>();
      for (const RawMorph& morph : raw.morphs) {
        const auto [at, fresh] = number.try_emplace(morph.name, names.size());
        if (fresh) names.push_back(morph.name), moved.emplace_back();
        for (std::size_t k = 0; k < morph.vertices.size(); ++k)
          for (std::uint32_t v = visual[morph.vertices[k]];
               v < origin_.size() && origin_[v].mesh == m && origin_[v].vertex == morph.vertices[k]; ++v)
            moved[at->second].emplace_back(v, (linear * morph.displacements[k].cast<double>()).cast<float>());
      }
    }
    for (std::size_t i = 0; i < names.size(); ++i) {
      std::stable_sort(moved[i].begin(), moved[i].end(),
                       [](const auto& a, const auto& b) { return a.first < b.first; });
      MorphTargetSource out;
      out.name = names[i];
      for (const auto& [v, d] : moved[i]) {
        if (!out.vertices.empty() && out.vertices.back() == v) {
          out.displacements.back() = d;
          continue;
        }
        out.vertices.push_back(v);
        out.displacements.push_back(d);
      }
      mesh_.morphs.push_back(std::move(out));
    }
  }

  void groups() {
    if (scene_.groups.empty()) return;
    triangle_groups_.resize(mesh_.triangles.size(), formats::kNone);
    mesh_.groups.resize(scene_.groups.size());
    for (std::size_t g = 0; g < scene_.groups.size(); ++g) mesh_.groups[g].name = scene_.groups[g];
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
      if (triangle_groups_[t] == formats::kNone) continue;
      for (std::uint32_t g : scene_.group_sets[triangle_groups_[t]]) {
        if (!mesh_.groups[g].triangles.empty() && mesh_.groups[g].triangles.back() == t) continue;
        mesh_.groups[g].triangles.push_back(t);
        for (std::uint32_t v : mesh_.triangles[t]) mesh_.groups[g].vertices.push_back(v);
      }
    }
    for (GroupSource& group : mesh_.groups) {
      std::sort(group.vertices.begin(), group.vertices.end());
      group.vertices.erase(std::unique(group.vertices.begin(), group.vertices.end()), group.vertices.end());
    }
    std::erase_if(mesh_.groups, [](const GroupSource& group) { return group.triangles.empty(); });
  }

  // Brings the textures and starts to look at them: that takes a while, and nothing else waits for it.
  void textures() {
    for (const RawTexture& texture : scene_.textures)
      mesh_.textures.push_back(loadTexture(texture, path_.parent_path(), texture_findings_));
    std::vector<std::span<const std::byte>> pictures;
    for (const TextureSource& texture : mesh_.textures) {
      if (!texture.bytes.empty()) pictures.emplace_back(texture.bytes);
    }
    if (pictures.empty()) return;
    picture_states_ = std::async(std::launch::async, [this, pictures] { return pictureStates(pictures, options_); });
  }

  void sayOfPictures(const std::vector<PictureState>& states) {
    std::size_t at = 0;
    for (std::size_t t = 0; t < mesh_.textures.size(); ++t) {
      const TextureSource& texture = mesh_.textures[t];
      if (texture.bytes.empty()) continue;
      const PictureState state = states[at++];
      for (const PictureRemark& remark : kPictureRemarks) {
        if (remark.state != state) continue;
        warn(remark.id, 1, "the texture " + texture.name + " (" + texture.mime + ") " + remark.message, kPictureCure);
        mesh_.findings.back().place = asUtf8(scene_.textures[t].path.empty() ? texture.name : scene_.textures[t].path);
      }
    }
  }

  void materials() {
    mesh_.findings.insert(mesh_.findings.end(), texture_findings_.begin(), texture_findings_.end());
    if (picture_states_.valid()) sayOfPictures(picture_states_.get());
    for (RawMaterial& raw : scene_.materials) {
      MaterialSource material;
      material.name = std::move(raw.name);
      material.base_color = raw.base_color;
      material.texture = raw.texture;
      material.double_sided = raw.double_sided;
      mesh_.materials.push_back(std::move(material));
    }
  }

  struct Origin {
    std::uint32_t mesh, vertex;
  };

  RawScene scene_;
  std::filesystem::path path_;
  const ImportOptions& options_;
  VisualMesh mesh_;
  Eigen::Matrix4d to_world_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<std::uint32_t> first_point_;
  std::vector<Origin> origin_;  ///< per visual vertex
  std::vector<std::uint32_t> triangle_groups_;
  std::vector<bool> left_out_;  ///< per face of the file, up to the last stray one
  std::vector<Finding> texture_findings_;
  std::future<std::vector<PictureState>> picture_states_;  ///< of the textures that have bytes
};

}  // namespace

double metresPerUnit(const std::string& unit) {
  for (const LengthUnit& known : kLengthUnits)
    if (unit == known.name) return known.metres;
  const auto number = parseNumber(unit);
  return number && std::isfinite(*number) && *number > kLeastUnit && *number < kMostUnit ? *number : 0;
}

VisualMesh assembleVisualMesh(RawScene scene, const std::filesystem::path& file, const std::string& format,
                              const ImportOptions& options) {
  return Assembler(std::move(scene), file, format, options).run();
}

}  // namespace sinew::tools

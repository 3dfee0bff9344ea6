// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/cluster_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <map>
#include <nlohmann/json.hpp>

#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

constexpr std::string_view kPrefix = "CLUSTER_";
// Of the diagonal: nearer than this a vertex is the same one, moved by rounding.
constexpr double kSame = 1e-5;
constexpr double kFarthestEdit = 0.02;

bool isClusterName(std::string_view name) {
  return name.size() > kPrefix.size() && std::equal(kPrefix.begin(), kPrefix.end(), name.begin(), [](char a, char b) {
           return a == char(std::toupper(static_cast<unsigned char>(b)));
         });
}

bool isTrue(const nlohmann::json& value) {
  return (value.is_boolean() && value.get<bool>()) || (value.is_number() && value.get<double>() != 0);
}

struct Flags {
  std::string name;  // empty: no cluster mesh
  bool visual = false;
};

Flags flagsOf(const NodeSource& node) {
  Flags flags;
  const auto json = nlohmann::json::parse(node.properties_json, nullptr, false);
  const auto take = [&](const nlohmann::json& properties) {
    if (!properties.is_object()) return;
    if (const auto at = properties.find("sinew_cluster"); at != properties.end()) {
      if (at->is_string() && !at->get<std::string>().empty())
        flags.name = at->get<std::string>();
      else if (isTrue(*at))
        flags.name = isClusterName(node.name) ? node.name.substr(kPrefix.size()) : node.name;
    }
    if (const auto at = properties.find("sinew_visual"); at != properties.end()) flags.visual = isTrue(*at);
  };
  take(json);
  if (json.is_object() && json.contains("mesh")) take(json["mesh"]);
  return flags;
}

// Triangles of each cluster mesh, in order of the file.
struct Found {
  ClusterMesh mesh;
  std::vector<std::uint32_t> triangles;
};

std::vector<Found> findClusterMeshes(const VisualMesh& mesh) {
  std::map<std::string, Flags> nodes;
  for (const NodeSource& node : mesh.nodes) {
    Flags flags = flagsOf(node);
    if (!flags.name.empty() || flags.visual) nodes.emplace(node.name, std::move(flags));
  }
  std::vector<Found> found;
  const auto add = [&](const std::string& name, const std::string& object, bool visual) -> Found& {
    const auto at = std::find_if(found.begin(), found.end(), [&](const Found& f) { return f.mesh.name == name; });
    if (at == found.end()) {
      found.push_back({{name, object, visual, {}, {}}, {}});
      return found.back();
    }
    if (at->mesh.object != object) {
      throw ToolError(ExitCode::bad_input, mesh.file,
                      "has two cluster meshes named '" + name + "' (" + at->mesh.object + " and " + object + ")",
                      "Rename one of them.");
    }
    return *at;
  };
  for (const SubMeshSource& sub : mesh.sub_meshes) {
    const auto node = nodes.find(sub.node);
    std::string name = node == nodes.end() ? "" : node->second.name;
    std::string object = sub.node;
    for (const std::string& candidate : {sub.node, sub.mesh}) {
      if (!name.empty() || !isClusterName(candidate)) continue;
      name = candidate.substr(kPrefix.size());
      object = candidate;
    }
    if (name.empty()) continue;
    Found& entry = add(name, object, node != nodes.end() && node->second.visual);
    for (std::uint32_t t = 0; t < sub.triangle_count; ++t) entry.triangles.push_back(sub.first_triangle + t);
  }
  for (const GroupSource& group : mesh.groups) {
    if (!isClusterName(group.name) || group.triangles.empty()) continue;
    const std::string name = group.name.substr(kPrefix.size());
    // An object whose only group has its name.
    if (std::any_of(found.begin(), found.end(), [&](const Found& f) { return f.mesh.name == name; })) continue;
    add(name, group.name, false).triangles = group.triangles;
  }
  return found;
}

void copySurface(const VisualMesh& mesh, const std::vector<std::uint32_t>& triangles, ClusterMesh& out) {
  std::map<std::uint32_t, std::uint32_t> number;
  for (const std::uint32_t t : triangles) {
    Triangle corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t welded = mesh.welded[mesh.triangles[t][k]];
      const auto [at, fresh] = number.try_emplace(welded, std::uint32_t(out.positions.size()));
      if (fresh) out.positions.push_back(mesh.welded_positions[welded]);
      corners[k] = at->second;
    }
    out.triangles.push_back(corners);
  }
}

// Keeps of a per-vertex list what stays.
template <class List>
void keepOnly(List& list, const std::vector<std::uint32_t>& kept) {
  if (list.empty()) return;
  List out;
  out.reserve(kept.size());
  for (const std::uint32_t v : kept) out.push_back(std::move(list[v]));
  list = std::move(out);
}

void renumber(std::vector<std::uint32_t>& list, const std::vector<std::uint32_t>& to) {
  for (std::uint32_t& v : list) v = to[v];
  std::erase(list, formats::kNone);
}

void removeTriangles(VisualMesh& mesh, const std::vector<std::uint8_t>& gone) {
  // A vertex leaves with its last triangle.
  std::vector<std::uint8_t> leaves(mesh.positions.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const std::uint32_t v : mesh.triangles[t]) leaves[v] = std::uint8_t(leaves[v] | (gone[t] != 0 ? 1 : 2));
  }
  std::vector<std::uint32_t> kept;
  std::vector<std::uint32_t> to(mesh.positions.size(), formats::kNone);
  for (std::uint32_t v = 0; v < leaves.size(); ++v) {
    if (leaves[v] == 1) continue;
    to[v] = std::uint32_t(kept.size());
    kept.push_back(v);
  }
  std::vector<std::uint32_t> triangle_to(mesh.triangles.size(), formats::kNone);
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> faces;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    if (gone[t] != 0) continue;
    triangle_to[t] = std::uint32_t(triangles.size());
    const Triangle& c = mesh.triangles[t];
    triangles.push_back({to[c[0]], to[c[1]], to[c[2]]});
    faces.push_back(mesh.triangle_face[t]);
  }
  std::vector<SubMeshSource> subs;
  std::uint32_t first = 0;
  for (SubMeshSource sub : mesh.sub_meshes) {
    std::uint32_t count = 0;
    for (std::uint32_t t = 0; t < sub.triangle_count; ++t) count += gone[sub.first_triangle + t] == 0 ? 1U : 0U;
    if (count == 0 && sub.triangle_count > 0) continue;
    sub.first_triangle = first;
    sub.triangle_count = count;
    first += count;
    subs.push_back(std::move(sub));
  }
  mesh.sub_meshes = std::move(subs);
  mesh.triangles = std::move(triangles);
  mesh.triangle_face = std::move(faces);
  for (GroupSource& group : mesh.groups) {
    renumber(group.vertices, to);
    renumber(group.triangles, triangle_to);
  }
  std::erase_if(mesh.groups, [](const GroupSource& g) { return g.vertices.empty() && isClusterName(g.name); });
  for (AttributeSource& attribute : mesh.attributes) {
    std::vector<float> values;
    for (const std::uint32_t v : kept) {
      const auto at = attribute.values.begin() + std::ptrdiff_t(std::size_t(v) * attribute.components);
      values.insert(values.end(), at, at + attribute.components);
    }
    attribute.values = std::move(values);
  }
  for (MorphTargetSource& morph : mesh.morphs) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < morph.vertices.size(); ++i) {
      if (to[morph.vertices[i]] == formats::kNone) continue;
      morph.displacements[count] = morph.displacements[i];
      morph.vertices[count++] = to[morph.vertices[i]];
    }
    morph.vertices.resize(count);
    morph.displacements.resize(count);
  }
  keepOnly(mesh.positions, kept);
  keepOnly(mesh.normals, kept);
  keepOnly(mesh.uvs, kept);
  keepOnly(mesh.colors, kept);
  keepOnly(mesh.skin, kept);
  keepOnly(mesh.source_vertex, kept);
  keepOnly(mesh.welded, kept);
  std::vector<std::uint32_t> welded_to(mesh.welded_positions.size(), formats::kNone);
  std::vector<Vector3d> welded_positions;
  for (std::uint32_t& w : mesh.welded) {
    if (welded_to[w] == formats::kNone) {
      welded_to[w] = std::uint32_t(welded_positions.size());
      welded_positions.push_back(mesh.welded_positions[w]);
    }
    w = welded_to[w];
  }
  mesh.welded_positions = std::move(welded_positions);
  mesh.bounds_min = mesh.bounds_max = mesh.positions[mesh.triangles[0][0]];
  for (const Triangle& t : mesh.triangles) {
    for (const std::uint32_t v : t) {
      mesh.bounds_min = mesh.bounds_min.cwiseMin(mesh.positions[v]);
      mesh.bounds_max = mesh.bounds_max.cwiseMax(mesh.positions[v]);
    }
  }
  mesh.diagonal = (mesh.bounds_max - mesh.bounds_min).norm();
}

}  // namespace

std::vector<ClusterMesh> takeClusterMeshes(VisualMesh& mesh) {
  std::vector<Found> found = findClusterMeshes(mesh);
  std::vector<ClusterMesh> clusters;
  std::vector<std::uint8_t> gone(mesh.triangles.size(), 0);
  for (Found& entry : found) {
    copySurface(mesh, entry.triangles, entry.mesh);
    if (!entry.mesh.visual) {
      for (const std::uint32_t t : entry.triangles) gone[t] = 1;
    }
    clusters.push_back(std::move(entry.mesh));
  }
  if (std::find(gone.begin(), gone.end(), 0) == gone.end()) {
    throw ToolError(ExitCode::bad_input, mesh.file, "holds nothing but cluster meshes",
                    "Export the mesh that they duplicate too, or give one the property sinew_visual = true.");
  }
  if (std::find(gone.begin(), gone.end(), 1) != gone.end()) removeTriangles(mesh, gone);
  return clusters;
}

ClusterMatch matchClusterMesh(const VisualMesh& mesh, const Surface& surface, const ClusterMesh& cluster,
                              std::optional<double> tolerance) {
  const auto& x = mesh.welded_positions;
  // Half of the mean edge at each welded point.
  std::vector<double> reach(x.size(), 0);
  std::vector<std::uint32_t> edges(x.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle c = mesh.weldedTriangle(t);
    for (std::size_t k = 0; k < 3; ++k) {
      const double half = 0.5 * (x[c[k]] - x[c[(k + 1) % 3]]).norm();
      for (const std::uint32_t p : {c[k], c[(k + 1) % 3]}) {
        reach[p] += half;
        ++edges[p];
      }
    }
  }
  for (std::size_t p = 0; p < x.size(); ++p) {
    reach[p] = tolerance ? *tolerance : std::min(reach[p] / std::max(1U, edges[p]), kFarthestEdit * mesh.diagonal);
  }
  std::vector<Vector3d> normals(cluster.positions.size(), Vector3d::Zero());
  std::map<std::array<std::uint32_t, 2>, int> uses;
  for (const Triangle& t : cluster.triangles) {
    const auto& p = cluster.positions;
    const Vector3d n = (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
    for (std::size_t k = 0; k < 3; ++k) {
      normals[t[k]] += n;
      ++uses[{std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])}];
    }
  }

  // A sheet that was cut out has no outside that an importer could find: the side that most of it agrees with counts.
  double agreement = 0;
  for (std::size_t i = 0; i < cluster.positions.size(); ++i) {
    const SurfacePoint at = surface.nearest(cluster.positions[i]);
    if (at.distance <= kFarthestEdit * mesh.diagonal) agreement += surface.normal(at.triangle).dot(normals[i]);
  }
  if (agreement < 0) {
    for (Vector3d& n : normals) n = -n;
  }

  ClusterMatch match;
  const double same = kSame * mesh.diagonal;
  std::vector<std::uint8_t> taken(x.size(), 0);
  bool edited = false;
  for (std::size_t i = 0; i < cluster.positions.size(); ++i) {
    const SurfacePoint at = surface.nearest(cluster.positions[i]);
    const Triangle corners = mesh.weldedTriangle(at.triangle);
    const std::uint32_t p = *std::min_element(corners.begin(), corners.end(), [&](std::uint32_t a, std::uint32_t b) {
      return (x[a] - cluster.positions[i]).squaredNorm() < (x[b] - cluster.positions[i]).squaredNorm();
    });
    const bool turned = at.distance > same && surface.normal(at.triangle).dot(normals[i]) < 0;
    if (at.distance > std::max(same, reach[p]) || turned) {
      ++match.unmatched;
      match.furthest_unmatched = std::max(match.furthest_unmatched, at.distance);
      continue;
    }
    match.furthest = std::max(match.furthest, at.distance);
    edited = edited || (x[p] - cluster.positions[i]).norm() > same;
    // A point between vertices (subdivided) names none; the surface does that below.
    if ((x[p] - cluster.positions[i]).norm() <= std::max(same, reach[p])) taken[p] = 1;
  }

  // Visual vertices that lie on the inside of the cluster mesh's surface.
  const geometry::TriangleBvh tree(cluster.positions, cluster.triangles);
  for (std::size_t p = 0; p < x.size(); ++p) {
    if (taken[p] != 0) continue;
    const double limit = edited ? std::max(same, reach[p]) : same;
    const auto hit = tree.closest(x[p], limit);
    if (hit.triangle == formats::kNone) continue;
    const Triangle& t = cluster.triangles[hit.triangle];
    const auto& q = cluster.positions;
    bool on_rim = false;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k];
      const std::uint32_t b = t[(k + 1) % 3];
      if (uses[{std::min(a, b), std::max(a, b)}] > 1) continue;
      const Vector3d ab = q[b] - q[a];
      const double s = std::clamp((hit.point - q[a]).dot(ab) / std::max(ab.squaredNorm(), 1e-300), 0.0, 1.0);
      on_rim = on_rim || (q[a] + s * ab - hit.point).norm() <= 1e-9 * mesh.diagonal;
    }
    if (!on_rim || hit.squared_distance <= same * same) taken[p] = 1;
  }
  match.weights.resize(mesh.positions.size());
  for (std::size_t v = 0; v < match.weights.size(); ++v) match.weights[v] = taken[mesh.welded[v]];
  return match;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/inspect.h"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "tools/author/settings.h"

namespace sinew::tools {
namespace {

using nlohmann::ordered_json;

std::string sectionName(std::uint32_t id) {
  std::string name;
  for (int k = 0; k < 4; ++k) name += char((id >> (8 * k)) & 0xff);
  return name;
}

ordered_json vectorJson(const std::array<float, 3>& x) { return {x[0], x[1], x[2]}; }

// Only what the cluster's models use.
ordered_json mechanicsJson(const formats::PackageView& package, const formats::ClusterMechanics& m) {
  ordered_json json;
  json["stiffness"] = choicesOf("clusters.stiffness").at(std::size_t(m.stiffness));
  if (m.stiffness == formats::StiffnessModel::per_step) json["per_step_beta"] = vectorJson(m.per_step_beta);
  if (m.stiffness == formats::StiffnessModel::elastic) {
    json["young"] = m.young;
    json["poisson"] = m.poisson;
  }
  json["damping"] = m.damping;
  json["limit"] = choicesOf("clusters.limit").at(std::size_t(m.limit));
  if (m.limit == formats::LimitMethod::principal) json["stretch_min"] = m.stretch_min;
  if (m.limit == formats::LimitMethod::principal || m.limit == formats::LimitMethod::rows) {
    json["stretch_max"] = m.stretch_max;
  }
  if (m.limit == formats::LimitMethod::frobenius || m.limit == formats::LimitMethod::frobenius_cheap ||
      m.limit == formats::LimitMethod::soft) {
    json["norm_max"] = m.norm_max;
  }
  if (m.limit == formats::LimitMethod::soft) json["norm_limit"] = m.norm_limit;
  if (m.limit == formats::LimitMethod::curve) {
    json["curve"] = ordered_json::array();
    for (const auto& point : package.curvePoints().subspan(m.first_curve_point, m.curve_point_count)) {
      json["curve"].push_back({point.norm, point.response});
    }
  }
  json["volume"] = choicesOf("clusters.volume").at(std::size_t(m.volume) + 1);  // after auto
  if (m.plastic_creep > 0) {
    json["plastic"] = {{"yield", m.plastic_yield}, {"creep", m.plastic_creep}, {"limit", m.plastic_limit}};
  }
  if (m.channel != formats::kNone) {
    json["fibre"] = vectorJson(m.fibre);
    json["channel"] = package.text(package.channels()[m.channel].name);
    json["contraction"] = m.contraction;
  }
  return json;
}

ordered_json fieldJson(const formats::PackageView& package, const formats::Field& field) {
  std::size_t samples = 0;
  for (const auto& pack : package.fieldPacks().subspan(field.first_pack, field.pack_count)) {
    for (const float volume : pack.volume) samples += volume > 0 ? 1 : 0;
  }
  return {{"piece", package.text(package.pieces()[field.piece].name)},
          {"held", field.held != 0},
          {"level", field.level},
          {"functions", field.function_count},
          {"driven", field.driven_count},
          {"samples", samples},
          {"contact_points", field.point_count},
          {"lowest_hz", field.lowest_hz},
          {"static_error", field.static_error},
          {"least_eigenvalue", field.least_eigenvalue}};
}

}  // namespace

ordered_json inspectPackage(const formats::PackageView& package) {
  const formats::PackageInfo& info = package.info();
  ordered_json json;
  json["format_version"] = package.formatVersion();
  json["bytes"] = package.totalBytes();
  json["sections"] = ordered_json::array();
  for (const auto& section : package.sections())
    json["sections"].push_back({{"name", sectionName(section.id)}, {"bytes", section.bytes}});
  constexpr std::array<std::pair<formats::Feature, const char*>, 13> kFeatures = {{
      {formats::kFeatureTetrahedra, "tetrahedra"},
      {formats::kFeatureQuadratic, "quadratic"},
      {formats::kFeatureVisual, "visual"},
      {formats::kFeatureBarycentric, "barycentric_attachment"},
      {formats::kFeatureClusterAttachment, "cluster_attachment"},
      {formats::kFeatureIdentity, "identity"},
      {formats::kFeatureGroups, "groups"},
      {formats::kFeatureTextures, "textures"},
      {formats::kFeatureMechanics, "mechanics"},
      {formats::kFeatureActivation, "activation"},
      {formats::kFeatureVertexStiffness, "vertex_stiffness"},
      {formats::kFeaturePinWeights, "pin_weights"},
      {formats::kFeatureField, "fields"},
  }};
  json["features"] = ordered_json::array();
  for (const auto& [bit, name] : kFeatures) {
    if ((package.features() & bit) != 0) json["features"].push_back(name);
  }
  json["name"] = package.text(info.name);
  json["tool_version"] = package.text(info.tool_version);
  json["source_file"] = package.text(info.source_file);
  json["metres_per_unit"] = info.metres_per_unit;
  json["unit_source"] = package.text(info.unit_source);
  json["bounds"] = {
      {"min", vectorJson(info.bounds_min)}, {"max", vectorJson(info.bounds_max)}, {"diagonal", info.diagonal}};
  json["origin"] = info.origin;
  json["mass"] = info.total_mass;
  json["physical_volume"] = info.physical_volume;
  json["source_volume"] = info.source_volume >= 0 ? ordered_json(info.source_volume) : ordered_json(nullptr);
  json["physical_vertices"] = package.physicalVertices().size();
  json["tetrahedra"] = package.tetrahedra().size();
  json["pieces"] = ordered_json::array();
  for (const auto& piece : package.pieces()) {
    json["pieces"].push_back({{"name", package.text(piece.name)},
                              {"physical_vertices", piece.vertex_count},
                              {"tetrahedra", piece.tetrahedron_count},
                              {"clusters", piece.cluster_count}});
  }
  json["clusters"] = ordered_json::array();
  const std::vector<std::string> modes = choicesOf("clusters.mode");
  for (const auto& cluster : package.clusters()) {
    json["clusters"].push_back({{"name", package.text(cluster.name)},
                                {"members", cluster.member_count},
                                {"mode", modes.at(std::size_t(cluster.mode))}});
  }
  json["mechanics"] = ordered_json::array();
  for (const auto& m : package.mechanics()) json["mechanics"].push_back(mechanicsJson(package, m));
  json["channels"] = ordered_json::array();
  for (const auto& channel : package.channels()) json["channels"].push_back(package.text(channel.name));
  json["fields"] = ordered_json::array();
  for (const auto& field : package.allFields()) json["fields"].push_back(fieldJson(package, field));
  for (const auto& set : package.pinSets()) {
    json["pin_sets"].push_back(
        {{"name", package.text(set.name)}, {"target", package.text(set.target)}, {"vertices", set.count}});
  }
  for (const auto& part : package.parts()) {
    std::vector<std::uint32_t> sources;
    for (const std::uint32_t v : package.partVertices().subspan(part.first, part.count)) {
      if (!package.visualIdentity().empty()) sources.push_back(package.visualIdentity()[v].source_vertex);
    }
    std::sort(sources.begin(), sources.end());
    sources.erase(std::unique(sources.begin(), sources.end()), sources.end());
    json["parts"].push_back({{"name", package.text(part.name)},
                             {"attach", part.cluster == formats::kNone ? "follow" : "rigid"},
                             {"visual_vertices", part.count},
                             {"source_vertices", sources}});
  }
  json["memberships"] = package.memberships().size();
  json["visual_vertices"] = package.visualPositions().size();
  json["visual_triangles"] = package.visualTriangles().size();
  json["source_vertices"] = package.sourceIdentity().size();
  json["groups"] = ordered_json::array();
  for (const auto& group : package.groups()) {
    json["groups"].push_back({{"name", package.text(group.name)}, {"visual_vertices", group.count}});
  }
  json["masks"] = ordered_json::array();
  for (const auto& mask : package.masks()) {
    json["masks"].push_back({{"name", package.text(mask.name)}, {"visual_vertices", mask.count}});
  }
  json["attachment"] = {{"max_rest_error", info.max_rest_error}};
  json["tetrahedra_quality"] = {{"min_dihedral_deg", info.min_dihedral_deg},
                                {"max_dihedral_deg", info.max_dihedral_deg},
                                {"inverted", info.inverted_tetrahedra}};
  return json;
}

ordered_json inspectSource(const VisualMesh& mesh, const Topology& topology) {
  ordered_json json;
  json["file"] = mesh.file;
  json["format"] = mesh.format;
  // Sub-meshes of one node and mesh differ only by material; an artist counts them as one mesh.
  struct Part {
    std::vector<std::uint8_t> used;
    std::uint64_t triangles = 0;
  };
  std::vector<std::string> order;
  std::map<std::string, Part> parts;
  for (const SubMeshSource& sub : mesh.sub_meshes) {
    const std::string name = sub.mesh.empty() ? sub.node : sub.mesh;
    auto [at, added] = parts.try_emplace(name);
    if (added) {
      order.push_back(name);
      at->second.used.assign(mesh.positions.size(), 0);
    }
    at->second.triangles += sub.triangle_count;
    for (std::uint32_t t = sub.first_triangle; t < sub.first_triangle + sub.triangle_count; ++t) {
      for (std::uint32_t v : mesh.triangles[t]) at->second.used[v] = 1;
    }
  }
  json["meshes"] = ordered_json::array();
  for (const std::string& name : order) {
    const Part& part = parts[name];
    ordered_json groups = ordered_json::array();
    for (const GroupSource& group : mesh.groups) {
      if (std::any_of(group.vertices.begin(), group.vertices.end(),
                      [&](std::uint32_t v) { return part.used[v] != 0; })) {
        groups.push_back(group.name);
      }
    }
    json["meshes"].push_back({{"name", name},
                              {"vertices", std::count(part.used.begin(), part.used.end(), 1)},
                              {"triangles", part.triangles},
                              {"uv", !mesh.uvs.empty()},
                              {"colors", !mesh.colors.empty()},
                              {"groups", groups},
                              {"skin", !mesh.skin.empty()}});
  }
  const auto vector = [](const Eigen::Vector3d& x) { return ordered_json{x[0], x[1], x[2]}; };
  json["bounds"] = {{"min", vector(mesh.bounds_min)}, {"max", vector(mesh.bounds_max)}, {"diagonal", mesh.diagonal}};
  json["metres_per_unit"] = mesh.metres_per_unit;
  json["unit_source"] = mesh.unit_source;
  json["up_axis"] = mesh.up_axis;
  json["source_vertices"] = mesh.source_vertex_count;
  json["source_faces"] = mesh.source_face_count;
  json["visual_vertices"] = mesh.positions.size();
  json["welded_vertices"] = mesh.welded_positions.size();
  json["components"] = topology.parts.size();
  json["boundary_edges"] = topology.boundary_edges.size();
  json["non_manifold_edges"] = topology.non_manifold_edges.size();
  json["degenerate_triangles"] = topology.degenerate_triangles.size();
  json["closed"] = topology.closed;
  json["materials"] = ordered_json::array();
  for (const MaterialSource& material : mesh.materials) {
    json["materials"].push_back(
        {{"name", material.name},
         {"base_color", material.base_color},
         {"texture", material.texture == formats::kNone ? ordered_json(nullptr)
                                                        : ordered_json(mesh.textures[material.texture].name)}});
  }
  json["joints"] = mesh.joints;
  json["attributes"] = ordered_json::array();
  for (const AttributeSource& attribute : mesh.attributes) {
    json["attributes"].push_back({{"name", attribute.name}, {"components", attribute.components}});
  }
  json["morph_targets"] = ordered_json::array();
  for (const MorphTargetSource& morph : mesh.morphs) json["morph_targets"].push_back(morph.name);
  json["nodes"] = ordered_json::array();
  for (const NodeSource& node : mesh.nodes) {
    json["nodes"].push_back({{"name", node.name},
                             {"parent", node.parent},
                             {"properties", ordered_json::parse(node.properties_json, nullptr, false)}});
  }
  return json;
}

}  // namespace sinew::tools

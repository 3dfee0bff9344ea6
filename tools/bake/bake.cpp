// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/bake.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <new>
#include <span>
#include <string>

#include "runtime/geometry/rounded.h"
#include "sinew/formats/package.h"
#include "sinew/formats/version.h"
#include "sinew/formats/writer.h"
#include "tools/attach/attach.h"
#include "tools/author/regions.h"
#include "tools/bake/authored.h"
#include "tools/bake/fields.h"
#include "tools/bake/findings_json.h"
#include "tools/bake/moments.h"
#include "tools/bake/parts.h"
#include "tools/bake/suggest_parts.h"
#include "tools/core/error.h"
#include "tools/import/import.h"
#include "tools/import/topology.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using nlohmann::ordered_json;

// Every vertex keeps some mass, also where its tetrahedra hardly touch the solid: this part of the body's mean.
constexpr double kLightestVertex = 0.05;
// Weights of a cluster attachment below this change nothing that can be seen.
constexpr double kMinimumAttachmentWeight = 0.01;

formats::Float3 toFloat(const Vector3d& x) { return {float(x[0]), float(x[1]), float(x[2])}; }
Vector3d toDouble(const formats::Float3& x) { return {double(x[0]), double(x[1]), double(x[2])}; }

// Why a package is refused, empty if it is not: what passes here is what every user will load.
std::string refusalOf(std::span<const std::byte> package) {
  // The reader wants aligned bytes.
  const std::unique_ptr<std::byte, void (*)(std::byte*)> aligned(
      static_cast<std::byte*>(::operator new(package.size(), std::align_val_t(formats::kSectionAlignment))),
      [](std::byte* p) { ::operator delete(p, std::align_val_t(formats::kSectionAlignment)); });
  std::memcpy(aligned.get(), package.data(), package.size());
  formats::PackageView view;
  return formats::PackageView::open({aligned.get(), package.size()}, view).reason;
}

// Moves everything to the package's origin and onto the floats it will hold, so that what follows is computed from
// exactly what the runtime will see.
Vector3d moveToOrigin(VisualMesh& mesh, PhysicalMesh& physical) {
  Vector3d origin = 0.5 * (mesh.bounds_min + mesh.bounds_max);
  for (Vector3d& x : mesh.positions) x = geometry::roundedToFloat(x - origin);
  for (Vector3d& x : mesh.welded_positions) x = geometry::roundedToFloat(x - origin);
  for (Vector3d& x : physical.positions) x = geometry::roundedToFloat(x - origin);
  mesh.bounds_min = geometry::roundedToFloat(mesh.bounds_min - origin);
  mesh.bounds_max = geometry::roundedToFloat(mesh.bounds_max - origin);
  return origin;
}

double volumeOf(const PhysicalMesh& mesh, std::size_t t) {
  const auto& v = mesh.tetrahedra[t];
  const Vector3d& d = mesh.positions[v[3]];
  return (mesh.positions[v[0]] - d).cross(mesh.positions[v[1]] - d).dot(mesh.positions[v[2]] - d) / -6;
}

std::vector<formats::PhysicalVertex> physicalVertices(const PhysicalMesh& mesh, double density,
                                                      const std::string& file) {
  std::vector<double> mass(mesh.positions.size(), 0);
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const double quarter = density * volumeOf(mesh, t) * mesh.fill[t] / 4;
    for (std::uint32_t v : mesh.tetrahedra[t]) mass[v] += quarter;
  }
  for (const PhysicalBody& body : mesh.bodies) {
    double total = 0;
    for (std::uint32_t v = 0; v < body.vertex_count; ++v) total += mass[body.first_vertex + v];
    double floor = kLightestVertex * total / body.vertex_count;
    if (!(floor > 0)) floor = density * std::max(body.volume, 1e-30) / body.vertex_count;
    for (std::uint32_t v = 0; v < body.vertex_count; ++v) {
      mass[body.first_vertex + v] = std::max(mass[body.first_vertex + v], floor);
    }
  }
  double all = 0;
  for (const double m : mass) all += m;
  if (!(float(*std::min_element(mass.begin(), mass.end())) > 0) || !(all <= double(formats::kMostNumber))) {
    char text[64];
    std::snprintf(text, sizeof text, "is too %s to compute with: %.1e kg", all < 1 ? "small" : "large", all);
    throw ToolError(ExitCode::bad_input, file, text,
                    "Give the unit it was made in (--unit), or another material.density.");
  }
  std::vector<formats::PhysicalVertex> vertices(mass.size());
  for (std::size_t v = 0; v < mass.size(); ++v) vertices[v] = {toFloat(mesh.positions[v]), float(mass[v])};
  return vertices;
}

// The package's bounds are the model's: a reader takes what is more than a diagonal outside them for damage.
void refuseFarVertices(const VisualMesh& mesh, const PhysicalMesh& physical) {
  double farthest = 0;
  for (const Vector3d& x : physical.positions) {
    farthest = std::max({farthest, (mesh.bounds_min - x).maxCoeff(), (x - mesh.bounds_max).maxCoeff()});
  }
  if (farthest <= 0.999 * mesh.diagonal) return;
  char text[128];
  std::snprintf(text, sizeof text, "its tetrahedra reach %.3g m beyond a model whose diagonal is %.3g m", farthest,
                mesh.diagonal);
  throw ToolError(ExitCode::bad_input, mesh.file, text, "Lower tetrahedra.thickness, or the recipe's factors of it.");
}

// Where visual vertex v hangs at rest.
HungPlace hungAt(const formats::PackageContent& content, std::size_t v) {
  if (!content.barycentric.empty()) {
    const formats::BarycentricAttachment& attachment = content.barycentric[v];
    return hungOn(attachment, content.tetrahedra[attachment.tetrahedron],
                  [&](std::uint32_t p) { return content.physical_vertices[p].rest_position; });
  }
  const auto& range = content.cluster_attachment_ranges[v];
  return hungAtRest(std::span(content.cluster_attachments).subspan(range.first, range.count), content.clusters,
                    content.visual_positions[v]);
}

formats::ClusterMechanics mechanicsOf(const ClusterOptions& options, bool sheet) {
  formats::ClusterMechanics mechanics = formats::kPlainMechanics;
  mechanics.stiffness = options.stiffness;
  mechanics.per_step_beta.fill(float(options.per_step_beta));
  mechanics.young = float(options.young);
  mechanics.poisson = float(options.poisson);
  mechanics.damping = float(options.damping);
  mechanics.limit = options.limit;
  mechanics.stretch_min = float(options.limit_min);
  mechanics.stretch_max = float(options.limit_max);
  mechanics.norm_max = float(options.limit_norm);
  mechanics.norm_limit = float(std::max(options.limit_norm, options.limit_norm_max));
  mechanics.volume = options.volume.value_or(sheet ? formats::VolumeMethod::none : formats::VolumeMethod::principal);
  mechanics.plastic_yield = float(options.plastic_yield);
  mechanics.plastic_creep = float(options.plastic_creep);
  mechanics.plastic_limit = float(options.plastic_limit);
  return mechanics;
}

// CMEC and CURV, where a cluster's settings say more than frequencies.
void addMechanics(const std::vector<ClusterSource>& sources, const ClusterOptions& of_all,
                  const std::vector<PhysicalBody>& bodies, formats::PackageContent& content) {
  bool plain = true;
  std::vector<formats::ClusterMechanics> mechanics;
  std::map<std::string, std::pair<std::uint32_t, std::uint32_t>> curves;  // first point and count, by text
  for (const ClusterSource& source : sources) {
    const ClusterOptions& options = source.options ? *source.options : of_all;
    mechanics.push_back(mechanicsOf(options, bodies[source.body].source_volume < 0));
    plain = plain && options.stiffness == formats::StiffnessModel::frequency && !(options.damping > 0) &&
            options.limit == formats::LimitMethod::none && mechanics.back().volume == formats::VolumeMethod::none &&
            !(options.plastic_creep > 0);
    if (options.limit != formats::LimitMethod::curve) continue;
    const auto [at, fresh] = curves.try_emplace(options.limit_curve);
    if (fresh) {
      const std::vector<formats::CurvePoint> points = curvePoints(options.limit_curve);
      if (points.empty()) {
        throw ToolError(ExitCode::usage, "", "clusters.limit is curve, but clusters.limit_curve is empty",
                        "Give its points, as in --set clusters.limit_curve=4:4,9:5.");
      }
      at->second = {std::uint32_t(content.curve_points.size()), std::uint32_t(points.size())};
      content.curve_points.insert(content.curve_points.end(), points.begin(), points.end());
    }
    mechanics.back().first_curve_point = at->second.first;
    mechanics.back().curve_point_count = at->second.second;
  }
  if (!plain) content.mechanics = std::move(mechanics);
}

void attachToTetrahedra(const std::vector<TetrahedronPlace>& places, formats::PackageContent& content) {
  for (const TetrahedronPlace& place : places) {
    content.barycentric.push_back(
        {place.tetrahedron, {float(place.weights[0]), float(place.weights[1]), float(place.weights[2])}});
  }
}

void attachToClusters(const std::vector<TetrahedronPlace>& places, formats::PackageContent& content) {
  // Clusters of each physical vertex with their shares.
  std::vector<std::vector<std::pair<std::uint32_t, double>>> of_vertex(content.physical_vertices.size());
  for (std::uint32_t c = 0; c < content.clusters.size(); ++c) {
    const formats::Cluster& cluster = content.clusters[c];
    for (std::uint32_t m = cluster.first_member; m < cluster.first_member + cluster.member_count; ++m) {
      of_vertex[content.memberships[m].vertex].emplace_back(c, double(content.memberships[m].share));
    }
  }
  std::vector<std::pair<std::uint32_t, double>> weights;
  for (const TetrahedronPlace& place : places) {
    weights.clear();
    double clamped_sum = 0;
    for (double w : place.weights) clamped_sum += std::max(w, 0.0);
    for (std::size_t k = 0; k < 4; ++k) {
      const double w = std::max(place.weights[k], 0.0) / clamped_sum;
      for (const auto& [c, share] : of_vertex[content.tetrahedra[place.tetrahedron].vertex[k]]) {
        const auto at =
            std::find_if(weights.begin(), weights.end(), [wanted = c](const auto& x) { return x.first == wanted; });
        if (at == weights.end())
          weights.emplace_back(c, w * share);
        else
          at->second += w * share;
      }
    }
    std::sort(weights.begin(), weights.end());
    std::erase_if(weights, [](const auto& x) { return x.second < kMinimumAttachmentWeight; });
    double sum = 0;
    for (const auto& entry : weights) sum += entry.second;
    content.cluster_attachment_ranges.push_back(
        {std::uint32_t(content.cluster_attachments.size()), std::uint32_t(weights.size())});
    for (const auto& [c, w] : weights) content.cluster_attachments.push_back({c, float(w / sum)});
  }
}

void addVisual(const VisualMesh& mesh, const PackageOptions& options, formats::PackageContent& content) {
  for (const Vector3d& x : mesh.positions) content.visual_positions.push_back(toFloat(x));
  for (const auto& n : mesh.normals) content.visual_normals.push_back({n[0], n[1], n[2]});
  for (const auto& uv : mesh.uvs) content.visual_uvs.push_back({uv[0], uv[1]});
  if (content.visual_colors.empty()) content.visual_colors = packedColors(mesh.colors);  // else: the recipe's
  content.visual_triangles = mesh.triangles;
  std::vector<std::uint32_t> texture_index(mesh.textures.size(), formats::kNone);
  if (options.textures) {
    for (std::size_t t = 0; t < mesh.textures.size(); ++t) {
      const TextureSource& texture = mesh.textures[t];
      if (texture.bytes.empty()) continue;
      texture_index[t] = std::uint32_t(content.textures.size());
      content.textures.push_back({content.addText(texture.name), content.addText(texture.mime),
                                  content.texture_bytes.size(), texture.bytes.size()});
      content.texture_bytes.insert(content.texture_bytes.end(), texture.bytes.begin(), texture.bytes.end());
    }
  }
  for (const MaterialSource& material : mesh.materials) {
    std::array<float, 4> color = material.base_color;
    for (float& channel : color) channel = std::clamp(channel, 0.0F, 1.0F);
    content.materials.push_back({content.addText(material.name), color,
                                 material.texture == kNoIndex ? formats::kNone : texture_index[material.texture],
                                 material.double_sided ? std::uint32_t(formats::kMaterialDoubleSided) : 0U});
  }
  for (const SubMeshSource& sub : mesh.sub_meshes) {
    const std::string name = sub.mesh.empty() || sub.mesh == sub.node ? sub.node
                             : sub.node.empty()                       ? sub.mesh
                                                                      : sub.node + "/" + sub.mesh;
    content.sub_meshes.push_back({content.addText(name), sub.material == kNoIndex ? formats::kNone : sub.material,
                                  sub.first_triangle, sub.triangle_count, 0});
  }
  if (options.groups) {
    for (const GroupSource& group : mesh.groups) {
      content.groups.push_back({content.addText(group.name), std::uint32_t(content.group_vertices.size()),
                                std::uint32_t(group.vertices.size())});
      content.group_vertices.insert(content.group_vertices.end(), group.vertices.begin(), group.vertices.end());
    }
  }
  if (!options.identity) return;
  content.source_identity.assign(mesh.source_vertex_count, {formats::kNone, 0, 0});
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    content.visual_identity.push_back({mesh.source_vertex[v], mesh.welded[v]});
    formats::SourceIdentity& source = content.source_identity[mesh.source_vertex[v]];
    source.welded = mesh.welded[v];
    ++source.visual_count;
  }
  std::uint32_t first = 0;
  for (formats::SourceIdentity& source : content.source_identity) {
    source.first_visual = first;
    first += source.visual_count;
  }
  content.source_visual_list.resize(first);
  std::vector<std::uint32_t> filled(content.source_identity.size(), 0);
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    const std::uint32_t s = mesh.source_vertex[v];
    content.source_visual_list[content.source_identity[s].first_visual + filled[s]++] = v;
  }
  for (const SourceMeshRange& range : mesh.source_meshes) {
    content.source_meshes.push_back(
        {content.addText(range.name), range.first_source_vertex, range.source_vertex_count});
  }
}

std::string methodName(TetrahedraMethod method) {
  switch (method) {
    case TetrahedraMethod::grid:
      return "grid";
    case TetrahedraMethod::stuffing:
      return "stuffing";
    case TetrahedraMethod::delaunay:
      return "delaunay";
    case TetrahedraMethod::shell:
      return "shell";
    case TetrahedraMethod::automatic:
      break;
  }
  return "auto";
}

}  // namespace

ordered_json costsJson(const Progress& progress) {
  ordered_json stages = ordered_json::array();
  for (const StageCost& cost : progress.costs()) {
    stages.push_back({{"name", cost.name}, {"seconds", cost.seconds}, {"peak_megabytes", cost.peak_megabytes}});
  }
  return stages;
}

ordered_json cacheJson(const StageCache& cache) {
  ordered_json json = {{"folder", cache.folder().string()}, {"stages", ordered_json::array()}};
  double saved = 0;
  for (const StageCache::Stage& stage : cache.stages()) {
    json["stages"].push_back(
        {{"name", stage.name}, {"from_cache", stage.from_cache}, {"seconds_saved", stage.seconds_saved}});
    saved += stage.seconds_saved;
  }
  json["seconds_saved"] = saved;
  json["damaged_entries"] = cache.damaged();
  return json;
}

ImportedSource importSource(const Recipe& recipe, Progress& progress) {
  progress.stage("import");
  ImportedSource source;
  source.mesh = importVisualMesh(recipe.source, recipe.settings.import, progress);
  const std::vector<ClusterMesh> cluster_meshes = takeClusterMeshes(source.mesh);
  progress.stage("topology");
  source.topology = analyzeTopology(source.mesh);
  source.authored = evaluateRecipe(recipe, source.mesh, source.topology, cluster_meshes, source.findings);
  source.parts = findParts(recipe, source.authored, source.mesh, source.topology, source.findings);
  if (source.parts.empty()) {
    const std::vector<Finding> suggested = suggestParts(source.mesh, source.topology);
    source.findings.insert(source.findings.end(), suggested.begin(), suggested.end());
  }
  return source;
}

namespace {

BakeResult bakeSource(const Recipe& recipe, ImportedSource& source, Progress& progress, StageCache* cache,
                      bool with_fields) {
  StageCache no_cache{{}};
  StageCache& kept = cache == nullptr ? no_cache : *cache;
  const Settings& settings = recipe.settings;
  VisualMesh& mesh = source.mesh;
  const Topology& topology = source.topology;
  const AuthoredWeights& authored = source.authored;
  const std::vector<RidingPart>& parts = source.parts;

  progress.stage("tetrahedra");
  // What is filled: the mesh without the parts that ride along, with its own topology.
  VisualMesh without;
  Topology topology_without;
  if (!parts.empty()) {
    without = withoutParts(mesh, parts);
    topology_without = analyzeTopology(without);
  }
  const Topology& host_topology = parts.empty() ? topology : topology_without;
  TetrahedraOptions filling = settings.tetrahedra;
  filling.shell_factors = shellFactors(recipe, authored, mesh);
  // The key covers all that this stage and the places on the tetrahedra read; a mesh has one topology.
  const StageKey key = tetrahedraKey(parts.empty() ? mesh : without, filling);
  PhysicalMesh physical = kept.get("tetrahedra", key, [&] {
    return tetrahedralize(parts.empty() ? mesh : without, host_topology, filling, progress);
  });
  const Vector3d origin = moveToOrigin(mesh, physical);
  if (!parts.empty()) without = withoutParts(mesh, parts);
  const VisualMesh& host = parts.empty() ? mesh : without;
  physical.quality = measureQuality(physical.positions, physical.tetrahedra);
  if (physical.quality.inverted > 0) {
    throw ToolError(ExitCode::bad_input, mesh.file,
                    "something in it is too small or too thin for its distance from the rest: " +
                        std::to_string(physical.quality.inverted) +
                        " tetrahedra turn over when rounded to single precision",
                    "Bake far parts as files of their own; make a shell thicker (tetrahedra.thickness).");
  }

  refuseFarVertices(mesh, physical);

  progress.stage("clusters");
  std::vector<Finding> findings = mesh.findings;
  findings.insert(findings.end(), physical.findings.begin(), physical.findings.end());
  findings.insert(findings.end(), source.findings.begin(), source.findings.end());
  std::vector<TetrahedronPlace> places =
      kept.get("places", key, [&] { return placeVisualVertices(host, host_topology, physical); });
  followHost(parts, host, physical, places);
  const WeightTransfer transfer(host, physical, places);
  std::vector<std::uint32_t> recipe_cluster;
  std::vector<ClusterSource> clusters;
  if (authored.clusters.empty()) {
    clusters = automaticClusters(physical, settings.clusters, {}, findings);
    recipe_cluster.assign(clusters.size(), kNoIndex);
  } else {
    clusters =
        authoredClusters(transfer, authored.clusters, authored.cluster_weights, settings, findings, recipe_cluster);
  }

  formats::PackageContent content;
  content.physical_vertices = physicalVertices(physical, settings.material.density, mesh.file);
  for (const auto& tetrahedron : physical.tetrahedra) content.tetrahedra.push_back({tetrahedron});
  ClusterConstants constants = clusterConstants(clusters, content.physical_vertices, settings.clusters, findings);
  for (std::size_t c = 0; c < clusters.size(); ++c) constants.clusters[c].name = content.addText(clusters[c].name);
  content.clusters = std::move(constants.clusters);
  content.memberships = std::move(constants.memberships);
  content.quadratic_moments = std::move(constants.quadratic_moments);
  addMechanics(clusters, settings.clusters, physical.bodies, content);
  addAuthored(recipe, authored, transfer, clusters, recipe_cluster, mesh, content, findings);
  std::uint32_t next_cluster = 0;
  for (std::uint32_t b = 0; b < physical.bodies.size(); ++b) {
    const PhysicalBody& body = physical.bodies[b];
    const std::uint32_t first = next_cluster;
    while (next_cluster < clusters.size() && clusters[next_cluster].body == b) ++next_cluster;
    content.bodies.push_back({body.first_vertex, body.vertex_count, body.first_tetrahedron, body.tetrahedron_count,
                              first, next_cluster - first, content.addText(body.name)});
  }

  progress.stage("attachment");
  addVisual(mesh, settings.package, content);
  if (settings.attachment.method == AttachmentMethod::clusters)
    attachToClusters(places, content);
  else
    attachToTetrahedra(places, content);
  content.info.diagonal = float(mesh.diagonal);
  addParts(parts, places, transfer, content);
  for (const RidingPart& part : parts) {
    if (!part.rigid) continue;
    for (const std::uint32_t v : part.vertices) places[v].distance = 0;
  }
  double rest_error = 0, beyond = 0;
  std::size_t worst = 0;
  double farthest = 0;
  for (std::size_t v = 0; v < places.size(); ++v) {
    const HungPlace hung = hungAt(content, v);
    const double error = (toDouble(hung.place) - toDouble(content.visual_positions[v])).norm();
    rest_error = std::max(rest_error, error);
    if (!(error - hung.rounded <= beyond)) {
      beyond = error - hung.rounded;
      worst = v;
    }
    farthest = std::max(farthest, places[v].distance);
  }

  ordered_json fields_report;
  if (with_fields) {
    progress.stage("fields");
    fields_report = addFields(settings, content);
  }

  progress.stage("package");
  formats::BodyInfo& info = content.info;
  info.origin = {origin[0], origin[1], origin[2]};
  info.metres_per_unit = mesh.metres_per_unit;
  info.bounds_min = toFloat(mesh.bounds_min);
  info.bounds_max = toFloat(mesh.bounds_max);
  double mass = 0;
  for (const auto& vertex : content.physical_vertices) mass += double(vertex.mass);
  info.total_mass = float(mass);
  info.density = float(settings.material.density);
  double volume = 0;
  double source_volume = 0;
  bool volume_defined = true;
  for (const PhysicalBody& body : physical.bodies) {
    volume_defined = volume_defined && body.source_volume >= 0;
    source_volume += std::max(body.source_volume, 0.0);
    volume += body.volume;
  }
  info.physical_volume = float(volume);
  info.source_volume = volume_defined ? float(source_volume) : -1.0F;
  info.max_rest_error = float(rest_error / mesh.diagonal);
  info.min_dihedral_deg = float(physical.quality.min_dihedral_deg);
  info.max_dihedral_deg = float(physical.quality.max_dihedral_deg);
  info.name = content.addText(std::filesystem::path(mesh.file).stem().string());
  info.tool_version = content.addText(formats::kSoftwareVersion);
  info.source_file = content.addText(std::filesystem::path(mesh.file).filename().string());
  info.unit_source = content.addText(mesh.unit_source);
  ordered_json settings_json = settings.toJson();
  settings_json["import.up"] = mesh.up_axis;  // what was found: the way back to the source's axes
  info.settings_json = content.addText(settings_json.dump());
  if (!(beyond <= kMostRestError * mesh.diagonal)) {
    char distance[32];
    std::snprintf(distance, sizeof distance, "%.2g", beyond / mesh.diagonal);
    throw ToolError(ExitCode::bad_input, mesh.file,
                    "source vertex " + std::to_string(mesh.source_vertex[worst]) + " would be attached " + distance +
                        " diagonals from its place",
                    "Its tetrahedra are too small or thin for where it lies: raise tetrahedra.thickness of a shell, "
                    "use --set attachment.method=clusters, or remove the stray part.");
  }

  BakeResult result;
  result.package = formats::writePackage(content);
  std::string refusal = refusalOf(result.package);
  if (!refusal.empty() && !content.fields.empty()) {
    // Sizes at which numbers of fields leave their bounds, and pieces thinner than rounding: clusters move those.
    removeFields(content);
    fields_report = {{"left_out", refusal}};
    result.package = formats::writePackage(content);
    refusal = refusalOf(result.package);
  }
  if (!refusal.empty()) {
    throw ToolError(ExitCode::system, mesh.file, "the baked package does not pass its own check: " + refusal,
                    "This is a fault of sinew: please report it with the file.");
  }

  ordered_json& report = result.report;
  report["source"] = mesh.file;
  report["tool_version"] = formats::kSoftwareVersion;
  report["format"] = mesh.format;
  report["unit"] = {{"metres_per_unit", mesh.metres_per_unit}, {"from", mesh.unit_source}, {"up_axis", mesh.up_axis}};
  const Vector3d size = mesh.bounds_max - mesh.bounds_min;
  report["size_metres"] = {size[0], size[1], size[2]};
  report["visual"] = {{"source_vertices", mesh.source_vertex_count},
                      {"source_faces", mesh.source_face_count},
                      {"visual_vertices", mesh.positions.size()},
                      {"visual_triangles", mesh.triangles.size()},
                      {"welded_vertices", mesh.welded_positions.size()},
                      {"unreferenced_vertices", mesh.unreferenced.size()},
                      {"parts", topology.parts.size()},
                      {"closed", topology.closed},
                      {"boundary_edges", topology.boundary_edges.size()},
                      {"non_manifold_edges", topology.non_manifold_edges.size()}};
  ordered_json bodies = ordered_json::array();
  for (std::uint32_t b = 0; b < physical.bodies.size(); ++b) {
    const PhysicalBody& body = physical.bodies[b];
    ordered_json entry = {{"name", body.name},
                          {"method", methodName(body.method)},
                          {"parts", body.parts.size()},
                          {"physical_vertices", content.bodies[b].vertex_count},
                          {"tetrahedra", content.bodies[b].tetrahedron_count},
                          {"clusters", content.bodies[b].cluster_count},
                          {"volume", body.volume}};
    if (body.source_volume >= 0) {
      entry["source_volume"] = body.source_volume;
      entry["volume_ratio"] = body.volume / body.source_volume;
    } else {
      entry["source_volume"] = nullptr;
    }
    bodies.push_back(entry);
  }
  report["bodies"] = bodies;
  report["physical_vertices"] = content.physical_vertices.size();
  report["tetrahedra"] = content.tetrahedra.size();
  report["tetrahedra_quality"] = {{"min_dihedral_deg", physical.quality.min_dihedral_deg},
                                  {"max_dihedral_deg", physical.quality.max_dihedral_deg},
                                  {"inverted", physical.quality.inverted}};
  report["clusters"] = content.clusters.size();
  report["memberships"] = content.memberships.size();
  report["fields"] = fields_report;
  if (!content.channels.empty()) report["channels"] = content.channels.size();
  for (const formats::AttachedPart& part : content.parts) {
    report["attached_parts"].push_back(
        {{"name", std::string(content.strings.data() + part.name.offset, part.name.bytes)},
         {"attach", part.cluster == formats::kNone ? "follow" : "rigid"},
         {"visual_vertices", part.count}});
  }
  if (!content.pin_sets.empty()) report["pin_sets"] = content.pin_sets.size();
  report["mass"] = mass;
  report["attachment"] = {
      {"method", settings.attachment.method == AttachmentMethod::clusters ? "clusters" : "barycentric"},
      {"max_rest_error", rest_error / mesh.diagonal},
      {"max_distance", farthest / mesh.diagonal}};
  report["package_bytes"] = result.package.size();
  report["findings"] = findingsJson(findings);
  report["settings"] = settings_json;
  result.findings = std::move(findings);
  progress.finish();
  return result;
}

}  // namespace

BakeResult bake(const Recipe& recipe, Progress& progress, StageCache* cache) {
  ImportedSource source = importSource(recipe, progress);
  return bakeSource(recipe, source, progress, cache, true);
}

std::vector<Finding> refusalOfBake(const Recipe& recipe, ImportedSource source, Progress& progress, StageCache* cache) {
  try {
    bakeSource(recipe, source, progress, cache, false);
  } catch (const ToolError& error) {
    if (error.code() == ExitCode::system) throw;
    return {{"bake-refused", Severity::error, error.problem(), 1, "", {}, "", error.cure()}};
  }
  return {};
}

}  // namespace sinew::tools

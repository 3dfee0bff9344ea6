// SPDX-License-Identifier: GPL-3.0-or-later
//
// The package's content: what is simulated (pieces, masses, clusters, mechanics), what is drawn, and where that hangs.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <map>
#include <numeric>

#include "sinew/formats/version.h"
#include "tools/bake/authored.h"
#include "tools/bake/moments.h"
#include "tools/bake/stages.h"
#include "tools/core/error.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// Every vertex keeps some mass, also where its tetrahedra hardly touch the solid: this part of the piece's mean.
constexpr double kLightestVertex = 0.05;
// Mass of a vertex that carries a rigid part, of the host's lightest one: the host's motion is its own.
constexpr float kRiderMass = 1e-3F;
// Weights of a cluster attachment below this change nothing that can be seen.
constexpr double kMinimumAttachmentWeight = 0.01;

formats::Float3 toFloat(const Vector3d& x) { return {float(x[0]), float(x[1]), float(x[2])}; }

double volumeOf(const PhysicalMesh& mesh, std::size_t t) {
  const auto& v = mesh.tetrahedra[t];
  const Vector3d& d = mesh.positions[v[3]];
  return (mesh.positions[v[0]] - d).cross(mesh.positions[v[1]] - d).dot(mesh.positions[v[2]] - d) / -6;
}

std::vector<formats::PhysicalVertex> physicalVertices(const PhysicalMesh& mesh, std::span<const ClusterSource> clusters,
                                                      double density, const std::string& file) {
  std::vector<double> mass(mesh.positions.size(), 0);
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    const double quarter = density * volumeOf(mesh, t) * mesh.fill[t] / 4;
    for (std::uint32_t v : mesh.tetrahedra[t]) mass[v] += quarter;
  }
  for (const PhysicalPiece& piece : mesh.pieces) {
    const auto own = mass.begin() + piece.first_vertex;
    const double total = std::accumulate(own, own + piece.vertex_count, 0.0);
    double floor = kLightestVertex * total / piece.vertex_count;
    if (!(floor > 0)) floor = density * std::max(piece.volume, 1e-30) / piece.vertex_count;
    std::for_each(own, own + piece.vertex_count, [floor](double& m) { m = std::max(m, floor); });
  }
  std::vector<formats::PhysicalVertex> vertices(mass.size());
  for (std::size_t v = 0; v < mass.size(); ++v) vertices[v] = {toFloat(mesh.positions[v]), float(mass[v])};
  for (const ClusterSource& cluster : clusters) {
    if (cluster.rider == formats::kNone) continue;
    float lightest = std::numeric_limits<float>::infinity();
    for (const std::uint32_t v : cluster.vertices) lightest = std::min(lightest, vertices[v].mass);
    for (std::uint32_t k = 0; k < 4; ++k) vertices[cluster.rider + k].mass = kRiderMass * lightest;
  }
  const double all = std::accumulate(mass.begin(), mass.end(), 0.0);
  const bool weighs = std::all_of(vertices.begin(), vertices.end(), [](const auto& vertex) { return vertex.mass > 0; });
  if (!weighs || !(all <= double(formats::kMostNumber))) {
    char text[64];
    std::snprintf(text, sizeof text, "is too %s to compute with: %.1e kg", all < 1 ? "small" : "large", all);
    throw ToolError(ExitCode::bad_input, file, text,
                    "Give the unit it was made in (--unit), or another material.density.");
  }
  return vertices;
}

// The first function of a field is X / sqrt(J), J = sum m X^2 about the middle, where it is longest: orthonormal in the
// masses. What changes by more than kMostNumber a metre has no square in floats.
void refuseTinyPieces(const PhysicalMesh& mesh, const std::vector<formats::PhysicalVertex>& vertices,
                      const std::string& file) {
  for (const PhysicalPiece& piece : mesh.pieces) {
    double mass = 0;
    Eigen::Array3d first = Eigen::Array3d::Zero(), second = first;
    const Vector3d& from = mesh.positions[piece.first_vertex];
    for (std::uint32_t v = piece.first_vertex; v < piece.first_vertex + piece.vertex_count; ++v) {
      const double m = double(vertices[v].mass);
      const Eigen::Array3d x = mesh.positions[v] - from;
      mass += m;
      first += m * x;
      second += m * x * x;
    }
    const double longest = (second - first * first / mass).maxCoeff();
    if (std::sqrt(longest) * double(formats::kMostNumber) >= 1) continue;
    throw ToolError(ExitCode::bad_input, file,
                    "piece '" + piece.name + "' is too small to compute with: " +
                        lengthText(std::sqrt(longest / mass)) + " from its middle on average",
                    "Give the unit it was made in (--unit); field.functions=0 bakes it for --solver report alone.");
  }
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
                  const std::vector<PhysicalPiece>& pieces, formats::PackageContent& content) {
  bool plain = true;
  std::vector<formats::ClusterMechanics> mechanics;
  std::map<std::string, std::pair<std::uint32_t, std::uint32_t>> curves;  // first point and count, by text
  for (const ClusterSource& source : sources) {
    const ClusterOptions& options = source.options ? *source.options : of_all;
    mechanics.push_back(mechanicsOf(options, pieces[source.piece].source_volume < 0));
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

// Each with what stands before the next one's: its own and its accessories'.
void addBodies(const PhysicalMesh& physical, std::span<const ClusterSource> clusters,
               formats::PackageContent& content) {
  std::uint32_t first = 0;
  for (std::uint32_t b = 0; b < physical.pieces.size(); ++b) {
    const PhysicalPiece& piece = physical.pieces[b];
    const bool last = b + 1 == physical.pieces.size();
    const std::size_t vertices = last ? physical.positions.size() : physical.pieces[b + 1].first_vertex;
    const std::size_t tetrahedra = last ? physical.tetrahedra.size() : physical.pieces[b + 1].first_tetrahedron;
    std::uint32_t end = first;
    while (end < clusters.size() && clusters[end].piece == b) ++end;
    content.pieces.push_back({piece.first_vertex, std::uint32_t(vertices) - piece.first_vertex, piece.first_tetrahedron,
                              std::uint32_t(tetrahedra) - piece.first_tetrahedron, first, end - first,
                              content.addText(piece.name)});
    first = end;
  }
}

void addVisual(const VisualMesh& mesh, formats::PackageContent& content) {
  for (const Vector3d& x : mesh.positions) content.visual_positions.push_back(toFloat(x));
  for (const auto& n : mesh.normals) content.visual_normals.push_back({n[0], n[1], n[2]});
  for (const auto& uv : mesh.uvs) content.visual_uvs.push_back({uv[0], uv[1]});
  if (content.visual_colors.empty()) content.visual_colors = packedColors(mesh.colors);  // else: the recipe's
  content.visual_triangles = mesh.triangles;
  std::vector<std::uint32_t> texture_index(mesh.textures.size(), formats::kNone);
  for (std::size_t t = 0; t < mesh.textures.size(); ++t) {
    const TextureSource& texture = mesh.textures[t];
    if (texture.bytes.empty()) continue;
    texture_index[t] = std::uint32_t(content.textures.size());
    content.textures.push_back({content.addText(texture.name), content.addText(texture.mime),
                                content.texture_bytes.size(), texture.bytes.size()});
    content.texture_bytes.insert(content.texture_bytes.end(), texture.bytes.begin(), texture.bytes.end());
  }
  for (const MaterialSource& material : mesh.materials) {
    std::array<float, 4> color = material.base_color;
    for (float& channel : color) channel = std::clamp(channel, 0.0F, 1.0F);
    content.materials.push_back({content.addText(material.name), color,
                                 material.texture == formats::kNone ? formats::kNone : texture_index[material.texture],
                                 material.double_sided ? std::uint32_t(formats::kMaterialDoubleSided) : 0U});
  }
  for (const SubMeshSource& sub : mesh.sub_meshes) {
    const std::string name = sub.mesh.empty() || sub.mesh == sub.node ? sub.node
                             : sub.node.empty()                       ? sub.mesh
                                                                      : sub.node + "/" + sub.mesh;
    content.sub_meshes.push_back({content.addText(name), sub.material == formats::kNone ? formats::kNone : sub.material,
                                  sub.first_triangle, sub.triangle_count, 0});
  }
  for (const GroupSource& group : mesh.groups) {
    content.groups.push_back({content.addText(group.name), std::uint32_t(content.group_vertices.size()),
                              std::uint32_t(group.vertices.size())});
    content.group_vertices.insert(content.group_vertices.end(), group.vertices.begin(), group.vertices.end());
  }
}

void addIdentity(const VisualMesh& mesh, formats::PackageContent& content) {
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
  std::iota(content.source_visual_list.begin(), content.source_visual_list.end(), 0U);
  std::stable_sort(content.source_visual_list.begin(), content.source_visual_list.end(),
                   [&](std::uint32_t v, std::uint32_t u) { return mesh.source_vertex[v] < mesh.source_vertex[u]; });
  for (const SourceMeshRange& range : mesh.source_meshes) {
    content.source_meshes.push_back(
        {content.addText(range.name), range.first_source_vertex, range.source_vertex_count});
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
  for (const TetrahedronPlace& place : places) {
    std::map<std::uint32_t, double> weights;
    double clamped_sum = 0;
    for (double w : place.weights) clamped_sum += std::max(w, 0.0);
    for (std::size_t k = 0; k < 4; ++k) {
      const double w = std::max(place.weights[k], 0.0) / clamped_sum;
      for (const auto& [c, share] : of_vertex[content.tetrahedra[place.tetrahedron].vertex[k]]) weights[c] += w * share;
    }
    std::erase_if(weights, [](const auto& x) { return x.second < kMinimumAttachmentWeight; });
    double sum = 0;
    for (const auto& entry : weights) sum += entry.second;
    content.cluster_attachment_ranges.push_back(
        {std::uint32_t(content.cluster_attachments.size()), std::uint32_t(weights.size())});
    for (const auto& [c, w] : weights) content.cluster_attachments.push_back({c, float(w / sum)});
  }
}

// Largest distance of a visual vertex from its place. Throws where one is further off than floats round.
double restError(const VisualMesh& mesh, const formats::PackageContent& content) {
  double largest = 0, beyond = 0;
  std::size_t worst = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const HungPlace hung = hungAt(content, v);
    const double error =
        (Eigen::Map<const Eigen::Vector3f>(hung.place.data()).cast<double>() - mesh.positions[v]).norm();
    largest = std::max(largest, error);
    if (error - hung.rounded <= beyond) continue;
    beyond = error - hung.rounded;
    worst = v;
  }
  if (beyond <= kMostRestError * mesh.diagonal) return largest;
  char distance[32];
  std::snprintf(distance, sizeof distance, "%.2g", beyond / mesh.diagonal);
  throw ToolError(ExitCode::bad_input, mesh.file,
                  "source vertex " + std::to_string(mesh.source_vertex[worst]) + " would be attached " + distance +
                      " diagonals from its place",
                  "Its tetrahedra are too small or thin for where it lies: raise tetrahedra.thickness of a shell, "
                  "use --set attachment.method=clusters, or remove the stray part.");
}

// INFO.
void addInfo(const Settings& settings, const Solid& solid, Content& result) {
  const VisualMesh& mesh = solid.source.mesh;
  formats::PackageContent& content = result.package;
  formats::PackageInfo& info = content.info;
  info.origin = {solid.origin[0], solid.origin[1], solid.origin[2]};
  info.metres_per_unit = mesh.metres_per_unit;
  info.bounds_min = toFloat(mesh.bounds_min);
  info.bounds_max = toFloat(mesh.bounds_max);
  info.diagonal = float(mesh.diagonal);
  info.total_mass = float(result.mass);
  info.density = float(settings.material.density);
  double volume = 0, source_volume = 0;
  bool volume_defined = true;
  for (const PhysicalPiece& piece : solid.physical.pieces) {
    volume_defined = volume_defined && piece.source_volume >= 0;
    source_volume += piece.source_volume;
    volume += piece.volume;
  }
  info.physical_volume = float(volume);
  info.source_volume = volume_defined ? float(source_volume) : -1.0F;
  info.max_rest_error = float(result.rest_error / mesh.diagonal);
  info.min_dihedral_deg = float(solid.physical.quality.min_dihedral_deg);
  info.max_dihedral_deg = float(solid.physical.quality.max_dihedral_deg);
  info.name = content.addText(std::filesystem::path(mesh.file).stem().string());
  info.tool_version = content.addText(formats::kSoftwareVersion);
  info.source_file = content.addText(std::filesystem::path(mesh.file).filename().string());
  info.unit_source = content.addText(mesh.unit_source);
  info.settings_json = content.addText(statedSettings(settings, mesh).dump());
}

}  // namespace

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

Content contentOf(const Recipe& recipe, const Solid& solid, const Placed& placed, const Clustered& clustered,
                  Progress& progress) {
  const Settings& settings = recipe.settings;
  const VisualMesh& mesh = solid.source.mesh;
  const std::vector<ClusterSource>& clusters = clustered.clusters;
  Content result{{}, clustered.findings};
  formats::PackageContent& content = result.package;
  content.physical_vertices = physicalVertices(placed.physical, clusters, settings.material.density, mesh.file);
  if (settings.field.functions > 0) refuseTinyPieces(placed.physical, content.physical_vertices, mesh.file);
  for (const auto& tetrahedron : placed.physical.tetrahedra) content.tetrahedra.push_back({tetrahedron});
  ClusterConstants constants =
      clusterConstants(clusters, content.physical_vertices, settings.clusters, result.findings);
  for (std::size_t c = 0; c < clusters.size(); ++c) constants.clusters[c].name = content.addText(clusters[c].name);
  content.clusters = std::move(constants.clusters);
  content.memberships = std::move(constants.memberships);
  content.quadratic_moments = std::move(constants.quadratic_moments);
  addMechanics(clusters, settings.clusters, placed.physical.pieces, content);
  addAuthored(recipe, solid.source.authored, clustered.transfer, clusters, mesh, content, result.findings);
  addBodies(placed.physical, clusters, content);
  for (const formats::PhysicalVertex& vertex : content.physical_vertices) result.mass += double(vertex.mass);

  progress.stage("attachment");
  addVisual(mesh, content);
  addIdentity(mesh, content);
  if (settings.attachment.method == AttachmentMethod::clusters) {
    attachToClusters(placed.places, content);
  } else {
    for (const auto& [tetrahedron, w, distance] : placed.places)
      content.barycentric.push_back({tetrahedron, {float(w[0]), float(w[1]), float(w[2])}});
  }
  addParts(solid.source.parts, placed.riders, clusters, placed.physical, content);
  result.rest_error = restError(mesh, content);
  addInfo(settings, solid, result);
  return result;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// A bake's report on itself, read from its stages.
#include <string_view>

#include "sinew/formats/version.h"
#include "tools/bake/findings_json.h"
#include "tools/bake/stages.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using nlohmann::ordered_json;

ordered_json piecesJson(std::span<const PhysicalPiece> pieces, std::span<const formats::PieceRange> ranges) {
  ordered_json all = ordered_json::array();
  Settings used;
  for (std::size_t b = 0; b < pieces.size(); ++b) {
    const PhysicalPiece& piece = pieces[b];
    used.tetrahedra.method = piece.method;
    ordered_json entry = {{"name", piece.name},
                          {"method", used.toJson()["tetrahedra.method"]},
                          {"parts", piece.parts.size()},
                          {"physical_vertices", ranges[b].vertex_count},
                          {"tetrahedra", ranges[b].tetrahedron_count},
                          {"clusters", ranges[b].cluster_count},
                          {"volume", piece.volume},
                          {"source_volume", nullptr}};
    if (piece.source_volume >= 0) {
      entry["source_volume"] = piece.source_volume;
      entry["volume_ratio"] = piece.volume / piece.source_volume;
    }
    all.push_back(entry);
  }
  return all;
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

ordered_json statedSettings(const Settings& settings, const VisualMesh& mesh) {
  ordered_json stated = settings.toJson();
  stated["import.up"] = mesh.up_axis;  // what was found: the way back to the source's axes
  return stated;
}

ordered_json reportOf(const Settings& settings, const Solid& solid, const Placed& placed, const Content& baked,
                      const ordered_json& fields, std::size_t package_bytes) {
  const VisualMesh& mesh = solid.source.mesh;
  const Topology& topology = solid.source.topology;
  const TetrahedraQuality& quality = solid.physical.quality;
  const formats::PackageContent& content = baked.package;
  ordered_json report;
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
  report["pieces"] = piecesJson(solid.physical.pieces, content.pieces);
  report["physical_vertices"] = content.physical_vertices.size();
  report["tetrahedra"] = content.tetrahedra.size();
  report["tetrahedra_quality"] = {{"min_dihedral_deg", quality.min_dihedral_deg},
                                  {"max_dihedral_deg", quality.max_dihedral_deg},
                                  {"inverted", quality.inverted}};
  report["clusters"] = content.clusters.size();
  report["memberships"] = content.memberships.size();
  report["fields"] = fields;
  if (!content.channels.empty()) report["channels"] = content.channels.size();
  for (const formats::AttachedPart& part : content.parts) {
    report["attached_parts"].push_back(
        {{"name", std::string(content.strings.data() + part.name.offset, part.name.bytes)},
         {"attach", part.cluster == formats::kNone ? "follow" : "rigid"},
         {"visual_vertices", part.count}});
  }
  if (!content.pin_sets.empty()) report["pin_sets"] = content.pin_sets.size();
  report["mass"] = baked.mass;
  double farthest = 0;
  for (const TetrahedronPlace& place : placed.places) farthest = std::max(farthest, place.distance);
  report["attachment"] = {
      {"method", settings.attachment.method == AttachmentMethod::clusters ? "clusters" : "barycentric"},
      {"max_rest_error", baked.rest_error / mesh.diagonal},
      {"max_distance", farthest / mesh.diagonal}};
  report["package_bytes"] = package_bytes;
  report["findings"] = findingsJson(baked.findings);
  report["settings"] = statedSettings(settings, mesh);
  return report;
}

}  // namespace sinew::tools

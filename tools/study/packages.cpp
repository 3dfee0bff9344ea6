// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/packages.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "runtime/geometry/grid_tetrahedra.h"
#include "tools/author/clusters.h"
#include "tools/bake/fields.h"
#include "tools/bake/moments.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using geometry::TetMesh;

constexpr double kDensity = 1000;  // kg/m^3

/// A mesh with the clusters it is to have, before masses and moments.
struct Draft {
  TetMesh mesh;
  std::vector<ClusterSource> clusters;
};

TetMesh boxMesh(const std::array<int, 3>& cells, const Vector3d& size) {
  geometry::CellGrid grid;
  grid.size = cells;
  grid.spacing = size.cwiseQuotient(Vector3d(cells[0], cells[1], cells[2]));
  grid.origin = -0.5 * size;
  grid.kept.assign(std::size_t(cells[0]) * std::size_t(cells[1]) * std::size_t(cells[2]), 1);
  return geometry::gridTetrahedra(grid);
}

std::vector<ClusterSource> gridOf(const TetMesh& mesh, const std::array<std::uint32_t, 3>& grid) {
  PhysicalMesh physical;
  physical.positions = mesh.positions;
  physical.tetrahedra = mesh.tetrahedra;
  physical.fill.assign(mesh.tetrahedra.size(), 1.0);
  PhysicalPiece body;
  body.name = "body";
  body.vertex_count = std::uint32_t(mesh.positions.size());
  body.tetrahedron_count = std::uint32_t(mesh.tetrahedra.size());
  physical.pieces.push_back(body);
  ClusterOptions options;
  options.grid = grid;
  std::vector<Finding> findings;
  return gridClusters(physical, options, findings);
}

std::vector<double> massesOf(const TetMesh& mesh) {
  std::vector<double> mass(mesh.positions.size(), 0.0);
  for (const geometry::Tetrahedron& tetrahedron : mesh.tetrahedra) {
    for (const std::uint32_t v : tetrahedron) mass[v] += kDensity * geometry::volume(mesh, tetrahedron) / 4;
  }
  return mass;
}

// The boundary of the tetrahedra as visual mesh: each vertex on a corner of a tetrahedron.
void addSurface(const TetMesh& mesh, const formats::StringRef& name, formats::PackageContent& content) {
  std::vector<std::uint32_t> tetrahedron_of;
  std::vector<std::uint32_t> visual(mesh.positions.size(), formats::kNone);
  std::vector<Vector3d> normals;
  const std::vector<geometry::Triangle> faces = geometry::boundaryFaces(mesh, &tetrahedron_of);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto& [a, b, c] = faces[f];
    const Vector3d area = (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
    formats::Triangle triangle{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = faces[f][k];
      if (visual[v] == formats::kNone) {
        visual[v] = std::uint32_t(content.visual_positions.size());
        content.visual_positions.push_back(content.physical_vertices[v].rest_position);
        formats::BarycentricAttachment attachment{tetrahedron_of[f], {0, 0, 0}};
        const geometry::Tetrahedron& corners = mesh.tetrahedra[tetrahedron_of[f]];
        const auto corner = std::size_t(std::find(corners.begin(), corners.end(), v) - corners.begin());
        if (corner < 3) attachment.weight[corner] = 1;
        content.barycentric.push_back(attachment);
        normals.emplace_back(Vector3d::Zero());
      }
      triangle[k] = visual[v];
      normals[visual[v]] += area;
    }
    content.visual_triangles.push_back(triangle);
  }
  for (const Vector3d& normal : normals) {
    const Vector3d n = normal.normalized();
    content.visual_normals.push_back({float(n[0]), float(n[1]), float(n[2])});
  }
  content.sub_meshes.push_back({name, formats::kNone, 0, std::uint32_t(content.visual_triangles.size()), 0});
}

std::shared_ptr<const Asset> assetOf(Draft draft, const StudyPackageOptions& options) {
  formats::PackageContent content;
  const formats::StringRef name = content.addText("study");
  const std::vector<double> mass = massesOf(draft.mesh);
  Vector3d low = draft.mesh.positions.front(), high = low;
  double total = 0;
  for (std::size_t i = 0; i < mass.size(); ++i) {
    const Vector3d& x = draft.mesh.positions[i];
    content.physical_vertices.push_back({{float(x[0]), float(x[1]), float(x[2])}, float(mass[i])});
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
    total += mass[i];
  }
  for (const auto& tetrahedron : draft.mesh.tetrahedra) content.tetrahedra.push_back({tetrahedron});
  ClusterOptions cluster_options;
  cluster_options.stretch_hz = cluster_options.bend_hz = cluster_options.twist_hz = options.frequency_hz;
  for (ClusterSource& source : draft.clusters) source.mode = formats::ClusterMode::linear;
  std::vector<Finding> findings;
  ClusterConstants constants = clusterConstants(draft.clusters, content.physical_vertices, cluster_options, findings);
  content.clusters = std::move(constants.clusters);
  content.memberships = std::move(constants.memberships);
  for (formats::Cluster& cluster : content.clusters) cluster.name = name;
  content.pieces.push_back({0, std::uint32_t(mass.size()), 0, std::uint32_t(content.tetrahedra.size()), 0,
                            std::uint32_t(content.clusters.size()), name});
  if (options.mechanics) content.mechanics.assign(content.clusters.size(), *options.mechanics);
  if (options.surface) addSurface(draft.mesh, name, content);
  formats::PackageInfo& info = content.info;
  info.metres_per_unit = 1;
  info.bounds_min = {float(low[0]), float(low[1]), float(low[2])};
  info.bounds_max = {float(high[0]), float(high[1]), float(high[2])};
  info.diagonal = float((high - low).norm());
  info.total_mass = float(total);
  info.density = float(kDensity);
  info.physical_volume = float(geometry::volume(draft.mesh));
  info.source_volume = -1;
  info.name = info.tool_version = info.source_file = info.unit_source = name;
  info.settings_json = content.addText("{}");
  if (options.fields) addFields(Settings{}, content);
  auto asset = Asset::fromMemory(formats::writePackage(content));
  if (!asset) {
    throw ToolError(ExitCode::system, "", "a package of the study is refused: " + asset.reason(),
                    "This is a fault of sinew: please report it.");
  }
  return *asset;
}

}  // namespace

double chance(std::uint64_t seed, std::uint64_t index) {
  // SplitMix64 (Steele et al. 2014).
  std::uint64_t z = seed * 0x9e3779b97f4a7c15ULL + (index + 1) * 0xbf58476d1ce4e5b9ULL;
  for (int round = 0; round < 2; ++round) {
    z += 0x9e3779b97f4a7c15ULL;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    z ^= z >> 31U;
  }
  return double(z >> 11U) * 0x1p-53;
}

std::shared_ptr<const Asset> boxPackage(const BoxBody& box, const StudyPackageOptions& options) {
  Draft draft{boxMesh(box.cells, {box.size[0], box.size[1], box.size[2]}), {}};
  for (Vector3d& x : draft.mesh.positions) x += Vector3d(box.center[0], box.center[1], box.center[2]);
  draft.clusters = gridOf(draft.mesh, box.clusters);
  return assetOf(std::move(draft), options);
}

std::shared_ptr<const Asset> tetrahedronPackage(const StudyPackageOptions& options) {
  Draft draft;
  draft.mesh.positions = {
      {0, 0, 0}, {0, 0, 1}, {std::sqrt(0.75), 0, 0.5}, {std::sqrt(1.0 / 12), std::sqrt(2.0 / 3), 0.5}};
  draft.mesh.tetrahedra = {{0, 1, 2, 3}};
  const auto& x = draft.mesh.positions;
  if (geometry::signedVolume6(x[0], x[1], x[2], x[3]) < 0)
    std::swap(draft.mesh.tetrahedra[0][0], draft.mesh.tetrahedra[0][1]);
  draft.clusters = gridOf(draft.mesh, {1, 1, 1});
  StudyPackageOptions with_fields = options;
  with_fields.fields = true;
  return assetOf(std::move(draft), with_fields);
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/packages.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/geometry/grid_tetrahedra.h"
#include "runtime/geometry/pseudo_inverse.h"
#include "runtime/geometry/stuffing.h"
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

TetMesh stuffed(const std::function<double(const Vector3d&)>& depth, const Vector3d& low, const Vector3d& high,
                double spacing) {
  geometry::StuffingDomain domain;
  domain.inside = [&](const Vector3d& x) { return depth(x) > 0; };
  domain.crossing = [&](const Vector3d& in, const Vector3d& out) {
    double a = 0, b = 1;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (a + b);
      (depth(in + middle * (out - in)) > 0 ? a : b) = middle;
    }
    return 0.5 * (a + b);
  };
  return geometry::stuffIsosurface(domain, {low, high}, spacing);
}

double segmentDepth(const Vector3d& x, const Vector3d& a, const Vector3d& b, double radius) {
  const double t = std::clamp((x - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return radius - (x - a - t * (b - a)).norm();
}

TetMesh ringMesh() {
  const auto depth = [](const Vector3d& x) { return 0.16 - std::hypot(std::hypot(x[0], x[2]) - 0.5, x[1]); };
  return stuffed(depth, {-0.7, -0.2, -0.7}, {0.7, 0.2, 0.7}, 0.16);
}

TetMesh animalMesh() {
  const auto depth = [](const Vector3d& x) {
    double d = segmentDepth(x, {-0.35, 0, 0}, {0.35, 0, 0}, 0.24);
    for (const double side : {-0.14, 0.14}) {
      for (const double along : {-0.35, 0.35}) {
        d = std::max(d, segmentDepth(x, {along, 0, side}, {along, -0.55, side}, 0.09));
      }
    }
    return std::max(d, segmentDepth(x, {0.4, 0.1, 0}, {0.7, 0.35, 0}, 0.15));
  };
  return stuffed(depth, {-0.7, -0.7, -0.3}, {0.9, 0.6, 0.3}, 0.17);
}

std::vector<ClusterSource> gridOf(const TetMesh& mesh, const std::array<std::uint32_t, 3>& grid) {
  PhysicalMesh physical;
  physical.positions = mesh.positions;
  physical.tetrahedra = mesh.tetrahedra;
  physical.fill.assign(mesh.tetrahedra.size(), 1.0);
  PhysicalBody body;
  body.name = "body";
  body.vertex_count = std::uint32_t(mesh.positions.size());
  body.tetrahedron_count = std::uint32_t(mesh.tetrahedra.size());
  physical.bodies.push_back(body);
  ClusterOptions options;
  options.grid = grid;
  std::vector<Finding> findings;
  return gridClusters(physical, options, findings);
}

ClusterSource clusterOf(const std::string& name, const std::vector<std::uint32_t>& vertices) {
  ClusterSource source;
  source.name = name;
  source.vertices = vertices;
  source.weights.assign(vertices.size(), 1.0);
  return source;
}

Draft loosePoints(const std::vector<Vector3d>& points) {
  Draft draft;
  draft.mesh.positions = points;
  std::vector<std::uint32_t> all(points.size());
  for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  draft.clusters.push_back(clusterOf("all", all));
  return draft;
}

Draft oddBody() {
  Draft draft;
  draft.mesh = boxMesh({3, 3, 3}, Vector3d::Ones());
  std::vector<std::uint32_t> all, line, sheet;
  for (std::uint32_t i = 0; i < draft.mesh.positions.size(); ++i) {
    const Vector3d& x = draft.mesh.positions[i];
    if (x[1] < -0.49 && x[2] < -0.49) line.push_back(i);
    if (x[1] > 0.49) sheet.push_back(i);
    all.push_back(i);
  }
  draft.clusters = {clusterOf("one", {4}),   clusterOf("two", {4, 9}),  clusterOf("three", {4, 9, 20}),
                    clusterOf("line", line), clusterOf("sheet", sheet), clusterOf("all", all)};
  return draft;
}

Draft draftOf(StudyBody body) {
  switch (body) {
    case StudyBody::box: {
      Draft draft{boxMesh({2, 2, 2}, Vector3d::Ones()), {}};
      draft.clusters = gridOf(draft.mesh, {1, 1, 1});
      return draft;
    }
    case StudyBody::box2: {
      Draft draft{boxMesh({4, 4, 4}, Vector3d::Ones()), {}};
      draft.clusters = gridOf(draft.mesh, {2, 2, 2});
      return draft;
    }
    case StudyBody::box3: {
      Draft draft{boxMesh({5, 5, 5}, Vector3d::Ones()), {}};
      draft.clusters = gridOf(draft.mesh, {3, 3, 3});
      return draft;
    }
    case StudyBody::bar: {
      Draft draft{boxMesh({16, 2, 2}, {4, 0.4, 0.4}), {}};
      draft.clusters = gridOf(draft.mesh, {6, 1, 1});
      return draft;
    }
    case StudyBody::ring: {
      Draft draft{ringMesh(), {}};
      draft.clusters = gridOf(draft.mesh, {2, 1, 2});
      return draft;
    }
    case StudyBody::animal: {
      Draft draft{animalMesh(), {}};
      draft.clusters = gridOf(draft.mesh, {0, 0, 0});
      return draft;
    }
    case StudyBody::one_vertex:
      return loosePoints({{0, 0, 0}});
    case StudyBody::two_vertices:
      return loosePoints({{-0.5, 0, 0}, {0.5, 0.1, 0}});
    case StudyBody::three_vertices:
      return loosePoints({{-0.5, 0, 0}, {0.5, 0, 0}, {0, 0.7, 0.2}});
    case StudyBody::line:
      return loosePoints({{-0.5, 0, 0}, {-0.3, 0, 0}, {0, 0, 0}, {0.1, 0, 0}, {0.5, 0, 0}});
    case StudyBody::plane: {
      std::vector<Vector3d> points;
      for (int i = 0; i < 4; ++i) {
        for (int j = 0; j < 4; ++j) points.emplace_back(0.3 * i, 0.2 * j + 0.05 * i, 0.1 * i);
      }
      return loosePoints(points);
    }
    case StudyBody::coincident: {
      const TetMesh mesh = boxMesh({2, 2, 2}, Vector3d::Ones());
      std::vector<Vector3d> points;
      for (const Vector3d& x : mesh.positions) points.insert(points.end(), {x, x});
      return loosePoints(points);
    }
    case StudyBody::odd:
      return oddBody();
  }
  return {};
}

std::vector<double> massesOf(const TetMesh& mesh, double ratio) {
  std::vector<double> mass(mesh.positions.size(), mesh.tetrahedra.empty() ? 1.0 : 0.0);
  for (const geometry::Tetrahedron& tetrahedron : mesh.tetrahedra) {
    for (const std::uint32_t v : tetrahedron) mass[v] += kDensity * geometry::volume(mesh, tetrahedron) / 4;
  }
  if (ratio == 1) return mass;
  // Chance decides which are heavy, but both extremes occur.
  const double mean = mass.front();
  for (std::size_t i = 0; i < mass.size(); ++i) {
    const double t = i == 0 ? 0.0 : i == 1 ? 1.0 : chance(77, i);
    mass[i] = mean * std::pow(ratio, t - 0.5);
  }
  return mass;
}

// A bake makes flat clusters rigid and poor ones linear; a package by another hand may hold them as they are.
// \param made the moments as the bake made them; those of the package follow the order of its clusters.
void keepMode(formats::ClusterMode mode, const std::vector<formats::QuadraticMoment>& made, formats::Cluster& cluster,
              formats::PackageContent& content) {
  if (cluster.mode == formats::ClusterMode::quadratic) {
    content.quadratic_moments.push_back(made[cluster.quadratic]);
    cluster.quadratic = std::uint32_t(content.quadratic_moments.size() - 1);
  }
  if (cluster.mode == mode) return;
  cluster.mode = mode;
  if (mode != formats::ClusterMode::quadratic) return;
  using Vector9d = Eigen::Matrix<double, 9, 1>;
  Eigen::Matrix<double, 9, 9> moment = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::uint32_t k = cluster.first_member; k < cluster.first_member + cluster.member_count; ++k) {
    const formats::Membership& member = content.memberships[k];
    Vector3d q;
    for (int a = 0; a < 3; ++a) {
      q[a] = (double(content.physical_vertices[member.vertex].rest_position[std::size_t(a)]) -
              double(cluster.rest_center[std::size_t(a)])) /
             double(cluster.radius);
    }
    Vector9d monomial;
    monomial << q, q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0];
    for (int j = 0; j < 6; ++j) monomial[3 + j] -= double(cluster.quadratic_mean[std::size_t(j)]);
    moment += double(member.mu) * monomial * monomial.transpose();
  }
  const Eigen::Matrix<double, 9, 9> inverse = geometry::pseudoInverse<9>(moment);
  formats::QuadraticMoment packed{};
  std::size_t n = 0;
  for (int row = 0; row < 9; ++row) {
    for (int column = 0; column <= row; ++column) packed.a_qq[n++] = float(inverse(row, column));
  }
  cluster.quadratic = std::uint32_t(content.quadratic_moments.size());
  content.quadratic_moments.push_back(packed);
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

Vector3d vectorOf(const std::array<float, 3>& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

// CMEC of every cluster.
void addMechanics(const StudyPackageOptions& options, formats::PackageContent& content) {
  if (!options.mechanics) return;
  formats::ClusterMechanics mechanics = *options.mechanics;
  content.curve_points = options.curve;
  mechanics.curve_point_count = std::uint32_t(options.curve.size());
  if (options.elastic_hz > 0) {
    Vector3d first = Vector3d::Zero();
    double mass = 0, second = 0;
    for (const formats::PhysicalVertex& vertex : content.physical_vertices) {
      const Vector3d d = vectorOf(vertex.rest_position) - vectorOf(content.physical_vertices.front().rest_position);
      mass += double(vertex.mass);
      first += double(vertex.mass) * d;
      second += double(vertex.mass) * d.squaredNorm();
    }
    const double radius2 = std::max(0.0, second / mass - (first / mass).squaredNorm());
    // Of a single vertex any modulus will do.
    const double omega = 2 * std::numbers::pi * options.elastic_hz;
    mechanics.young = float(std::clamp(kDensity * omega * omega * radius2, 1e-30, 1e12));
  }
  if (mechanics.contraction > 0) {
    mechanics.channel = 0;
    content.channels = {{content.addText("fibre")}};
  }
  content.mechanics.assign(content.clusters.size(), mechanics);
}

std::shared_ptr<const Asset> assetOf(Draft draft, const StudyPackageOptions& options) {
  formats::PackageContent content;
  const formats::StringRef name = content.addText("study");
  const std::vector<double> mass = massesOf(draft.mesh, options.mass_ratio);
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
  for (ClusterSource& source : draft.clusters) source.mode = options.mode;
  std::vector<Finding> findings;
  ClusterConstants constants = clusterConstants(draft.clusters, content.physical_vertices, cluster_options, findings);
  content.clusters = std::move(constants.clusters);
  content.memberships = std::move(constants.memberships);
  for (formats::Cluster& cluster : content.clusters) {
    cluster.name = name;
    keepMode(options.mode, constants.quadratic_moments, cluster, content);
  }
  content.bodies.push_back({0, std::uint32_t(mass.size()), 0, std::uint32_t(content.tetrahedra.size()), 0,
                            std::uint32_t(content.clusters.size()), name});
  addMechanics(options, content);
  if (options.surface) addSurface(draft.mesh, name, content);
  formats::BodyInfo& info = content.info;
  info.metres_per_unit = 1;
  info.bounds_min = {float(low[0]), float(low[1]), float(low[2])};
  info.bounds_max = {float(high[0]), float(high[1]), float(high[2])};
  info.diagonal = high == low ? 1.0F : float((high - low).norm());
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

std::string_view nameOf(StudyBody body) {
  constexpr std::array<std::string_view, kStudyBodyCount> kNames = {
      "box",          "box2",           "box3", "bar",   "ring",       "animal", "one_vertex",
      "two_vertices", "three_vertices", "line", "plane", "coincident", "odd"};
  return kNames[std::size_t(body)];
}

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

std::shared_ptr<const Asset> studyPackage(StudyBody body, const StudyPackageOptions& options) {
  Draft draft = draftOf(body);
  for (Vector3d& x : draft.mesh.positions) x *= options.size;
  return assetOf(std::move(draft), options);
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

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/lattice.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "runtime/geometry/grid_tetrahedra.h"
#include "sinew/formats/writer.h"
#include "tools/bake/fields.h"
#include "tools/bake/moments.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Index3 = std::array<std::uint32_t, 3>;

constexpr double kDensity = 1000;  // kg/m^3

// First point of a box along an axis; box `count` begins where the last one ends.
std::uint32_t boxBegin(std::uint32_t points, std::uint32_t count, std::uint32_t box) {
  return std::uint32_t(std::uint64_t(points) * box / count);
}

// Memberships a point along one axis where each box grows by `layers` points.
double meanBoxes(std::uint32_t points, std::uint32_t count, std::uint32_t layers) {
  double sum = 0;
  for (std::uint32_t b = 0; b < count; ++b) {
    const std::uint32_t begin = boxBegin(points, count, b), end = boxBegin(points, count, b + 1);
    sum += std::min(end + layers, points) - (begin > layers ? begin - layers : 0);
  }
  return sum / points;
}

// The layers along each axis that come nearest to the memberships wanted.
Index3 layersFor(const LatticeOptions& o) {
  Index3 best = {0, 0, 0}, layers{};
  double best_distance = std::abs(1 - o.memberships);
  constexpr std::uint32_t kMost = 6;
  for (layers[2] = 0; layers[2] <= kMost; ++layers[2]) {
    for (layers[1] = 0; layers[1] <= kMost; ++layers[1]) {
      for (layers[0] = 0; layers[0] <= kMost; ++layers[0]) {
        double mean = 1;
        for (std::size_t a = 0; a < 3; ++a) mean *= meanBoxes(o.points[a], o.boxes[a], layers[a]);
        if (std::abs(mean - o.memberships) < best_distance) {
          best_distance = std::abs(mean - o.memberships);
          best = layers;
        }
      }
    }
  }
  return best;
}

// 1 inside, falling over the layers that it shares with a neighbour.
double axisWeight(std::uint32_t point, std::uint32_t begin, std::uint32_t end, std::uint32_t layers,
                  std::uint32_t points) {
  if (layers == 0) return 1;
  const double from_begin = begin == 0 ? 1e9 : double(point) - begin + layers + 1;
  const double from_end = end == points ? 1e9 : double(end) - point + layers;
  return std::min(1.0, std::min(from_begin, from_end) / (2 * layers + 1));
}

std::vector<ClusterSource> boxClusters(const LatticeOptions& o, const std::vector<std::uint32_t>& numbers) {
  const Index3 layers = layersFor(o);
  std::vector<ClusterSource> clusters;
  Index3 box{};
  for (box[2] = 0; box[2] < o.boxes[2]; ++box[2]) {
    for (box[1] = 0; box[1] < o.boxes[1]; ++box[1]) {
      for (box[0] = 0; box[0] < o.boxes[0]; ++box[0]) {
        ClusterSource cluster;
        cluster.mode = o.mode;
        Index3 begin{}, end{}, low{}, high{};
        for (std::size_t a = 0; a < 3; ++a) {
          begin[a] = boxBegin(o.points[a], o.boxes[a], box[a]);
          end[a] = boxBegin(o.points[a], o.boxes[a], box[a] + 1);
          low[a] = begin[a] > layers[a] ? begin[a] - layers[a] : 0;
          high[a] = std::min(end[a] + layers[a], o.points[a]);
        }
        std::vector<std::pair<std::uint32_t, double>> members;
        Index3 p{};
        for (p[2] = low[2]; p[2] < high[2]; ++p[2]) {
          for (p[1] = low[1]; p[1] < high[1]; ++p[1]) {
            for (p[0] = low[0]; p[0] < high[0]; ++p[0]) {
              double weight = 1;
              for (std::size_t a = 0; a < 3; ++a) {
                weight *= axisWeight(p[a], begin[a], end[a], layers[a], o.points[a]);
              }
              members.emplace_back(numbers[(p[2] * o.points[1] + p[1]) * o.points[0] + p[0]], weight);
            }
          }
        }
        std::sort(members.begin(), members.end());
        for (const auto& [vertex, weight] : members) {
          cluster.vertices.push_back(vertex);
          cluster.weights.push_back(weight);
        }
        clusters.push_back(std::move(cluster));
      }
    }
  }
  return clusters;
}

// The number of each point, by its place in rows of x within layers of z: along a Morton curve, as a bake has them.
std::vector<std::uint32_t> bakedOrder(const LatticeOptions& o) {
  geometry::TetMesh mesh;
  Index3 p{};
  for (p[2] = 0; p[2] < o.points[2]; ++p[2]) {
    for (p[1] = 0; p[1] < o.points[1]; ++p[1]) {
      for (p[0] = 0; p[0] < o.points[0]; ++p[0]) mesh.positions.emplace_back(p[0], p[1], p[2]);
    }
  }
  geometry::sortForLocality(mesh);
  std::vector<std::uint32_t> numbers(mesh.positions.size());
  for (std::uint32_t i = 0; i < mesh.positions.size(); ++i) {
    const Vector3d& at = mesh.positions[i];
    numbers[(std::size_t(at[2]) * o.points[1] + std::size_t(at[1])) * o.points[0] + std::size_t(at[0])] = i;
  }
  return numbers;
}

formats::Float3 toFloat(const Vector3d& x) { return {float(x[0]), float(x[1]), float(x[2])}; }

Vector3d toDouble(const formats::Float3& x) { return {double(x[0]), double(x[1]), double(x[2])}; }

Vector3d positionOf(const formats::PackageContent& content, std::uint32_t vertex) {
  return toDouble(content.physical_vertices[vertex].rest_position);
}

// Tetrahedra of all cells, and visual vertices on an ellipsoid, ring by ring as a modeller would number them.
void addTetrahedra(const LatticeOptions& o, const Vector3d& low, double spacing,
                   const std::vector<std::uint32_t>& numbers, formats::PackageContent& content) {
  geometry::CellGrid grid;
  grid.origin = low;
  grid.spacing = Vector3d::Constant(spacing);
  for (std::size_t a = 0; a < 3; ++a) grid.size[a] = int(o.points[a]) - 1;
  grid.kept.assign(std::size_t(grid.size[0]) * std::size_t(grid.size[1]) * std::size_t(grid.size[2]), 1);
  const geometry::TetMesh mesh = geometry::gridTetrahedra(grid);
  for (const auto& t : mesh.tetrahedra) {
    formats::Tetrahedron tetrahedron{};
    for (std::size_t k = 0; k < 4; ++k) {
      const Vector3d at = (mesh.positions[t[k]] - low) / spacing;
      tetrahedron.vertex[k] =
          numbers[(std::uint32_t(std::lround(at[2])) * o.points[1] + std::uint32_t(std::lround(at[1]))) * o.points[0] +
                  std::uint32_t(std::lround(at[0]))];
    }
    content.tetrahedra.push_back(tetrahedron);
  }

  if (o.visual_vertices == 0) return;
  const std::uint32_t around = std::max(3U, std::uint32_t(std::lround(std::sqrt(1.6 * o.visual_vertices))));
  const Vector3d half = -0.97 * low;
  for (std::uint32_t i = 0; i < o.visual_vertices; ++i) {
    const double turn = 2 * std::numbers::pi * (i % around) / around;
    const double height = 1 - 2 * (i + 0.5) / o.visual_vertices;
    const double wide = std::sqrt(1 - height * height);
    const Vector3d direction(wide * std::cos(turn), height, wide * std::sin(turn));
    const formats::Float3 position = toFloat(direction.cwiseProduct(half));
    const Vector3d x = toDouble(position);
    content.visual_positions.push_back(position);
    content.visual_normals.push_back(toFloat(direction.cwiseQuotient(half).normalized()));
    if (i >= around) {
      const std::uint32_t left = i % around == 0 ? i + around - 1 : i - 1;
      if (left < o.visual_vertices) content.visual_triangles.push_back({i, left, i - around});
    }
    std::array<int, 3> cell{};
    for (int a = 0; a < 3; ++a) {
      cell[std::size_t(a)] = std::clamp(int((x[a] - low[a]) / spacing), 0, grid.size[std::size_t(a)] - 1);
    }
    const std::size_t first = 5 * grid.index(cell[0], cell[1], cell[2]);
    formats::BarycentricAttachment best{};
    double best_least = -1e30;
    for (std::size_t t = first; t < first + 5; ++t) {
      const auto& v = content.tetrahedra[t].vertex;
      const Vector3d d = positionOf(content, v[3]);
      Eigen::Matrix3d edges;
      for (std::size_t k = 0; k < 3; ++k) edges.col(Eigen::Index(k)) = positionOf(content, v[k]) - d;
      const Vector3d w = edges.inverse() * (x - d);
      const double least = std::min(w.minCoeff(), 1 - w.sum());
      if (least > best_least) {
        best_least = least;
        best = {std::uint32_t(t), {float(w[0]), float(w[1]), float(w[2])}};
      }
    }
    content.barycentric.push_back(best);
  }
  const formats::StringRef name = content.addText("ellipsoid");
  content.sub_meshes.push_back({name, formats::kNone, 0, std::uint32_t(content.visual_triangles.size()), 0});
}

}  // namespace

const LatticeBody& blockBody(std::uint32_t visual_vertices) {
  static std::map<std::uint32_t, LatticeBody> bodies;
  const auto found = bodies.find(visual_vertices);
  if (found != bodies.end()) return found->second;
  LatticeOptions options;
  options.visual_vertices = visual_vertices;
  return bodies.emplace(visual_vertices, makeLattice(options)).first->second;
}

LatticeBody makeLattice(const LatticeOptions& o) {
  formats::PackageContent content;
  const double spacing = 1.0 / (*std::max_element(o.points.begin(), o.points.end()) - 1);
  const Vector3d size = spacing * Vector3d(o.points[0] - 1, o.points[1] - 1, o.points[2] - 1);
  const Vector3d low = -0.5 * size;
  const std::vector<std::uint32_t> numbers = bakedOrder(o);
  content.physical_vertices.resize(numbers.size());
  double mass = 0;
  Index3 p{};
  for (p[2] = 0; p[2] < o.points[2]; ++p[2]) {
    for (p[1] = 0; p[1] < o.points[1]; ++p[1]) {
      for (p[0] = 0; p[0] < o.points[0]; ++p[0]) {
        double own = kDensity * spacing * spacing * spacing;
        for (std::size_t a = 0; a < 3; ++a) own *= p[a] == 0 || p[a] + 1 == o.points[a] ? 0.5 : 1.0;
        mass += own;
        content.physical_vertices[numbers[(p[2] * o.points[1] + p[1]) * o.points[0] + p[0]]] = {
            toFloat(low + spacing * Vector3d(p[0], p[1], p[2])), float(own)};
      }
    }
  }
  ClusterOptions options;
  options.mode = o.mode;
  options.stretch_hz = o.stretch_hz;
  options.bend_hz = o.bend_hz;
  options.twist_hz = o.twist_hz;
  std::vector<Finding> findings;
  ClusterConstants constants = clusterConstants(boxClusters(o, numbers), content.physical_vertices, options, findings);
  content.clusters = std::move(constants.clusters);
  content.memberships = std::move(constants.memberships);
  content.quadratic_moments = std::move(constants.quadratic_moments);
  addTetrahedra(o, low, spacing, numbers, content);
  const formats::StringRef name = content.addText("lattice");
  for (formats::Cluster& cluster : content.clusters) cluster.name = name;
  content.pieces.push_back({0, std::uint32_t(content.physical_vertices.size()), 0,
                            std::uint32_t(content.tetrahedra.size()), 0, std::uint32_t(content.clusters.size()), name});
  formats::PackageInfo& info = content.info;
  info.metres_per_unit = 1;
  info.bounds_min = toFloat(low);
  info.bounds_max = toFloat(-low);
  info.diagonal = float(size.norm());
  info.total_mass = float(mass);
  info.density = float(kDensity);
  info.physical_volume = info.source_volume = float(size.prod());
  info.name = info.tool_version = info.source_file = info.unit_source = name;
  info.settings_json = content.addText("{}");
  addFields(Settings{}, content);

  LatticeBody body;
  body.package = formats::writePackage(content);
  auto asset = Asset::fromMemory(body.package);
  if (!asset) {
    throw ToolError(ExitCode::system, "", "the benchmark's own body is refused: " + asset.reason(),
                    "This is a fault of sinew: please report it.");
  }
  body.asset = *asset;
  body.vertices = std::uint32_t(content.physical_vertices.size());
  body.clusters = std::uint32_t(content.clusters.size());
  body.memberships = std::uint32_t(content.memberships.size());
  body.visual_vertices = o.visual_vertices;
  return body;
}

}  // namespace sinew::tools

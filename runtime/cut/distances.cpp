// SPDX-License-Identifier: MIT
#include "runtime/cut/distances.h"

#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace sinew::cutting {
namespace {

/// Nodes around the part that its grid keeps.
constexpr double kMargin = 1.5;

/// The section at rest as a plane: distance of a place, positive outside of the part.
struct RestPlane {
  Vector3d point = Vector3d::Zero(), normal = Vector3d::Zero();
  double outside(const Vector3d& x) const { return (x - point).dot(normal); }
};

RestPlane planeOf(const Cut& cut, const PartMesh& mesh, const PartPiece& piece) {
  RestPlane plane;
  for (const SectionPoint& p : piece.section) plane.point += p.rest / double(piece.section.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const SectionPoint& p : piece.section) {
    spread += (p.rest - plane.point) * (p.rest - plane.point).transpose();
  }
  plane.normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  // Away from what the part has.
  double inside = 0;
  for (std::uint32_t i = piece.first; i < piece.first + piece.count; ++i) {
    if (mesh.own[i] == 0) continue;
    const Vector3d x = asVector(cut.package.physicalVertices()[mesh.vertices[i]].rest_position);
    inside += double(mesh.masses[i]) * plane.outside(x);
  }
  if (inside > 0) plane.normal = -plane.normal;
  return plane;
}

/// Marks the nodes of a grid that tetrahedra of the part cover.
std::vector<char> coveredBy(const Cut& cut, const PartMesh& mesh, const PartPiece& piece,
                            const formats::DistanceGrid& grid) {
  std::vector<char> covered(std::size_t(grid.nodes[0]) * grid.nodes[1] * grid.nodes[2], 0);
  const Vector3d origin = asVector(grid.origin);
  for (std::uint32_t i = piece.first_tetrahedron; i < piece.first_tetrahedron + piece.tetrahedron_count; ++i) {
    const auto& corners = cut.package.tetrahedra()[mesh.tetrahedra[i].source].vertex;
    std::array<Vector3d, 4> at;
    Vector3d low = Vector3d::Constant(1e300), high = -low;
    for (std::size_t k = 0; k < 4; ++k) {
      at[k] = (asVector(cut.package.physicalVertices()[corners[k]].rest_position) - origin) / double(grid.spacing);
      low = low.cwiseMin(at[k]);
      high = high.cwiseMax(at[k]);
    }
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = at[std::size_t(k)] - at[3];
    const Eigen::Matrix3d inverse = edges.inverse();
    if (!inverse.allFinite()) continue;
    std::array<std::uint32_t, 3> from = {}, to = {};
    for (std::size_t a = 0; a < 3; ++a) {
      const double most = double(grid.nodes[a]) - 1;
      from[a] = std::uint32_t(std::clamp(std::ceil(low[int(a)] - 1e-6), 0.0, most));
      to[a] = std::uint32_t(std::clamp(std::floor(high[int(a)] + 1e-6), 0.0, most));
    }
    for (std::uint32_t z = from[2]; z <= to[2]; ++z) {
      for (std::uint32_t y = from[1]; y <= to[1]; ++y) {
        for (std::uint32_t x = from[0]; x <= to[0]; ++x) {
          const Vector3d w = inverse * (Vector3d(x, y, z) - at[3]);
          if (std::min(w.minCoeff(), 1 - w.sum()) < -1e-6) continue;
          covered[(std::size_t(z) * grid.nodes[1] + y) * grid.nodes[0] + x] = 1;
        }
      }
    }
  }
  return covered;
}

void addGrid(const Cut& cut, std::uint32_t part, const PartPiece& piece, const formats::DistanceGrid& grid,
             formats::PackageContent& content) {
  const PartMesh& mesh = cut.partition.parts[part];
  const auto values = cut.package.distanceValues().subspan(grid.first_value,
                                                           std::size_t(grid.nodes[0]) * grid.nodes[1] * grid.nodes[2]);
  formats::DistanceGrid made = grid;
  made.piece = piece.piece;
  made.first_value = std::uint32_t(content.distance_values.size());
  if (cut.piece_is_whole[piece.source] != 0) {
    content.distance_values.insert(content.distance_values.end(), values.begin(), values.end());
    content.distance_grids.push_back(made);
    return;
  }
  // The nodes around what the part has.
  std::array<std::uint32_t, 3> from = {}, to = {};
  const Vector3d low = asVector(content.info.bounds_min), high = asVector(content.info.bounds_max);
  for (std::size_t a = 0; a < 3; ++a) {
    const double most = double(grid.nodes[a]) - 1, spacing = double(grid.spacing), at = double(grid.origin[a]);
    from[a] = std::uint32_t(std::clamp(std::floor((low[int(a)] - at) / spacing - kMargin), 0.0, most - 1));
    to[a] = std::uint32_t(std::clamp(std::ceil((high[int(a)] - at) / spacing + kMargin), double(from[a]) + 1, most));
    made.nodes[a] = to[a] - from[a] + 1;
    made.origin[a] = grid.origin[a] + grid.spacing * float(from[a]);
  }
  // A part smaller than a few cells has none: it does not stand for what touches it.
  const Vector3d at_least = low.array() - double(content.info.diagonal);
  if (!(2 * made.spacing <= content.info.diagonal) || (asVector(made.origin).array() < at_least.array()).any()) return;
  const bool cuts = piece.section.size() >= 3;
  const RestPlane plane = cuts ? planeOf(cut, mesh, piece) : RestPlane();
  const auto same_side = std::count_if(cut.partition.parts.begin(), cut.partition.parts.end(),
                                       [&](const PartMesh& other) { return other.side == mesh.side; });
  const std::vector<char> covered = same_side > 1 ? coveredBy(cut, mesh, piece, grid) : std::vector<char>();
  const double unit = double(grid.unit);
  for (std::uint32_t z = from[2]; z <= to[2]; ++z) {
    for (std::uint32_t y = from[1]; y <= to[1]; ++y) {
      for (std::uint32_t x = from[0]; x <= to[0]; ++x) {
        const std::size_t node = (std::size_t(z) * grid.nodes[1] + y) * grid.nodes[0] + x;
        double distance = unit * double(values[node]);
        if (cuts) {
          const Vector3d at = asVector(grid.origin) + double(grid.spacing) * Vector3d(x, y, z);
          distance = std::max(distance, plane.outside(at));
        }
        // Within another part of this side.
        if (!covered.empty() && covered[node] == 0) distance = std::abs(distance);
        content.distance_values.push_back(std::int16_t(std::clamp(std::lround(distance / unit), -32767L, 32767L)));
      }
    }
  }
  content.distance_grids.push_back(made);
}

}  // namespace

void addDistances(const Cut& cut, std::uint32_t part, const std::vector<PartPiece>& pieces,
                  formats::PackageContent& content) {
  for (const PartPiece& piece : pieces) {
    for (const formats::DistanceGrid& grid : cut.package.distanceGrids()) {
      if (grid.piece == piece.source && !content.field_points.empty()) addGrid(cut, part, piece, grid, content);
    }
  }
}

}  // namespace sinew::cutting

// SPDX-License-Identifier: MIT
#include "runtime/attach/visual_constants.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "runtime/clusters/algebra.h"

namespace sinew::internal {
namespace {

using Wide = Eigen::Vector3d;

Wide wide(const Vec3& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

// Unit length, or zero where there is no direction.
Wide unitOrZero(const Wide& v) {
  const double length = v.norm();
  return length > 1e-300 && std::isfinite(length) ? Wide(v / length) : Wide::Zero();
}

Wide crossOf(const Wide& a, const Wide& b) { return a.cross(b); }

double angleBetween(const Wide& a, const Wide& b) { return std::atan2(crossOf(a, b).norm(), a.dot(b)); }

// Part of a direction across a unit vector, of unit length, or zero.
Wide unitAcross(const Wide& direction, const Wide& n) { return unitOrZero(direction - n * n.dot(direction)); }

// From one position to another.
Wide edge(std::span<const Vec3> positions, std::uint32_t from, std::uint32_t to) {
  return wide(positions[to]) - wide(positions[from]);
}

void makeSlots(const formats::PackageView& package, VisualConstants& result) {
  const auto attachments = package.barycentric();
  Array<std::uint32_t> slot_of;
  slot_of.resize(package.tetrahedra().size(), formats::kNone);
  result.records.reserve(attachments.size());
  bool outside = false;
  for (const formats::BarycentricAttachment& attachment : attachments) {
    std::uint32_t& slot = slot_of[attachment.tetrahedron];
    if (slot == formats::kNone) {
      slot = std::uint32_t(result.corners.size());
      const auto& v = package.tetrahedra()[attachment.tetrahedron].vertex;
      result.corners.push_back({{v[0], v[1], v[2], v[3]}});
    }
    const auto& w = attachment.weight;
    result.records.push_back({{w[0], w[1], w[2]}, slot});
    outside |= w[0] < 0 || w[1] < 0 || w[2] < 0 || w[0] + w[1] + w[2] > 1;
  }
  if (!outside) return;
  result.directions.assign(result.records);
  for (AttachmentRecord& record : result.directions) {
    const float last = 1.0F - record.weight[0] - record.weight[1] - record.weight[2];
    float sum = std::clamp(last, 0.0F, 1.0F);
    for (float& weight : record.weight) {
      weight = std::clamp(weight, 0.0F, 1.0F);
      sum += weight;
    }
    for (float& weight : record.weight) weight = sum > 0 ? weight / sum : 0.25F;
  }
}

// Sources of directions: the deformation of the slots, at a physical vertex their mean by volume.
void makeSlotGradients(const formats::PackageView& package, VisualConstants& result) {
  const auto vertices = package.physicalVertices();
  result.slots_at.resize(result.corners.empty() ? 0 : vertices.size(), BlendRun{0, 0});
  Array<double> volumes, volume_at(result.slots_at.size());
  for (const SlotCorners& slot : result.corners) {
    const auto at = [&](std::size_t k) { return wide(vertices[slot.vertex[k]].rest_position); };
    Eigen::Matrix3d edges;
    edges << at(0) - at(3), at(1) - at(3), at(2) - at(3);
    const double volume = std::abs(edges.determinant());
    const Eigen::Matrix3d inverse = edges.inverse();
    SlotInverse rows = {};
    if (inverse.allFinite()) {
      for (int row = 0; row < 3; ++row) {
        for (int axis = 0; axis < 3; ++axis) rows.row[row][axis] = float(inverse(row, axis));
      }
    }
    result.inverses.push_back(rows);
    volumes.push_back(volume);
    for (const std::uint32_t v : slot.vertex) {
      ++result.slots_at[v].count;
      volume_at[v] += volume;
    }
  }
  std::uint32_t end = 0;
  for (BlendRun& run : result.slots_at) {
    run.first = end;
    end += run.count;
    run.count = 0;
  }
  result.slot_terms.resize(end);
  for (std::uint32_t slot = 0; slot < result.corners.size(); ++slot) {
    for (const std::uint32_t v : result.corners[slot].vertex) {
      BlendRun& run = result.slots_at[v];
      result.slot_terms[run.first + run.count++] = {slot, float(volumes[slot] / volume_at[v])};
    }
  }
}

// For a mesh without normals: angle-weighted mean of the faces around each vertex.
void makeNormals(const formats::PackageView& package, VisualConstants& result) {
  const auto positions = package.visualPositions();
  Array<Wide> sums(positions.size());
  for (const formats::Triangle& triangle : package.visualTriangles()) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Wide a = edge(positions, triangle[k], triangle[(k + 1) % 3]);
      const Wide b = edge(positions, triangle[k], triangle[(k + 2) % 3]);
      sums[triangle[k]] += angleBetween(a, b) * unitOrZero(crossOf(a, b));
    }
  }
  for (const Wide& sum : sums) {
    const Wide unit = unitOrZero(sum);
    result.made_normals.push_back(unit.isZero(0) ? Vec3{0, 1, 0}
                                                 : Vec3{float(unit[0]), float(unit[1]), float(unit[2])});
  }
}

void makeSubMeshRuns(const formats::PackageView& package, VisualConstants& result) {
  Array<std::uint64_t> used;
  result.first_sub_mesh_run.push_back(0);
  for (const formats::SubMesh& sub_mesh : package.subMeshes()) {
    used.clear();
    for (const formats::Triangle& triangle :
         package.visualTriangles().subspan(sub_mesh.first_triangle, sub_mesh.triangle_count)) {
      for (const std::uint32_t vertex : triangle) used.push_back(vertex);
    }
    sortAscending(used);
    used.truncate(std::size_t(std::unique(used.begin(), used.end()) - used.begin()));
    for (std::size_t i = 0; i < used.size();) {
      std::size_t end = i + 1;
      while (end < used.size() && used[end] == used[end - 1] + 1) ++end;
      result.sub_mesh_runs.push_back({std::uint32_t(used[i]), std::uint32_t(end - i)});
      i = end;
    }
    result.first_sub_mesh_run.push_back(std::uint32_t(result.sub_mesh_runs.size()));
  }
}

}  // namespace

VisualConstants makeVisualConstants(const formats::PackageView& package) {
  VisualConstants result;
  makeSlots(package, result);
  makeSlotGradients(package, result);
  if (package.visualNormals().empty()) makeNormals(package, result);
  makeSubMeshRuns(package, result);
  return result;
}

Array<std::array<float, 4>> makeTangents(const formats::PackageView& package, std::span<const Vec3> normals) {
  const auto positions = package.visualPositions();
  const auto uvs = package.visualUvs();
  // By handedness: 0 left, 1 right.
  struct Sum {
    Wide tangent = Wide::Zero();
    double angle = 0;
  };
  Array<std::array<Sum, 2>> sums(positions.size());
  for (const formats::Triangle& triangle :
       uvs.empty() ? std::span<const formats::Triangle>() : package.visualTriangles()) {
    const auto uv = [&](std::size_t k, std::size_t axis) {
      return double(uvs[triangle[k]][axis]) - double(uvs[triangle[0]][axis]);
    };
    const double area = uv(1, 0) * uv(2, 1) - uv(2, 0) * uv(1, 1);
    if (area == 0 || !std::isfinite(area)) continue;
    const Wide e1 = edge(positions, triangle[0], triangle[1]), e2 = edge(positions, triangle[0], triangle[2]);
    const Wide tangent = unitOrZero((e1 * uv(2, 1) - e2 * uv(1, 1)) * (area > 0 ? 1.0 : -1.0));
    if (tangent.isZero(0)) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t vertex = triangle[k];
      const Wide flat = unitAcross(tangent, unitOrZero(wide(normals[vertex])));
      const double angle =
          angleBetween(edge(positions, vertex, triangle[(k + 1) % 3]), edge(positions, vertex, triangle[(k + 2) % 3]));
      Sum& sum = sums[vertex][area > 0 ? 1 : 0];
      sum.tangent += angle * flat;
      sum.angle += angle;
    }
  }
  Array<std::array<float, 4>> result(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const bool right = sums[i][1].angle >= sums[i][0].angle;
    const Wide n = unitOrZero(wide(normals[i]));
    const Wide sum = sums[i][right ? 1 : 0].tangent;
    Wide tangent = unitAcross(sum, n);
    if (tangent.norm() < 0.5) {
      tangent = unitOrZero(crossOf(n, std::abs(n[0]) < 0.6 ? Wide::UnitX() : Wide::UnitZ()));
      if (tangent.isZero(0)) tangent = Wide::UnitX();
    }
    result[i] = {float(tangent[0]), float(tangent[1]), float(tangent[2]), right ? 1.0F : -1.0F};
  }
  return result;
}

}  // namespace sinew::internal

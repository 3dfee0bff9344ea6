// SPDX-License-Identifier: MIT
#include "runtime/attach/visual.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "runtime/clusters/goal.h"

namespace sinew::internal {
namespace {

// cof(A) = det(A) A^-T, also where A is singular: how areas and normals transform.
Matrix3 cofactor(const Matrix3& a) {
  Matrix3 c;
  c.col(0) = a.col(1).cross(a.col(2));
  c.col(1) = a.col(2).cross(a.col(0));
  c.col(2) = a.col(0).cross(a.col(1));
  return c;
}

void write(const StridedFloat3& stream, std::uint32_t i, const Vector3& value) {
  char* bytes = reinterpret_cast<char*>(stream.data) + std::size_t(i) * stream.stride;
  std::memcpy(bytes, value.data(), sizeof(float) * 3);
}

std::array<float, 4> barycentricWeights(const formats::BarycentricAttachment& attachment) {
  const auto& w = attachment.weight;
  return {w[0], w[1], w[2], 1.0F - w[0] - w[1] - w[2]};
}

Matrix3 visualCofactor(const Body& body, std::uint32_t vertex) {
  const formats::PackageView& package = body.package();
  Matrix3 sum = Matrix3::Zero();
  if (!package.barycentric().empty()) {
    const formats::BarycentricAttachment& attachment = package.barycentric()[vertex];
    const auto& corners = package.tetrahedra()[attachment.tetrahedron].vertex;
    const std::array<float, 4> weights = barycentricWeights(attachment);
    // Clamped: far outside its tetrahedron a normal would otherwise extrapolate the difference of neighbours.
    for (std::size_t k = 0; k < 4; ++k) sum += std::clamp(weights[k], 0.0F, 1.0F) * body.cofactors[corners[k]];
  } else if (!package.clusterAttachmentRanges().empty()) {
    const formats::ClusterAttachmentRange range = package.clusterAttachmentRanges()[vertex];
    const Vector3 rest = asVector(package.visualPositions()[vertex]);
    for (const formats::ClusterAttachment& use : package.clusterAttachments().subspan(range.first, range.count)) {
      sum += use.weight *
             cofactor(clusterGradient(package.clusters()[use.cluster], loadFrame(body.blocks, use.cluster), rest));
    }
  }
  return sum;
}

Vector3 visualNormal(const Body& body, std::uint32_t vertex) {
  const Vector3 rest = asVector(body.package().visualNormals()[vertex]);
  const Vector3 deformed = visualCofactor(body, vertex) * rest;
  const float length = deformed.norm();
  if (length > 1e-12F && std::isfinite(length)) return deformed / length;
  const float rest_length = rest.norm();  // collapsed to nothing: any direction is as good; keep the rest one
  return rest_length > 0 ? Vector3(rest / rest_length) : Vector3(Vector3::UnitY());
}

}  // namespace

Vector3 attachedPosition(const Body& body, std::uint32_t vertex, std::span<const Vec3> positions) {
  const formats::PackageView& package = body.package();
  if (!package.barycentric().empty()) {
    const formats::BarycentricAttachment& attachment = package.barycentric()[vertex];
    const auto& corners = package.tetrahedra()[attachment.tetrahedron].vertex;
    const Vector3 last = asVector(positions[corners[3]]);
    Vector3 offset = Vector3::Zero();
    for (std::size_t k = 0; k < 3; ++k) offset += attachment.weight[k] * (asVector(positions[corners[k]]) - last);
    return last + offset;
  }
  if (!package.clusterAttachmentRanges().empty()) {
    const formats::ClusterAttachmentRange range = package.clusterAttachmentRanges()[vertex];
    const Vector3 rest = asVector(package.visualPositions()[vertex]);
    Vector3 sum = Vector3::Zero();
    for (const formats::ClusterAttachment& use : package.clusterAttachments().subspan(range.first, range.count)) {
      sum += use.weight * clusterGoal(package.clusters()[use.cluster], body.rest().clusters[use.cluster],
                                      loadFrame(body.blocks, use.cluster), rest);
    }
    return sum;
  }
  return asVector(package.visualPositions()[vertex]);
}

void updateCofactors(const Body& body, std::uint32_t begin, std::uint32_t end) {
  const formats::PackageView& package = body.package();
  for (std::uint32_t i = begin; i < end; ++i) {
    const Vector3 rest = asVector(package.physicalVertices()[i].rest_position);
    Matrix3 gradient = Matrix3::Zero();
    for (const ClusterUse& use : body.rest().usesOf(i)) {
      gradient +=
          use.share * clusterGradient(package.clusters()[use.cluster], loadFrame(body.blocks, use.cluster), rest);
    }
    body.cofactors[i] = cofactor(gradient);
  }
}

void writeVisual(const Body& body, std::uint32_t begin, std::uint32_t end, const StridedFloat3& positions,
                 const StridedFloat3& normals) {
  for (std::uint32_t i = begin; i < end; ++i) {
    if (positions.data != nullptr && i < positions.count) write(positions, i, attachedPosition(body, i, body.x));
    if (normals.data != nullptr && i < normals.count) write(normals, i, visualNormal(body, i));
  }
}

}  // namespace sinew::internal

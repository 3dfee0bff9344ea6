// SPDX-License-Identifier: MIT
#include "runtime/clusters/goal.h"

#include <cmath>

namespace sinew::internal {

void updatePartRotation(const formats::PackageView& package, std::uint32_t first, std::uint32_t count,
                        std::span<ClusterBlock> blocks) {
  if (count == 0) return;
  const auto clusters = package.clusters().subspan(first, count);
  const auto component = [&](const float(&values)[8], std::size_t c) { return values[(first + c) % 8]; };
  const auto block = [&](std::size_t c) -> ClusterBlock& { return blocks[(first + c) / 8]; };
  const auto centerOf = [&](std::size_t c) {
    const ClusterBlock& b = block(c);
    return Vector3(component(b.center[0], c), component(b.center[1], c), component(b.center[2], c));
  };
  // Σ m p q^T of the part, put together from its clusters; relative to the first one's centres.
  const Vector3 reference = centerOf(0);
  double mass = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), rest_center = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (std::size_t c = 0; c < count; ++c) {
    const double m = double(clusters[c].mass), radius = double(clusters[c].radius);
    const Eigen::Vector3d at = (centerOf(c) - reference).cast<double>();
    const Eigen::Vector3d rest = (asVector(clusters[c].rest_center) - asVector(clusters[0].rest_center)).cast<double>();
    Eigen::Matrix3d a_pq;
    for (int k = 0; k < 9; ++k) a_pq.data()[k] = double(component(block(c).a_pq[k], c));
    mass += m;
    center += m * at;
    rest_center += m * rest;
    moment += m * (at * rest.transpose() + radius * radius * a_pq);
  }
  moment -= center * rest_center.transpose() / mass;
  const double scale = moment.cwiseAbs().maxCoeff();
  geometry::Quaternion rotation;
  for (std::size_t k = 0; k < 4; ++k) rotation[k] = component(block(0).part_rotation[k], 0);
  if (scale > 0 && std::isfinite(scale)) geometry::nearestRotation((moment / scale).cast<float>(), rotation);
  for (std::size_t c = 0; c < count; ++c) {
    for (std::size_t k = 0; k < 4; ++k) block(c).part_rotation[k][(first + c) % 8] = rotation[k];
  }
}

}  // namespace sinew::internal

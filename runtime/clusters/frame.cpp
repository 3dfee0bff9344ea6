// SPDX-License-Identifier: MIT
#include "runtime/clusters/frame.h"

#include "runtime/clusters/goal.h"

namespace sinew::internal {

ClusterFrame loadFrame(std::span<const ClusterBlock> blocks, std::uint32_t cluster) {
  const ClusterBlock& block = blocks[cluster / 8];
  const std::uint32_t lane = cluster % 8;
  ClusterFrame frame;
  for (int k = 0; k < 3; ++k) frame.center[k] = block.center[k][lane];
  for (std::size_t k = 0; k < 4; ++k) frame.rotation[k] = block.rotation[k][lane];
  for (int k = 0; k < 27; ++k) {
    frame.a_pq.data()[k] = block.a_pq[k][lane];
    frame.f.data()[k] = block.f[k][lane];
  }
  return frame;
}

void storeFrame(const ClusterFrame& frame, std::span<ClusterBlock> blocks, std::uint32_t cluster) {
  ClusterBlock& block = blocks[cluster / 8];
  const std::uint32_t lane = cluster % 8;
  for (int k = 0; k < 3; ++k) block.center[k][lane] = frame.center[k];
  for (std::size_t k = 0; k < 4; ++k) block.rotation[k][lane] = frame.rotation[k];
  for (int k = 0; k < 27; ++k) {
    block.a_pq[k][lane] = frame.a_pq.data()[k];
    block.f[k][lane] = frame.f.data()[k];
  }
}

void addGoal(const formats::Cluster& cluster, const ClusterRest& rest, const ClusterFrame& frame,
             const Vec3& rest_position, float weight, Vector3& sum) {
  float q[9];
  for (int k = 0; k < 3; ++k)
    q[k] = (rest_position[std::size_t(k)] - cluster.rest_center[std::size_t(k)]) / cluster.radius;
  const bool quadratic = cluster.mode == formats::ClusterMode::quadratic;
  for (int k = 0; quadratic && k < 3; ++k) {
    q[3 + k] = q[k] * q[k] - rest.mean[3 + k];
    q[6 + k] = q[k] * q[k < 2 ? k + 1 : 0] - rest.mean[6 + k];
  }
  for (int k = 0; k < 3; ++k) q[k] -= rest.mean[k];
  for (int i = 0; i < 3; ++i) {
    const auto term = [&](int k) { return cluster.radius * frame.f.data()[3 * k + i] * q[k]; };
    const float goal = frame.center[i] + (quadratic ? sumOfNine(term) : term(0) + (term(1) + term(2)));
    sum[i] += weight * goal;
  }
}

}  // namespace sinew::internal

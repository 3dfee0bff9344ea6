// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include "runtime/clusters/frame.h"
#include "runtime/load/rest_constants.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

/// Rotation of a body part from its clusters' moments, into ClusterBlock::part_rotation of each: what a cluster falls
/// back to that has lost its own. \param first, count the part's clusters.
void updatePartRotation(const formats::PackageView& package, std::uint32_t first, std::uint32_t count,
                        std::span<ClusterBlock> blocks);

/// g of eq. 4: where the cluster wants the point with rest position X. Metres, world.
inline Vector3 clusterGoal(const formats::Cluster& cluster, const ClusterRest& rest, const ClusterFrame& frame,
                           const Vector3& rest_position) {
  const Vector3 q = restOffset(cluster, rest_position);
  if (cluster.mode == formats::ClusterMode::quadratic) {
    return frame.center + cluster.radius * (frame.f * (monomials<9>(q) - rest.mean));
  }
  return frame.center + cluster.radius * (frame.f.leftCols<3>() * (q - rest.mean.head<3>()));
}

/// d g / d X at a rest position (eq. 13).
inline Matrix3 clusterGradient(const formats::Cluster& cluster, const ClusterFrame& frame,
                               const Vector3& rest_position) {
  if (cluster.mode == formats::ClusterMode::quadratic) {
    return frame.f * monomialGradient<9>(restOffset(cluster, rest_position));
  }
  return frame.f.leftCols<3>();
}

}  // namespace sinew::internal

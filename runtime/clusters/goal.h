// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include "runtime/clusters/frame.h"
#include "runtime/clusters/stiffness.h"
#include "runtime/load/rest_constants.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

/// Least and largest stretch a cluster's goal may have along any direction. Not authored limits but a guard: what is
/// squashed or mirrored past it comes back on the right side.
inline constexpr float kLeastStretch = 0.1F;
inline constexpr float kLargestStretch = 3.0F;

/// Rigid pose of a body part from its clusters' moments, into ClusterFrame::part_rotation and part_center of each: what
/// a cluster falls back to that has lost its own orientation, and all of them where the part is astray (part_astray).
/// \param first, count the part's clusters.
void updatePartPose(const formats::PackageView& package, const RestConstants& constants, std::uint32_t first,
                    std::uint32_t count, std::span<ClusterFrame> frames);

/// R, then F, from the frame's moments (docs/method.md eq. 3, 5, 8, 10, 11).
void updateFrame(const formats::Cluster& cluster, const ClusterRest& rest, const ClusterStiffness& stiffness,
                 ClusterFrame& frame);

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

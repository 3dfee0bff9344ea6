// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include "runtime/clusters/frame.h"
#include "runtime/clusters/stiffness.h"
#include "runtime/load/rest_constants.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

/// Drawn to a point a cube is 1 radius of gyration from its rest shape, to a line 0.82, flattened 0.58; a bar bent to a
/// quarter circle 0.25.
inline constexpr double kAstray = 0.85;
/// The same of single clusters, each about its own best pose, as |A_pq - R M| / tr M tells at least: 0.32 for a
/// flattened cube, 0.17 for one stretched by half. A part whose clusters are less distorted is bent, not astray.
inline constexpr double kDistorted = 0.25;
/// Passes of this length or longer, s, are too few for clusters to pass a correction on to one another: a free part
/// goes back as one as soon as it is kHardlyAstray radii of gyration from its rest shape. So does one whose heaviest
/// vertex weighs more than kUneven times its lightest: clusters hold on to one another by the masses that they share.
inline constexpr float kFewPasses = 0.02F;
inline constexpr double kHardlyAstray = 0.002;
inline constexpr float kUneven = 100;

/// Rigid pose of a body part from its clusters' moments: its rotation into ClusterBlock::part_rotation of each, what a
/// cluster falls back to that has lost its own. Where the part is far from its rest shape, ClusterBlock::astray is set
/// and centres move to where that pose has them, so that it goes back as one: all at once where it is stiff, at the
/// rate of its frequency where it is soft. \param first, count the part's clusters. \param stiffness of all clusters;
/// empty = stiff.
/// \param far how far that is: root mean square, in radii of gyration. \return whether it is that far.
bool updatePartPose(const formats::PackageView& package, const RestConstants& constants,
                    std::span<const ClusterStiffness> stiffness, std::uint32_t first, std::uint32_t count,
                    std::span<ClusterBlock> blocks, double far = kAstray);

/// sum += weight g of eq. 4: where the cluster wants the point with rest position X. Metres, world.
void addGoal(const formats::Cluster& cluster, const ClusterRest& rest, const ClusterFrame& frame,
             const Vec3& rest_position, float weight, Vector3& sum);

/// d g / d X at a rest position (eq. 13).
inline Matrix3 clusterGradient(const formats::Cluster& cluster, const ClusterFrame& frame,
                               const Vector3& rest_position) {
  if (cluster.mode == formats::ClusterMode::quadratic) {
    return frame.f * monomialGradient<9>(restOffset(cluster, rest_position));
  }
  return frame.f.leftCols<3>();
}

}  // namespace sinew::internal

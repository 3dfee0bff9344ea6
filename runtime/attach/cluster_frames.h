// SPDX-License-Identifier: MIT
//
// The transforms of clusters that best fit the current positions: overlays show them, visual vertices and normals
// follow them (docs/report.md §5, §6). Computed when drawn, never in a step.
#pragma once

#include <cstdint>
#include <span>

#include "runtime/clusters/algebra.h"
#include "runtime/load/rest_constants.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

/// The transform of a cluster: X goes to center + radius * f * q~.
struct ClusterFrame {
  Vector3 center = Vector3::Zero();        ///< c, metres
  Matrix3 rotation = Matrix3::Identity();  ///< R
  Columns<9> f = Columns<9>::Zero();       ///< F; columns 3.. only if quadratic
};

/// F is A of the match, R in directions that the rest shape lacks, and R where A would turn the cluster inside out or
/// flat. \param rest of the clusters. \param positions of all physical vertices, finite.
ClusterFrame fitCluster(const formats::PackageView& package, std::span<const ClusterRest> rest,
                        std::span<const Vec3> positions, std::uint32_t cluster);

}  // namespace sinew::internal

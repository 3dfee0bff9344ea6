// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include "runtime/clusters/algebra.h"
#include "runtime/geometry/rotation.h"
#include "runtime/kernels/layout.h"

namespace sinew::internal {

/// One cluster's part of a ClusterBlock, by itself: what the solver of rows works on. The transform that gives its
/// goals is g = center + radius * f * q~.
struct ClusterFrame {
  Vector3 center = Vector3::Zero();                               ///< c, metres
  geometry::Quaternion rotation = geometry::kIdentityQuaternion;  ///< R
  Columns<9> a_pq = Columns<9>::Zero();  ///< Σ mu p q~^T with p = (x - c) / radius; columns 3.. only if quadratic
  Columns<9> f = Columns<9>::Zero();     ///< F; columns 3.. only if quadratic
};

ClusterFrame loadFrame(std::span<const ClusterBlock> blocks, std::uint32_t cluster);
void storeFrame(const ClusterFrame& frame, std::span<ClusterBlock> blocks, std::uint32_t cluster);

}  // namespace sinew::internal

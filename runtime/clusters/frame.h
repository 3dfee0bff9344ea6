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

inline ClusterFrame loadFrame(std::span<const ClusterBlock> blocks, std::uint32_t cluster) {
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

inline void storeFrame(const ClusterFrame& frame, std::span<ClusterBlock> blocks, std::uint32_t cluster) {
  ClusterBlock& block = blocks[cluster / 8];
  const std::uint32_t lane = cluster % 8;
  for (int k = 0; k < 3; ++k) block.center[k][lane] = frame.center[k];
  for (std::size_t k = 0; k < 4; ++k) block.rotation[k][lane] = frame.rotation[k];
  for (int k = 0; k < 27; ++k) {
    block.a_pq[k][lane] = frame.a_pq.data()[k];
    block.f[k][lane] = frame.f.data()[k];
  }
}

}  // namespace sinew::internal

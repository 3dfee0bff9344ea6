// SPDX-License-Identifier: MIT
//
// What each cluster asks of each of its members (docs/method.md eq. 4). For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/layout.h"
#include "runtime/kernels/moments.h"
#include "runtime/kernels/shuffles.h"

namespace sinew::internal::SINEW_KERNELS {

/// Writes share alpha (g - y) of every member of eight clusters into its slot, xyz0: slot = 8 * member block + lane.
template <bool quadratic>
SINEW_INLINE void goals(const ClusterRestBlock& rest, const MemberBlock* members, const StiffnessBlock& stiffness,
                        const ClusterBlock& state, const float* y, float* slots) {
  for (std::uint32_t lane = 0; lane < 8; ++lane) {
    const std::uint32_t count = rest.block_count[lane];
    if (count == 0) continue;
    const float radius = rest.radius[lane], alpha = stiffness.alpha[lane];
    Float8 f[quadratic ? 27 : 9], mean[quadratic ? 9 : 3];
    for (int k = 0; k < (quadratic ? 27 : 9); ++k) f[k] = splat<Float8>(radius * state.f[k][lane]);
    for (int k = 0; k < (quadratic ? 9 : 3); ++k) mean[k] = splat<Float8>(rest.mean[k][lane]);
    const Vec3Of<Float8> center = {splat<Float8>(state.center[0][lane]), splat<Float8>(state.center[1][lane]),
                                   splat<Float8>(state.center[2][lane])};
    for (std::uint32_t b = 0; b < count; ++b) {
      const MemberBlock& block = members[rest.first_block[lane] + b];
      const Vec3Of<Float8> start = gatherTriples(y, block.vertex);
      const Float8 qx = load8(block.q[0]), qy = load8(block.q[1]), qz = load8(block.q[2]);
      Float8 q[9] = {qx, qy, qz, {}, {}, {}, {}, {}, {}};
      if constexpr (quadratic) {
        Float8 second[6];
        squares(qx, qy, qz, second);
        for (int k = 0; k < 6; ++k) q[3 + k] = second[k];
      }
      Vec3Of<Float8> move = center - start;
      for (int k = 0; k < (quadratic ? 9 : 3); ++k) {
        const Float8 value = q[k] - mean[k];
        move.x += f[3 * k] * value;
        move.y += f[3 * k + 1] * value;
        move.z += f[3 * k + 2] * value;
      }
      const Float8 share = alpha * load8(block.share);
      storeQuadruples(slots + 32 * std::uint64_t(rest.first_block[lane] + b), share * move);
    }
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

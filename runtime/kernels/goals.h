// SPDX-License-Identifier: MIT
//
// What each cluster asks of each of its members (docs/method.md eq. 4). For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/members.h"

namespace sinew::internal::SINEW_KERNELS {

template <bool quadratic, class W>
struct GoalTransform {
  W f[quadratic ? 27 : 9];  // times the radius
  W mean[quadratic ? 9 : 3];
  W offset[3];  // centre - reference
  W alpha;

  GoalTransform(const ClusterRestBlock& rest, const StiffnessBlock& stiffness, const ClusterBlock& state,
                std::uint32_t lane) {
    const float radius = rest.radius[lane];
    SINEW_UNROLL for (int k = 0; k < (quadratic ? 27 : 9); ++k) f[k] = splat<W>(radius * state.f[k][lane]);
    SINEW_UNROLL for (int k = 0; k < (quadratic ? 9 : 3); ++k) mean[k] = splat<W>(rest.mean[k][lane]);
    for (int k = 0; k < 3; ++k) offset[k] = splat<W>(state.center[k][lane] - state.reference[k][lane]);
    alpha = splat<W>(stiffness.alpha[lane]);
  }

  SINEW_INLINE void ask(const MemberBlock* block, float* slots) const {
    const W qx = loadRest<W>(block, 0), qy = loadRest<W>(block, 1), qz = loadRest<W>(block, 2);
    W q[9] = {qx, qy, qz, {}, {}, {}, {}, {}, {}};
    if constexpr (quadratic) {
      W second[6];
      squares<W>(qx, qy, qz, second);
      for (int k = 0; k < 6; ++k) q[3 + k] = second[k];
    }
    Vec3Of<W> move = Vec3Of<W>{offset[0], offset[1], offset[2]} - loadMoves<W>(slots);
    SINEW_UNROLL for (int k = 0; k < (quadratic ? 9 : 3); ++k) {
      const W value = q[k] - mean[k];
      move.x += f[3 * k] * value;
      move.y += f[3 * k + 1] * value;
      move.z += f[3 * k + 2] * value;
    }
    const W share = alpha * loadMembers<W>(block, &MemberBlock::share);
    storeSlots(slots, share * move);
  }
};

/// Writes share alpha (g - y) of every member of eight clusters into its slot, xyz0: slot = 8 * member block + lane.
/// Takes y - reference from there, where moments left it.
template <bool quadratic>
SINEW_INLINE void goals(const ClusterRestBlock& rest, const MemberBlock* members, const StiffnessBlock& stiffness,
                        const ClusterBlock& state, float* slots) {
  for (std::uint32_t lane = 0; lane < 8; ++lane) {
    const std::uint32_t count = rest.block_count[lane];
    if (count == 0) continue;
    const MemberBlock* blocks = members + rest.first_block[lane];
    float* const at = slots + kSlotFloats * rest.first_block[lane];
    std::uint32_t b = 0;
#if defined(__AVX512F__)
    if (count > 1) {
      const GoalTransform<quadratic, Float16> transform(rest, stiffness, state, lane);
      for (; b + 1 < count; b += 2) transform.ask(blocks + b, at + kSlotFloats * b);
    }
#endif
    if (b < count) {
      const GoalTransform<quadratic, Float8> transform(rest, stiffness, state, lane);
      for (; b < count; ++b) transform.ask(blocks + b, at + kSlotFloats * b);
    }
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

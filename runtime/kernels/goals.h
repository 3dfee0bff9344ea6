// SPDX-License-Identifier: MIT
//
// What each cluster asks of each of its members (docs/method.md eq. 4). For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/members.h"

namespace sinew::internal::SINEW_KERNELS {

/// What the goals of eight clusters are made of, ready to be spread over lanes.
template <bool quadratic>
struct GoalTransforms {
  static constexpr std::uint32_t kColumns = quadratic ? 9 : 3;
  float f[3 * kColumns][8];  ///< times the radius
  float offset[3][8];        ///< centre - reference

  GoalTransforms(const ClusterRestBlock& rest, const ClusterBlock& state) {
    const Float8 radius = load8(rest.radius);
    for (std::uint32_t k = 0; k < 3 * kColumns; ++k) store8(f[k], radius * load8(state.f[k]));
    for (int k = 0; k < 3; ++k) store8(offset[k], load8(state.center[k]) - load8(state.reference[k]));
  }

  /// share alpha (g - y) of the members of a block (two, where W holds two) of cluster `lane`.
  template <class W>
  SINEW_INLINE void ask(const ClusterRestBlock& rest, float alpha, std::uint32_t lane, const MemberBlock* block,
                        float* slots) const {
    const W qx = loadRest<W>(block, 0), qy = loadRest<W>(block, 1), qz = loadRest<W>(block, 2);
    W q[9] = {qx, qy, qz, {}, {}, {}, {}, {}, {}};
    if constexpr (quadratic) {
      W second[6];
      squares<W>(qx, qy, qz, second);
      for (int k = 0; k < 6; ++k) q[3 + k] = second[k];
    }
    Vec3Of<W> move = Vec3Of<W>{splat<W>(offset[0][lane]), splat<W>(offset[1][lane]), splat<W>(offset[2][lane])} -
                     loadMoves<W>(slots);
    SINEW_UNROLL for (std::uint32_t k = 0; k < kColumns; ++k) {
      const W value = q[k] - splat<W>(rest.mean[k][lane]);
      move.x += splat<W>(f[3 * k][lane]) * value;
      move.y += splat<W>(f[3 * k + 1][lane]) * value;
      move.z += splat<W>(f[3 * k + 2][lane]) * value;
    }
    const W share = splat<W>(alpha) * loadMembers<W>(block, &MemberBlock::share);
    storeSlots(slots, share * move);
  }
};

/// Writes share alpha (g - y) of every member of eight clusters into its slot, xyz0: slot = 8 * member block + lane.
/// Takes y - reference from there, where moments left it.
template <bool quadratic>
SINEW_INLINE void goals(const ClusterRestBlock& rest, const MemberBlock* members, const StiffnessBlock& stiffness,
                        const ClusterBlock& state, float* slots) {
  const GoalTransforms<quadratic> transforms(rest, state);
  for (std::uint32_t lane = 0; lane < 8; ++lane) {
    const std::uint32_t count = rest.block_count[lane];
    const MemberBlock* blocks = members + rest.first_block[lane];
    float* const at = slots + kSlotFloats * rest.first_block[lane];
    const float alpha = stiffness.alpha[lane];
    std::uint32_t b = 0;
#if defined(__AVX512F__)
    for (; b + 1 < count; b += 2) {
      transforms.template ask<Float16>(rest, alpha, lane, blocks + b, at + kSlotFloats * b);
    }
#endif
    for (; b < count; ++b) transforms.template ask<Float8>(rest, alpha, lane, blocks + b, at + kSlotFloats * b);
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

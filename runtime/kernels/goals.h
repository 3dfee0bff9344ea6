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
  float offset[3][8];        ///< centre - reference - F mean

  GoalTransforms(const ClusterRestBlock& rest, const ClusterBlock& state) {
    const Float8 radius = load8(rest.radius);
    Float8 from[3];
    for (int k = 0; k < 3; ++k) from[k] = load8(state.center[k]) - load8(state.reference[k]);
    for (std::uint32_t k = 0; k < 3 * kColumns; ++k) {
      const Float8 scaled = radius * load8(state.f[k]);
      store8(f[k], scaled);
      from[k % 3] -= scaled * load8(rest.mean[k / 3]);
    }
    for (int k = 0; k < 3; ++k) store8(offset[k], from[k]);
  }

  /// share alpha (g - y) of members of cluster `lane`.
  template <class W>
  SINEW_INLINE void ask(float alpha, std::uint32_t lane, const MembersAt<W>& members, float* slots, float* run_slots,
                        bool run) const {
    const W qx = members.rest(0), qy = members.rest(1), qz = members.rest(2);
    W q[9] = {qx, qy, qz, {}, {}, {}, {}, {}, {}};
    if constexpr (quadratic) {
      W second[6];
      squares<W>(qx, qy, qz, second);
      SINEW_UNROLL for (int k = 0; k < 6; ++k) q[3 + k] = second[k];
    }
    Vec3Of<W> move = Vec3Of<W>{splat<W>(offset[0][lane]), splat<W>(offset[1][lane]), splat<W>(offset[2][lane])} -
                     loadMoves<W>(slots);
    SINEW_UNROLL for (std::uint32_t k = 0; k < kColumns; ++k) {
      move.x += splat<W>(f[3 * k][lane]) * q[k];
      move.y += splat<W>(f[3 * k + 1][lane]) * q[k];
      move.z += splat<W>(f[3 * k + 2][lane]) * q[k];
    }
    const W share = splat<W>(alpha) * members.field(kMemberShare);
    storeSlots(slots, run_slots, share * move, run);
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
    const std::uint32_t* words = members[rest.first_block[lane]].words;
    float* at = slots + kSlotFloats * rest.first_block[lane];
    const float alpha = stiffness.alpha[lane];
    const std::uint32_t runs = rest.run_count[lane];
#if defined(__AVX512F__)
    if (count == 1) transforms.ask(alpha, lane, MembersAt<Float8>{words, 8}, at, at, runs != 0);
    for (std::uint32_t b = 0; b + 1 < count; b += 2, words += kPairWords, at += kPairSlotFloats) {
      transforms.ask(alpha, lane, MembersAt<Float16>{words, 16}, at, at, b < runs);
    }
#else
    const std::uint32_t stride = count == 1 ? 8 : 16;
    for (std::uint32_t b = 0; b < count; b += 2, words += kPairWords, at += kPairSlotFloats) {
      for (std::uint32_t half = 0; half < stride / 8; ++half) {
        transforms.ask(alpha, lane, MembersAt<Float8>{words + 8 * half, stride}, at + kSlotFloats * half,
                       at + kRunFloats * half, b < runs);
      }
    }
#endif
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

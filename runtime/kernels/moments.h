// SPDX-License-Identifier: MIT
//
// c = Σ mu x and A_pq = Σ mu p q~^T of eight clusters (docs/method.md eq. 1, 2). For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/members.h"

namespace sinew::internal::SINEW_KERNELS {

constexpr std::uint32_t kTile =
    16;  // member blocks of either parity whose mu p stay at hand between the sweeps over columns

// One column of Σ mu p q~^T: a block's share of it.
template <class W>
SINEW_INLINE void addColumn(const W (&p)[3], W q, W* sums) {
  SINEW_UNROLL for (int row = 0; row < 3; ++row) sums[row] += p[row] * q;
}

// p = y - reference of members, to their slots; mu p.
template <class W>
SINEW_INLINE void weighMembers(const MembersAt<W>& members, const float* y, const Vec3Of<W>& origin, float* slots,
                               W (&weighted)[3]) {
  const Vec3Of<W> p = gatherMembers(y, members) - origin;
  storeMoves(slots, p);
  const W mu = members.field(kMemberMu);
  weighted[0] = mu * p.x;
  weighted[1] = mu * p.y;
  weighted[2] = mu * p.z;
}

// Sums of a block's lanes, and what was there already. Of a pair: the first block's and the second's.
SINEW_INLINE void leaveSum(float* out, Float8 sum, bool add) { store8(out, add ? load8(out) + sum : sum); }
#if defined(__AVX512F__)
SINEW_INLINE void leaveSum(float* out, Float16 sum, bool) { store8(out, lowHalf(sum) + highHalf(sum)); }
#endif

/// Σ mu p and Σ mu p q^T, column by column, over `count` pairs of blocks or one of their halves, lane by lane: sum k to
/// sums + 64 k, or added to it. p = y - reference goes to the slots. What a sum is made of and in which order does not
/// depend on how the work is cut below: blocks of even number, blocks of odd number, then both.
template <bool quadratic, class W>
SINEW_INLINE void sweepInline(MembersAt<W> members, std::uint32_t count, const float* y, const float* reference,
                              float* slots, float* result, bool add) {
  constexpr std::uint32_t kSums = quadratic ? 30 : 12;
  W sums[kSums];
  SINEW_UNROLL for (std::uint32_t k = 0; k < kSums; ++k) sums[k] = W{};
  const Vec3Of<W> origin = {splat<W>(reference[0]), splat<W>(reference[1]), splat<W>(reference[2])};
#if defined(__AVX512F__)
  constexpr bool at_once = true;  // 32 registers hold all sums
#else
  constexpr bool at_once = !quadratic;
#endif
  if (at_once || count <= 1) {
    for (std::uint32_t b = 0; b < count; ++b, members.words += kPairWords, slots += kPairSlotFloats) {
      W p[3];
      weighMembers<W>(members, y, origin, slots, p);
      SINEW_UNROLL for (int row = 0; row < 3; ++row) sums[row] += p[row];
      W q[3];
      SINEW_UNROLL for (int k = 0; k < 3; ++k) {
        q[k] = members.rest(k);
        addColumn(p, q[k], sums + 3 + 3 * k);
      }
      if constexpr (quadratic) {
        SINEW_UNROLL for (int k = 0; k < 3; ++k) addColumn(p, W(q[k] * q[k]), sums + 12 + 3 * k);
        SINEW_UNROLL for (int k = 0; k < 3; ++k) { addColumn(p, W(q[k] * q[k == 2 ? 0 : k + 1]), sums + 21 + 3 * k); }
      }
    }
  } else if constexpr (quadratic) {
    // Column by column over a tile, so that each sweep keeps its sums in registers.
    W p[kTile][3];
    for (std::uint32_t first = 0; first < count; first += kTile) {
      const std::uint32_t size = count - first < kTile ? count - first : kTile;
      MembersAt<W> at = members;
      for (std::uint32_t t = 0; t < size; ++t, at.words += kPairWords, slots += kPairSlotFloats) {
        weighMembers<W>(at, y, origin, slots, p[t]);
        SINEW_UNROLL for (int row = 0; row < 3; ++row) sums[row] += p[t][row];
        SINEW_UNROLL for (int k = 0; k < 3; ++k) addColumn(p[t], at.rest(k), sums + 3 + 3 * k);
      }
      SINEW_UNROLL for (int k = 0; k < 3; ++k) {
        at = members;
        for (std::uint32_t t = 0; t < size; ++t, at.words += kPairWords) {
          const W u = at.rest(k), v = at.rest(k == 2 ? 0 : k + 1);
          addColumn(p[t], W(u * u), sums + 12 + 3 * k);
          addColumn(p[t], W(u * v), sums + 21 + 3 * k);
        }
      }
      members = at;
    }
  }
  SINEW_UNROLL for (std::uint32_t k = 0; k < kSums; ++k) leaveSum(result + 64 * k, sums[k], add);
}

// Nine columns are much code, which is not inlined everywhere; three are little work, which a call would slow down.
template <class W>
SINEW_APART static void sweepNine(MembersAt<W> members, std::uint32_t count, const float* y, const float* reference,
                                  float* slots, float* sums, bool add) {
  sweepInline<true, W>(members, count, y, reference, slots, sums, add);
}
template <bool quadratic, class W>
SINEW_INLINE void sweepMoments(MembersAt<W> members, std::uint32_t count, const float* y, const float* reference,
                               float* slots, float* sums, bool add) {
  if constexpr (quadratic) {
    sweepNine<W>(members, count, y, reference, slots, sums, add);
  } else {
    sweepInline<false, W>(members, count, y, reference, slots, sums, add);
  }
}

template <bool quadratic>
SINEW_INLINE void moments(const ClusterRestBlock& rest, const MemberBlock* members, const float* y, ClusterBlock& state,
                          float* slots) {
  constexpr std::uint32_t kSums = quadratic ? 30 : 12;
  alignas(64) float sums[kSums][8][8];  // of each cluster, eight partial sums
  float references[3][8];
  for (std::uint32_t lane = 0; lane < 8; ++lane) {
    const std::uint32_t count = rest.block_count[lane];
    float* const own = sums[0][lane];
    if (count == 0) {
      for (std::uint32_t k = 0; k < kSums; ++k) store8(own + 64 * k, Float8{});
      for (int k = 0; k < 3; ++k) references[k][lane] = 0.0F;
      continue;
    }
    const std::uint32_t* words = members[rest.first_block[lane]].words;
    float* const at = slots + kSlotFloats * rest.first_block[lane];
    // Relative to a member, not to the world's origin: far from the origin the differences are what floats still hold.
    const float* reference = y + words[kMemberOffset];
    for (int k = 0; k < 3; ++k) references[k][lane] = reference[k];
    if (count == 1) {
      sweepMoments<quadratic>(MembersAt<Float8>{words, 8}, 1, y, reference, at, own, false);
      continue;
    }
#if defined(__AVX512F__)
    sweepMoments<quadratic>(MembersAt<Float16>{words, 16}, count / 2, y, reference, at, own, false);
#else
    sweepMoments<quadratic>(MembersAt<Float8>{words, 16}, count / 2, y, reference, at, own, false);
    sweepMoments<quadratic>(MembersAt<Float8>{words + 8, 16}, count / 2, y, reference, at + kSlotFloats, own, true);
#endif
  }
  const auto sum = [&](std::uint32_t k) {
    Float8 eight[8];
    SINEW_UNROLL for (std::uint32_t lane = 0; lane < 8; ++lane) eight[lane] = load8(sums[k][lane]);
    return sumEach(eight);
  };
  const Float8 inverse_radius = 1.0F / load8(rest.radius);
  Float8 first[3];
  SINEW_UNROLL for (std::uint32_t k = 0; k < 3; ++k) {
    first[k] = sum(k);
    store8(state.reference[k], load8(references[k]));
    store8(state.center[k], load8(references[k]) + first[k]);
  }
  // About the centre, and about the mean of q~.
  SINEW_ROLLED for (std::uint32_t k = 0; k < (quadratic ? 9 : 3); ++k) {
    SINEW_UNROLL for (std::uint32_t row = 0; row < 3; ++row) {
      const Float8 centred = sum(3 + 3 * k + row) - load8(rest.mean[k]) * first[row];
      store8(state.a_pq[3 * k + row], centred * inverse_radius);
    }
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

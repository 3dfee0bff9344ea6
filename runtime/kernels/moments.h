// SPDX-License-Identifier: MIT
//
// c = Σ mu x and A_pq = Σ mu p q~^T of eight clusters (docs/method.md eq. 1, 2). For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/members.h"

namespace sinew::internal::SINEW_KERNELS {

constexpr std::uint32_t kTile = 16;  // member blocks whose mu p stay at hand between the sweeps over columns

// One column of Σ mu p q~^T: a block's share of it.
template <class W>
SINEW_INLINE void addColumn(const W (&p)[3], W q, W* sums) {
  for (int row = 0; row < 3; ++row) sums[row] += p[row] * q;
}

// p = y - reference of one block, to its slots; mu p.
template <class W>
SINEW_INLINE void weighMembers(const MemberBlock* block, const float* y, const Vec3Of<W>& origin, float* slots,
                               W (&weighted)[3]) {
  const Vec3Of<W> p = gatherMembers<W>(y, block) - origin;
  storeMoves(slots, p);
  const W mu = loadMembers<W>(block, &MemberBlock::mu);
  weighted[0] = mu * p.x;
  weighted[1] = mu * p.y;
  weighted[2] = mu * p.z;
}

/// Σ mu p into sums[0..2] and Σ mu p q~^T, column by column, into sums[3..], over blocks 0, step, 2 step, ... (two at a
/// time where W holds two; then step is 2); p = y - reference goes to the slots. What a sum is made of and in which
/// order does not depend on how the work is cut below.
template <bool quadratic, class W>
SINEW_INLINE void sweepInline(const MemberBlock* blocks, std::uint32_t count, std::uint32_t step, const float* y,
                              const float (&reference)[3], const float (&mean)[9], float* slots,
                              W (&result)[quadratic ? 30 : 12]) {
  constexpr std::uint32_t kSums = quadratic ? 30 : 12;
  W sums[kSums];  // in registers, which what `result` refers to could not be: slots are written between
  SINEW_UNROLL for (std::uint32_t k = 0; k < kSums; ++k) sums[k] = W{};
  const Vec3Of<W> origin = {splat<W>(reference[0]), splat<W>(reference[1]), splat<W>(reference[2])};
#if defined(__AVX512F__)
  constexpr bool at_once = true;  // 32 registers hold all sums
#else
  constexpr bool at_once = !quadratic;
#endif
  if (at_once || count <= step) {
    for (std::uint32_t b = 0; b < count; b += step) {
      W p[3];
      weighMembers<W>(blocks + b, y, origin, slots + kSlotFloats * b, p);
      for (int row = 0; row < 3; ++row) sums[row] += p[row];
      W q[3];
      for (int k = 0; k < 3; ++k) {
        q[k] = loadRest<W>(blocks + b, k);
        addColumn(p, W(q[k] - mean[k]), sums + 3 + 3 * k);
      }
      if constexpr (quadratic) {
        for (int k = 0; k < 3; ++k) addColumn(p, W(q[k] * q[k] - mean[3 + k]), sums + 12 + 3 * k);
        for (int k = 0; k < 3; ++k) addColumn(p, W(q[k] * q[k == 2 ? 0 : k + 1] - mean[6 + k]), sums + 21 + 3 * k);
      }
    }
    SINEW_UNROLL for (std::uint32_t k = 0; k < kSums; ++k) result[k] = sums[k];
    return;
  }
  // Column by column over a tile, so that each sweep keeps its sums in registers.
  if constexpr (quadratic) {
    W p[kTile][3];
    for (std::uint32_t first = 0; first < count; first += kTile * step) {
      const std::uint32_t end = count - first < kTile * step ? count : first + kTile * step;
      for (std::uint32_t b = first, t = 0; b < end; b += step, ++t) {
        weighMembers<W>(blocks + b, y, origin, slots + kSlotFloats * b, p[t]);
        for (int row = 0; row < 3; ++row) sums[row] += p[t][row];
        for (int k = 0; k < 3; ++k) addColumn(p[t], W(loadRest<W>(blocks + b, k) - mean[k]), sums + 3 + 3 * k);
      }
      for (int k = 0; k < 3; ++k) {
        for (std::uint32_t b = first, t = 0; b < end; b += step, ++t) {
          const W u = loadRest<W>(blocks + b, k), v = loadRest<W>(blocks + b, k == 2 ? 0 : k + 1);
          addColumn(p[t], W(u * u - mean[3 + k]), sums + 12 + 3 * k);
          addColumn(p[t], W(u * v - mean[6 + k]), sums + 21 + 3 * k);
        }
      }
    }
    SINEW_UNROLL for (std::uint32_t k = 0; k < kSums; ++k) result[k] = sums[k];
  }
}

// Nine columns are much code, which is not inlined everywhere; three are little work, which a call would slow down.
template <class W>
[[gnu::noinline]] static void sweepNine(const MemberBlock* blocks, std::uint32_t count, std::uint32_t step,
                                        const float* y, const float (&reference)[3], const float (&mean)[9],
                                        float* slots, W (&result)[30]) {
  sweepInline<true, W>(blocks, count, step, y, reference, mean, slots, result);
}
template <bool quadratic, class W>
SINEW_INLINE void sweepMoments(const MemberBlock* blocks, std::uint32_t count, std::uint32_t step, const float* y,
                               const float (&reference)[3], const float (&mean)[9], float* slots,
                               W (&result)[quadratic ? 30 : 12]) {
  if constexpr (quadratic) {
    sweepNine<W>(blocks, count, step, y, reference, mean, slots, result);
  } else {
    sweepInline<false, W>(blocks, count, step, y, reference, mean, slots, result);
  }
}

/// The canonical order, whatever the registers: blocks of even number are summed, blocks of odd number are summed, then
/// both sums are added.
template <bool quadratic>
SINEW_INLINE void sumMoments(const MemberBlock* blocks, std::uint32_t count, const float* y,
                             const float (&reference)[3], const float (&mean)[9], float* slots, Float8 (&sums)[32]) {
  constexpr std::uint32_t kSums = quadratic ? 30 : 12;
#if defined(__AVX512F__)
  const std::uint32_t paired = count & ~1U;
  if (paired == 0) {
    Float8 only[kSums];
    sweepMoments<quadratic, Float8>(blocks, 1, 1, y, reference, mean, slots, only);
    SINEW_UNROLL for (std::uint32_t k = 0; k < kSums; ++k) sums[k] = only[k];
  } else {
    Float16 both[kSums];
    sweepMoments<quadratic, Float16>(blocks, paired, 2, y, reference, mean, slots, both);
    if (paired == count) {
      SINEW_UNROLL for (std::uint32_t k = 0; k < kSums; ++k) sums[k] = lowHalf(both[k]) + highHalf(both[k]);
    } else {
      Float8 last[kSums];
      sweepMoments<quadratic, Float8>(blocks + paired, 1, 1, y, reference, mean, slots + kSlotFloats * paired, last);
      SINEW_UNROLL for (std::uint32_t k = 0; k < kSums; ++k) {
        sums[k] = (lowHalf(both[k]) + last[k]) + highHalf(both[k]);
      }
    }
  }
#else
  Float8 even[kSums];
  sweepMoments<quadratic, Float8>(blocks, count, 2, y, reference, mean, slots, even);
  if (count > 1) {
    Float8 odd[kSums];
    sweepMoments<quadratic, Float8>(blocks + 1, count - 1, 2, y, reference, mean, slots + kSlotFloats, odd);
    SINEW_UNROLL for (std::uint32_t k = 0; k < kSums; ++k) sums[k] = even[k] + odd[k];
  } else {
    SINEW_UNROLL for (std::uint32_t k = 0; k < kSums; ++k) sums[k] = even[k];
  }
#endif
  for (std::uint32_t k = kSums; k < 32; ++k) sums[k] = Float8{};
}

template <bool quadratic>
SINEW_INLINE void moments(const ClusterRestBlock& rest, const MemberBlock* members, const float* y, ClusterBlock& state,
                          float* slots) {
  constexpr int kSums = quadratic ? 30 : 12, kGroups = (kSums + 7) / 8;
  // By cluster, then transposed to lanes.
  Float8 rows[std::uint32_t(kGroups)][8];
  float references[3][8];
  for (std::uint32_t lane = 0; lane < 8; ++lane) {
    const std::uint32_t count = rest.block_count[lane];
    if (count == 0) {
      for (int g = 0; g < kGroups; ++g) rows[g][lane] = Float8{};
      for (int k = 0; k < 3; ++k) references[k][lane] = 0.0F;
      continue;
    }
    const MemberBlock* blocks = members + rest.first_block[lane];
    // Relative to a member, not to the world's origin: far from the origin the differences are what floats still hold.
    const float* first = y + blocks[0].offset[0];
    const float reference[3] = {first[0], first[1], first[2]};
    for (int k = 0; k < 3; ++k) references[k][lane] = reference[k];
    float mean[9] = {};
    for (int k = 0; k < (quadratic ? 9 : 3); ++k) mean[k] = rest.mean[k][lane];
    Float8 sums[32];
    sumMoments<quadratic>(blocks, count, y, reference, mean, slots + kSlotFloats * rest.first_block[lane], sums);
    SINEW_UNROLL for (int g = 0; g < kGroups; ++g) {
      const Float8 eight[8] = {sums[8 * g],     sums[8 * g + 1], sums[8 * g + 2], sums[8 * g + 3],
                               sums[8 * g + 4], sums[8 * g + 5], sums[8 * g + 6], sums[8 * g + 7]};
      rows[g][lane] = sumEach(eight);
    }
  }
  SINEW_UNROLL for (int g = 0; g < kGroups; ++g) transpose(rows[g]);
  const auto sum = [&](int k) { return rows[k / 8][k % 8]; };
  const Float8 inverse_radius = 1.0F / load8(rest.radius);
  for (int k = 0; k < 3; ++k) {
    store8(state.reference[k], load8(references[k]));
    store8(state.center[k], load8(references[k]) + sum(k));
  }
  // About the centre: Σ mu q~ is zero but for the rounding of its floats.
  SINEW_UNROLL for (int k = 0; k < (quadratic ? 27 : 9); ++k) store8(state.a_pq[k], sum(3 + k) * inverse_radius);
}

}  // namespace sinew::internal::SINEW_KERNELS

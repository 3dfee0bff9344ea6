// SPDX-License-Identifier: MIT
//
// c = Σ mu x and A_pq = Σ mu p q~^T of eight clusters (docs/method.md eq. 1, 2). For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/members.h"

namespace sinew::internal::SINEW_KERNELS {

// Pairs of member blocks whose mu p stay at hand between the sweeps over columns.
constexpr std::uint32_t kTile = 32;

// Lanes that sums are taken in: four of SSE's registers hold more of them than pairs.
#if defined(__AVX__)
using SumLanes = Float8;
#else
using SumLanes = Float4;
#endif

// One column of Σ mu p q~^T: a block's share of it.
template <class W>
SINEW_INLINE void addColumn(const W (&p)[3], W q, W* sums) {
  SINEW_UNROLL for (int row = 0; row < 3; ++row) sums[row] += p[row] * q;
}

// p = y - reference of members, to their slots; mu p.
template <class W>
SINEW_INLINE void weighMembers(const MembersAt<W>& members, bool run, const float* y, const Vec3Of<W>& origin,
                               float* slots, W (&weighted)[3]) {
  const Vec3Of<W> p = positionsOf(y, members, run) - origin;
  storeMoves(slots, p);
  const W mu = members.field(kMemberMu);
  weighted[0] = mu * p.x;
  weighted[1] = mu * p.y;
  weighted[2] = mu * p.z;
}

// Four sums, over four lanes each: to `out`, or added to it. Of a pair: the first block's and the second's.
template <class W>
SINEW_INLINE void leaveFours(float* out, const W& fours, bool add) {
#if defined(__AVX512F__)
  if constexpr (sizeof(W) > sizeof(Float8)) {
    const Float8 low = lowHalf(fours);
    return store8(out, (add ? load8(out) + low : low) + highHalf(fours));
  } else
#endif
  {
    store(out, add ? load<W>(out) + fours : fours);
  }
}

/// Members of one cluster: the same lanes of at most kTile blocks or pairs, the first of them runs.
template <class W>
struct MembersToSum {
  MembersAt<W> first;
  std::uint32_t count, runs;
  const float* y;
  const float* reference;
  float* slots;
};

/// How many fours are summed.
template <bool quadratic>
constexpr std::uint32_t kFours = quadratic ? 8 : 3;
// Which sum a column's row is. The last columns, q_k^2 and q_k times the next, come k by k, four sums of the six each.
SINEW_INLINE std::uint32_t sumOf(std::uint32_t column, std::uint32_t row) {
  if (column < 3) return 3 + 3 * column + row;
  const std::uint32_t k = column % 3, place = column < 6 ? row : 3 + row;
  return place < 4 ? 12 + 4 * k + place : 24 + 2 * k + (place - 4);
}

/// Σ mu p and Σ mu p q^T, column by column: four sums each to `result` + 64 k, over four lanes and four, or added to
/// it. p = y - reference goes to the slots. What a sum is made of and in which order does not depend on how the work is
/// cut: four lanes each of blocks of even number and of odd number, tile by tile, and the halves of a block at last.
template <bool quadratic, class W>
SINEW_INLINE void sweepInline(const MembersToSum<W>& all, float* result, bool add) {
  const Vec3Of<W> origin = {splat<W>(all.reference[0]), splat<W>(all.reference[1]), splat<W>(all.reference[2])};
  MembersAt<W> members = all.first;
  float* slots = all.slots;
  W p[quadratic ? kTile : 1][3];
  W sums[12] = {};
  for (std::uint32_t b = 0; b < all.count; ++b, members.words += kPairWords, slots += kPairSlotFloats) {
    W(&own)[3] = p[quadratic ? b : 0];
    weighMembers<W>(members, b < all.runs, all.y, origin, slots, own);
    SINEW_UNROLL for (int row = 0; row < 3; ++row) sums[row] += own[row];
    SINEW_UNROLL for (int k = 0; k < 3; ++k) addColumn(own, members.rest(k), sums + 3 + 3 * k);
  }
  SINEW_UNROLL for (int k = 0; k < 12; k += 4) {
    leaveFours(result + 16 * k, sumFours(sums[k], sums[k + 1], sums[k + 2], sums[k + 3]), add);
  }
  if constexpr (quadratic) {
    // So many of three pairs of columns at a time that a sweep keeps its sums in registers.
#if defined(__AVX512F__)
    constexpr int kAtOnce = 3;
#else
    constexpr int kAtOnce = 1;
#endif
    W rest[3];
    SINEW_ROLLED for (int first = 0; first < 3; first += kAtOnce) {
      members = all.first;
      W six[kAtOnce][6] = {};
      for (std::uint32_t b = 0; b < all.count; ++b, members.words += kPairWords) {
        SINEW_UNROLL for (int k = 0; k < kAtOnce; ++k) {
          const W u = members.rest(first + k), v = members.rest(first + k == 2 ? 0 : first + k + 1);
          addColumn(p[b], W(u * u), six[k]);
          addColumn(p[b], W(u * v), six[k] + 3);
        }
      }
      SINEW_UNROLL for (int k = 0; k < kAtOnce; ++k) {
        const W(&s)[6] = six[k];
        leaveFours(result + 64 * (3 + first + k), sumFours(s[0], s[1], s[2], s[3]), add);
        rest[first + k] = sumPairwise(s[4], s[5]);
      }
    }
    leaveFours(result + 64 * 6, sumPairs(rest[0], rest[1]), add);
    leaveFours(result + 64 * 7, sumPairs(rest[2], rest[2]), add);
  }
}

// Nine columns are much code, which is not inlined everywhere; three are little work, which a call would slow down.
template <class W>
SINEW_APART static void sweepNine(const MembersToSum<W>& all, float* sums, bool add) {
  sweepInline<true, W>(all, sums, add);
}
template <bool quadratic, class W>
SINEW_INLINE void sweepMoments(const MembersToSum<W>& all, float* sums, bool add) {
  if constexpr (quadratic) {
    sweepNine<W>(all, sums, add);
  } else {
    sweepInline<false, W>(all, sums, add);
  }
}

// Sums of a cluster's members, W at a time.
template <bool quadratic, class W>
SINEW_INLINE void sumMembers(const MembersToSum<W>& all, float* result) {
  constexpr std::uint32_t kWidth = sizeof(W) / sizeof(float);
  const std::uint32_t stride = all.first.stride;
  for (std::uint32_t tile = 0; tile < all.count; tile += kTile) {
    const std::uint32_t left = all.count - tile;
    for (std::uint32_t lane = 0; lane < stride; lane += kWidth) {
      sweepMoments<quadratic, W>({{all.first.words + kPairWords * tile + lane, stride},
                                  left < kTile ? left : kTile,
                                  all.runs > tile ? all.runs - tile : 0,
                                  all.y,
                                  all.reference,
                                  all.slots + kPairSlotFloats * tile + (lane < 8 ? lane : kSlotFloats + lane - 8)},
                                 result + lane % 8, tile + lane >= 8);
    }
  }
}

template <bool quadratic>
SINEW_INLINE void moments(const ClusterRestBlock& rest, const MemberBlock* members, const float* y, ClusterBlock& state,
                          float* slots) {
  alignas(64) float fours[kFours<quadratic>][8][8];  // of each cluster, four sums over four lanes each
  float references[3][8];
  for (std::uint32_t lane = 0; lane < 8; ++lane) {
    const std::uint32_t count = rest.block_count[lane];
    float* const own = fours[0][lane];
    if (count == 0) {
      for (std::uint32_t k = 0; k < kFours<quadratic>; ++k) store8(own + 64 * k, Float8{});
      for (int k = 0; k < 3; ++k) references[k][lane] = 0.0F;
      continue;
    }
    const std::uint32_t* words = members[rest.first_block[lane]].words;
    float* const at = slots + kSlotFloats * rest.first_block[lane];
    // Relative to a member, not to the world's origin: far from the origin the differences are what floats still hold.
    const float* reference = y + words[kMemberOffset];
    for (int k = 0; k < 3; ++k) references[k][lane] = reference[k];
    const std::uint32_t pairs = (count + 1) / 2, runs = (rest.run_count[lane] + 1) / 2;
#if defined(__AVX512F__)
    if (count > 1) {
      sumMembers<quadratic, Float16>({{words, 16}, pairs, runs, y, reference, at}, own);
    } else {
      sweepMoments<quadratic, Float8>({{words, 8}, 1, runs, y, reference, at}, own, false);
    }
#else
    sumMembers<quadratic, SumLanes>({{words, count > 1 ? 16U : 8U}, pairs, runs, y, reference, at}, own);
#endif
  }
  // Of all clusters, sum k in sums[k].
  float sums[4 * kFours<quadratic>][8];
  SINEW_ROLLED for (std::uint32_t k = 0; k < kFours<quadratic>; ++k) {
    Float8 v[4];
    SINEW_UNROLL for (std::uint32_t i = 0; i < 4; ++i) {
      const float *a = fours[k][i], *b = fours[k][i + 4];
      v[i] = joined(load4(a), load4(b)) + joined(load4(a + 4), load4(b + 4));
    }
    const Float8 xy0 = interleaveLow(v[0], v[1]), xy1 = interleaveLow(v[2], v[3]);
    const Float8 zw0 = interleaveHigh(v[0], v[1]), zw1 = interleaveHigh(v[2], v[3]);
    store8(sums[4 * k], pairLow(xy0, xy1));
    store8(sums[4 * k + 1], pairHigh(xy0, xy1));
    store8(sums[4 * k + 2], pairLow(zw0, zw1));
    store8(sums[4 * k + 3], pairHigh(zw0, zw1));
  }
  const Float8 inverse_radius = 1.0F / load8(rest.radius);
  Float8 first[3];
  SINEW_UNROLL for (std::uint32_t k = 0; k < 3; ++k) {
    first[k] = load8(sums[k]);
    store8(state.reference[k], load8(references[k]));
    store8(state.center[k], load8(references[k]) + first[k]);
  }
  // About the centre, and about the mean of q~.
  SINEW_ROLLED for (std::uint32_t k = 0; k < (quadratic ? 9 : 3); ++k) {
    SINEW_UNROLL for (std::uint32_t row = 0; row < 3; ++row) {
      const Float8 centred = load8(sums[sumOf(k, row)]) - load8(rest.mean[k]) * first[row];
      store8(state.a_pq[3 * k + row], centred * inverse_radius);
    }
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

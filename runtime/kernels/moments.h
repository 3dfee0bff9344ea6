// SPDX-License-Identifier: MIT
//
// c = Σ mu x and A_pq = Σ mu p q~^T of eight clusters (docs/method.md eq. 1, 2). For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/layout.h"
#include "runtime/kernels/shuffles.h"

namespace sinew::internal::SINEW_KERNELS {

/// Monomials of second degree: xx yy zz xy yz zx.
SINEW_INLINE void squares(Float8 x, Float8 y, Float8 z, Float8 (&out)[6]) {
  out[0] = x * x;
  out[1] = y * y;
  out[2] = z * z;
  out[3] = x * y;
  out[4] = y * z;
  out[5] = z * x;
}

constexpr std::uint32_t kTile = 16;  // member blocks whose mu p stay at hand between the sweeps over columns

/// Σ mu (y - reference) into sums[0..2] and Σ mu (y - reference) q~^T, column by column, into sums[3..].
/// Three sweeps, so that each keeps its accumulators in registers.
template <bool quadratic>
SINEW_INLINE void sumMoments(const MemberBlock* blocks, std::uint32_t count, const float* y,
                             const float (&reference)[3], const float (&mean)[9], Float8 (&sums)[32]) {
  for (Float8& sum : sums) sum = Float8{};
  const Vec3Of<Float8> origin = {splat<Float8>(reference[0]), splat<Float8>(reference[1]), splat<Float8>(reference[2])};
  Float8 mp[kTile][3];
  for (std::uint32_t first = 0; first < count; first += kTile) {
    const std::uint32_t tile = count - first < kTile ? count - first : kTile;
    const MemberBlock* block = blocks + first;
    for (std::uint32_t b = 0; b < tile; ++b) {
      const Vec3Of<Float8> p = load8(block[b].mu) * (gatherTriples(y, block[b].vertex) - origin);
      mp[b][0] = p.x;
      mp[b][1] = p.y;
      mp[b][2] = p.z;
      sums[0] += p.x;
      sums[1] += p.y;
      sums[2] += p.z;
      for (int k = 0; k < 3; ++k) {
        const Float8 q = load8(block[b].q[k]) - mean[k];
        sums[3 + 3 * k] += p.x * q;
        sums[4 + 3 * k] += p.y * q;
        sums[5 + 3 * k] += p.z * q;
      }
    }
    if constexpr (quadratic) {
      for (int k = 0; k < 3; ++k) {
        Float8 a[6] = {};
        for (std::uint32_t b = 0; b < tile; ++b) {
          const Float8 u = load8(block[b].q[k]), w = load8(block[b].q[k == 2 ? 0 : k + 1]);
          const Float8 square = u * u - mean[3 + k], product = u * w - mean[6 + k];
          for (int row = 0; row < 3; ++row) {
            a[row] += mp[b][row] * square;
            a[3 + row] += mp[b][row] * product;
          }
        }
        for (int row = 0; row < 3; ++row) {
          sums[12 + 3 * k + row] += a[row];
          sums[21 + 3 * k + row] += a[3 + row];
        }
      }
    }
  }
}

template <bool quadratic>
SINEW_INLINE void moments(const ClusterRestBlock& rest, const MemberBlock* members, const float* y,
                          ClusterBlock& state) {
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
    const float* first = y + 3 * std::uint64_t(blocks[0].vertex[0]);
    const float reference[3] = {first[0], first[1], first[2]};
    for (int k = 0; k < 3; ++k) references[k][lane] = reference[k];
    float mean[9];
    for (int k = 0; k < (quadratic ? 9 : 3); ++k) mean[k] = rest.mean[k][lane];
    Float8 sums[32];
    sumMoments<quadratic>(blocks, count, y, reference, mean, sums);
    for (int g = 0; g < kGroups; ++g) {
      const Float8 eight[8] = {sums[8 * g],     sums[8 * g + 1], sums[8 * g + 2], sums[8 * g + 3],
                               sums[8 * g + 4], sums[8 * g + 5], sums[8 * g + 6], sums[8 * g + 7]};
      rows[g][lane] = sumEach(eight);
    }
  }
  for (int g = 0; g < kGroups; ++g) transpose(rows[g]);
  const auto sum = [&](int k) { return rows[k / 8][k % 8]; };
  const Float8 inverse_radius = 1.0F / load8(rest.radius);
  for (int k = 0; k < 3; ++k) store8(state.center[k], load8(references[k]) + sum(k));
  // About the centre: Σ mu q~ is zero but for the rounding of its floats.
  for (int k = 0; k < (quadratic ? 27 : 9); ++k) store8(state.a_pq[k], sum(3 + k) * inverse_radius);
}

}  // namespace sinew::internal::SINEW_KERNELS

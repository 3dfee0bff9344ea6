// SPDX-License-Identifier: MIT
//
// Member blocks one at a time, or a pair where registers hold sixteen floats. For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/layout.h"
#include "runtime/kernels/shuffles.h"

namespace sinew::internal::SINEW_KERNELS {

/// From one pair of member blocks to the next: words, and floats of their slots.
constexpr std::uint64_t kPairWords = 16 * kMemberFields, kPairSlotFloats = 2 * kSlotFloats;

/// As many members as W has lanes: those of a block, alone or half of a pair, half of those, or a whole pair.
template <class W>
struct MembersAt {
  const std::uint32_t* words;
  std::uint32_t stride;  ///< from field to field: 8 alone, 16 in a pair

  SINEW_INLINE W field(std::uint32_t k) const {
    W value = load<W>(words + stride * k);
#if defined(__AVX512F__)
    // Read once: compilers read it again for each use, and loads are what is scarce.
    if constexpr (sizeof(W) > sizeof(Float8)) asm("" : "+v"(value));
#endif
    return value;
  }
  SINEW_INLINE W rest(int k) const { return field(kMemberRest + std::uint32_t(k)); }
};
/// \param run whether the members are consecutive vertices.
SINEW_INLINE Vec3Of<Float4> positionsOf(const float* y, const MembersAt<Float4>& members, bool run) {
  const float* at = y + members.words[0];
  if (run) return lanesOf(load4(at), load4(at + 4), load4(at + 8));
  return gatherFourTriples(y, members.words);
}
SINEW_INLINE Vec3Of<Float8> positionsOf(const float* y, const MembersAt<Float8>& members, bool run) {
  if (run) return lanesOf(loadTriples(y + members.words[0]));
  return gatherTriples(y, members.words);
}
// Between lanes and the first floats of slots: x, y, z of their members, a pair's as wide as W, otherwise eight each.
template <class W>
constexpr std::size_t kMoves = sizeof(W) > sizeof(Float8) ? 16 : 8;
template <class W>
SINEW_INLINE void storeMoves(float* slots, const Vec3Of<W>& v) {
  store(slots, v.x);
  store(slots + kMoves<W>, v.y);
  store(slots + 2 * kMoves<W>, v.z);
}
template <class W>
SINEW_INLINE Vec3Of<W> loadMoves(const float* slots) {
  return {load<W>(slots), load<W>(slots + kMoves<W>), load<W>(slots + 2 * kMoves<W>)};
}
/// What is asked of members goes to their slots. \param run whether they are consecutive vertices; `run_slots` is where
/// the slots of such begin.
SINEW_INLINE void storeSlots(float* slots, float* run_slots, const Vec3Of<Float8>& v, bool run) {
  if (run) return storeTriples(run_slots, triplesOf(v));
  storeQuadruples(slots, v);
}

#if defined(__AVX512F__)
SINEW_INLINE Vec3Of<Float16> positionsOf(const float* y, const MembersAt<Float16>& members, bool run) {
  const Vec3Of<Float8> a = positionsOf(y, MembersAt<Float8>{members.words, 16}, run),
                       b = positionsOf(y, MembersAt<Float8>{members.words + 8, 16}, run);
  return {joined(a.x, b.x), joined(a.y, b.y), joined(a.z, b.z)};
}
SINEW_INLINE void storeSlots(float* slots, float* run_slots, const Vec3Of<Float16>& v, bool run) {
  if (!run) return storeQuadruples(slots, slots + kSlotFloats, v);
  const Triples16 triples = triplesOf(v);
  for (int k = 0; k < 3; ++k) store16(run_slots + 16 * k, triples.part[k]);
}
#endif

/// Monomials of second degree: xx yy zz xy yz zx.
template <class W>
SINEW_INLINE void squares(W x, W y, W z, W (&out)[6]) {
  out[0] = x * x;
  out[1] = y * y;
  out[2] = z * z;
  out[3] = x * y;
  out[4] = y * z;
  out[5] = z * x;
}

}  // namespace sinew::internal::SINEW_KERNELS

// SPDX-License-Identifier: MIT
//
// Member blocks one at a time, or a pair where registers hold sixteen floats. For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/layout.h"
#include "runtime/kernels/shuffles.h"

namespace sinew::internal::SINEW_KERNELS {

/// Floats of a slot block: eight members, four each.
constexpr std::uint64_t kSlotFloats = 32;
/// From one pair of member blocks to the next: words, and floats of their slots.
constexpr std::uint64_t kPairWords = 16 * kMemberFields, kPairSlotFloats = 2 * kSlotFloats;

/// As many members as W has lanes: those of a block, alone or half of a pair, or a whole pair.
template <class W>
struct MembersAt {
  const std::uint32_t* words;
  std::uint32_t stride;  ///< from field to field: 8 alone, 16 in a pair

  SINEW_INLINE W field(std::uint32_t k) const {
    W result;
    __builtin_memcpy(&result, words + stride * k, sizeof result);
    return result;
  }
  SINEW_INLINE W rest(int k) const { return field(kMemberRest + std::uint32_t(k)); }
};
SINEW_INLINE Vec3Of<Float8> gatherMembers(const float* y, const MembersAt<Float8>& members) {
  return gatherTriples(y, members.words);
}
// Between lanes and the first floats of slots: x, y, z of their members, as wide as W.
template <class W>
SINEW_INLINE void storeMoves(float* slots, const Vec3Of<W>& v) {
  constexpr std::size_t kWidth = sizeof(W) / sizeof(float);
  __builtin_memcpy(slots, &v.x, sizeof(W));
  __builtin_memcpy(slots + kWidth, &v.y, sizeof(W));
  __builtin_memcpy(slots + 2 * kWidth, &v.z, sizeof(W));
}
template <class W>
SINEW_INLINE Vec3Of<W> loadMoves(const float* slots) {
  constexpr std::size_t kWidth = sizeof(W) / sizeof(float);
  Vec3Of<W> v;
  __builtin_memcpy(&v.x, slots, sizeof(W));
  __builtin_memcpy(&v.y, slots + kWidth, sizeof(W));
  __builtin_memcpy(&v.z, slots + 2 * kWidth, sizeof(W));
  return v;
}
SINEW_INLINE void storeSlots(float* slots, const Vec3Of<Float8>& v) { storeQuadruples(slots, v); }

#if defined(__AVX512F__)
SINEW_INLINE Vec3Of<Float16> gatherMembers(const float* y, const MembersAt<Float16>& members) {
  return gatherTriples(y, members.words, members.words + 8);
}
SINEW_INLINE void storeSlots(float* slots, const Vec3Of<Float16>& v) { storeQuadruples(slots, slots + kSlotFloats, v); }
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

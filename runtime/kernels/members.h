// SPDX-License-Identifier: MIT
//
// Member blocks one at a time, or two side by side where registers hold sixteen floats. For kernel files only, see
// lanes.h.
#pragma once

#include "runtime/kernels/layout.h"
#include "runtime/kernels/shuffles.h"

namespace sinew::internal::SINEW_KERNELS {

/// Floats of a slot block: eight members, four each.
constexpr std::uint64_t kSlotFloats = 32;

// Floats `p` of a block and, where W holds two blocks, of the next.
template <class W>
SINEW_INLINE W loadMembers(const MemberBlock* block, const float (MemberBlock::*p)[8]);
template <>
SINEW_INLINE Float8 loadMembers<Float8>(const MemberBlock* block, const float (MemberBlock::*p)[8]) {
  return load8(block->*p);
}
template <class W>
SINEW_INLINE W loadRest(const MemberBlock* block, int k);
template <>
SINEW_INLINE Float8 loadRest<Float8>(const MemberBlock* block, int k) {
  return load8(block->q[k]);
}
template <class W>
SINEW_INLINE Vec3Of<W> gatherMembers(const float* y, const MemberBlock* block);
template <>
SINEW_INLINE Vec3Of<Float8> gatherMembers<Float8>(const float* y, const MemberBlock* block) {
  return gatherTriples(y, block->offset);
}
// Between lanes and the first 24 floats of slot blocks: x, y, z of eight members.
SINEW_INLINE void storeMoves(float* slots, const Vec3Of<Float8>& v) {
  store8(slots, v.x);
  store8(slots + 8, v.y);
  store8(slots + 16, v.z);
}
template <class W>
SINEW_INLINE Vec3Of<W> loadMoves(const float* slots);
template <>
SINEW_INLINE Vec3Of<Float8> loadMoves<Float8>(const float* slots) {
  return {load8(slots), load8(slots + 8), load8(slots + 16)};
}
SINEW_INLINE void storeSlots(float* slots, const Vec3Of<Float8>& v) { storeQuadruples(slots, v); }

#if defined(__AVX512F__)
template <>
SINEW_INLINE Float16 loadMembers<Float16>(const MemberBlock* block, const float (MemberBlock::*p)[8]) {
  return joined(load8(block[0].*p), load8(block[1].*p));
}
template <>
SINEW_INLINE Float16 loadRest<Float16>(const MemberBlock* block, int k) {
  return joined(load8(block[0].q[k]), load8(block[1].q[k]));
}
template <>
SINEW_INLINE Vec3Of<Float16> gatherMembers<Float16>(const float* y, const MemberBlock* block) {
  return gatherTriples(y, block[0].offset, block[1].offset);
}
SINEW_INLINE void storeMoves(float* slots, const Vec3Of<Float16>& v) {
  storeMoves(slots, Vec3Of<Float8>{lowHalf(v.x), lowHalf(v.y), lowHalf(v.z)});
  storeMoves(slots + kSlotFloats, Vec3Of<Float8>{highHalf(v.x), highHalf(v.y), highHalf(v.z)});
}
template <>
SINEW_INLINE Vec3Of<Float16> loadMoves<Float16>(const float* slots) {
  const Vec3Of<Float8> a = loadMoves<Float8>(slots), b = loadMoves<Float8>(slots + kSlotFloats);
  return {joined(a.x, b.x), joined(a.y, b.y), joined(a.z, b.z)};
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

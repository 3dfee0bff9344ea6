// SPDX-License-Identifier: MIT
//
// Halves of registers. For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/lanes.h"

namespace sinew::internal::SINEW_KERNELS {

#define SINEW_SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)

#if defined(__AVX__)
// By intrinsics where halves may come from memory: the compiler makes a load and a shuffle of the general form.
SINEW_INLINE Float8 joined(Float4 low, Float4 high) {
  return Float8(_mm256_insertf128_ps(_mm256_castps128_ps256(__m128(low)), __m128(high), 1));
}
SINEW_INLINE Float4 lowHalf(Float8 a) { return SINEW_SHUFFLE(a, a, 0, 1, 2, 3); }
SINEW_INLINE Float4 highHalf(Float8 a) { return SINEW_SHUFFLE(a, a, 4, 5, 6, 7); }
#else
SINEW_INLINE Float8 joined(Float4 low, Float4 high) { return {low, high}; }
SINEW_INLINE Float4 lowHalf(Float8 a) { return a.low; }
SINEW_INLINE Float4 highHalf(Float8 a) { return a.high; }
#endif

/// Sums of the lanes of each, and 0.
SINEW_INLINE Float4 sumsOf(const Vec3Of<Float8>& v) {
  const Float4 x = lowHalf(v.x) + highHalf(v.x), y = lowHalf(v.y) + highHalf(v.y), z = lowHalf(v.z) + highHalf(v.z),
               none = {};
  const Float4 xy = SINEW_SHUFFLE(x, y, 0, 4, 1, 5) + SINEW_SHUFFLE(x, y, 2, 6, 3, 7);
  const Float4 z0 = SINEW_SHUFFLE(z, none, 0, 4, 1, 5) + SINEW_SHUFFLE(z, none, 2, 6, 3, 7);
  return SINEW_SHUFFLE(xy, z0, 0, 1, 4, 5) + SINEW_SHUFFLE(xy, z0, 2, 3, 6, 7);
}

#if defined(__AVX512F__)
SINEW_INLINE Float16 joined(Float8 low, Float8 high) {
  return SINEW_SHUFFLE(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}
SINEW_INLINE Float16 joined(Float4 a, Float4 b, Float4 c, Float4 d) {
  __m512 result = _mm512_castps128_ps512(__m128(a));
  result = _mm512_insertf32x4(result, __m128(b), 1);
  result = _mm512_insertf32x4(result, __m128(c), 2);
  return Float16(_mm512_insertf32x4(result, __m128(d), 3));
}
SINEW_INLINE Float8 lowHalf(Float16 a) { return SINEW_SHUFFLE(a, a, 0, 1, 2, 3, 4, 5, 6, 7); }
SINEW_INLINE Float8 highHalf(Float16 a) { return SINEW_SHUFFLE(a, a, 8, 9, 10, 11, 12, 13, 14, 15); }
#endif

}  // namespace sinew::internal::SINEW_KERNELS

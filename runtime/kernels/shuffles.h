// SPDX-License-Identifier: MIT
//
// Between arrays of xyz triples and lanes. For kernel files only, see lanes.h.
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

SINEW_INLINE Float4 interleaveLow(Float4 a, Float4 b) { return SINEW_SHUFFLE(a, b, 0, 4, 1, 5); }
SINEW_INLINE Float4 interleaveHigh(Float4 a, Float4 b) { return SINEW_SHUFFLE(a, b, 2, 6, 3, 7); }
SINEW_INLINE Float4 pairLow(Float4 a, Float4 b) { return SINEW_SHUFFLE(a, b, 0, 1, 4, 5); }
SINEW_INLINE Float4 pairHigh(Float4 a, Float4 b) { return SINEW_SHUFFLE(a, b, 2, 3, 6, 7); }
// The same shuffle of four in each half: 0 to 3 are of a, 4 to 7 of b.
template <int i, int j, int k, int l>
SINEW_INLINE Float8 inHalves(Float8 a, Float8 b) {
#if defined(__AVX__)
  constexpr auto at = [](int place) { return place < 4 ? place : place + 4; };
  return SINEW_SHUFFLE(a, b, at(i), at(j), at(k), at(l), at(i) + 4, at(j) + 4, at(k) + 4, at(l) + 4);
#else
  return joined(SINEW_SHUFFLE(a.low, b.low, i, j, k, l), SINEW_SHUFFLE(a.high, b.high, i, j, k, l));
#endif
}
// In each half of four: a0 b0 a1 b1, and a2 b2 a3 b3.
SINEW_INLINE Float8 interleaveLow(Float8 a, Float8 b) { return inHalves<0, 4, 1, 5>(a, b); }
SINEW_INLINE Float8 interleaveHigh(Float8 a, Float8 b) { return inHalves<2, 6, 3, 7>(a, b); }
// In each half of four: a0 a1 b0 b1, and a2 a3 b2 b3.
SINEW_INLINE Float8 pairLow(Float8 a, Float8 b) { return inHalves<0, 1, 4, 5>(a, b); }
SINEW_INLINE Float8 pairHigh(Float8 a, Float8 b) { return inHalves<2, 3, 6, 7>(a, b); }
#if defined(__AVX__)
// The low halves of both, and the high halves; the low one of a and the high one of b.
SINEW_INLINE Float8 lowHalves(Float8 a, Float8 b) { return SINEW_SHUFFLE(a, b, 0, 1, 2, 3, 8, 9, 10, 11); }
SINEW_INLINE Float8 highHalves(Float8 a, Float8 b) { return SINEW_SHUFFLE(a, b, 4, 5, 6, 7, 12, 13, 14, 15); }
SINEW_INLINE Float8 lowAndHigh(Float8 a, Float8 b) { return SINEW_SHUFFLE(a, b, 0, 1, 2, 3, 12, 13, 14, 15); }
#else
SINEW_INLINE Float8 lowHalves(Float8 a, Float8 b) { return joined(lowHalf(a), lowHalf(b)); }
SINEW_INLINE Float8 highHalves(Float8 a, Float8 b) { return joined(highHalf(a), highHalf(b)); }
SINEW_INLINE Float8 lowAndHigh(Float8 a, Float8 b) { return joined(lowHalf(a), highHalf(b)); }
#endif

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
SINEW_INLINE Float16 interleaveLow(Float16 a, Float16 b) {
  return SINEW_SHUFFLE(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29);
}
SINEW_INLINE Float16 interleaveHigh(Float16 a, Float16 b) {
  return SINEW_SHUFFLE(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31);
}
SINEW_INLINE Float16 pairLow(Float16 a, Float16 b) {
  return SINEW_SHUFFLE(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29);
}
SINEW_INLINE Float16 pairHigh(Float16 a, Float16 b) {
  return SINEW_SHUFFLE(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31);
}
#endif

/// Eight vectors of four floats (three and one to ignore), k and k + 4 side by side, into lanes.
SINEW_INLINE Vec3Of<Float8> toLanes(const Float8 (&v)[4]) {
  const Float8 xy0 = interleaveLow(v[0], v[1]), xy1 = interleaveLow(v[2], v[3]);
  const Float8 z0 = interleaveHigh(v[0], v[1]), z1 = interleaveHigh(v[2], v[3]);
  return {pairLow(xy0, xy1), pairHigh(xy0, xy1), pairLow(z0, z1)};
}

/// The triples at data + offset: each read as 16 bytes, so the array needs 4 bytes of padding behind it.
SINEW_INLINE Vec3Of<Float8> gatherTriples(const float* data, const std::uint32_t* offset) {
  Float8 v[4];
  SINEW_UNROLL for (int i = 0; i < 4; ++i) v[i] = joined(load4(data + offset[i]), load4(data + offset[i + 4]));
  return toLanes(v);
}
SINEW_INLINE Vec3Of<Float4> gatherFourTriples(const float* data, const std::uint32_t* offset) {
  Float4 v[4];
  SINEW_UNROLL for (int i = 0; i < 4; ++i) v[i] = load4(data + offset[i]);
  const Float4 xy0 = interleaveLow(v[0], v[1]), xy1 = interleaveLow(v[2], v[3]);
  const Float4 z0 = interleaveHigh(v[0], v[1]), z1 = interleaveHigh(v[2], v[3]);
  return {pairLow(xy0, xy1), pairHigh(xy0, xy1), pairLow(z0, z1)};
}
#if defined(__AVX512F__)
// In halves: putting together four times four floats costs twice the shuffles.
SINEW_INLINE Vec3Of<Float16> gatherTriples(const float* data, const std::uint32_t* first, const std::uint32_t* second) {
  const Vec3Of<Float8> a = gatherTriples(data, first), b = gatherTriples(data, second);
  return {joined(a.x, b.x), joined(a.y, b.y), joined(a.z, b.z)};
}
#endif

/// Lanes as eight vectors of four floats, the last of them 0: those of lanes k and k + 4 side by side (kSlotOfLane).
SINEW_INLINE void storeQuadruples(float* out, const Vec3Of<Float8>& v) {
  const Float8 zero{};
  const Float8 xy0 = interleaveLow(v.x, v.y), xy1 = interleaveHigh(v.x, v.y);
  const Float8 z0 = interleaveLow(v.z, zero), z1 = interleaveHigh(v.z, zero);
  store8(out, pairLow(xy0, z0));
  store8(out + 8, pairHigh(xy0, z0));
  store8(out + 16, pairLow(xy1, z1));
  store8(out + 24, pairHigh(xy1, z1));
}

#if defined(__AVX512F__)
/// Of two blocks: the first eight lanes go to `out`, the others to `second`.
SINEW_INLINE void storeQuadruples(float* out, float* second, const Vec3Of<Float16>& v) {
  const Float16 zero{};
  const Float16 xy0 = interleaveLow(v.x, v.y), xy1 = interleaveHigh(v.x, v.y);
  const Float16 z0 = interleaveLow(v.z, zero), z1 = interleaveHigh(v.z, zero);
  const Float16 four[4] = {pairLow(xy0, z0), pairHigh(xy0, z0), pairLow(xy1, z1), pairHigh(xy1, z1)};
  for (int i = 0; i < 4; ++i) {
    store8(out + 8 * i, lowHalf(four[i]));
    store8(second + 8 * i, highHalf(four[i]));
  }
}
#endif

/// Eight consecutive xyz triples as they lie in memory: what treats x, y and z alike need not take them apart.
struct Triples8 {
  Float8 part[3];
};
SINEW_INLINE Triples8 loadTriples(const float* p) { return {{load8(p), load8(p + 8), load8(p + 16)}}; }
SINEW_INLINE void storeTriples(float* p, const Triples8& t) {
  SINEW_UNROLL for (int k = 0; k < 3; ++k) store8(p + 8 * k, t.part[k]);
}
/// The same for the last `count` < 8 of an array; missing triples repeat the first.
SINEW_INLINE Triples8 loadTriples(const float* p, std::uint32_t count) {
  if (count >= 8) [[likely]]
    return loadTriples(p);
  float copy[24];
  SINEW_ROLLED for (std::uint32_t i = 0; i < 24; ++i) copy[i] = p[i < 3 * count ? i : i % 3];
  return loadTriples(copy);
}
SINEW_INLINE void storeTriples(float* p, const Triples8& t, std::uint32_t count) {
  if (count >= 8) [[likely]]
    return storeTriples(p, t);
  float copy[24];
  storeTriples(copy, t);
  SINEW_ROLLED for (std::uint32_t i = 0; i < 3 * count; ++i) p[i] = copy[i];
}
/// The same triple eight times.
SINEW_INLINE Triples8 repeated(const float (&v)[3]) {
  const Float4 a = {v[0], v[1], v[2], v[0]}, b = {v[1], v[2], v[0], v[1]}, c = {v[2], v[0], v[1], v[2]};
  return {{joined(a, b), joined(c, a), joined(b, c)}};
}
SINEW_INLINE Triples8 operator+(const Triples8& a, const Triples8& b) {
  return {{a.part[0] + b.part[0], a.part[1] + b.part[1], a.part[2] + b.part[2]}};
}
SINEW_INLINE Triples8 operator-(const Triples8& a, const Triples8& b) {
  return {{a.part[0] - b.part[0], a.part[1] - b.part[1], a.part[2] - b.part[2]}};
}
SINEW_INLINE Triples8 operator*(Float8 s, const Triples8& a) {  // s: the same in all lanes
  return {{s * a.part[0], s * a.part[1], s * a.part[2]}};
}

/// Four consecutive triples, apart.
SINEW_INLINE Vec3Of<Float4> lanesOf(Float4 a, Float4 b, Float4 c) {
  // a = x0 y0 z0 x1, b = y1 z1 x2 y2, c = z2 x3 y3 z3
  const Float4 xy = SINEW_SHUFFLE(b, c, 2, 3, 5, 6);  // x2 y2 x3 y3
  const Float4 yz = SINEW_SHUFFLE(a, b, 1, 2, 4, 5);  // y0 z0 y1 z1
  return {SINEW_SHUFFLE(a, xy, 0, 3, 4, 6), SINEW_SHUFFLE(yz, xy, 0, 2, 5, 7), SINEW_SHUFFLE(yz, c, 1, 3, 4, 7)};
}
SINEW_INLINE Vec3Of<Float8> lanesOf(const Triples8& t) {
#if defined(__AVX512F__)
  // a = x0 y0 z0 x1 | y1 z1 x2 y2, b = z2 x3 y3 z3 | x4 y4 z4 x5, c = y5 z5 x6 y6 | z6 x7 y7 z7
  const Float8 a = t.part[0], b = t.part[1], c = t.part[2];
  const Float8 x = SINEW_SHUFFLE(SINEW_SHUFFLE(a, b, 0, 3, 6, 9, 12, 15, 0, 0), c, 0, 1, 2, 3, 4, 5, 10, 13);
  const Float8 y = SINEW_SHUFFLE(SINEW_SHUFFLE(a, b, 1, 4, 7, 10, 13, 0, 0, 0), c, 0, 1, 2, 3, 4, 8, 11, 14);
  const Float8 z = SINEW_SHUFFLE(SINEW_SHUFFLE(a, b, 2, 5, 8, 11, 14, 0, 0, 0), c, 0, 1, 2, 3, 4, 9, 12, 15);
  return {x, y, z};
#else
  // As above, four triples in each half.
  const Float8 a = lowAndHigh(t.part[0], t.part[1]), b = joined(highHalf(t.part[0]), lowHalf(t.part[2])),
               c = lowAndHigh(t.part[1], t.part[2]);
  const Float8 xy = inHalves<2, 3, 5, 6>(b, c), yz = inHalves<1, 2, 4, 5>(a, b);
  return {inHalves<0, 3, 4, 6>(a, xy), inHalves<0, 2, 5, 7>(yz, xy), inHalves<1, 3, 4, 7>(yz, c)};
#endif
}
SINEW_INLINE Triples8 triplesOf(const Vec3Of<Float8>& v) {
  // x0 y0 x1 y1; z0 x1 z2 x3; y1 z1 y3 z3; x2 y2 x3 y3
  const Float8 xy = interleaveLow(v.x, v.y), zx = inHalves<0, 5, 2, 7>(v.z, v.x), yz = inHalves<1, 5, 3, 7>(v.y, v.z),
               xy2 = interleaveHigh(v.x, v.y);
  const Float8 a = pairLow(xy, zx), b = pairLow(yz, xy2), c = pairHigh(zx, yz);
  return {{lowHalves(a, b), lowAndHigh(c, a), highHalves(b, c)}};
}
/// Eight vectors of four floats, two and two side by side, without their fourth floats.
SINEW_INLINE Triples8 triplesOf(const Float8 (&v)[4]) {
#if defined(__AVX__)
  return {{SINEW_SHUFFLE(v[0], v[1], 0, 1, 2, 4, 5, 6, 8, 9), SINEW_SHUFFLE(v[1], v[2], 2, 4, 5, 6, 8, 9, 10, 12),
           SINEW_SHUFFLE(v[2], v[3], 5, 6, 8, 9, 10, 12, 13, 14)}};
#else
  Float4 four[2][3];
  SINEW_UNROLL for (int half = 0; half < 2; ++half) {
    const Float4 a = v[2 * half].low, b = v[2 * half].high, c = v[2 * half + 1].low, d = v[2 * half + 1].high;
    four[half][0] = SINEW_SHUFFLE(a, SINEW_SHUFFLE(a, b, 2, 2, 4, 4), 0, 1, 4, 6);
    four[half][1] = SINEW_SHUFFLE(b, c, 1, 2, 4, 5);
    four[half][2] = SINEW_SHUFFLE(SINEW_SHUFFLE(c, d, 2, 2, 4, 4), d, 0, 2, 5, 6);
  }
  return {{joined(four[0][0], four[0][1]), joined(four[0][2], four[1][0]), joined(four[1][1], four[1][2])}};
#endif
}
#if defined(__AVX512F__)
/// Sixteen of them: 48 floats.
struct Triples16 {
  Float16 part[3];
};
SINEW_INLINE Triples16 triplesOf(const Vec3Of<Float16>& v) {
  return {{SINEW_SHUFFLE(SINEW_SHUFFLE(v.x, v.y, 0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5), v.z, 0, 1, 16, 3,
                         4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15),
           SINEW_SHUFFLE(SINEW_SHUFFLE(v.x, v.y, 21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26), v.z, 0, 21, 2,
                         3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15),
           SINEW_SHUFFLE(SINEW_SHUFFLE(v.x, v.y, 0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0), v.z, 26, 1,
                         2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31)}};
}
/// Sixteen vectors of four floats, four and four side by side, without their fourth floats.
SINEW_INLINE Triples16 triplesOf(const Float16 (&v)[4]) {
  return {{SINEW_SHUFFLE(v[0], v[1], 0, 1, 2, 4, 5, 6, 8, 9, 10, 12, 13, 14, 16, 17, 18, 20),
           SINEW_SHUFFLE(v[1], v[2], 5, 6, 8, 9, 10, 12, 13, 14, 16, 17, 18, 20, 21, 22, 24, 25),
           SINEW_SHUFFLE(v[2], v[3], 10, 12, 13, 14, 16, 17, 18, 20, 21, 22, 24, 25, 26, 28, 29, 30)}};
}
#endif

/// `count` scalars; 0 in missing lanes.
SINEW_INLINE Float8 loadScalars(const float* p, std::uint32_t count) {
  if (count >= 8) [[likely]]
    return load8(p);
  float copy[8] = {};
  SINEW_ROLLED for (std::uint32_t i = 0; i < count; ++i) copy[i] = p[i];
  return load8(copy);
}

// The two steps of sumFours().
template <class W>
SINEW_INLINE W sumPairwise(const W& a, const W& b) {
  return interleaveLow(a, b) + interleaveHigh(a, b);
}
template <class W>
SINEW_INLINE W sumPairs(const W& ab, const W& cd) {
  return pairLow(ab, cd) + pairHigh(ab, cd);
}
/// In each four lanes the sums of a, b, c and d over these lanes, always in the same order.
template <class W>
SINEW_INLINE W sumFours(const W& a, const W& b, const W& c, const W& d) {
  return sumPairs(sumPairwise(a, b), sumPairwise(c, d));
}

/// Rows become columns.
SINEW_INLINE void transpose(Float8 (&v)[8]) {
  Float8 a[8], b[8];
  for (int i = 0; i < 4; ++i) {
    a[2 * i] = interleaveLow(v[2 * i], v[2 * i + 1]);
    a[2 * i + 1] = interleaveHigh(v[2 * i], v[2 * i + 1]);
  }
  for (int i = 0; i < 2; ++i) {
    b[4 * i] = pairLow(a[4 * i], a[4 * i + 2]);
    b[4 * i + 1] = pairHigh(a[4 * i], a[4 * i + 2]);
    b[4 * i + 2] = pairLow(a[4 * i + 1], a[4 * i + 3]);
    b[4 * i + 3] = pairHigh(a[4 * i + 1], a[4 * i + 3]);
  }
  for (int i = 0; i < 4; ++i) {
    v[i] = lowHalves(b[i], b[i + 4]);
    v[i + 4] = highHalves(b[i], b[i + 4]);
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

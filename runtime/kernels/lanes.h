// SPDX-License-Identifier: MIT
//
// Eight floats that compute together, and the small algebra on them that kernels are written in. The compiler lowers
// them to what a translation unit is compiled for (two SSE registers, one AVX register, two of NEON or WASM SIMD), so
// there is one source for all instruction sets and the results are the same bit for bit: the same eight lanes, the same
// order of operations, no fused multiply-add (-ffp-contract=off), only operations that IEEE 754 rounds exactly.
//
// The algebra is written on a type F, Float8 or float or double: tests run it on doubles.
//
// Kernel files include nothing but this header and plain structs, and live in namespace SINEW_KERNELS, one for each
// instruction set: an inline function compiled for AVX must never be what another file's call links to.
#pragma once

#include <cstdint>

#if defined(__SSE4_1__)
#include <immintrin.h>
#endif

#ifndef SINEW_KERNELS
#define SINEW_KERNELS baseline  // what the compiler's own flags say
#endif
#define SINEW_INLINE [[gnu::always_inline]] inline
// A function that stays one: much code, called from several places. Clang makes no copies for constant arguments.
#if defined(__clang__)
#define SINEW_APART [[gnu::noinline]]
#else
#define SINEW_APART [[gnu::noinline, gnu::noclone]]
#endif
// Before loops over arrays of lanes: taken apart, so that the arrays are registers.
#define SINEW_UNROLL _Pragma("GCC unroll 32")
// Before loops over arrays of lanes that are too many for registers: a third of the code at the same speed.
#define SINEW_ROLLED _Pragma("GCC unroll 1")

namespace sinew::internal::SINEW_KERNELS {

using Float4 = float __attribute__((vector_size(16)));
using Int4 = std::int32_t __attribute__((vector_size(16)));

inline constexpr std::uint32_t kLanes = 8;

#if defined(__AVX__)
using Float8 = float __attribute__((vector_size(32)));
using Int8 = std::int32_t __attribute__((vector_size(32)));  ///< also masks: -1 where true
#else
// Two halves: compilers split vectors wider than a register into scalars at comparisons and shuffles.
struct Float8 {
  Float4 low, high;
};
struct Int8 {
  Int4 low, high;
};
// NOLINTBEGIN(bugprone-macro-parentheses): the argument is an operator.
#define SINEW_LANES_OPERATOR(op)                                                                     \
  SINEW_INLINE Float8 operator op(Float8 a, Float8 b) { return {a.low op b.low, a.high op b.high}; } \
  SINEW_INLINE Float8 operator op(Float8 a, float b) { return {a.low op b, a.high op b}; }           \
  SINEW_INLINE Float8 operator op(float a, Float8 b) { return {a op b.low, a op b.high}; }           \
  SINEW_INLINE Float8& operator op##=(Float8& a, Float8 b) { return a = a op b; }                    \
  SINEW_INLINE Float8& operator op##=(Float8& a, float b) { return a = a op b; }
SINEW_LANES_OPERATOR(+)
SINEW_LANES_OPERATOR(-)
SINEW_LANES_OPERATOR(*)
SINEW_LANES_OPERATOR(/)
#undef SINEW_LANES_OPERATOR
#define SINEW_LANES_COMPARISON(op)                                                                             \
  SINEW_INLINE Int8 operator op(Float8 a, Float8 b) { return {Int4(a.low op b.low), Int4(a.high op b.high)}; } \
  SINEW_INLINE Int8 operator op(Float8 a, float b) { return a op Float8{Float4{b, b, b, b}, Float4{b, b, b, b}}; }
SINEW_LANES_COMPARISON(<)
SINEW_LANES_COMPARISON(<=)
SINEW_LANES_COMPARISON(>)
SINEW_LANES_COMPARISON(>=)
SINEW_LANES_COMPARISON(==)
SINEW_LANES_COMPARISON(!=)
#undef SINEW_LANES_COMPARISON
#define SINEW_LANES_BITS(op)                                                                   \
  SINEW_INLINE Int8 operator op(Int8 a, Int8 b) { return {a.low op b.low, a.high op b.high}; } \
  SINEW_INLINE Int8& operator op##=(Int8& a, Int8 b) { return a = a op b; }
SINEW_LANES_BITS(&)
SINEW_LANES_BITS(|)
SINEW_LANES_BITS(^)
#undef SINEW_LANES_BITS
// NOLINTEND(bugprone-macro-parentheses)
SINEW_INLINE Int8 operator~(Int8 a) { return {~a.low, ~a.high}; }
SINEW_INLINE Float8 operator-(Float8 a) { return {-a.low, -a.high}; }
#endif

#if defined(__AVX512F__)
/// Two Float8 side by side: two blocks of clusters (match.h), or of members where the canonical order lets them
/// (moments.h).
using Float16 = float __attribute__((vector_size(64)));
using Int16 = std::int32_t __attribute__((vector_size(64)));
#endif

// A float as any F. Not F{} + value, which would have to make a positive zero of a negative one.
template <class F>
SINEW_INLINE F splat(float value) {
  return F(value);
}
template <>
SINEW_INLINE Float8 splat<Float8>(float v) {
#if defined(__AVX__)
  return Float8{v, v, v, v, v, v, v, v};
#else
  return {Float4{v, v, v, v}, Float4{v, v, v, v}};
#endif
}
template <>
SINEW_INLINE Float4 splat<Float4>(float v) {
  return Float4{v, v, v, v};
}
#if defined(__AVX512F__)
template <>
SINEW_INLINE Float16 splat<Float16>(float v) {
  return Float16{v, v, v, v, v, v, v, v, v, v, v, v, v, v, v, v};
}
#endif

// One lane of Float8 or Float16, of Int8 or Int16.
template <class F>
SINEW_INLINE float lane(const F& a, std::uint32_t i) {
  float value;
  __builtin_memcpy(&value, reinterpret_cast<const char*>(&a) + 4 * i, sizeof value);
  return value;
}
template <class Mask>
SINEW_INLINE bool isSet(const Mask& a, std::uint32_t i) {
  std::int32_t value;
  __builtin_memcpy(&value, reinterpret_cast<const char*>(&a) + 4 * i, sizeof value);
  return value != 0;
}
template <class F>
SINEW_INLINE void setLane(F& a, std::uint32_t i, float value) {
  __builtin_memcpy(reinterpret_cast<char*>(&a) + 4 * i, &value, sizeof value);
}
// Unaligned loads and stores of vectors and masks of any width.
template <class V>
SINEW_INLINE V load(const void* p) {
  V result;
  __builtin_memcpy(&result, p, sizeof result);
  return result;
}
template <class V>
SINEW_INLINE void store(void* p, const V& value) {
  __builtin_memcpy(p, &value, sizeof value);
}
#if !defined(__AVX__)
// Half by half: a copy of 32 bytes never becomes a pair of registers.
template <>
SINEW_INLINE Float8 load<Float8>(const void* p) {
  return {load<Float4>(p), load<Float4>(static_cast<const float*>(p) + 4)};
}
template <>
SINEW_INLINE void store<Float8>(void* p, const Float8& value) {
  store(p, value.low);
  store(static_cast<float*>(p) + 4, value.high);
}
#endif
SINEW_INLINE Float8 load8(const float* p) { return load<Float8>(p); }
SINEW_INLINE void store8(float* p, Float8 value) { store(p, value); }
/// Eight integers as floats, which they are exactly.
SINEW_INLINE Float8 convert8(const std::int16_t* p) {
#if defined(__AVX__)
  using Short8 = std::int16_t __attribute__((vector_size(16)));
  return __builtin_convertvector(load<Short8>(p), Float8);
#else
  using Short4 = std::int16_t __attribute__((vector_size(8)));
  return {__builtin_convertvector(load<Short4>(p), Float4), __builtin_convertvector(load<Short4>(p + 4), Float4)};
#endif
}
SINEW_INLINE Float4 load4(const float* p) { return load<Float4>(p); }

/// Four doubles, of which sums of products are made.
#if defined(__AVX__)
using Double4 = double __attribute__((vector_size(32)));
SINEW_INLINE void addTimes(Double4& sum, Double4 x, double factor) { sum += x * factor; }
SINEW_INLINE void addTo(Double4& sum, Float4 x) { sum += __builtin_convertvector(x, Double4); }
#else
using Double2 = double __attribute__((vector_size(16)));
struct Double4 {
  Double2 low, high;
};
SINEW_INLINE void addTimes(Double4& sum, Double4 x, double factor) {
  sum.low += x.low * factor;
  sum.high += x.high * factor;
}
SINEW_INLINE void addTo(Double4& sum, Float4 x) {
  using Float2 = float __attribute__((vector_size(8)));
  sum.low += __builtin_convertvector(Float2{x[0], x[1]}, Double2);
  sum.high += __builtin_convertvector(Float2{x[2], x[3]}, Double2);
}
#endif
SINEW_INLINE Double4 loadDouble4(const double* p) {
#if defined(__AVX__)
  return load<Double4>(p);
#else
  return {load<Double2>(p), load<Double2>(p + 2)};
#endif
}
SINEW_INLINE void storeDouble4(double* p, Double4 value) {
#if defined(__AVX__)
  store(p, value);
#else
  store(p, value.low);
  store(p + 2, value.high);
#endif
}
SINEW_INLINE void store4(float* p, Float4 value) { store(p, value); }
#if defined(__AVX512F__)
SINEW_INLINE Float16 load16(const float* p) { return load<Float16>(p); }
SINEW_INLINE void store16(float* p, Float16 value) { store(p, value); }
#endif

// select(mask, a, b): a where the mask is true. For scalars the mask is a bool.
SINEW_INLINE Float4 select(Int4 mask, Float4 a, Float4 b) {
#if defined(__SSE4_1__)
  return Float4(_mm_blendv_ps(__m128(b), __m128(a), __m128(Float4(mask))));
#else
  return Float4((mask & Int4(a)) | (~mask & Int4(b)));
#endif
}
SINEW_INLINE Float8 select(Int8 mask, Float8 a, Float8 b) {
#if defined(__AVX__)
  return Float8(_mm256_blendv_ps(__m256(b), __m256(a), __m256(Float8(mask))));
#else
  return {select(mask.low, a.low, b.low), select(mask.high, a.high, b.high)};
#endif
}
#if defined(__AVX512F__)
SINEW_INLINE Float16 select(Int16 mask, Float16 a, Float16 b) { return mask ? a : b; }
#endif
SINEW_INLINE float select(bool mask, float a, float b) { return mask ? a : b; }
SINEW_INLINE double select(bool mask, double a, double b) { return mask ? a : b; }

SINEW_INLINE Int4 both(Int4 a, Int4 b) { return a & b; }
SINEW_INLINE Int8 both(Int8 a, Int8 b) { return a & b; }
#if defined(__AVX512F__)
SINEW_INLINE Int16 both(Int16 a, Int16 b) { return a & b; }
SINEW_INLINE Int16 either(Int16 a, Int16 b) { return a | b; }
SINEW_INLINE Int16 no(Int16 a) { return ~a; }
SINEW_INLINE bool any(Int16 mask) { return _mm512_movepi32_mask(__m512i(mask)) != 0; }
SINEW_INLINE Float16 absolute(Float16 a) { return Float16(Int16(a) & 0x7fffffff); }
SINEW_INLINE Float16 squareRoot(Float16 a) { return Float16(_mm512_maskz_sqrt_ps(0xffff, __m512(a))); }
#endif
SINEW_INLINE bool both(bool a, bool b) { return a && b; }
SINEW_INLINE Int4 either(Int4 a, Int4 b) { return a | b; }
SINEW_INLINE Int8 either(Int8 a, Int8 b) { return a | b; }
SINEW_INLINE bool either(bool a, bool b) { return a || b; }
SINEW_INLINE Int4 no(Int4 a) { return ~a; }
SINEW_INLINE Int8 no(Int8 a) { return ~a; }
SINEW_INLINE bool no(bool a) { return !a; }

SINEW_INLINE bool any(Int4 mask) {
#if defined(__SSE4_1__)
  return _mm_movemask_ps(__m128(Float4(mask))) != 0;
#else
  std::uint64_t bits[2];
  __builtin_memcpy(bits, &mask, sizeof bits);
  return (bits[0] | bits[1]) != 0;
#endif
}
SINEW_INLINE bool any(Int8 mask) {
#if defined(__AVX__)
  return _mm256_movemask_ps(__m256(Float8(mask))) != 0;
#else
  return any(mask.low | mask.high);
#endif
}
SINEW_INLINE bool any(bool mask) { return mask; }

// Of a and b where either is not a number: b. One instruction where there is one that does just that.
template <class F>
SINEW_INLINE F smaller(F a, F b) {
  return select(a < b, a, b);
}
template <class F>
SINEW_INLINE F larger(F a, F b) {
  return select(a > b, a, b);
}
#if defined(__AVX__)
SINEW_INLINE Float8 smaller(Float8 a, Float8 b) { return Float8(_mm256_min_ps(__m256(a), __m256(b))); }
SINEW_INLINE Float8 larger(Float8 a, Float8 b) { return Float8(_mm256_max_ps(__m256(a), __m256(b))); }
#endif
#if defined(__SSE4_1__)
SINEW_INLINE Float4 smaller(Float4 a, Float4 b) { return Float4(_mm_min_ps(__m128(a), __m128(b))); }
SINEW_INLINE Float4 larger(Float4 a, Float4 b) { return Float4(_mm_max_ps(__m128(a), __m128(b))); }
#endif
#if defined(__AVX512F__)
// With a mask of all lanes: g++ 12 warns of the plain ones' own undefined operand.
SINEW_INLINE Float16 smaller(Float16 a, Float16 b) {
  return Float16(_mm512_maskz_min_ps(0xffff, __m512(a), __m512(b)));
}
SINEW_INLINE Float16 larger(Float16 a, Float16 b) { return Float16(_mm512_maskz_max_ps(0xffff, __m512(a), __m512(b))); }
#endif
template <class F>
SINEW_INLINE F clamped(F value, F low, F high) {
  return smaller(larger(value, low), high);
}

SINEW_INLINE Float4 absolute(Float4 a) { return Float4(Int4(a) & 0x7fffffff); }
SINEW_INLINE Float8 absolute(Float8 a) {
#if defined(__AVX__)
  return Float8(Int8(a) & 0x7fffffff);
#else
  return {absolute(a.low), absolute(a.high)};
#endif
}
SINEW_INLINE float absolute(float a) { return __builtin_fabsf(a); }
SINEW_INLINE double absolute(double a) { return __builtin_fabs(a); }

SINEW_INLINE Float4 squareRoot(Float4 a) {
#if defined(__SSE4_1__)
  return Float4(_mm_sqrt_ps(__m128(a)));
#else
  return Float4{__builtin_sqrtf(a[0]), __builtin_sqrtf(a[1]), __builtin_sqrtf(a[2]), __builtin_sqrtf(a[3])};
#endif
}
SINEW_INLINE Float8 squareRoot(Float8 a) {
#if defined(__AVX__)
  return Float8(_mm256_sqrt_ps(__m256(a)));
#else
  return {squareRoot(a.low), squareRoot(a.high)};
#endif
}
SINEW_INLINE float squareRoot(float a) { return __builtin_sqrtf(a); }
SINEW_INLINE double squareRoot(double a) { return __builtin_sqrt(a); }

template <class F>
struct Vec3Of {
  F x, y, z;
};

template <class F>
SINEW_INLINE Vec3Of<F> operator+(const Vec3Of<F>& a, const Vec3Of<F>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class F>
SINEW_INLINE Vec3Of<F> operator-(const Vec3Of<F>& a, const Vec3Of<F>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class F>
SINEW_INLINE Vec3Of<F> operator*(F s, const Vec3Of<F>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class F>
SINEW_INLINE F dot(const Vec3Of<F>& a, const Vec3Of<F>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class F>
SINEW_INLINE Vec3Of<F> cross(const Vec3Of<F>& a, const Vec3Of<F>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/// Column by column: column k is (m[3k], m[3k+1], m[3k+2]), as Eigen stores it.
template <class F>
struct Mat3Of {
  F m[9];
  SINEW_INLINE F& operator()(int row, int column) { return m[3 * column + row]; }
  SINEW_INLINE const F& operator()(int row, int column) const { return m[3 * column + row]; }
};

template <class F>
SINEW_INLINE Mat3Of<F> identity() {
  const F zero{}, one = splat<F>(1.0F);
  return {{one, zero, zero, zero, one, zero, zero, zero, one}};
}
template <class F>
SINEW_INLINE Mat3Of<F> operator*(const Mat3Of<F>& a, const Mat3Of<F>& b) {
  Mat3Of<F> c;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) c(i, j) = a(i, 0) * b(0, j) + a(i, 1) * b(1, j) + a(i, 2) * b(2, j);
  }
  return c;
}
/// a^T b.
template <class F>
SINEW_INLINE Mat3Of<F> transposedTimes(const Mat3Of<F>& a, const Mat3Of<F>& b) {
  Mat3Of<F> c;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) c(i, j) = a(0, i) * b(0, j) + a(1, i) * b(1, j) + a(2, i) * b(2, j);
  }
  return c;
}
template <class F>
SINEW_INLINE Vec3Of<F> operator*(const Mat3Of<F>& a, const Vec3Of<F>& v) {
  return {a(0, 0) * v.x + a(0, 1) * v.y + a(0, 2) * v.z, a(1, 0) * v.x + a(1, 1) * v.y + a(1, 2) * v.z,
          a(2, 0) * v.x + a(2, 1) * v.y + a(2, 2) * v.z};
}
template <class F>
SINEW_INLINE Mat3Of<F> transposed(const Mat3Of<F>& a) {
  return {{a.m[0], a.m[3], a.m[6], a.m[1], a.m[4], a.m[7], a.m[2], a.m[5], a.m[8]}};
}
template <class F>
SINEW_INLINE F determinant(const Mat3Of<F>& a) {
  return a(0, 0) * (a(1, 1) * a(2, 2) - a(1, 2) * a(2, 1)) - a(0, 1) * (a(1, 0) * a(2, 2) - a(1, 2) * a(2, 0)) +
         a(0, 2) * (a(1, 0) * a(2, 1) - a(1, 1) * a(2, 0));
}
template <class F>
SINEW_INLINE F squaredNorm(const Mat3Of<F>& a) {
  F sum = a.m[0] * a.m[0];
  for (int k = 1; k < 9; ++k) sum = sum + a.m[k] * a.m[k];
  return sum;
}
template <class F, class Mask>
SINEW_INLINE Mat3Of<F> select(Mask mask, const Mat3Of<F>& a, const Mat3Of<F>& b) {
  Mat3Of<F> c;
  for (int k = 0; k < 9; ++k) c.m[k] = select(mask, a.m[k], b.m[k]);
  return c;
}

/// Unit quaternion w, x, y, z.
template <class F>
struct QuaternionOf {
  F w, x, y, z;
};

template <class F>
SINEW_INLINE Mat3Of<F> rotationMatrix(const QuaternionOf<F>& q) {
  const F one = splat<F>(1.0F), two = splat<F>(2.0F);
  Mat3Of<F> r;
  r(0, 0) = one - two * (q.y * q.y + q.z * q.z);
  r(0, 1) = two * (q.x * q.y - q.w * q.z);
  r(0, 2) = two * (q.x * q.z + q.w * q.y);
  r(1, 0) = two * (q.x * q.y + q.w * q.z);
  r(1, 1) = one - two * (q.x * q.x + q.z * q.z);
  r(1, 2) = two * (q.y * q.z - q.w * q.x);
  r(2, 0) = two * (q.x * q.z - q.w * q.y);
  r(2, 1) = two * (q.y * q.z + q.w * q.x);
  r(2, 2) = one - two * (q.x * q.x + q.y * q.y);
  return r;
}

}  // namespace sinew::internal::SINEW_KERNELS

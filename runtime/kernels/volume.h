// SPDX-License-Identifier: MIT
//
// Volume of a cluster's goal, lane by lane (docs/method.md §9).
#pragma once

#include "runtime/kernels/kernels.h"
#include "runtime/kernels/svd.h"

namespace sinew::internal::SINEW_KERNELS {

/// Cube root of 1e-7..1e7 by Halley's iteration (no exponent tricks: lanes and scalars agree).
template <class F>
SINEW_INLINE F cubeRoot(F x) {
  const F one = splat<F>(1.0F), two = splat<F>(2.0F);
  F scale = one;
  for (int k = 0; k < 3; ++k) {
    const auto small = x<splat<F>(0.015625F), large = x> splat<F>(64.0F);
    x = select(small, splat<F>(512.0F) * x, select(large, splat<F>(0.001953125F) * x, x));
    scale = select(small, splat<F>(0.125F) * scale, select(large, splat<F>(8.0F) * scale, scale));
  }
  // x is in 1/64..64: six steps from 1 leave nothing a double could see.
  F y = one;
  for (int k = 0; k < (sizeof(one + one) == sizeof(double) ? 6 : 5); ++k) {
    const F y3 = y * y * y;
    y = y * ((y3 + two * x) / (two * y3 + x));
  }
  return scale * y;
}

/// The cofactor of A: the gradient of det A, and what a unit pressure does to the moments.
template <class F>
SINEW_INLINE Mat3Of<F> cofactor(const Mat3Of<F>& a) {
  const Vec3Of<F> x = columnOf(a, 0), y = columnOf(a, 1), z = columnOf(a, 2);
  const Vec3Of<F> yz = cross(y, z), zx = cross(z, x), xy = cross(x, y);
  return {{yz.x, yz.y, yz.z, zx.x, zx.y, zx.z, xy.x, xy.y, xy.z}};
}

template <class F>
SINEW_INLINE F innerProduct(const Mat3Of<F>& a, const Mat3Of<F>& b) {
  F sum = a.m[0] * b.m[0];
  for (int k = 1; k < 9; ++k) sum = sum + a.m[k] * b.m[k];
  return sum;
}

/// The pressure that keeps the volume of a cluster (docs/method.md eq. 18): lambda with
/// det(A + lambda B) + ease lambda = 1, by Newton's steps; 0 where it would not bring the volume nearer, or A is beyond
/// what the guard of eq. 10 lets through. No pressure moves A by more than 1 (in the Frobenius norm) in a pass.
/// \param a the linear block of F. \param cofactors of A. \param b what a unit pressure makes of it: the answer of the
/// cluster's modes to the cofactor. \param ease how much the volume gives way to a unit pressure, 0..
template <class F>
SINEW_INLINE F volumePressure(const Mat3Of<F>& a, const Mat3Of<F>& cofactors, const Mat3Of<F>& b, F ease) {
  const F zero{}, one = splat<F>(1.0F), two = splat<F>(2.0F), three = splat<F>(3.0F);
  const F least = splat<F>(1e-30F);
  const F volume = determinant(a), slope = innerProduct(cofactors, b) + ease, square = innerProduct(cofactor(b), a),
          cube = determinant(b);
  const F most = smaller(one / larger(squareRoot(squaredNorm(b)), least), splat<F>(kVolumeYield) / larger(ease, least));
  F pressure = zero;
  for (int step = 0; step < 6; ++step) {
    const F value = volume - one + pressure * (slope + pressure * (square + pressure * cube));
    const F change = slope + pressure * (two * square + three * pressure * cube);
    const F next = pressure - value / larger(change, least);
    pressure = clamped(next, zero - most, most);
  }
  const F left = volume - one + pressure * (slope + pressure * (square + pressure * cube));
  const F lies = squaredNorm(a), bound = splat<F>(3.3F * kLargestStretch * kLargestStretch);
  return select(both(lies < bound, absolute(left) < absolute(volume - one)), pressure, zero);
}

/// What the volume is brought back to behind a limit: what it was before, as far as that is nearer to 1.
/// \param was the product of the stretches before. \param is behind the limit.
template <class F>
SINEW_INLINE F volumeToRestore(F was, F is) {
  const F one = splat<F>(1.0F);
  return clamped(was, smaller(is, one), larger(is, one));
}

/// `principal`, behind a limit: the triple of stretches with the given product within least..largest that is nearest to
/// the given one, nearest in the logarithms of the stretches: all that are free take the same factor. Newton's steps on
/// that factor; since only the bound ahead can be met, each step fixes at least one more stretch or is the last: three
/// are exact.
/// \param sigma within least..largest. \param least > 0, <= 1. \param largest >= 1. \param volume > 0, within 1e-7..1e7
/// of the product as it is.
template <class F>
static inline Vec3Of<F> volumePrincipal(Vec3Of<F> sigma, F least, F largest, F volume) {
  const F zero{}, one = splat<F>(1.0F);
  const F product = sigma.x * sigma.y * sigma.z;
  using Mask = decltype(F{} < F{});
  const Mask grows = product < volume;
  const F bound = select(grows, largest, least);
  F value[3] = {sigma.x, sigma.y, sigma.z};
  for (int step = 0; step < 3; ++step) {
    const F inverse = volume / (value[0] * value[1] * value[2]);
    F free_count = zero;
    Mask is_free[3] = {};
    for (int k = 0; k < 3; ++k) {
      is_free[k] = either(both(grows, value[k] < bound), both(no(grows), value[k] > bound));
      free_count = free_count + select(is_free[k], one, zero);
    }
    // inverse^(1 / free_count); all three can be free in the first step only, or at the end when the product is right.
    F factor = select(free_count > splat<F>(1.5F), squareRoot(inverse), inverse);
    factor = select(free_count > splat<F>(2.5F), step == 0 ? cubeRoot(inverse) : one, factor);
    for (int k = 0; k < 3; ++k) {
      const F moved = factor * value[k];
      const F held = select(grows, smaller(moved, bound), larger(moved, bound));
      value[k] = select(is_free[k], held, value[k]);
    }
  }
  return {value[0], value[1], value[2]};
}

}  // namespace sinew::internal::SINEW_KERNELS

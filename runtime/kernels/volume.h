// SPDX-License-Identifier: MIT
//
// Volume of a cluster's goal, lane by lane (docs/method.md §9).
#pragma once

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

/// `cube_root`: A / |det A|^(1/3) (Müller et al. 2005, §3.4). Determinants below 1e-6 count as 1e-6: a squashed A grows
/// by 100 at most, which is this method's known blow-up; a limit has to follow it.
template <class F>
static inline Mat3Of<F> volumeCubeRoot(const Mat3Of<F>& a) {
  const F det = absolute(determinant(a));
  const F factor = splat<F>(1.0F) / cubeRoot(clamped(det, splat<F>(1e-6F), splat<F>(1e6F)));
  Mat3Of<F> result;
  for (int k = 0; k < 9; ++k) result.m[k] = factor * a.m[k];
  return result;
}

/// `principal`: the triple of stretches with product 1 within least..largest that is nearest to the given one, nearest
/// in the logarithms of the stretches: all that are free take the same factor. Newton's steps on that factor; since
/// only the bound ahead can be met, each step fixes at least one more stretch or is the last: three are exact.
/// \param sigma within least..largest. \param least > 0, <= 1. \param largest >= 1.
template <class F>
static inline Vec3Of<F> volumePrincipal(Vec3Of<F> sigma, F least, F largest) {
  const F zero{}, one = splat<F>(1.0F);
  const F product = sigma.x * sigma.y * sigma.z;
  using Mask = decltype(F{} < F{});
  const Mask grows = product < one;
  const F bound = select(grows, largest, least);
  F value[3] = {sigma.x, sigma.y, sigma.z};
  for (int step = 0; step < 3; ++step) {
    const F inverse = one / (value[0] * value[1] * value[2]);
    F free_count = zero;
    Mask is_free[3] = {};
    for (int k = 0; k < 3; ++k) {
      is_free[k] = either(both(grows, value[k] < bound), both(no(grows), value[k] > bound));
      free_count = free_count + select(is_free[k], one, zero);
    }
    // inverse^(1 / free_count); all three can be free in the first step only, or at the end when the product is 1.
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

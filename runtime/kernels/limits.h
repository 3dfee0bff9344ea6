// SPDX-License-Identifier: MIT
//
// Stretch limits, lane by lane (docs/method.md §9): each takes the linear part A of a cluster's goal, its rotation R
// and parameters (which may differ by lane), and gives the limited A.
#pragma once

#include "runtime/kernels/svd.h"

namespace sinew::internal::SINEW_KERNELS {

/// `rows`: each row of A at most `longest` long (Henriques 2006, §4.1.2, first method; c_max = longest²). The rows are
/// those of A seen in the cluster's own frame, R^T A: in the world's frame the limit would depend on how the body lies.
template <class F>
static inline Mat3Of<F> limitRows(const Mat3Of<F>& a, const Mat3Of<F>& r, F longest) {
  const F one = splat<F>(1.0F);
  Mat3Of<F> local = transposedTimes(r, a);
  for (int i = 0; i < 3; ++i) {
    // Scaled by the largest entry, so that squares neither overflow nor vanish.
    const F largest = larger(larger(absolute(local(i, 0)), absolute(local(i, 1))),
                             larger(absolute(local(i, 2)), splat<F>(1.17549435e-38F)));
    const F x = local(i, 0) / largest, y = local(i, 1) / largest, z = local(i, 2) / largest;
    const F ratio = (longest / largest) / squareRoot(x * x + y * y + z * z);
    const F factor = smaller(ratio, one);
    for (int j = 0; j < 3; ++j) local(i, j) = factor * local(i, j);
  }
  return r * local;
}

/// gamma A + (1 - gamma) R.
template <class F>
SINEW_INLINE Mat3Of<F> blend(const Mat3Of<F>& a, const Mat3Of<F>& r, F gamma) {
  Mat3Of<F> result;
  for (int k = 0; k < 9; ++k) result.m[k] = r.m[k] + gamma * (a.m[k] - r.m[k]);
  return result;
}

/// The root in 0..1 of |gamma A + (1 - gamma) R|² = wanted (squared Frobenius norms); 1 where A is not above it.
/// \param wanted 3.., the norm of R.
template <class F>
SINEW_INLINE F gammaForNorm(const Mat3Of<F>& a, const Mat3Of<F>& r, F wanted) {
  const F zero{}, one = splat<F>(1.0F), three = splat<F>(3.0F);
  // d = A - R over its largest entry s: s² a2 g² + 2 s b g - c = 0 with c = wanted - 3 >= 0, b = <R, d>.
  Mat3Of<F> d;
  for (int k = 0; k < 9; ++k) d.m[k] = a.m[k] - r.m[k];
  const F s = scaleOf(d);
  F a2 = zero, b = zero;
  for (int k = 0; k < 9; ++k) {
    const F x = d.m[k] / s;
    a2 = a2 + x * x;
    b = b + r.m[k] * x;
  }
  const F c = larger(wanted - three, zero);
  const F root = squareRoot(b * b + a2 * c);
  // The positive root, in the form that does not cancel; x = s g.
  const auto ascending = b > zero;
  const F sum = b + root, difference = root - b;
  const F x = select(ascending, c / select(sum > zero, sum, one), difference / a2);
  return smaller(x / s, one);
}

// The limits that blend A with R come as their gamma, 0..1, which the squares and products of a quadratic goal take as
// well: blend(a, r, gamma) is the limited A.

/// `frobenius`: |A|² at most `norm_max` (second method).
template <class F>
static inline F gammaFrobenius(const Mat3Of<F>& a, const Mat3Of<F>& r, F norm_max) {
  return gammaForNorm(a, r, norm_max);
}

/// `frobenius_cheap`: gamma = norm_max / |A|² where that is below 1 (third method). Not a bound of |A|² but of
/// gamma |A|²: far out the goal goes back to R.
template <class F>
static inline F gammaFrobeniusCheap(const Mat3Of<F>& a, F norm_max) {
  const F one = splat<F>(1.0F);
  const F s = scaleOf(a);
  Mat3Of<F> unit;
  for (int k = 0; k < 9; ++k) unit.m[k] = a.m[k] / s;
  return smaller(((norm_max / s) / s) / squaredNorm(unit), one);
}

/// |A|² without overflow: at most 9e30.
template <class F>
SINEW_INLINE F boundedNorm(const Mat3Of<F>& a) {
  const F most = splat<F>(1e15F), least = F{} - most;
  Mat3Of<F> bounded;
  for (int k = 0; k < 9; ++k) bounded.m[k] = clamped(a.m[k], least, most);
  return squaredNorm(bounded);
}

/// `curve`: the norm becomes `response`, which the caller looked up for boundedNorm(A); 1 where that is not below the
/// norm.
template <class F>
static inline F gammaToResponse(const Mat3Of<F>& a, const Mat3Of<F>& r, F response) {
  return select(boundedNorm(a) > response, gammaForNorm(a, r, response), splat<F>(1.0F));
}

/// `soft`: a norm phi above `knee` becomes m - (knee / phi) (m - knee), which approaches `norm_limit` (= m) and never
/// reaches it (§4.1.3).
template <class F>
static inline F gammaSoft(const Mat3Of<F>& a, const Mat3Of<F>& r, F knee, F norm_limit) {
  const F phi = boundedNorm(a);
  const auto above = phi > knee;
  const F response = norm_limit - (knee / select(above, phi, knee)) * (norm_limit - knee);
  return select(above, gammaForNorm(a, r, response), splat<F>(1.0F));
}

/// Whether all principal stretches surely lie within least..largest and nothing is mirrored; cheap, so that the
/// decomposition stays off the usual path. Never true where it should not be; false near the limits.
template <class F>
SINEW_INLINE auto surelyWithin(const Mat3Of<F>& a, F least, F largest) {
  // Of C = A^T A: all three eigenvalues lie within sqrt(2/3) |C - m 1| of their mean m.
  const Vec3Of<F> x = columnOf(a, 0), y = columnOf(a, 1), z = columnOf(a, 2);
  const F xx = dot(x, x), yy = dot(y, y), zz = dot(z, z), xy = dot(x, y), yz = dot(y, z), zx = dot(z, x);
  const F third = splat<F>(1.0F / 3.0F), two = splat<F>(2.0F);
  const F m = third * (xx + yy + zz);
  const F dx = xx - m, dy = yy - m, dz = zz - m;
  // 0.6667 > 2/3, so that rounding errs to the safe side.
  const F spread2 = splat<F>(0.6667F) * (dx * dx + dy * dy + dz * dz + two * (xy * xy + yz * yz + zx * zx));
  const F above = splat<F>(0.99999F) * largest * largest - m, below = m - splat<F>(1.00001F) * least * least;
  return both(both(determinant(a) > F{}, both(above > F{}, above * above > spread2)),
              both(below > F{}, below * below > spread2));
}

/// `principal`: each principal stretch within least..largest; nothing is mirrored then (§4.2 of the report has no such
/// answer). \param svd of A.
template <class F>
static inline Vec3Of<F> limitPrincipal(const SvdOf<F>& svd, F least, F largest) {
  return {clamped(svd.sigma.x, least, largest), clamped(svd.sigma.y, least, largest),
          clamped(svd.sigma.z, least, largest)};
}

}  // namespace sinew::internal::SINEW_KERNELS

// SPDX-License-Identifier: MIT
//
// Rotation-variant singular value decomposition of 3x3 matrices, lane by lane: a fixed number of sweeps, no branches on
// values, so that all lanes and all instruction sets compute the same.
#pragma once

#include "runtime/kernels/lanes.h"

namespace sinew::internal::SINEW_KERNELS {

/// A = u diag(sigma) v^T with u and v proper rotations.
template <class F>
struct SvdOf {
  Mat3Of<F> u, v;
  Vec3Of<F> sigma;  ///< |x| >= |y| >= |z|; only z may be negative, and is exactly where A mirrors
};

/// Sweeps over the three pairs of columns. Convergence is quadratic: four leave less than the rounding of a float for
/// any input, five that of a double.
template <class F>
inline constexpr int kSvdSweeps = sizeof(F{} + F{}) == sizeof(double) ? 6 : 4;

// Largest absolute entry, at least the least normal float: what a matrix is divided by before its entries are squared.
template <class F>
SINEW_INLINE F scaleOf(const Mat3Of<F>& a) {
  F scale = splat<F>(1.17549435e-38F);
  for (int k = 0; k < 9; ++k) scale = larger(absolute(a.m[k]), scale);
  return scale;
}

// Turns columns p and q of b (and of v) until they are orthogonal (Hestenes 1958). A call, for the bytes of three.
template <class F>
[[gnu::noinline]] static void orthogonalize(Mat3Of<F>& b, Mat3Of<F>& v, int p, int q) {
  const F zero{}, one = splat<F>(1.0F), two = splat<F>(2.0F), least = splat<F>(1e-37F);
  F alpha = b(0, p) * b(0, p), beta = b(0, q) * b(0, q), gamma = b(0, p) * b(0, q);
  for (int i = 1; i < 3; ++i) {
    alpha = alpha + b(i, p) * b(i, p);
    beta = beta + b(i, q) * b(i, q);
    gamma = gamma + b(i, p) * b(i, q);
  }
  // tan of the smaller angle: t = 2 gamma / (d + sign(d) sqrt(d² + 4 gamma²)), d = beta - alpha.
  const F d = beta - alpha, gamma2 = two * gamma;
  const F root = squareRoot(d * d + gamma2 * gamma2);
  const F denominator = absolute(d) + root;
  const auto usable = denominator > least;
  const F magnitude = gamma2 / select(usable, denominator, one);
  const F t = select(usable, select(d < zero, zero - magnitude, magnitude), zero);
  const F c = one / squareRoot(one + t * t), s = t * c;
  for (int i = 0; i < 3; ++i) {
    const F x = b(i, p), y = b(i, q), vx = v(i, p), vy = v(i, q);
    b(i, p) = c * x - s * y;
    b(i, q) = s * x + c * y;
    v(i, p) = c * vx - s * vy;
    v(i, q) = s * vx + c * vy;
  }
}

// Swaps columns p and q where the second is longer; one of them changes sign, so that v stays a rotation.
template <class F>
[[gnu::noinline]] static void sortColumns(Mat3Of<F>& b, Mat3Of<F>& v, F& length_p, F& length_q, int p, int q) {
  const F zero{};
  const auto swap = length_p < length_q;
  for (int i = 0; i < 3; ++i) {
    const F x = b(i, p), y = b(i, q), vx = v(i, p), vy = v(i, q);
    b(i, p) = select(swap, y, x);
    b(i, q) = select(swap, zero - x, y);
    v(i, p) = select(swap, vy, vx);
    v(i, q) = select(swap, zero - vx, vy);
  }
  const F a = length_p;
  length_p = select(swap, length_q, a);
  length_q = select(swap, a, length_q);
}

template <class F>
SINEW_INLINE Vec3Of<F> columnOf(const Mat3Of<F>& a, int column) {
  return {a(0, column), a(1, column), a(2, column)};
}
template <class F>
SINEW_INLINE Vec3Of<F> select(decltype(F{} < F{}) mask, const Vec3Of<F>& a, const Vec3Of<F>& b) {
  return {select(mask, a.x, b.x), select(mask, a.y, b.y), select(mask, a.z, b.z)};
}

// A unit vector across a unit vector: its cross product with the axis it is least along.
template <class F>
SINEW_INLINE Vec3Of<F> someAcross(const Vec3Of<F>& u) {
  const F zero{}, one = splat<F>(1.0F);
  const F x = absolute(u.x), y = absolute(u.y), z = absolute(u.z);
  const auto along_x = both(x <= y, x <= z), along_y = both(no(along_x), y <= z);
  const Vec3Of<F> axis{select(along_x, one, zero), select(along_y, one, zero),
                       select(either(along_x, along_y), zero, one)};
  const Vec3Of<F> across = cross(u, axis);
  return (one / squareRoot(dot(across, across))) * across;
}

/// The decomposition (Irving et al. 2004, §5, for what becomes of a reflection), by one-sided Jacobi rotations, which
/// find small singular values as exactly as large ones (Demmel & Veselić 1992).
///
/// Guarantee: u and v are rotations to rounding for every finite A, at any rank and scale a float can hold; not-finite
/// lanes hold anything and do not touch others.
template <class F>
static SvdOf<F> rotationSvd(const Mat3Of<F>& a) {
  const F one = splat<F>(1.0F), zero{};
  const F scale = scaleOf(a), shrink = one / scale;
  Mat3Of<F> b, v = identity<F>();
  for (int k = 0; k < 9; ++k) b.m[k] = shrink * a.m[k];
  for (int sweep = 0; sweep < kSvdSweeps<F>; ++sweep) {
    orthogonalize(b, v, 0, 1);
    orthogonalize(b, v, 0, 2);
    orthogonalize(b, v, 1, 2);
  }
  F length[3];
  for (int k = 0; k < 3; ++k) length[k] = dot(columnOf(b, k), columnOf(b, k));
  sortColumns(b, v, length[0], length[1], 0, 1);
  sortColumns(b, v, length[0], length[2], 0, 2);
  sortColumns(b, v, length[1], length[2], 1, 2);

  // u: the columns, made unit; where one is lost in rounding, any direction across the ones before does.
  SvdOf<F> result;
  const Vec3Of<F> b0 = columnOf(b, 0), b1 = columnOf(b, 1), b2 = columnOf(b, 2);
  const auto some = length[0] > zero;
  const F length0 = squareRoot(length[0]);
  const Vec3Of<F> u0 = select<F>(some, (one / select(some, length0, one)) * b0, Vec3Of<F>{one, zero, zero});
  Vec3Of<F> rest = b1 - dot(u0, b1) * u0;
  rest = rest - dot(u0, rest) * u0;
  const F rest2 = dot(rest, rest);
  const auto plane = rest2 > splat<F>(1e-30F);
  const Vec3Of<F> u1 = select<F>(plane, (one / squareRoot(select(plane, rest2, one))) * rest, someAcross(u0));
  const Vec3Of<F> u2 = cross(u0, u1);
  result.u = {{u0.x, u0.y, u0.z, u1.x, u1.y, u1.z, u2.x, u2.y, u2.z}};
  result.v = v;
  result.sigma = {scale * dot(u0, b0), scale * dot(u1, b1), scale * dot(u2, b2)};
  return result;
}

/// u diag(sigma) v^T.
template <class F>
SINEW_INLINE Mat3Of<F> compose(const SvdOf<F>& svd, const Vec3Of<F>& sigma) {
  Mat3Of<F> a;
  for (int j = 0; j < 3; ++j) {
    const F x = sigma.x * svd.v(j, 0), y = sigma.y * svd.v(j, 1), z = sigma.z * svd.v(j, 2);
    for (int i = 0; i < 3; ++i) a(i, j) = svd.u(i, 0) * x + svd.u(i, 1) * y + svd.u(i, 2) * z;
  }
  return a;
}

}  // namespace sinew::internal::SINEW_KERNELS

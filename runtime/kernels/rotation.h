// SPDX-License-Identifier: MIT
//
// The proper rotations nearest to eight matrices: the lanes' form of runtime/geometry/rotation.h, which says what is
// guaranteed and why. For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/kernels.h"
#include "runtime/kernels/lanes.h"

namespace sinew::internal::SINEW_KERNELS {

/// F: Float8 or Float16. \param[in,out] q the previous rotations (warm start); the results.
template <class F>
[[gnu::noinline]] static void nearestRotation(const Mat3Of<F>& a, QuaternionOf<F>& q) {
  using Mask = decltype(F{} < F{});
  F scale = absolute(a.m[0]), difference = a.m[0] - a.m[0];
  for (int k = 1; k < 9; ++k) {
    scale = larger(absolute(a.m[k]), scale);
    difference += a.m[k] - a.m[k];
  }
  const Mask finite = difference == 0.0F;  // not for infinities and what is no number
  const Mask usable = finite & (scale > 0.0F);
  const Mask normal = usable & (scale >= 1.17549435e-38F);
  const F inverse = select(normal, 1.0F / scale, F{});
  Mat3Of<F> b;
  for (int k = 0; k < 9; ++k) b.m[k] = select(normal, a.m[k] * inverse, F{});

  constexpr float kDefinite = 1e-2F, kNear = 0.5F, kSettled = 1e-6F;  // see geometry::nearestRotation
  QuaternionOf<F> iterate = q;
  Mask active = normal, settled = {};
  for (int iteration = 0; iteration < 6 && any(active); ++iteration) {
    const Mat3Of<F> c = transposedTimes(rotationMatrix(iterate), b);
    const F g0 = c(2, 1) - c(1, 2), g1 = c(0, 2) - c(2, 0), g2 = c(1, 0) - c(0, 1);
    const F j00 = c(1, 1) + c(2, 2), j11 = c(0, 0) + c(2, 2), j22 = c(0, 0) + c(1, 1);
    const F j01 = -0.5F * (c(0, 1) + c(1, 0)), j02 = -0.5F * (c(0, 2) + c(2, 0)), j12 = -0.5F * (c(1, 2) + c(2, 1));
    active &= j00 > kDefinite;
    const F d0 = select(active, j00, splat<F>(1.0F));
    const F i0 = 1.0F / d0, l10 = j01 * i0, l20 = j02 * i0;
    const F pivot1 = j11 - l10 * j01;
    active &= pivot1 > kDefinite;
    const F d1 = select(active, pivot1, splat<F>(1.0F));
    const F i1 = 1.0F / d1, l21 = (j12 - l20 * j01) * i1;
    const F pivot2 = j22 - l20 * j02 - l21 * l21 * d1;
    active &= pivot2 > kDefinite;
    const F d2 = select(active, pivot2, splat<F>(1.0F));
    const F y1 = g1 - l10 * g0;
    const F s2 = (g2 - l20 * g0 - l21 * y1) / d2;
    const F s1 = y1 * i1 - l21 * s2;
    const F s0 = g0 * i0 - l10 * s1 - l20 * s2;
    const F length2 = s0 * s0 + s1 * s1 + s2 * s2;
    active &= length2 < kNear * kNear;
    // iterate * (1, step / 2), normalized: the Cayley map, exact to third order.
    const F w = iterate.w, x = iterate.x, y = iterate.y, z = iterate.z;
    const F h0 = 0.5F * s0, h1 = 0.5F * s1, h2 = 0.5F * s2;
    const F nw = w - x * h0 - y * h1 - z * h2, nx = x + w * h0 + y * h2 - z * h1, ny = y + w * h1 + z * h0 - x * h2,
            nz = z + w * h2 + x * h1 - y * h0;
    const F unit = 1.0F / squareRoot(nw * nw + nx * nx + ny * ny + nz * nz);
    iterate = {select(active, nw * unit, w), select(active, nx * unit, x), select(active, ny * unit, y),
               select(active, nz * unit, z)};
    const Mask done = active & (length2 < kSettled);
    settled |= done;
    active &= ~done;
  }
  q = {select(settled, iterate.w, q.w), select(settled, iterate.x, q.x), select(settled, iterate.y, q.y),
       select(settled, iterate.z, q.z)};
  const Mask left = usable & ~settled;
  if (!any(left)) return;
  // What Newton cannot settle, one by one.
  for (std::uint32_t i = 0; i < sizeof(F) / sizeof(float); ++i) {
    if (!isSet(left, i)) continue;
    float matrix[9], quaternion[4] = {lane(q.w, i), lane(q.x, i), lane(q.y, i), lane(q.z, i)};
    for (int k = 0; k < 9; ++k) matrix[k] = lane(a.m[k], i);
    nearestRotationOfLane(matrix, quaternion);
    setLane(q.w, i, quaternion[0]);
    setLane(q.x, i, quaternion[1]);
    setLane(q.y, i, quaternion[2]);
    setLane(q.z, i, quaternion[3]);
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

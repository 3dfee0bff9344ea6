// SPDX-License-Identifier: MIT
//
// The proper rotations nearest to eight matrices: the lanes' form of runtime/geometry/rotation.h, which has the
// guarantees and their reasons. For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/kernels.h"
#include "runtime/kernels/lanes.h"

namespace sinew::internal::SINEW_KERNELS {

/// F: Float8 or Float16. \param[in,out] q the previous rotations (warm start); the results.
template <class F>
[[gnu::noinline]] static void nearestRotation(const Mat3Of<F>& a, QuaternionOf<F>& q) {
  using Mask = decltype(F{} < F{});
  F size[9], nothing[9];
  for (int k = 0; k < 9; ++k) {
    size[k] = absolute(a.m[k]);
    nothing[k] = a.m[k] - a.m[k];
  }
  const auto largest = [&](int k) { return larger(larger(size[k], size[k + 1]), size[k + 2]); };
  const F scale = larger(larger(largest(0), largest(3)), largest(6));
  const auto sum = [&](int k) { return nothing[k] + nothing[k + 1] + nothing[k + 2]; };
  const F difference = sum(0) + sum(3) + sum(6);
  const Mask finite = difference == 0.0F;  // not for infinities and what is no number
  const Mask usable = finite & (scale > 0.0F);
  const Mask normal = usable & (scale >= 1.17549435e-38F);
  const F inverse = select(normal, 1.0F / scale, F{});
  Mat3Of<F> b;
  for (int k = 0; k < 9; ++k) b.m[k] = select(normal, a.m[k] * inverse, F{});

  constexpr float kDefinite = 1e-2F, kNear = 1.0F, kSettled = 1e-6F;  // see geometry::nearestRotation
  QuaternionOf<F> iterate = q;
  Mask active = normal, settled = {};
  for (int iteration = 0; iteration < 6 && any(active); ++iteration) {
    const Mat3Of<F> c = transposedTimes(rotationMatrix(iterate), b);
    const F g0 = c(2, 1) - c(1, 2), g1 = c(0, 2) - c(2, 0), g2 = c(1, 0) - c(0, 1);
    const F j00 = c(1, 1) + c(2, 2), j11 = c(0, 0) + c(2, 2), j22 = c(0, 0) + c(1, 1);
    const F j01 = -0.5F * (c(0, 1) + c(1, 0)), j02 = -0.5F * (c(0, 2) + c(2, 0)), j12 = -0.5F * (c(1, 2) + c(2, 1));
    // By cofactors: one division, and little that waits for it. Lanes that are not definite come to nothing below.
    const F a00 = j11 * j22 - j12 * j12, a01 = j02 * j12 - j01 * j22, a02 = j01 * j12 - j02 * j11;
    const F a11 = j00 * j22 - j02 * j02, a12 = j01 * j02 - j00 * j12, a22 = j00 * j11 - j01 * j01;
    const F det = j00 * a00 + (j01 * a01 + j02 * a02);
    const F half = 0.5F / det;
    const F h0 = half * (a00 * g0 + (a01 * g1 + a02 * g2)), h1 = half * (a01 * g0 + (a11 * g1 + a12 * g2)),
            h2 = half * (a02 * g0 + (a12 * g1 + a22 * g2));
    const F length2 = h0 * h0 + (h1 * h1 + h2 * h2);
    // iterate * (1, h), h half the step, normalized: the Cayley map, exact to third order.
    const F w = iterate.w, x = iterate.x, y = iterate.y, z = iterate.z;
    const F nw = w - (x * h0 + (y * h1 + z * h2)), nx = x + (w * h0 + (y * h2 - z * h1)),
            ny = y + (w * h1 + (z * h0 - x * h2)), nz = z + (w * h2 + (x * h1 - y * h0));
    // 1 / |iterate (1, h)| = (1 + e)^-1/2 as a series.
    const F own = (w * w + x * x) + (y * y + z * z);
    const F e = (own - 1.0F) + own * length2, e2 = e * e;
    const F unit = (1.0F - 0.5F * e) + e2 * ((0.375F - 0.3125F * e) + e2 * (0.2734375F - 0.24609375F * e));
    active &= (j00 > kDefinite) & (a22 > kDefinite * j00) & (det > kDefinite * a22) &
              (length2 < 0.25F * kNear * kNear) & (absolute(e) < 0.5F * kNear * kNear);
    iterate = {select(active, nw * unit, w), select(active, nx * unit, x), select(active, ny * unit, y),
               select(active, nz * unit, z)};
    const Mask done = active & (length2 < 0.25F * kSettled);
    settled |= done;
    active &= ~done;
  }
  q = {select(settled, iterate.w, q.w), select(settled, iterate.x, q.x), select(settled, iterate.y, q.y),
       select(settled, iterate.z, q.z)};
  const Mask left = usable & ~settled;
  if (!any(left)) return;
  // Lanes that Newton leaves, one by one.
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

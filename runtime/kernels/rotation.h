// SPDX-License-Identifier: MIT
//
// The proper rotations nearest to eight matrices: the lanes' form of runtime/geometry/rotation.h, which says what is
// guaranteed and why. For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/kernels.h"
#include "runtime/kernels/lanes.h"

namespace sinew::internal::SINEW_KERNELS {

/// \param[in,out] q the previous rotations (warm start); the results.
static inline void nearestRotation(const Mat3Of<Float8>& a, QuaternionOf<Float8>& q) {
  Float8 scale = absolute(a.m[0]), difference = a.m[0] - a.m[0];
  for (int k = 1; k < 9; ++k) {
    scale = larger(absolute(a.m[k]), scale);
    difference += a.m[k] - a.m[k];
  }
  const Int8 finite = difference == 0.0F;  // not for infinities and what is no number
  const Int8 usable = finite & (scale > 0.0F);
  const Int8 normal = usable & (scale >= 1.17549435e-38F);
  const Float8 inverse = select(normal, 1.0F / scale, Float8{});
  Mat3Of<Float8> b;
  for (int k = 0; k < 9; ++k) b.m[k] = select(normal, a.m[k] * inverse, Float8{});

  constexpr float kDefinite = 1e-2F, kNear = 0.5F, kSettled = 1e-6F;  // see geometry::nearestRotation
  QuaternionOf<Float8> iterate = q;
  Int8 active = normal, settled = {};
  for (int iteration = 0; iteration < 6 && any(active); ++iteration) {
    const Mat3Of<Float8> c = transposedTimes(rotationMatrix(iterate), b);
    const Float8 g0 = c(2, 1) - c(1, 2), g1 = c(0, 2) - c(2, 0), g2 = c(1, 0) - c(0, 1);
    const Float8 j00 = c(1, 1) + c(2, 2), j11 = c(0, 0) + c(2, 2), j22 = c(0, 0) + c(1, 1);
    const Float8 j01 = -0.5F * (c(0, 1) + c(1, 0)), j02 = -0.5F * (c(0, 2) + c(2, 0)),
                 j12 = -0.5F * (c(1, 2) + c(2, 1));
    active &= j00 > kDefinite;
    const Float8 d0 = select(active, j00, splat<Float8>(1.0F));
    const Float8 i0 = 1.0F / d0, l10 = j01 * i0, l20 = j02 * i0;
    const Float8 pivot1 = j11 - l10 * j01;
    active &= pivot1 > kDefinite;
    const Float8 d1 = select(active, pivot1, splat<Float8>(1.0F));
    const Float8 i1 = 1.0F / d1, l21 = (j12 - l20 * j01) * i1;
    const Float8 pivot2 = j22 - l20 * j02 - l21 * l21 * d1;
    active &= pivot2 > kDefinite;
    const Float8 d2 = select(active, pivot2, splat<Float8>(1.0F));
    const Float8 y1 = g1 - l10 * g0;
    const Float8 s2 = (g2 - l20 * g0 - l21 * y1) / d2;
    const Float8 s1 = y1 * i1 - l21 * s2;
    const Float8 s0 = g0 * i0 - l10 * s1 - l20 * s2;
    const Float8 length2 = s0 * s0 + s1 * s1 + s2 * s2;
    active &= length2 < kNear * kNear;
    // iterate * (1, step / 2), normalized: the Cayley map, exact to third order.
    const Float8 w = iterate.w, x = iterate.x, y = iterate.y, z = iterate.z;
    const Float8 h0 = 0.5F * s0, h1 = 0.5F * s1, h2 = 0.5F * s2;
    const Float8 nw = w - x * h0 - y * h1 - z * h2, nx = x + w * h0 + y * h2 - z * h1,
                 ny = y + w * h1 + z * h0 - x * h2, nz = z + w * h2 + x * h1 - y * h0;
    const Float8 unit = 1.0F / squareRoot(nw * nw + nx * nx + ny * ny + nz * nz);
    iterate = {select(active, nw * unit, w), select(active, nx * unit, x), select(active, ny * unit, y),
               select(active, nz * unit, z)};
    const Int8 done = active & (length2 < kSettled);
    settled |= done;
    active &= ~done;
  }
  q = {select(settled, iterate.w, q.w), select(settled, iterate.x, q.x), select(settled, iterate.y, q.y),
       select(settled, iterate.z, q.z)};
  const Int8 left = usable & ~settled;
  if (!any(left)) return;
  // What Newton cannot settle, one by one.
  for (std::uint32_t i = 0; i < 8; ++i) {
    if (!lane(left, i)) continue;
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

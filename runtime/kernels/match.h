// SPDX-License-Identifier: MIT
//
// R, then F, of eight clusters from their moments (docs/method.md eq. 3, 5, 8, 10, 11). For kernel files only, see
// lanes.h.
#pragma once

#include "runtime/kernels/layout.h"
#include "runtime/kernels/limits.h"
#include "runtime/kernels/rotation.h"
#include "runtime/kernels/shuffles.h"
#include "runtime/kernels/volume.h"

namespace sinew::internal::SINEW_KERNELS {

// A_pq of this many times its norm at rest: the cluster is torn apart.
constexpr float kTorn = 2.5F;

// A cluster has lost its orientation where what resists a turn of R falls below this part of the rest shape's.
constexpr float kLostResistance = 0.3F;

SINEW_INLINE Mat3Of<Float8> loadMatrix(const float (*p)[8]) {
  Mat3Of<Float8> result;
  for (int k = 0; k < 9; ++k) result.m[k] = load8(p[k]);
  return result;
}

// Whether the moments no longer say how the cluster is turned: J = tr(S) 1 - S, S = sym(R^T A_pq), the curvature of
// tr(R^T A_pq) at its maximum, is not above kLostResistance of its rest value in every direction (Sylvester's minors).
// Directions that the rest shape lacks as well do not count.
SINEW_INLINE Int8 orientationIsLost(const Mat3Of<Float8>& r, const Mat3Of<Float8>& a_pq, const Mat3Of<Float8>& moment) {
  const Float8 trace = moment(0, 0) + moment(1, 1) + moment(2, 2);
  const Mat3Of<Float8> c = transposedTimes(r, a_pq);
  const Float8 diagonal = c(0, 0) + c(1, 1) + c(2, 2) - (kLostResistance - 1e-3F) * trace;
  const Float8 m00 = diagonal - (c(0, 0) - kLostResistance * moment(0, 0));
  const Float8 m11 = diagonal - (c(1, 1) - kLostResistance * moment(1, 1));
  const Float8 m22 = diagonal - (c(2, 2) - kLostResistance * moment(2, 2));
  const Float8 m01 = kLostResistance * moment(0, 1) - 0.5F * (c(0, 1) + c(1, 0));
  const Float8 m02 = kLostResistance * moment(0, 2) - 0.5F * (c(0, 2) + c(2, 0));
  const Float8 m12 = kLostResistance * moment(1, 2) - 0.5F * (c(1, 2) + c(2, 1));
  const Float8 minor = m00 * m11 - m01 * m01;
  const Float8 det = m22 * minor - m12 * (m00 * m12 - m01 * m02) + m02 * (m01 * m12 - m11 * m02);
  return (trace > 0.0F) & ~((m00 > 0.0F) & (minor > 0.0F) & (det > 0.0F));
}

// Limit and volume of eight linear blocks by their principal stretches (docs/method.md §9). Not inlined: it stays off
// the usual path of clusters that have neither. \param[in,out] a the linear blocks. \param act lanes to look at.
// \param[out] shaped lanes that changed. \return lanes that the guard moved.
static inline Int8 limitStretches(const StiffnessBlock& stiffness, Int8 act, Mat3Of<Float8>& a, Int8& shaped) {
  const Float8 least = load8(stiffness.least), largest = load8(stiffness.largest);
  const Int8 keeps_volume = loadMask(stiffness.keeps_volume);
  const SvdOf<Float8> svd = rotationSvd(a);
  const Vec3Of<Float8> held = limitPrincipal(svd, least, largest);
  const Int8 outside = (held.x != svd.sigma.x) | (held.y != svd.sigma.y) | (held.z != svd.sigma.z);
  const Vec3Of<Float8> kept = volumePrincipal(held, least, largest);
  const Vec3Of<Float8> sigma = {select(keeps_volume, kept.x, held.x), select(keeps_volume, kept.y, held.y),
                                select(keeps_volume, kept.z, held.z)};
  Float8 finite = absolute(a.m[0]);
  for (int k = 1; k < 9; ++k) finite += absolute(a.m[k]);
  shaped = act & (outside | keeps_volume) & (finite < splat<Float8>(3.0e38F));
  a = select(shaped, compose(svd, sigma), a);
  const Float8 guard = larger(largest, splat<Float8>(kLargestStretch));
  return shaped & ((svd.sigma.z < kLeastStretch) | (svd.sigma.x > guard));
}

template <bool quadratic>
SINEW_INLINE void match(const ClusterRestBlock& rest, const StiffnessBlock& stiffness, ClusterBlock& state) {
  constexpr int kColumns = quadratic ? 9 : 3;
  const Mat3Of<Float8> a_pq = loadMatrix(state.a_pq);
  QuaternionOf<Float8> q = {load8(state.rotation[0]), load8(state.rotation[1]), load8(state.rotation[2]),
                            load8(state.rotation[3])};
  nearestRotation(a_pq, q);
  Mat3Of<Float8> r = rotationMatrix(q);
  const Mat3Of<Float8> moment = loadMatrix(rest.moment);
  const Int8 lost = orientationIsLost(r, a_pq, moment) | loadMask(state.astray);
  // Torn apart: no guard acts on a cluster that does not deform.
  const Int8 torn = squaredNorm(a_pq) > kTorn * kTorn * squaredNorm(moment);
  if (any(lost)) {
    // Neighbours that guess differently would tangle for good (a ring of four, scattered, came to rest inside out), so
    // all that are lost take the part's rotation.
    q = {select(lost, load8(state.part_rotation[0]), q.w), select(lost, load8(state.part_rotation[1]), q.x),
         select(lost, load8(state.part_rotation[2]), q.y), select(lost, load8(state.part_rotation[3]), q.z)};
    r = rotationMatrix(q);
  }
  store8(state.rotation[0], q.w);
  store8(state.rotation[1], q.x);
  store8(state.rotation[2], q.y);
  store8(state.rotation[3], q.z);

  // F = [R 0] + (A_pq - R M) S.
  Float8 f[27];
  for (int k = 0; k < 9; ++k) f[k] = r.m[k];
  SINEW_UNROLL for (int k = 9; k < 3 * kColumns; ++k) f[k] = Float8{};
  const Int8 deforms = loadMask(stiffness.deforms);
  Int8 limited = {}, shaped = {};
  if (any(deforms)) {
    Float8 deviation[27];
    SINEW_UNROLL for (int k = 0; k < kColumns; ++k) {
      const Vec3Of<Float8> at_rest =
          r * Vec3Of<Float8>{load8(rest.moment[3 * k]), load8(rest.moment[3 * k + 1]), load8(rest.moment[3 * k + 2])};
      deviation[3 * k] = load8(state.a_pq[3 * k]) - at_rest.x;
      deviation[3 * k + 1] = load8(state.a_pq[3 * k + 1]) - at_rest.y;
      deviation[3 * k + 2] = load8(state.a_pq[3 * k + 2]) - at_rest.z;
    }
    SINEW_UNROLL for (int j = 0; j < kColumns; ++j) {
      SINEW_UNROLL for (int i = 0; i < kColumns; ++i) {
        const int low = i < j ? i : j, high = i < j ? j : i;
        const Float8 s = load8(stiffness.s[high * (high + 1) / 2 + low]);
        for (int row = 0; row < 3; ++row) f[3 * j + row] += deviation[3 * i + row] * s;
      }
    }
    Mat3Of<Float8> linear;
    for (int k = 0; k < 9; ++k) linear.m[k] = f[k];
    const Int8 act = deforms & (loadMask(stiffness.keeps_volume) |
                                ~surelyWithin(linear, load8(stiffness.least), load8(stiffness.largest)));
    if (any(act)) {
      limited = limitStretches(stiffness, act, linear, shaped);
      for (int k = 0; k < 9; ++k) f[k] = linear.m[k];
      for (int k = 9; k < 3 * kColumns; ++k) {
        const Float8 most = splat<Float8>(kLargestStretch);
        f[k] = select(limited, clamped(f[k], -most, most), f[k]);
      }
    }
  }
  limited |= (lost & loadMask(stiffness.stiff)) | torn;

  // Where the classes of modes differ in stiffness, S mixes them and the deviation turns the cluster by itself: in a
  // C-shaped cluster that grew without bound out of nothing (a ring of four, stretch 12 Hz, bend 6 Hz). Turned back,
  // so that A_pq F^T is symmetric, the match never lengthens a deviation.
  const Int8 turned = (loadMask(stiffness.mixes) | limited | shaped) & ~lost;
  if (any(turned)) {
    Mat3Of<Float8> product = {};
    for (int k = 0; k < kColumns; ++k) {
      for (int j = 0; j < 3; ++j) {
        for (int i = 0; i < 3; ++i) product(i, j) += load8(state.a_pq[3 * k + i]) * f[3 * k + j];
      }
    }
    QuaternionOf<Float8> turn = {splat<Float8>(1.0F), Float8{}, Float8{}, Float8{}};
    nearestRotation(product, turn);
    const Mat3Of<Float8> t = rotationMatrix(turn);
    for (int k = 0; k < kColumns; ++k) {
      const Vec3Of<Float8> column = t * Vec3Of<Float8>{f[3 * k], f[3 * k + 1], f[3 * k + 2]};
      f[3 * k] = select(turned, column.x, f[3 * k]);
      f[3 * k + 1] = select(turned, column.y, f[3 * k + 1]);
      f[3 * k + 2] = select(turned, column.z, f[3 * k + 2]);
    }
  }
  SINEW_UNROLL for (int k = 0; k < 3 * kColumns; ++k) store8(state.f[k], f[k]);
  storeMask(state.limited, limited);
  storeMask(state.lost, lost);
}

}  // namespace sinew::internal::SINEW_KERNELS

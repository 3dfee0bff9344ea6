// SPDX-License-Identifier: MIT
//
// R, then F, of eight or sixteen clusters from their moments (docs/method.md eq. 3, 5, 8, 10, 11). For kernel files
// only, see lanes.h.
#pragma once

#include "runtime/kernels/layout.h"
#include "runtime/kernels/limits.h"
#include "runtime/kernels/rotation.h"
#include "runtime/kernels/shuffles.h"
#include "runtime/kernels/volume.h"

namespace sinew::internal::SINEW_KERNELS {

// Where the packed lower triangle of a symmetric matrix has row i, column j.
constexpr std::uint8_t kPackedPlace[9][9] = {
    {0, 1, 3, 6, 10, 15, 21, 28, 36},     {1, 2, 4, 7, 11, 16, 22, 29, 37},     {3, 4, 5, 8, 12, 17, 23, 30, 38},
    {6, 7, 8, 9, 13, 18, 24, 31, 39},     {10, 11, 12, 13, 14, 19, 25, 32, 40}, {15, 16, 17, 18, 19, 20, 26, 33, 41},
    {21, 22, 23, 24, 25, 26, 27, 34, 42}, {28, 29, 30, 31, 32, 33, 34, 35, 43}, {36, 37, 38, 39, 40, 41, 42, 43, 44}};

// A cluster has lost its orientation where what resists a turn of R falls below this part of the rest shape's.
constexpr float kLostResistance = 0.3F;

// Two times eight lanes, floats or masks, as sixteen.
template <class V>
SINEW_INLINE void joinInto([[maybe_unused]] V& value, [[maybe_unused]] Float8 low, [[maybe_unused]] Float8 high) {
  static_assert(sizeof(V) == 2 * sizeof(Float8));
#if defined(__AVX512F__)
  value = V(joined(low, high));  // the bits
#endif
}

/// What one match takes: a block of clusters, half of one where W has four lanes, or two where it has sixteen. The
/// second is `next` blocks further: 1, or 0 where there is none, and then the same lanes are computed and stored twice.
template <class Block>
struct BlocksAt {
  Block* first;
  std::uint32_t next;
  std::uint32_t lane;  ///< 4 for the second half of the block
  Block* operator->() const { return first; }

  template <class W>
  SINEW_INLINE W load(const float (&at)[8]) const {
    return read<W>(at);
  }
  template <class W>
  SINEW_INLINE auto loadMask(const std::int32_t (&at)[8]) const {
    return read<decltype(W{} < W{})>(at);
  }
  template <class W>
  SINEW_INLINE void store(float (&at)[8], const W& value) const {
    write(at, value);
  }
  template <class Mask>
  SINEW_INLINE void storeMask(std::int32_t (&at)[8], const Mask& value) const {
    write(at, value);
  }
  template <class W>
  SINEW_INLINE Mat3Of<W> loadMatrix(const float (*p)[8]) const {
    Mat3Of<W> result;
    for (int k = 0; k < 9; ++k) result.m[k] = load<W>(p[k]);
    return result;
  }

 private:
  static constexpr std::size_t kBytes = 32;  // of eight lanes

  template <class V, class T>
  SINEW_INLINE V read(const T (&at)[8]) const {
    V value;
    if constexpr (sizeof(V) > kBytes) {
      Float8 low, high;  // joined in registers: a vector stored in halves is slow to read as a whole
      __builtin_memcpy(&low, at, kBytes);
      __builtin_memcpy(&high, at + stride(), kBytes);
      joinInto(value, low, high);
    } else {
      __builtin_memcpy(&value, at + (sizeof(V) < kBytes ? lane : 0), sizeof value);
    }
    return value;
  }
  template <class V, class T>
  SINEW_INLINE void write(T (&at)[8], const V& value) const {
    if constexpr (sizeof(V) > kBytes) {
      __builtin_memcpy(at, &value, kBytes);
      __builtin_memcpy(at + stride(), reinterpret_cast<const char*>(&value) + kBytes, kBytes);
    } else {
      __builtin_memcpy(at + (sizeof(V) < kBytes ? lane : 0), &value, sizeof value);
    }
  }
  SINEW_INLINE std::size_t stride() const { return next * (sizeof(Block) / sizeof(float)); }
};

// Whether the moments no longer say how the cluster is turned: J = tr(S) 1 - S, S = sym(R^T A_pq), the curvature of
// tr(R^T A_pq) at its maximum, is not above kLostResistance of its rest value in every direction (Sylvester's minors).
// Directions that the rest shape lacks as well do not count.
template <class W>
SINEW_INLINE auto orientationIsLost(const Mat3Of<W>& r, const Mat3Of<W>& a_pq, const Mat3Of<W>& moment) {
  const W trace = moment(0, 0) + moment(1, 1) + moment(2, 2);
  const Mat3Of<W> c = transposedTimes(r, a_pq);
  const W diagonal = c(0, 0) + c(1, 1) + c(2, 2) - (kLostResistance - 1e-3F) * trace;
  const W m00 = diagonal - (c(0, 0) - kLostResistance * moment(0, 0));
  const W m11 = diagonal - (c(1, 1) - kLostResistance * moment(1, 1));
  const W m22 = diagonal - (c(2, 2) - kLostResistance * moment(2, 2));
  const W m01 = kLostResistance * moment(0, 1) - 0.5F * (c(0, 1) + c(1, 0));
  const W m02 = kLostResistance * moment(0, 2) - 0.5F * (c(0, 2) + c(2, 0));
  const W m12 = kLostResistance * moment(1, 2) - 0.5F * (c(1, 2) + c(2, 1));
  const W minor = m00 * m11 - m01 * m01;
  const W det = m22 * minor - m12 * (m00 * m12 - m01 * m02) + m02 * (m01 * m12 - m11 * m02);
  return (trace > 0.0F) & ~((m00 > 0.0F) & (minor > 0.0F) & (det > 0.0F));
}

// Limit of linear blocks by their principal stretches (docs/method.md §9).
// \param[in,out] a the linear blocks. \param act lanes to look at. \param tangled lanes that may pass through
// themselves. \param[in,out] shaped plus the lanes that changed. \return lanes whose motion has to be stopped.
template <class W, class Mask = decltype(W{} < W{})>
SINEW_INLINE Mask limitStretches(BlocksAt<const StiffnessBlock> stiffness, Mask act, Mask tangled, Mat3Of<W>& a,
                                 Mask& shaped) {
  // What goes back through a mirrored shape is not stopped at the bound: from there on it would only creep.
  const W largest_guard = splat<W>(kLargestStretch), most_mirrored = W{} - largest_guard;
  const W least_guard = select(tangled, most_mirrored, splat<W>(kLeastStretch));
  W least = select(tangled, most_mirrored, stiffness.load<W>(stiffness->least));
  W largest = select(tangled, largest_guard, stiffness.load<W>(stiffness->largest));
  const Mask keeps_volume = stiffness.loadMask<W>(stiffness->keeps_volume) & ~tangled;
  const SvdOf<W> svd = rotationSvd(a);
  const Mask stiff = stiffness.loadMask<W>(stiffness->stiff);
  // What is beyond a limit, authored or the guard's, is stopped: bringing it back is no motion of its own.
  const W margin = stiffness.load<W>(stiffness->margin);
  const W outside_by = select(stiff, splat<W>(1.0F), margin);
  const Mask guarded = (svd.sigma.z * outside_by < least_guard) |
                       (svd.sigma.x > outside_by * larger(largest, splat<W>(kLargestStretch)));
  const Mask stopped = guarded | (svd.sigma.z * margin < least) | (svd.sigma.x > margin * largest);
  const Mask inside = guarded & stiff & ~tangled;
  least = select(inside, larger(least, splat<W>(kLeastStretch * kStiffGuardMargin)), least);
  largest = select(inside, smaller(largest, splat<W>(kLargestStretch / kStiffGuardMargin)), largest);
  const Vec3Of<W> held = limitPrincipal(svd, least, largest);
  const Mask outside = (held.x != svd.sigma.x) | (held.y != svd.sigma.y) | (held.z != svd.sigma.z);
  // A limit has taken some of the volume that the pressure had left: the stretches that are free make up for it.
  const W volume = volumeToRestore(svd.sigma.x * svd.sigma.y * svd.sigma.z, held.x * held.y * held.z);
  const Vec3Of<W> kept = volumePrincipal(held, least, largest, volume);
  const Vec3Of<W> sigma = {select(keeps_volume, kept.x, held.x), select(keeps_volume, kept.y, held.y),
                           select(keeps_volume, kept.z, held.z)};
  W finite = absolute(a.m[0]);
  for (int k = 1; k < 9; ++k) finite += absolute(a.m[k]);
  const Mask changed = act & outside & (finite < splat<W>(3.0e38F));
  a = select(changed, compose(svd, sigma), a);
  shaped |= changed;
  return changed & stopped;
}

// The pressure that keeps the volume (docs/method.md §9): F += lambda [cof A  0] S, what it does to the moments and the
// modes make of it. Not inlined: it stays off the usual path. \param[in,out] f of all columns. \param act lanes to look
// at.
template <class W, class Mask = decltype(W{} < W{})>
[[gnu::noinline]] static void keepVolume(int columns, BlocksAt<const StiffnessBlock> stiffness, Mask act, W* f) {
  Mat3Of<W> a;
  for (int k = 0; k < 9; ++k) a.m[k] = f[k];
  const Mat3Of<W> cofactors = cofactor(a);
  W answer[27];
  SINEW_ROLLED for (int j = 0; j < columns; ++j) {
    W sum[3] = {};
    for (int i = 0; i < 3; ++i) {
      const W s = stiffness.load<W>(stiffness->s[kPackedPlace[j][i]]);
      for (int row = 0; row < 3; ++row) sum[row] += cofactors(row, i) * s;
    }
    for (int row = 0; row < 3; ++row) answer[3 * j + row] = sum[row];
  }
  Mat3Of<W> b;
  for (int k = 0; k < 9; ++k) b.m[k] = answer[k];
  const W pressure = volumePressure(a, cofactors, b, stiffness.load<W>(stiffness->volume_ease));
  const W acting = select(act, pressure, W{});
  SINEW_ROLLED for (int k = 0; k < 3 * columns; ++k) f[k] += acting * answer[k];
}

// The same by limitFourStretches(), which all instruction sets share: few lanes are ever beyond a limit.
template <class W, class Mask = decltype(W{} < W{})>
[[gnu::noinline]] static Mask limitStretchesByFour(BlocksAt<const StiffnessBlock> stiffness, const Mask& act,
                                                   const Mask& tangled, W* a, Mask& shaped) {
  Mask stopped;
  const auto lanesFrom = [](auto& value, std::uint32_t first) { return reinterpret_cast<char*>(&value) + 4 * first; };
  for (std::uint32_t first = 0; first < sizeof(W) / sizeof(float); first += 4) {
    FourStretches four;
    SINEW_ROLLED for (int k = 0; k < 9; ++k) __builtin_memcpy(four.a[k], lanesFrom(a[k], first), sizeof four.a[k]);
    __builtin_memcpy(four.act, reinterpret_cast<const char*>(&act) + 4 * first, sizeof four.act);
    __builtin_memcpy(four.tangled, reinterpret_cast<const char*>(&tangled) + 4 * first, sizeof four.tangled);
    __builtin_memcpy(four.shaped, lanesFrom(shaped, first), sizeof four.shaped);
    const StiffnessBlock* block = first < kLanes ? stiffness.first : stiffness.first + stiffness.next;
    limitFourStretches(*block, sizeof(W) == sizeof(Float4) ? stiffness.lane : first % kLanes, four);
    SINEW_ROLLED for (int k = 0; k < 9; ++k) __builtin_memcpy(lanesFrom(a[k], first), four.a[k], sizeof four.a[k]);
    __builtin_memcpy(lanesFrom(shaped, first), four.shaped, sizeof four.shaped);
    __builtin_memcpy(lanesFrom(stopped, first), four.stopped, sizeof four.stopped);
  }
  return stopped;
}

/// \param columns 3, or 9 where a cluster is quadratic.
template <class W>
SINEW_INLINE void match(int columns, BlocksAt<const ClusterRestBlock> rest, BlocksAt<const StiffnessBlock> stiffness,
                        BlocksAt<ClusterBlock> state) {
  using Mask = decltype(W{} < W{});
  Mat3Of<W> a_pq;
  for (int k = 0; k < 9; ++k) a_pq.m[k] = state.load<W>(state->a_pq[k]);
  QuaternionOf<W> q = {state.load<W>(state->rotation[0]), state.load<W>(state->rotation[1]),
                       state.load<W>(state->rotation[2]), state.load<W>(state->rotation[3])};
  nearestRotation(a_pq, q);
  Mat3Of<W> r = rotationMatrix(q);
  const Mat3Of<W> moment = rest.loadMatrix<W>(rest->moment);
  const Mask lost = orientationIsLost(r, a_pq, moment) | state.loadMask<W>(state->astray);
  // Torn apart: no guard acts on a cluster that does not deform.
  const W stretched = larger(stiffness.load<W>(stiffness->largest), splat<W>(kLargestStretch));
  const Mask torn = squaredNorm(a_pq) > kTorn * kTorn * stretched * stretched * squaredNorm(moment);
  if (any(lost)) {
    // Neighbours that guess differently would tangle for good (a ring of four, scattered, came to rest inside out), so
    // all that are lost take the part's rotation.
    q = {select(lost, state.load<W>(state->part_rotation[0]), q.w),
         select(lost, state.load<W>(state->part_rotation[1]), q.x),
         select(lost, state.load<W>(state->part_rotation[2]), q.y),
         select(lost, state.load<W>(state->part_rotation[3]), q.z)};
    r = rotationMatrix(q);
  }
  state.store(state->rotation[0], q.w);
  state.store(state->rotation[1], q.x);
  state.store(state->rotation[2], q.y);
  state.store(state->rotation[3], q.z);

  // F = [R 0] + (A_pq - R M) S.
  W f[27];
  for (int k = 0; k < 9; ++k) f[k] = r.m[k];
  SINEW_ROLLED for (int k = 9; k < 3 * columns; ++k) f[k] = W{};
  const Mask deforms = stiffness.loadMask<W>(stiffness->deforms);
  Mask limited = {}, shaped = {};
  if (any(deforms)) {
    W deviation[27];
    SINEW_ROLLED for (int k = 0; k < columns; ++k) {
      const Vec3Of<W> at_rest = r * Vec3Of<W>{rest.load<W>(rest->moment[3 * k]), rest.load<W>(rest->moment[3 * k + 1]),
                                              rest.load<W>(rest->moment[3 * k + 2])};
      deviation[3 * k] = state.load<W>(state->a_pq[3 * k]) - at_rest.x;
      deviation[3 * k + 1] = state.load<W>(state->a_pq[3 * k + 1]) - at_rest.y;
      deviation[3 * k + 2] = state.load<W>(state->a_pq[3 * k + 2]) - at_rest.z;
    }
    // Three columns at a time: what is read for one serves three.
    SINEW_ROLLED for (int j = 0; j < columns; j += 3) {
      W sum[9];
      SINEW_UNROLL for (int k = 0; k < 9; ++k) sum[k] = f[3 * j + k];
      SINEW_ROLLED for (int i = 0; i < columns; ++i) {
        const std::uint8_t* place = &kPackedPlace[i][j];
        SINEW_UNROLL for (int k = 0; k < 3; ++k) {
          const W s = stiffness.load<W>(stiffness->s[place[k]]);
          SINEW_UNROLL for (int row = 0; row < 3; ++row) sum[3 * k + row] += deviation[3 * i + row] * s;
        }
      }
      SINEW_UNROLL for (int k = 0; k < 9; ++k) f[3 * j + k] = sum[k];
    }
    // A rigid cluster's F does not depend on which clusters are its neighbours.
    for (int k = 0; k < 9; ++k) f[k] = select(deforms, f[k], r.m[k]);
    SINEW_ROLLED for (int k = 9; k < 3 * columns; ++k) f[k] = select(deforms, f[k], W{});
    const Mask tangled = state.loadMask<W>(state->tangled);
    shaped = deforms & stiffness.loadMask<W>(stiffness->keeps_volume) & ~tangled;
    if (any(shaped)) keepVolume(columns, stiffness, shaped, f);
    const Mat3Of<W> linear = {{f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8]}};
    const Mask act =
        deforms & ~surelyWithin(linear, stiffness.load<W>(stiffness->least), stiffness.load<W>(stiffness->largest));
    if (any(act)) {
      limited = limitStretchesByFour(stiffness, act, tangled, f, shaped);
      const Mat3Of<W> held = {{f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8]}};
      const W cut = squareRoot(smaller(squaredNorm(held) / squaredNorm(linear), splat<W>(1.0F)));
      SINEW_ROLLED for (int k = 9; k < 3 * columns; ++k) {
        const W part = cut * f[k], most = larger(splat<W>(kMostSquares), kSquaresKept * absolute(part));
        f[k] = select(limited, clamped(part, -most, most), f[k]);
      }
    }
  }
  limited |= (lost | torn) & stiffness.loadMask<W>(stiffness->stiff);

  // Where the classes of modes differ in stiffness, S mixes them and the deviation turns the cluster by itself: in a
  // C-shaped cluster that grew without bound out of nothing (a ring of four, stretch 12 Hz, bend 6 Hz). Turned back,
  // so that A_pq F^T is symmetric, the match never lengthens a deviation.
  const Mask turned = (stiffness.loadMask<W>(stiffness->mixes) | limited | shaped) & ~lost;
  if (any(turned)) {
    Mat3Of<W> product = {};
    SINEW_ROLLED for (int k = 0; k < columns; ++k) {
      for (int j = 0; j < 3; ++j) {
        for (int i = 0; i < 3; ++i) product(i, j) += state.load<W>(state->a_pq[3 * k + i]) * f[3 * k + j];
      }
    }
    QuaternionOf<W> turn = {splat<W>(1.0F), W{}, W{}, W{}};
    nearestRotation(product, turn);
    const Mat3Of<W> t = rotationMatrix(turn);
    SINEW_ROLLED for (int k = 0; k < columns; ++k) {
      const Vec3Of<W> column = t * Vec3Of<W>{f[3 * k], f[3 * k + 1], f[3 * k + 2]};
      f[3 * k] = select(turned, column.x, f[3 * k]);
      f[3 * k + 1] = select(turned, column.y, f[3 * k + 1]);
      f[3 * k + 2] = select(turned, column.z, f[3 * k + 2]);
    }
  }
  SINEW_ROLLED for (int k = 0; k < 3 * columns; ++k) state.store(state->f[k], f[k]);
  state.storeMask(state->limited, limited);
  state.storeMask(state->lost, lost);
}

}  // namespace sinew::internal::SINEW_KERNELS

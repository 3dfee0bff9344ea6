// SPDX-License-Identifier: MIT
//
// Kernels of fields: the corotated energy at samples and the values at places (docs/method.md). For kernel files only,
// see lanes.h.
#pragma once

#include "runtime/kernels/field_layout.h"
#include "runtime/kernels/lanes.h"
#include "runtime/kernels/rotation.h"
#include "runtime/kernels/shuffles.h"
#include "runtime/kernels/svd.h"

namespace sinew::internal::SINEW_KERNELS {

/// Volumes det F between which a sample passes over from its own rotation to the piece's (docs/method.md §3).
inline constexpr float kSqueezed = 0.5F, kInverted = 0.02F;
/// Stiffness beyond a limit, of 2 mu + lambda.
inline constexpr float kLimitStiffness = 10;

/// Sum of eight lanes, in one order for all instruction sets.
SINEW_INLINE float sumOfLanes(Float8 a) {
  return ((lane(a, 0) + lane(a, 4)) + (lane(a, 1) + lane(a, 5))) +
         ((lane(a, 2) + lane(a, 6)) + (lane(a, 3) + lane(a, 7)));
}

/// F = sum_j z_j (grad phi_j)^T of eight samples.
SINEW_INLINE Mat3Of<Float8> deformationGradient(std::uint32_t functions, const float* gradients,
                                                const float* coefficients) {
  Mat3Of<Float8> f = {};
  for (std::uint32_t j = 0; j < functions; ++j) {
    const Float8 gx = load8(gradients + 24 * j), gy = load8(gradients + 24 * j + 8),
                 gz = load8(gradients + 24 * j + 16);
    SINEW_UNROLL
    for (int row = 0; row < 3; ++row) {
      const float z = coefficients[4 * j + std::uint32_t(row)];
      f(row, 0) += gx * z;
      f(row, 1) += gy * z;
      f(row, 2) += gz * z;
    }
  }
  return f;
}

/// R - 1, to the digits of small turns.
SINEW_INLINE Mat3Of<Float8> turnOf(const QuaternionOf<Float8>& q) {
  Mat3Of<Float8> r;
  r(0, 0) = -2.0F * (q.y * q.y + q.z * q.z);
  r(0, 1) = 2.0F * (q.x * q.y - q.w * q.z);
  r(0, 2) = 2.0F * (q.x * q.z + q.w * q.y);
  r(1, 0) = 2.0F * (q.x * q.y + q.w * q.z);
  r(1, 1) = -2.0F * (q.x * q.x + q.z * q.z);
  r(1, 2) = 2.0F * (q.y * q.z - q.w * q.x);
  r(2, 0) = 2.0F * (q.x * q.z - q.w * q.y);
  r(2, 1) = 2.0F * (q.y * q.z + q.w * q.x);
  r(2, 2) = -2.0F * (q.x * q.x + q.y * q.y);
  return r;
}

/// k |F - limited F|^2 of principal stretches, lengths and norms, with k = kLimitStiffness (2 mu + lambda).
[[gnu::noinline]] static double addLimits(const SampleLimits& limits, const SamplePack& pack, float stiffness, Int8 on,
                                          const Mat3Of<Float8>& f, Mat3Of<Float8>& p) {
  const Float8 modulus = load8(pack.mu) + load8(pack.mu) + load8(pack.lambda);
  const Float8 stiff = select(on, (2 * kLimitStiffness * stiffness) * load8(pack.volume) * modulus, Float8{});
  const SvdOf<Float8> svd = rotationSvd(f);
  const Float8 least = load8(limits.least), most = load8(limits.most);
  const Vec3Of<Float8> beyond = {svd.sigma.x - clamped(svd.sigma.x, least, most),
                                 svd.sigma.y - clamped(svd.sigma.y, least, most),
                                 svd.sigma.z - clamped(svd.sigma.z, least, most)};
  const Mat3Of<Float8> pull = compose(svd, stiff * beyond);
  for (int i = 0; i < 9; ++i) p.m[i] += pull.m[i];
  double energy = double(sumOfLanes(0.5F * stiff * dot(beyond, beyond)));
  for (std::uint32_t l = 0; l < 8; ++l) {
    if (!isSet(on, l)) continue;
    float at[9], pulled[9] = {};
    for (int i = 0; i < 9; ++i) at[i] = lane(f.m[i], l);
    energy += double(addLengthLimits(limits, l, lane(stiff, l), at, pulled));
    for (int i = 0; i < 9; ++i) setLane(p.m[i], l, lane(p.m[i], l) + pulled[i]);
  }
  return energy;
}

SINEW_INLINE Mat3Of<Float8> loadMatrix(const float* lanes) {
  Mat3Of<Float8> m;
  for (int i = 0; i < 9; ++i) m.m[i] = load8(lanes + 8 * i);
  return m;
}

/// F S^-1 - 1 from F - 1 and S^-1 - 1.
SINEW_INLINE Mat3Of<Float8> fromRestShape(const Mat3Of<Float8>& change, const Mat3Of<Float8>& rest_change) {
  Mat3Of<Float8> result = change * rest_change;
  for (int i = 0; i < 9; ++i) result.m[i] += change.m[i] + rest_change.m[i];
  return result;
}

SINEW_INLINE void addTo(Mat3Of<Float8>& to, const Mat3Of<Float8>& m) {
  for (int i = 0; i < 9; ++i) to.m[i] += m.m[i];
}

/// a b^T.
SINEW_INLINE Mat3Of<Float8> timesTransposed(const Mat3Of<Float8>& a, const Mat3Of<Float8>& b) {
  Mat3Of<Float8> result;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      result(row, column) = a(row, 0) * b(column, 0) + (a(row, 1) * b(column, 1) + a(row, 2) * b(column, 2));
    }
  }
  return result;
}

/// det F - 1 from F - 1.
SINEW_INLINE Float8 determinantChange(const Mat3Of<Float8>& c) {
  const Float8 trace = (c(0, 0) + c(1, 1)) + c(2, 2);
  const Float8 minors = ((c(0, 0) * c(1, 1) - c(0, 1) * c(1, 0)) + (c(1, 1) * c(2, 2) - c(1, 2) * c(2, 1))) +
                        (c(2, 2) * c(0, 0) - c(2, 0) * c(0, 2));
  return trace + (minors + determinant(c));
}

/// A measure of volume g(J), 0 and of slope 1 at J = 1: J - 1 from 0 to 1, and beyond by fourth roots, so that its
/// square grows more slowly than the squares of stretches do.
struct SwellingOf {
  Float8 value, rate;  ///< g, dg / dJ
};
SINEW_INLINE SwellingOf swellingOf(Float8 change) {
  const Float8 one = splat<Float8>(1.0F), beyond = larger(larger(change, Float8{} - change - one), Float8{});
  const Float8 root2 = squareRoot(beyond + one), root4 = squareRoot(root2);
  const Float8 more = 4.0F * beyond / ((root4 + one) * (root2 + one));
  return {select(change > Float8{}, more, select(change < Float8{} - one, Float8{} - one - more, change)),
          one / (root2 * root4)};
}

/// d det F / d F.
SINEW_INLINE Mat3Of<Float8> cofactor(const Mat3Of<Float8>& f) {
  Mat3Of<Float8> c;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      const int r1 = (row + 1) % 3, r2 = (row + 2) % 3, c1 = (column + 1) % 3, c2 = (column + 2) % 3;
      c(row, column) = f(r1, c1) * f(r2, c2) - f(r1, c2) * f(r2, c1);
    }
  }
  return c;
}

/// Psi = mu |F - R|^2 + lambda / 2 g^2(det F) of eight samples, times their volumes. Where a sample has a permanent
/// shape S, F stands for F S^-1. F and R are kept less 1, so that rounding is relative to the deformation.
/// \param energy added to, J. \return its derivative by F
SINEW_INLINE Mat3Of<Float8> stressOf(const FieldEnergyArguments& a, std::uint32_t s, double& energy) {
  const Mat3Of<Float8> one = identity<Float8>();
  const SamplePack& pack = a.packs[s];
  Mat3Of<Float8> change =
      deformationGradient(a.functions, a.gradients + std::size_t(24) * a.functions * s, a.coefficients);
  const float* const rest_change = a.rest_change != nullptr ? a.rest_change + std::size_t(72) * s : nullptr;
  if (rest_change != nullptr) change = fromRestShape(change, loadMatrix(rest_change));
  Mat3Of<Float8> f;
  for (int i = 0; i < 9; ++i) f.m[i] = change.m[i] + one.m[i];
  const Float8 swollen = determinantChange(change), unit = splat<Float8>(1.0F);
  float* const squeezed = a.squeezed + 8 * s;
  if (a.mark) store8(squeezed, clamped((kSqueezed - unit - swollen) / (kSqueezed - kInverted), Float8{}, unit));
  const Float8 common = load8(squeezed), own = unit - common;
  float* const q = a.quaternions + 32 * s;
  QuaternionOf<Float8> rotation = {load8(q), load8(q + 8), load8(q + 16), load8(q + 24)};
  Mat3Of<Float8> guide;
  for (int i = 0; i < 9; ++i) guide.m[i] = own * f.m[i] + common * one.m[i];
  nearestRotation(guide, rotation);
  store8(q, rotation.w);
  store8(q + 8, rotation.x);
  store8(q + 16, rotation.y);
  store8(q + 24, rotation.z);
  const Mat3Of<Float8> turn = turnOf(rotation);
  Mat3Of<Float8> strain;
  for (int i = 0; i < 9; ++i) strain.m[i] = change.m[i] - turn.m[i];
  const SwellingOf measure = swellingOf(swollen);
  const Float8 swelling = own * measure.value + common * ((change(0, 0) + change(1, 1)) + change(2, 2));
  const Float8 volume = load8(pack.volume) * a.stiffness;
  const Float8 mu = volume * load8(pack.mu), pressure = volume * load8(pack.lambda) * swelling;
  const Float8 size2 = squaredNorm(strain);
  const Float8 aligned = select(common < unit, mu * common / own, Float8{}) * squaredNorm(turn);
  energy += double(sumOfLanes((mu * size2 + aligned) + 0.5F * (pressure * swelling)));
  const Float8 twice = mu + mu, push = pressure * (own * measure.rate), common_push = pressure * common;
  const Mat3Of<Float8> area = cofactor(f);
  Mat3Of<Float8> p;
  for (int i = 0; i < 9; ++i) p.m[i] = twice * strain.m[i] + (push * area.m[i] + common_push * one.m[i]);
  if (a.limits != nullptr) {
    const Int8 on = (size2 > load8(a.limits[s].reach)) & (common < unit);
    if (any(on)) energy += addLimits(a.limits[s], pack, a.stiffness, on, f, p);
  }
  if (rest_change != nullptr) addTo(p, timesTransposed(p, loadMatrix(rest_change)));
  return p;
}

/// The energy of all samples, and sum P grad phi_j: some packs after the other, so that what they share stays in
/// registers; not that where nothing is to take it. \return the energy, J.
[[gnu::noinline]] static double fieldEnergy(const FieldEnergyArguments& a) {
  constexpr std::uint32_t kPacks = 4;
  const std::uint32_t k = a.functions;
  double energy = 0;
  for (std::uint32_t first = 0; first == 0 || first < a.pack_count; first += kPacks) {
    const std::uint32_t count = a.pack_count - first < kPacks ? a.pack_count - first : kPacks;
    Mat3Of<Float8> stress[kPacks];
    for (std::uint32_t i = 0; i < count; ++i) stress[i] = stressOf(a, first + i, energy);
    if (a.gradient == nullptr) continue;
    for (std::uint32_t j = 0; j < k; ++j) {
      float* const lanes = a.lanes + 24 * j;
      Vec3Of<Float8> sum = {};
      if (first > 0) sum = {load8(lanes), load8(lanes + 8), load8(lanes + 16)};
      const float* gradient = a.gradients + std::size_t(24) * (std::size_t(k) * first + j);
      for (std::uint32_t i = 0; i < count; ++i, gradient += std::size_t(24) * k) {
        sum = sum + stress[i] * Vec3Of<Float8>{load8(gradient), load8(gradient + 8), load8(gradient + 16)};
      }
      if (first + kPacks >= a.pack_count) {
        store4(a.gradient + 4 * j, sumsOf(sum));
        continue;
      }
      store8(lanes, sum.x);
      store8(lanes + 8, sum.y);
      store8(lanes + 16, sum.z);
    }
  }
  return energy;
}

/// Entry (i, j) of a symmetric 9 x 9 matrix that is kept as its lower triangle.
constexpr std::uint32_t ofNine(std::uint32_t i, std::uint32_t j) {
  return i >= j ? i * (i + 1) / 2 + j : j * (j + 1) / 2 + i;
}

/// to += weight n n^T, n = m S^-T: of strains m of F S^-1 where F is varied.
[[gnu::noinline]] static void addOuter(Float8 weight, const Mat3Of<Float8>& m, const Mat3Of<Float8>& to_rest,
                                       float* to) {
  const Mat3Of<Float8> n = timesTransposed(m, to_rest);
  float* entry = to;
  for (std::uint32_t i = 0; i < 9; ++i) {
    const Float8 scaled = weight * n.m[i];
    for (std::uint32_t j = 0; j <= i; ++j, entry += 8) store8(entry, load8(entry) + scaled * n.m[j]);
  }
}

/// u_a v_b^T.
[[gnu::noinline]] static Mat3Of<Float8> outer(const SvdOf<Float8>& svd, int a, int b) {
  Mat3Of<Float8> m;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) m(row, column) = svd.u(row, a) * svd.v(column, b);
  }
  return m;
}

/// d^2 Psi / dF^2 of eight samples times their volumes: 2 mu for directions of F that do not turn
/// R, 2 mu |1 - 2 / (sigma_i + sigma_j)| for turning ones (McAdams 2011; absolute values: Chen 2024), and lambda
/// (dg/dF)^2 (Gauss-Newton: no second derivative of g). Limits of principal stretches add theirs.
[[gnu::noinline]] static void sampleStiffness(const FieldStiffnessArguments& a, std::uint32_t s, float* out) {
  const SamplePack& pack = a.packs[s];
  const Mat3Of<Float8> one = identity<Float8>();
  const Float8 unit = splat<Float8>(1.0F), two = splat<Float8>(2.0F);
  Mat3Of<Float8> change =
      deformationGradient(a.functions, a.gradients + std::size_t(24) * a.functions * s, a.coefficients);
  Mat3Of<Float8> to_rest = one;  // S^-1
  if (a.rest_change != nullptr) {
    const Mat3Of<Float8> rest_change = loadMatrix(a.rest_change + std::size_t(72) * s);
    change = fromRestShape(change, rest_change);
    addTo(to_rest, rest_change);
  }
  const Float8 common = load8(a.squeezed + 8 * s), own = unit - common;
  Mat3Of<Float8> f, guide;
  for (int i = 0; i < 9; ++i) {
    f.m[i] = change.m[i] + one.m[i];
    guide.m[i] = own * change.m[i] + one.m[i];
  }
  const SvdOf<Float8> svd = rotationSvd(guide);
  const Float8 volume = load8(pack.volume) * a.stiffness;
  const Float8 mu2 = volume * load8(pack.mu) * 2.0F, pressure = volume * load8(pack.lambda);
  const Mat3Of<Float8> metric = timesTransposed(to_rest, to_rest);
  for (std::uint32_t i = 0; i < 9; ++i) {
    for (std::uint32_t j = 0; j <= i; ++j) {
      store8(out + 8 * ofNine(i, j), i % 3 == j % 3 ? mu2 * metric.m[i / 3 + 3 * (j / 3)] : Float8{});
    }
  }
  const Float8 sigma[3] = {svd.sigma.x, svd.sigma.y, svd.sigma.z};
  for (int axis = 0; axis < 3; ++axis) {
    const int p = (axis + 1) % 3, q = (axis + 2) % 3;
    const Float8 turned = two * own / larger(own, sigma[p] + sigma[q]);
    const Mat3Of<Float8> forth = outer(svd, p, q), back = outer(svd, q, p);
    Mat3Of<Float8> twist;
    for (int i = 0; i < 9; ++i) twist.m[i] = back.m[i] - forth.m[i];
    addOuter(-0.5F * mu2 * smaller(turned, two - turned), twist, to_rest, out);
  }
  const Float8 rate = own * swellingOf(determinantChange(change)).rate;
  const Mat3Of<Float8> area = cofactor(f);
  Mat3Of<Float8> swelling;
  for (int i = 0; i < 9; ++i) swelling.m[i] = rate * area.m[i] + common * one.m[i];
  addOuter(pressure, swelling, to_rest, out);
  if (a.limits == nullptr) return;
  const Float8 stiff = (2 * kLimitStiffness) * (mu2 + pressure);
  for (int axis = 0; axis < 3; ++axis) {
    const Float8 bound = clamped(sigma[axis], load8(a.limits[s].least), load8(a.limits[s].most));
    const Int8 beyond = ((sigma[axis] < bound) | (sigma[axis] > bound)) & (common <= Float8{});
    if (any(beyond)) {
      addOuter(select(beyond, stiff, Float8{}), outer(svd, axis, axis), to_rest, out);
    }
  }
}

/// The second derivative of fieldEnergy(), made positive sample by sample.
[[gnu::noinline]] static void fieldStiffness(const FieldStiffnessArguments& a) {
  const std::uint32_t k = a.functions, unknowns = 3 * (k - a.driven);
  float* const products = a.scratch + std::size_t(8 * 45) * a.pack_count;
  for (std::uint32_t s = 0; s < a.pack_count; ++s) sampleStiffness(a, s, a.scratch + std::size_t(8 * 45) * s);
  for (std::uint32_t column = 0; column < unknowns; ++column) {
    const std::uint32_t l = a.driven + column / 3, b = column % 3;
    // The stress of the samples as this unknown grows.
    for (std::uint32_t s = 0; s < a.pack_count; ++s) {
      const float *const d = a.scratch + std::size_t(8 * 45) * s, *const g = a.gradients +
                                                                             std::size_t(24) * (std::size_t(k) * s + l);
      const Float8 gx = load8(g), gy = load8(g + 8), gz = load8(g + 16);
      float* const to = products + std::size_t(8 * 9) * s;
      for (std::uint32_t i = 0; i < 9; ++i) {
        store8(to + 8 * i, (load8(d + 8 * ofNine(i, b)) * gx + load8(d + 8 * ofNine(i, b + 3)) * gy) +
                               load8(d + 8 * ofNine(i, b + 6)) * gz);
      }
    }
    for (std::uint32_t j = l; j < k; ++j) {
      Float8 x = {}, y = {}, z = {};
      for (std::uint32_t s = 0; s < a.pack_count; ++s) {
        const float *const p = products + std::size_t(8 * 9) * s, *const g = a.gradients +
                                                                             std::size_t(24) * (std::size_t(k) * s + j);
        const Float8 gx = load8(g), gy = load8(g + 8), gz = load8(g + 16);
        x += (load8(p) * gx + load8(p + 24) * gy) + load8(p + 48) * gz;
        y += (load8(p + 8) * gx + load8(p + 32) * gy) + load8(p + 56) * gz;
        z += (load8(p + 16) * gx + load8(p + 40) * gy) + load8(p + 64) * gz;
      }
      float* const to = a.matrix + std::size_t(3) * (j - a.driven) * a.stride + column;
      to[0] = sumOfLanes(x);
      to[a.stride] = sumOfLanes(y);
      to[2 * std::size_t(a.stride)] = sumOfLanes(z);
    }
  }
}

/// x = sum_j phi_j z_j at places.
static void fieldValues(const FieldValuesArguments& a) {
  for (std::uint32_t b = 0; b < a.blocks; ++b) {
    const float* const values = a.values + std::size_t(8) * a.functions * b;
    Float8 x = {}, y = {}, z = {};
    for (std::uint32_t j = 0; j < a.functions; ++j) {
      const Float8 phi = load8(values + 8 * j);
      x += phi * a.coefficients[4 * j];
      y += phi * a.coefficients[4 * j + 1];
      z += phi * a.coefficients[4 * j + 2];
    }
    store8(a.out + 24 * b, x);
    store8(a.out + 24 * b + 8, y);
    store8(a.out + 24 * b + 16, z);
  }
}

/// Eight rows of some columns.
template <std::uint32_t kColumns>
SINEW_INLINE void addProductBlock(const ProductArguments& a, std::uint32_t row, std::uint32_t column) {
  Double4 sum[2 * kColumns];
  double* const to = a.to + row;
  SINEW_UNROLL
  for (std::uint32_t c = 0; c < kColumns; ++c) {
    const double* const from = to + a.to_stride * (column + c);
    sum[2 * c] = loadDouble4(from);
    sum[2 * c + 1] = loadDouble4(from + 4);
  }
  for (std::uint32_t d = 0; d < a.depth; ++d) {
    const double* const left = a.left + a.stride * d + row;
    const Double4 low = loadDouble4(left), high = loadDouble4(left + 4);
    SINEW_UNROLL
    for (std::uint32_t c = 0; c < kColumns; ++c) {
      const double factor = a.right[std::size_t(a.depth) * (column + c) + d];
      addTimes(sum[2 * c], low, factor);
      addTimes(sum[2 * c + 1], high, factor);
    }
  }
  SINEW_UNROLL
  for (std::uint32_t c = 0; c < kColumns; ++c) {
    double* const out = to + a.to_stride * (column + c);
    storeDouble4(out, sum[2 * c]);
    storeDouble4(out + 4, sum[2 * c + 1]);
  }
}

static void addProduct(const ProductArguments& a) {
  std::uint32_t column = 0;
  for (; column + 4 <= a.columns; column += 4) {
    for (std::uint32_t row = 0; row < a.rows; row += 8) addProductBlock<4>(a, row, column);
  }
  for (; column < a.columns; ++column) {
    for (std::uint32_t row = 0; row < a.rows; row += 8) addProductBlock<1>(a, row, column);
  }
}

/// sum_m a_m r_m at places.
static void residualValues(const ResidualValuesArguments& a) {
  const std::int16_t* values = a.values;
  for (std::uint32_t row = 0; row < 3 * a.blocks; ++row, values += std::size_t(8) * a.modes) {
    Float8 even = {}, odd = {};
    std::uint32_t m = 0;
    for (; m + 1 < a.modes; m += 2) {
      even += convert8(values + 8 * m) * a.amplitudes[m];
      odd += convert8(values + 8 * m + 8) * a.amplitudes[m + 1];
    }
    if (m < a.modes) even += convert8(values + 8 * m) * a.amplitudes[m];
    store8(a.out + 8 * row, even + odd);
  }
}

/// Of kBlocks times eight modes, the first of which is `first`: their coordinates of the vector, divided by what they
/// resist; what these bring is added to a.lanes. Blocks side by side, so that sums do not wait for one another; each
/// adds as alone.
template <std::uint32_t kBlocks>
SINEW_INLINE void throughModes(const FieldModesArguments& a, std::uint32_t first) {
  const std::uint32_t n = a.unknowns;
  const std::size_t size = 8 * (std::size_t(n) + 1);
  const float* const block = a.modes + std::size_t(first) * (n + 1);
  Float8 even[kBlocks] = {}, odd[kBlocks] = {}, part[kBlocks];
  std::uint32_t i = 0;
  for (; i + 1 < n; i += 2) {
    for (std::uint32_t b = 0; b < kBlocks; ++b) even[b] += load8(block + b * size + 8 * (i + 1)) * a.vector[i];
    for (std::uint32_t b = 0; b < kBlocks; ++b) odd[b] += load8(block + b * size + 8 * (i + 2)) * a.vector[i + 1];
  }
  for (std::uint32_t b = 0; b < kBlocks; ++b) {
    if (i < n) even[b] += load8(block + b * size + 8 * (i + 1)) * a.vector[i];
    part[b] = (even[b] + odd[b]) / (load8(block + b * size) * a.stiffness + splat<Float8>(a.inertia));
  }
  for (i = 0; i < n; ++i) {
    Float8 sum = load8(a.lanes + 8 * i);
    for (std::uint32_t b = 0; b < kBlocks; ++b) sum += load8(block + b * size + 8 * (i + 1)) * part[b];
    store8(a.lanes + 8 * i, sum);
  }
}

/// Through the modes of the rest shape and back.
static void fieldModes(const FieldModesArguments& a) {
  const std::uint32_t n = a.unknowns;
  for (std::uint32_t i = 0; i < n; ++i) store8(a.lanes + 8 * i, Float8{});
  std::uint32_t first = 0;
  for (; first + 24 < n; first += 32) throughModes<4>(a, first);
  for (; first < n; first += 8) throughModes<1>(a, first);
  for (std::uint32_t i = 0; i < n; i += 3) {
    const float* const lanes = a.lanes + 8 * i;
    store4(a.vector + i, sumsOf({load8(lanes), load8(lanes + 8), load8(lanes + 16)}));
  }
}

/// The numbers of the lanes.
alignas(32) inline constexpr float kLaneNumbers[8] = {0, 1, 2, 3, 4, 5, 6, 7};

/// The inverse of the lower triangle of a block on the diagonal, written as a symmetric matrix.
SINEW_INLINE void invertBlock(float* block, std::uint32_t stride, std::uint32_t size) {
  float inverse[8][8];
  for (std::uint32_t c = 0; c < size; ++c) {
    for (std::uint32_t i = c; i < size; ++i) {
      const float* const row = block + std::size_t(stride) * i;
      float sum = i == c ? -1.0F : 0.0F;
      for (std::uint32_t k = c; k < i; ++k) sum += row[k] * inverse[k][c];
      inverse[i][c] = -sum / row[i];
    }
  }
  for (std::uint32_t i = 0; i < size; ++i) {
    for (std::uint32_t c = 0; c <= i; ++c) {
      block[std::size_t(stride) * i + c] = block[std::size_t(stride) * c + i] = inverse[i][c];
    }
  }
}

/// Cholesky factor L in place, column by column, and L^T above it; of each block of eight on the diagonal the inverse.
/// \return whether the matrix was positive.
static bool factorize(const FactorArguments& a) {
  float* const column = a.vector;
  for (std::uint32_t i = 0; i < a.stride; ++i) column[i] = 0;
  for (std::uint32_t k = 0; k < a.size; ++k) {
    float *const above = a.matrix + std::size_t(a.stride) * k, *const pivot = above + k;
    if (!(*pivot > 0)) return false;
    *pivot = squareRoot(*pivot);
    const float inverse = 1 / *pivot;
    column[k] = 0;
    for (std::uint32_t i = k + 1; i < a.size; ++i) {
      float* const entry = a.matrix + std::size_t(a.stride) * i + k;
      *entry *= inverse;
      column[i] = above[i] = *entry;
    }
    for (std::uint32_t i = k + 1; i < a.size; ++i) {
      float* const row = a.matrix + std::size_t(a.stride) * i;
      const float scale = column[i];
      for (std::uint32_t j = (k + 1) / 8 * 8; j <= i; j += 8)
        store8(row + j, load8(row + j) - load8(column + j) * scale);
    }
  }
  for (std::uint32_t k = 0; k < a.size; k += 8) {
    invertBlock(a.matrix + std::size_t(a.stride + 1) * k, a.stride, a.size - k < 8 ? a.size - k : 8);
  }
  return true;
}

/// x_I - sum of the rows from `begin` to `end` at block I, each times its unknown.
SINEW_INLINE Float8 lessRows(const FactorArguments& a, std::uint32_t block, std::uint32_t begin, std::uint32_t end) {
  Float8 even = load8(a.vector + block), odd = {};
  const float* row = a.matrix + std::size_t(a.stride) * begin + block;
  std::uint32_t i = begin;
  for (; i + 1 < end; i += 2, row += 2 * std::size_t(a.stride)) {
    even -= load8(row) * a.vector[i];
    odd -= load8(row + a.stride) * a.vector[i + 1];
  }
  if (i < end) even -= load8(row) * a.vector[i];
  return even + odd;
}

/// Solves with the factor, in place, block by block: L y = x, then L^T x = y.
static void solve(const FactorArguments& a) {
  const Float8 lanes = load8(kLaneNumbers);
  const auto throughDiagonal = [&](std::uint32_t block, bool transposed) {
    const float* row = a.matrix + std::size_t(a.stride + 1) * block;
    const std::uint32_t count = a.size - block < 8 ? a.size - block : 8;
    Float8 even = {}, odd = {};
    for (std::uint32_t c = 0; c < count; ++c, row += a.stride) {
      const Int8 has = transposed ? lanes <= float(c) : lanes >= float(c);
      (c % 2 == 0 ? even : odd) += select(has, load8(row), Float8{}) * a.vector[block + c];
    }
    store8(a.vector + block, even + odd);
  };
  for (std::uint32_t block = 0; block < a.size; block += 8) {
    store8(a.vector + block, lessRows(a, block, 0, block));
    throughDiagonal(block, false);
  }
  for (std::uint32_t block = (a.size + 7) / 8 * 8; block > 0;) {
    block -= 8;
    if (block + 8 < a.size) store8(a.vector + block, lessRows(a, block, block + 8, a.size));
    throughDiagonal(block, true);
  }
}

/// sum_j phi_j c_j at places.
static void fieldHeights(const FieldHeightsArguments& a) {
  for (std::uint32_t b = 0; b < a.blocks; ++b) {
    const float* const values = a.values + std::size_t(8) * a.functions * b;
    Float8 sum = {};
    for (std::uint32_t j = 0; j < a.functions; ++j) sum += load8(values + 8 * j) * a.coefficients[j];
    store8(a.out + 8 * b, sum);
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

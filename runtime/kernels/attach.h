// SPDX-License-Identifier: MIT
//
// Deformed visual vertices (docs/report.md §6): positions, normals and tangents from barycentric attachments or from
// blended cluster transforms. Vectors are held as xyz and one unused lane, because that is how they are read and
// written; only lengths are taken for four vertices at once.
#pragma once

#include "runtime/kernels/attach_layout.h"
#include "runtime/kernels/shuffles.h"

namespace sinew::internal::SINEW_KERNELS {

#define SINEW_INLINE_LAMBDA __attribute__((always_inline))

SINEW_INLINE Float4 splat4(float value) { return Float4{value, value, value, value}; }
SINEW_INLINE Float8 splat8(float v) { return joined(splat4(v), splat4(v)); }
#if defined(__AVX512F__)
using Float16 = float __attribute__((vector_size(64)));
SINEW_INLINE Float16 splat16(float v) { return Float16{v, v, v, v, v, v, v, v, v, v, v, v, v, v, v, v}; }
#endif
template <int K>
SINEW_INLINE Float4 spread(Float4 v) {
  return SINEW_SHUFFLE(v, v, K, K, K, K);
}
template <int I, int K>
SINEW_INLINE Float8 spreadPair(Float4 v) {
#if defined(__AVX__)
  return SINEW_SHUFFLE(v, v, I, I, I, I, K, K, K, K);
#else
  return joined(spread<I>(v), spread<K>(v));
#endif
}
// Three floats, without touching what lies behind them.
SINEW_INLINE Float4 load3(const float* p) {
#if defined(__SSE4_1__)
  const __m128 xy = _mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p)));
  return Float4(_mm_insert_ps(xy, _mm_load_ss(p + 2), 0x20));
#else
  return Float4{p[0], p[1], p[2], 0.0F};
#endif
}
SINEW_INLINE void store3(std::byte* p, Float4 v) {
#if defined(__SSE4_1__)
  const std::int64_t xy = _mm_cvtsi128_si64(_mm_castps_si128(__m128(v)));
  const std::int32_t z = _mm_extract_ps(__m128(v), 2);
  __builtin_memcpy(p, &xy, sizeof xy);
  __builtin_memcpy(p + 8, &z, sizeof z);
#else
  const float xyz[3] = {v[0], v[1], v[2]};
  __builtin_memcpy(p, xyz, sizeof xyz);
#endif
}

// Elements i .. i + 3 of a stream of vectors.
SINEW_INLINE void storeQuad(const OutputStream& out, std::uint32_t i, const Float4 (&v)[4]) {
  std::byte* p = out.data + std::size_t(i) * out.stride;
  if (out.stride == 12) {
    const Float4 a = SINEW_SHUFFLE(v[0], v[1], 0, 1, 2, 4);
    const Float4 b = SINEW_SHUFFLE(v[1], v[2], 1, 2, 4, 5);
    const Float4 z = SINEW_SHUFFLE(v[2], v[3], 2, 2, 4, 4);
    const Float4 c = SINEW_SHUFFLE(z, v[3], 0, 2, 5, 6);
    __builtin_memcpy(p, &a, 16);
    __builtin_memcpy(p + 16, &b, 16);
    __builtin_memcpy(p + 32, &c, 16);
    return;
  }
  store3(p, v[0]);
  store3(p + out.stride, v[1]);
  store3(p + 2 * out.stride, v[2]);
  store3(p + 3 * out.stride, v[3]);
}

// The four sums x + y + z.
SINEW_INLINE Float4 sumsOfQuad(Float4 a, Float4 b, Float4 c, Float4 d) {
  const Float4 ab_low = SINEW_SHUFFLE(a, b, 0, 4, 1, 5);  // ax bx ay by
  const Float4 cd_low = SINEW_SHUFFLE(c, d, 0, 4, 1, 5);
  const Float4 ab_high = SINEW_SHUFFLE(a, b, 2, 6, 3, 7);  // az bz
  const Float4 cd_high = SINEW_SHUFFLE(c, d, 2, 6, 3, 7);
  const Float4 x = SINEW_SHUFFLE(ab_low, cd_low, 0, 1, 4, 5);
  const Float4 y = SINEW_SHUFFLE(ab_low, cd_low, 2, 3, 6, 7);
  const Float4 z = SINEW_SHUFFLE(ab_high, cd_high, 0, 1, 4, 5);
  return (x + y) + z;
}

SINEW_INLINE Float4 cross(Float4 a, Float4 b) {
  const Float4 c = a * SINEW_SHUFFLE(b, b, 1, 2, 0, 3) - SINEW_SHUFFLE(a, a, 1, 2, 0, 3) * b;
  return SINEW_SHUFFLE(c, c, 1, 2, 0, 3);
}

// v scaled to unit length; where that cannot be told (nothing left, overflow, not a number) `fallback`, or up.
[[gnu::cold, gnu::noinline]] inline Float4 carefulUnit(Float4 v, Float4 fallback) {
  const Float4 candidates[2] = {v, fallback};
  for (const Float4& candidate : candidates) {
    const double x = double(candidate[0]), y = double(candidate[1]), z = double(candidate[2]);
    const double length = __builtin_sqrt(x * x + y * y + z * z);
    if (length > 1e-30 && length < 1e38) {
      return Float4{float(x / length), float(y / length), float(z / length), 0.0F};
    }
  }
  return Float4{0.0F, 1.0F, 0.0F, 0.0F};
}

// Scales that give four vectors unit length; false where that cannot be told.
SINEW_INLINE bool scalesOfQuad(const Float4 (&v)[4], Float4& scale) {
  const Float4 squared = sumsOfQuad(v[0] * v[0], v[1] * v[1], v[2] * v[2], v[3] * v[3]);
  const Int4 sound = (squared > splat4(1e-24F)) & (squared < splat4(1e30F));  // false for not a number
  scale = splat4(1.0F) / squareRoot(squared);
  return !any(~sound);
}
SINEW_INLINE void scaleQuad(Float4 (&v)[4], Float4 scale) {
  v[0] *= spread<0>(scale);
  v[1] *= spread<1>(scale);
  v[2] *= spread<2>(scale);
  v[3] *= spread<3>(scale);
}

// Four normals to unit length. \param rest_normals what to keep where there is no direction left.
SINEW_INLINE void normalizeQuad(Float4 (&n)[4], const float* rest_normals, const std::uint32_t (&index)[4]) {
  Float4 scale;
  if (scalesOfQuad(n, scale)) [[likely]] {
    scaleQuad(n, scale);
    return;
  }
  for (int k = 0; k < 4; ++k) n[k] = carefulUnit(n[k], load3(rest_normals + 3 * std::size_t(index[k])));
}

// A tangent made orthogonal to a unit normal, where the fast way found nothing left: any direction in the surface.
[[gnu::cold, gnu::noinline]] inline Float4 carefulTangent(Float4 t, Float4 n) {
  const Float4 unit = carefulUnit(t, n);
  const float along = unit[0] * n[0] + unit[1] * n[1] + unit[2] * n[2];
  const Float4 left = unit - splat4(along) * n;
  if (left[0] * left[0] + left[1] * left[1] + left[2] * left[2] > 1e-6F) return carefulUnit(left, n);
  const Float4 axis = __builtin_fabsf(n[0]) < 0.6F ? Float4{1, 0, 0, 0} : Float4{0, 0, 1, 0};
  return carefulUnit(cross(n, axis), axis);
}

// Tangents t made orthogonal to unit normals n, and unit.
SINEW_INLINE void orthonormalizeQuad(Float4 (&t)[4], const Float4 (&n)[4]) {
  Float4 scale, left_scale;
  Float4 left[4] = {t[0], t[1], t[2], t[3]};
  bool sound = scalesOfQuad(left, scale);
  scaleQuad(left, scale);
  const Float4 along = sumsOfQuad(left[0] * n[0], left[1] * n[1], left[2] * n[2], left[3] * n[3]);
  left[0] -= spread<0>(along) * n[0];
  left[1] -= spread<1>(along) * n[1];
  left[2] -= spread<2>(along) * n[2];
  left[3] -= spread<3>(along) * n[3];
  sound &= scalesOfQuad(left, left_scale) && !any(left_scale > splat4(1e3F));
  if (sound) [[likely]] {
    scaleQuad(left, left_scale);
    for (int k = 0; k < 4; ++k) t[k] = left[k];
    return;
  }
  for (int k = 0; k < 4; ++k) t[k] = carefulTangent(t[k], n[k]);
}

/// Fills frames [begin, end) from positions (3 floats each).
inline void fillSlotFrames(const float* positions, const SlotCorners* corners, SlotFrame* frames, std::uint32_t begin,
                           std::uint32_t end) {
  for (std::uint32_t i = begin; i < end; ++i) {
    const std::uint32_t* c = corners[i].vertex;
    const Float4 last = load3(positions + 3 * std::size_t(c[3]));
    for (int k = 0; k < 3; ++k) {
      const Float4 p = load3(positions + 3 * std::size_t(c[k]));
      store4(frames[i].column[k], p - last);
    }
    store4(frames[i].column[3], last);
  }
}

SINEW_INLINE Float4 attachedPoint(const AttachmentRecord& record, const SlotFrame* frames) {
  const float* frame = frames[record.slot].column[0];
  const Float4 weights = load4(record.weight);  // the slot in the last lane
  const Float4 w = SINEW_SHUFFLE(weights, splat4(1.0F), 0, 1, 2, 7);
  const Float8 sum = spreadPair<0, 1>(w) * load8(frame) + spreadPair<2, 3>(w) * load8(frame + 8);
  return lowHalf(sum) + highHalf(sum);
}

/// Positions of visual vertices [begin, end).
inline void writeAttachedPositions(const AttachmentRecord* records, const SlotFrame* frames, std::uint32_t begin,
                                   std::uint32_t end, OutputStream out) {
  std::uint32_t i = begin;
  for (; i + 4 <= end; i += 4) {
    const AttachmentRecord* r = records + i;
    const Float4 p[4] = {attachedPoint(r[0], frames), attachedPoint(r[1], frames), attachedPoint(r[2], frames),
                         attachedPoint(r[3], frames)};
    storeQuad(out, i, p);
  }
  for (; i < end; ++i) store3(out.data + std::size_t(i) * out.stride, attachedPoint(records[i], frames));
}

// q = (X - center) / radius of a cluster.
SINEW_INLINE Float4 clusterOffset(const ClusterColumns& cluster, Float4 rest) {
  return (rest - load4(cluster.center)) * splat4(cluster.inverse_radius);
}

SINEW_INLINE Float4 clusterPoint(const ClusterColumns& cluster, Float4 rest) {
  const Float4 q = clusterOffset(cluster, rest), x = spread<0>(q), y = spread<1>(q), z = spread<2>(q);
  Float4 p = (load4(cluster.column[0]) + x * load4(cluster.column[1])) +
             (y * load4(cluster.column[2]) + z * load4(cluster.column[3]));
  if (cluster.quadratic != 0) {
    const Float4 squares = q * q, mixed = q * SINEW_SHUFFLE(q, q, 1, 2, 0, 3);  // xx yy zz, xy yz zx
    p += (spread<0>(squares) * load4(cluster.column[4]) + spread<1>(squares) * load4(cluster.column[5])) +
         (spread<2>(squares) * load4(cluster.column[6]) + spread<0>(mixed) * load4(cluster.column[7])) +
         (spread<1>(mixed) * load4(cluster.column[8]) + spread<2>(mixed) * load4(cluster.column[9]));
  }
  return p;
}

struct Columns3 {
  Float4 x, y, z;
};

// d g / d X (eq. 17).
SINEW_INLINE Columns3 clusterSlope(const ClusterColumns& cluster, Float4 rest) {
  Columns3 g = {load4(cluster.column[1]), load4(cluster.column[2]), load4(cluster.column[3])};
  if (cluster.quadratic != 0) {
    const Float4 q = clusterOffset(cluster, rest), x = spread<0>(q), y = spread<1>(q), z = spread<2>(q);
    const Float4 xy = load4(cluster.column[7]), yz = load4(cluster.column[8]), zx = load4(cluster.column[9]);
    g.x += ((x + x) * load4(cluster.column[4]) + y * xy) + z * zx;
    g.y += ((y + y) * load4(cluster.column[5]) + x * xy) + z * yz;
    g.z += ((z + z) * load4(cluster.column[6]) + y * yz) + x * zx;
  }
  const Float4 scale = splat4(cluster.inverse_radius);
  return {scale * g.x, scale * g.y, scale * g.z};
}

// cof(A) = det(A) A^-T, also where A is singular: how areas and normals transform.
SINEW_INLINE Columns3 cofactor(const Columns3& a) { return {cross(a.y, a.z), cross(a.z, a.x), cross(a.x, a.y)}; }

SINEW_INLINE void addScaled(Columns3& sum, float weight, const Columns3& a) {
  const Float4 w = splat4(weight);
  sum.x += w * a.x;
  sum.y += w * a.y;
  sum.z += w * a.z;
}
SINEW_INLINE void store(PaddedMatrix& out, const Columns3& a) {
  store4(out.column[0], a.x);
  store4(out.column[1], a.y);
  store4(out.column[2], a.z);
}

/// Deformation gradients of slots [begin, end).
inline void fillSlotGradients(const SlotFrame* frames, const SlotInverse* inverses, PaddedMatrix* gradients,
                              std::uint32_t begin, std::uint32_t end) {
  for (std::uint32_t i = begin; i < end; ++i) {
    Columns3 sum = {};
    for (int k = 0; k < 3; ++k) {
      const Float4 edge = load4(frames[i].column[k]), row = load4(inverses[i].row[k]);
      sum.x += spread<0>(row) * edge;
      sum.y += spread<1>(row) * edge;
      sum.z += spread<2>(row) * edge;
    }
    store(gradients[i], sum);
  }
}

/// Deformation gradients of physical vertices [begin, end), and their cofactors; either output may be null.
/// \param runs of the slots at a vertex, by vertex.
inline void fillGradients(const BlendRun* runs, const BlendTerm* terms, const PaddedMatrix* slots,
                          PaddedMatrix* gradients, PaddedMatrix* cofactors, std::uint32_t begin, std::uint32_t end) {
  for (std::uint32_t i = begin; i < end; ++i) {
    Columns3 sum = {};
    for (std::uint32_t k = runs[i].first; k < runs[i].first + runs[i].count; ++k) {
      const PaddedMatrix& slot = slots[terms[k].of];
      addScaled(sum, terms[k].weight, {load4(slot.column[0]), load4(slot.column[1]), load4(slot.column[2])});
    }
    if (gradients != nullptr) store(gradients[i], sum);
    if (cofactors != nullptr) store(cofactors[i], cofactor(sum));
  }
}

SINEW_INLINE Float4 times(const Columns3& m, Float4 v) {
  return (spread<0>(v) * m.x + spread<1>(v) * m.y) + spread<2>(v) * m.z;
}

// (Σ w_k M_k) v over the corners of an attachment, w_3 = 1 - w_0 - w_1 - w_2.
SINEW_INLINE Float4 blendCorners(const AttachmentRecord& record, const SlotCorners& corners,
                                 const PaddedMatrix* matrices, const float* v) {
  const float *w = record.weight, last = 1.0F - w[0] - w[1] - w[2];
  const float* m0 = matrices[corners.vertex[0]].column[0];
  const float* m1 = matrices[corners.vertex[1]].column[0];
  const float* m2 = matrices[corners.vertex[2]].column[0];
  const float* m3 = matrices[corners.vertex[3]].column[0];
#if defined(__AVX512F__)
  const Float16 sum = (splat16(w[0]) * load16(m0) + splat16(w[1]) * load16(m1)) +
                      (splat16(w[2]) * load16(m2) + splat16(last) * load16(m3));
  const Float4 x = SINEW_SHUFFLE(sum, sum, 0, 1, 2, 3), y = SINEW_SHUFFLE(sum, sum, 4, 5, 6, 7),
               z = SINEW_SHUFFLE(sum, sum, 8, 9, 10, 11);
#else
  const Float8 xy =
      (splat8(w[0]) * load8(m0) + splat8(w[1]) * load8(m1)) + (splat8(w[2]) * load8(m2) + splat8(last) * load8(m3));
  const Float4 z = (splat4(w[0]) * load4(m0 + 8) + splat4(w[1]) * load4(m1 + 8)) +
                   (splat4(w[2]) * load4(m2 + 8) + splat4(last) * load4(m3 + 8));
  const Float4 x = lowHalf(xy), y = highHalf(xy);
#endif
  return (splat4(v[0]) * x + splat4(v[1]) * y) + splat4(v[2]) * z;
}

/// Unit normals of visual vertices [begin, end), and tangents where `tangents.data` is given (xyz unit and orthogonal
/// to the normal, w the sign of the rest tangent). \param rest_normals 3 floats each. \param rest_tangents 4 floats
/// each. \param deform(vertex, normal, tangent) computes cofactor * normal and gradient * tangent of a vertex.
template <class Deform>
SINEW_INLINE void writeDirections(const float* rest_normals, const float* rest_tangents, std::uint32_t begin,
                                  std::uint32_t end, OutputStream normals, OutputStream tangents,
                                  const Deform& deform) {
  // In two passes over a few at a time: roots and quotients wait for what is gathered, and gathering waits for memory.
  constexpr std::uint32_t kRun = 32;
  for (std::uint32_t first = begin; first < end; first += kRun) {
    const std::uint32_t count = end - first < kRun ? end - first : kRun;
    Float4 n[kRun], t[kRun];
    for (std::uint32_t k = 0; k < count; ++k) deform(first + k, n[k], t[k]);
    // Short of four vertices the last one is computed more than once.
    for (std::uint32_t k = count; k % 4 != 0; ++k) n[k] = n[count - 1], t[k] = t[count - 1];
    for (std::uint32_t k = 0; k < count; k += 4) {
      const std::uint32_t i = first + k, last = end - 1;
      const std::uint32_t index[4] = {i, i + 1 < end ? i + 1 : last, i + 2 < end ? i + 2 : last,
                                      i + 3 < end ? i + 3 : last};
      Float4 quad[4] = {n[k], n[k + 1], n[k + 2], n[k + 3]};
      normalizeQuad(quad, rest_normals, index);
      if (normals.data != nullptr) {
        if (i + 4 <= end) {
          storeQuad(normals, i, quad);
        } else {
          for (std::uint32_t c = 0; i + c < end; ++c)
            store3(normals.data + std::size_t(i + c) * normals.stride, quad[c]);
        }
      }
      if (tangents.data != nullptr) {
        Float4 along[4] = {t[k], t[k + 1], t[k + 2], t[k + 3]};
        orthonormalizeQuad(along, quad);
        for (std::uint32_t c = 0; c < 4 && i + c < end; ++c) {
          const Float4 value = Float4{along[c][0], along[c][1], along[c][2], rest_tangents[4 * std::size_t(i + c) + 3]};
          __builtin_memcpy(tangents.data + std::size_t(i + c) * tangents.stride, &value, sizeof value);
        }
      }
    }
  }
}

/// Of barycentric attachments. \param records with weights in 0..1: far outside its tetrahedron a direction would
/// otherwise extrapolate the difference of neighbours. \param gradients, rest_tangents only needed for tangents.
inline void writeAttachedDirections(const AttachmentRecord* records, const SlotCorners* corners,
                                    const PaddedMatrix* cofactors, const PaddedMatrix* gradients,
                                    const float* rest_normals, const float* rest_tangents, std::uint32_t begin,
                                    std::uint32_t end, OutputStream normals, OutputStream tangents) {
  writeDirections(rest_normals, rest_tangents, begin, end, normals, tangents,
                  [&](std::uint32_t i, Float4& n, Float4& t) SINEW_INLINE_LAMBDA {
                    const SlotCorners& at = corners[records[i].slot];
                    n = blendCorners(records[i], at, cofactors, rest_normals + 3 * std::size_t(i));
                    if (tangents.data != nullptr) {
                      t = blendCorners(records[i], at, gradients, rest_tangents + 4 * std::size_t(i));
                    }
                  });
}

/// Positions of visual vertices [begin, end) that hang on clusters. \param rest rest positions, 3 floats each.
inline void writeBlendedPositions(const float* rest, const BlendRun* runs, const BlendTerm* terms,
                                  const ClusterColumns* clusters, std::uint32_t begin, std::uint32_t end,
                                  OutputStream out) {
  for (std::uint32_t i = begin; i < end; ++i) {
    const Float4 position = load3(rest + 3 * std::size_t(i));
    Float4 sum = {};
    for (std::uint32_t k = runs[i].first; k < runs[i].first + runs[i].count; ++k) {
      sum += splat4(terms[k].weight) * clusterPoint(clusters[terms[k].of], position);
    }
    store3(out.data + std::size_t(i) * out.stride, sum);
  }
}

/// Normals and tangents of visual vertices that hang on clusters.
inline void writeBlendedDirections(const float* rest, const BlendRun* runs, const BlendTerm* terms,
                                   const ClusterColumns* clusters, const float* rest_normals,
                                   const float* rest_tangents, std::uint32_t begin, std::uint32_t end,
                                   OutputStream normals, OutputStream tangents) {
  writeDirections(rest_normals, rest_tangents, begin, end, normals, tangents,
                  [&](std::size_t i, Float4& n, Float4& t) SINEW_INLINE_LAMBDA {
                    const Float4 position = load3(rest + 3 * i), rest_n = load3(rest_normals + 3 * i);
                    n = t = Float4{};
                    for (std::uint32_t j = runs[i].first; j < runs[i].first + runs[i].count; ++j) {
                      const Columns3 slope = clusterSlope(clusters[terms[j].of], position);
                      const Float4 w = splat4(terms[j].weight);
                      n += w * times(cofactor(slope), rest_n);
                      if (tangents.data != nullptr) t += w * times(slope, load4(rest_tangents + 4 * i));
                    }
                  });
}

/// Least and largest coordinates of `count` points, 3 floats each; unusable ones are left out. \param low, high in and
/// out, 3 floats each.
inline void growBounds(const float* points, std::uint32_t count, float* low, float* high) {
  const Float4 limit = splat4(1e15F);
  Float4 least = load3(low), most = load3(high);
  for (std::uint32_t i = 0; i < count; ++i) {
    const Float4 p = load3(points + 3 * std::size_t(i));
    const Int4 sound = absolute(p) <= limit;
    if (any(~sound)) continue;
    least = select(p < least, p, least);
    most = select(p > most, p, most);
  }
  for (int k = 0; k < 3; ++k) {
    low[k] = least[k];
    high[k] = most[k];
  }
}

/// Which of the places [begin, end) lie below a plane: x along its normal less than its level. \param plane normal and
/// level. \param[out] found their numbers, room for end - begin. \return how many
inline std::uint32_t findBelow(OutputStream places, std::uint32_t begin, std::uint32_t end, const float* plane,
                               std::uint32_t* found) {
  const Float4 normal = load3(plane), level = splat4(plane[3]);
  std::uint32_t count = 0;
  for (std::uint32_t i = begin; i < end; i += 4) {
    Float4 along[4];
    for (std::uint32_t k = 0; k < 4; ++k) {
      const std::size_t v = i + k < end ? i + k : end - 1;
      along[k] = normal * load3(reinterpret_cast<const float*>(places.data + v * places.stride));
    }
    const Int4 below = sumsOfQuad(along[0], along[1], along[2], along[3]) < level;
    if (!any(below)) continue;
    for (std::uint32_t k = 0; k < 4 && i + k < end; ++k) {
      found[count] = i + k;
      count += isSet(below, k) ? 1U : 0U;
    }
  }
  return count;
}

inline constexpr AttachKernels attachTable() {
  return {fillSlotFrames,
          fillSlotGradients,
          fillGradients,
          writeAttachedPositions,
          writeAttachedDirections,
          writeBlendedPositions,
          writeBlendedDirections,
          growBounds,
          findBelow};
}

}  // namespace sinew::internal::SINEW_KERNELS

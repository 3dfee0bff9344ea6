// SPDX-License-Identifier: MIT
//
// Loops over physical vertices: predict, apply goals, sums of motion, settle (docs/method.md §5). For kernel files
// only, see lanes.h.
#pragma once

#include "runtime/kernels/kernels.h"
#include "runtime/kernels/shuffles.h"

namespace sinew::internal::SINEW_KERNELS {

SINEW_INLINE Vec3Of<Float8> broadcast(const float (&v)[3]) {
  return {splat<Float8>(v[0]), splat<Float8>(v[1]), splat<Float8>(v[2])};
}

SINEW_INLINE Vec3Of<Float8> velocityAt(const MotionOf3& motion, const Vec3Of<Float8>& point) {
  return broadcast(motion.velocity) + cross(broadcast(motion.omega), point - broadcast(motion.center));
}

SINEW_INLINE Int8 within(const Vec3Of<Float8>& v, float limit) {
  return (absolute(v.x) <= limit) & (absolute(v.y) <= limit) & (absolute(v.z) <= limit);  // false for NaN
}

// Partial sums of eight vertices at a time.
struct MotionAccumulator {
  Float8 sum[16] = {};
  SINEW_INLINE void addMomentum(Float8 mass, const Vec3Of<Float8>& arm, const Vec3Of<Float8>& velocity) {
    const Vec3Of<Float8> p = mass * velocity;
    const Vec3Of<Float8> l = cross(arm, p);
    sum[4] += p.x;
    sum[5] += p.y;
    sum[6] += p.z;
    sum[7] += l.x;
    sum[8] += l.y;
    sum[9] += l.z;
  }
  SINEW_INLINE void addMass(Float8 mass, const Vec3Of<Float8>& arm) {
    const Vec3Of<Float8> m = mass * arm;
    sum[0] += mass;
    sum[1] += m.x;
    sum[2] += m.y;
    sum[3] += m.z;
    sum[10] += m.x * arm.x;
    sum[11] += m.y * arm.y;
    sum[12] += m.z * arm.z;
    sum[13] += m.x * arm.y;
    sum[14] += m.y * arm.z;
    sum[15] += m.z * arm.x;
  }
  SINEW_INLINE void store(MotionLanes& out) const {
    for (int k = 0; k < 16; ++k) store8(out.sum[k], sum[k]);
  }
};

SINEW_INLINE std::uint32_t predict(const PredictArguments& a) {
  const VertexRange& r = a.vertices;
  const Vec3Of<Float8> kick = broadcast(a.kick), reference = broadcast(a.reference), moving = broadcast(a.moving);
  const Float8 kept = splat<Float8>(a.kept), h = splat<Float8>(a.h);
  MotionAccumulator sums;
  std::uint32_t repaired = 0;
  for (std::uint32_t i = r.begin; i < r.end; i += 8) {
    const std::uint32_t count = r.end - i < 8 ? r.end - i : 8;
    Vec3Of<Float8> x = loadTriples(r.x + 3 * std::uint64_t(i), count);
    Vec3Of<Float8> v = loadTriples(r.v + 3 * std::uint64_t(i), count);
    const Int8 unusable = ~(within(x, kLargestPosition) & within(v, kLargestVelocity));
    if (any(unusable)) {
      for (std::uint32_t k = 0; k < count; ++k) {
        if (!lane(unusable, k)) continue;
        a.repair(a.context, i + k);
        ++repaired;
      }
      x = loadTriples(r.x + 3 * std::uint64_t(i), count);
      v = loadTriples(r.v + 3 * std::uint64_t(i), count);
    }
    v = kept * (v + kick);
    const Vec3Of<Float8> y = x + h * v;
    storeTriples(r.v + 3 * std::uint64_t(i), v, count);
    storeTriples(r.y + 3 * std::uint64_t(i), y, count);
    sums.addMomentum(loadScalars(r.mass + i, count), y - reference, v - moving);
  }
  sums.store(*a.sums);
  return repaired;
}

SINEW_INLINE void apply(const ApplyArguments& a) {
  const VertexRange& r = a.vertices;
  const Vec3Of<Float8> normal = broadcast(a.normal), reference = broadcast(a.reference), moving = broadcast(a.moving);
  MotionAccumulator sums;
  for (std::uint32_t i = r.begin; i < r.end; i += 8) {
    const std::uint32_t count = r.end - i < 8 ? r.end - i : 8;
    const UseBlock use = a.uses[(i - r.begin) / 8];
    const std::uint32_t* offset = a.use_offset + 8 * std::uint64_t(use.first);
    // Vertices k and k + 4 side by side.
    Float8 moves[4] = {};
    for (std::uint32_t row = 0; row < use.rows; ++row, offset += 8) {
      for (int k = 0; k < 4; ++k) moves[k] += joined(load4(a.slots + offset[k]), load4(a.slots + offset[k + 4]));
    }
    Vec3Of<Float8> moved = toLanes(moves);
    const Vec3Of<Float8> start = loadTriples(r.y + 3 * std::uint64_t(i), count);
    if (a.ground) {
      // Rows hold the clusters up; what a vertex keeps of its own below the surface is taken here.
      const Float8 below = dot(normal, start + moved) - a.offset;
      const Float8 height = dot(normal, loadTriples(r.x + 3 * std::uint64_t(i), count)) - a.offset;
      const Float8 least = select(height >= 0.0F, Float8{}, smaller(height + splat<Float8>(a.recovery), Float8{}));
      moved = moved + select(below < least, least - below, Float8{}) * normal;
    }
    // v = (y - x) / h, but from the move: far from the origin the rounding of positions must not become speed.
    const Vec3Of<Float8> v = loadTriples(r.v + 3 * std::uint64_t(i), count) + splat<Float8>(a.inverse_h) * moved;
    const Vec3Of<Float8> y = start + moved;
    storeTriples(r.v + 3 * std::uint64_t(i), v, count);
    storeTriples(r.y + 3 * std::uint64_t(i), y, count);
    if (a.sums != nullptr) {
      const Float8 mass = loadScalars(r.mass + i, count);
      const Vec3Of<Float8> arm = y - reference;
      sums.addMomentum(mass, arm, v - moving);
      sums.addMass(mass, arm);
    }
  }
  if (a.sums != nullptr) sums.store(*a.sums);
}

SINEW_INLINE void sum(const SumArguments& a) {
  const VertexRange& r = a.vertices;
  const Vec3Of<Float8> reference = broadcast(a.reference), moving = broadcast(a.moving);
  MotionAccumulator sums;
  for (std::uint32_t i = r.begin; i < r.end; i += 8) {
    const std::uint32_t count = r.end - i < 8 ? r.end - i : 8;
    Float8 mass = loadScalars(r.mass + i, count);
    if (a.anchor_mass > 0) {
      for (std::uint32_t k = 0; k < count; ++k) {
        const float* force = a.force + 3 * std::uint64_t(i + k);
        if (a.anchored[i + k] != 0 || force[0] != 0 || force[1] != 0 || force[2] != 0) {
          setLane(mass, k, lane(mass, k) + a.anchor_mass);
        }
      }
    }
    const Vec3Of<Float8> arm = loadTriples(a.at + 3 * std::uint64_t(i), count) - reference;
    sums.addMomentum(mass, arm, loadTriples(r.v + 3 * std::uint64_t(i), count) - moving);
    sums.addMass(mass, arm);
  }
  sums.store(*a.sums);
}

SINEW_INLINE void settle(const SettleArguments& a) {
  const VertexRange& r = a.vertices;
  const Float8 h = splat<Float8>(a.h);
  for (std::uint32_t i = r.begin; i < r.end; i += 8) {
    const std::uint32_t count = r.end - i < 8 ? r.end - i : 8;
    const Vec3Of<Float8> y = loadTriples(r.y + 3 * std::uint64_t(i), count);
    const Vec3Of<Float8> own = loadTriples(r.v + 3 * std::uint64_t(i), count) - velocityAt(a.found, y);
    const Vec3Of<Float8> arm = y - broadcast(a.found.center);
    const auto rigid = [&](const MotionOf3& motion) {
      return broadcast(motion.velocity) + cross(broadcast(motion.omega), arm);
    };
    if (a.free) {
      const Vec3Of<Float8> x = loadTriples(r.x + 3 * std::uint64_t(i), count);
      storeTriples(r.x + 3 * std::uint64_t(i), x + h * (rigid(a.moved_as) + own), count);
    } else {
      storeTriples(r.x + 3 * std::uint64_t(i), y, count);
    }
    Float8 kept = splat<Float8>(a.kept);
    if (a.vertex_kept != nullptr) kept = kept * loadScalars(a.vertex_kept + (i - r.begin), count);
    storeTriples(r.v + 3 * std::uint64_t(i), rigid(a.wanted) + kept * own, count);
  }
}

SINEW_INLINE void addMotion(const AddMotionArguments& a) {
  const VertexRange& r = a.vertices;
  for (std::uint32_t i = r.begin; i < r.end; i += 8) {
    const std::uint32_t count = r.end - i < 8 ? r.end - i : 8;
    const Vec3Of<Float8> v = loadTriples(r.v + 3 * std::uint64_t(i), count);
    const Vec3Of<Float8> x = loadTriples(r.x + 3 * std::uint64_t(i), count);
    storeTriples(r.v + 3 * std::uint64_t(i), v + velocityAt(a.motion, x), count);
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

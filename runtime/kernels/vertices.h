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

// Arguments are taken by value below: what lives in a register need not be read again after each store.

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

// Whether any of eight vertices' floats is out of bounds or no number.
SINEW_INLINE bool anyUnusable(const Triples8& x, const Triples8& v) {
  Int8 usable = absolute(x.part[0]) <= kLargestPosition;
  usable &= absolute(v.part[0]) <= kLargestVelocity;
  for (int k = 1; k < 3; ++k) {
    usable &= absolute(x.part[k]) <= kLargestPosition;
    usable &= absolute(v.part[k]) <= kLargestVelocity;
  }
  return any(~usable);
}

SINEW_INLINE std::uint32_t predict(const PredictArguments a) {
  const VertexRange& r = a.vertices;
  const Vec3Of<Float8> reference = broadcast(a.reference), moving = broadcast(a.moving);
  const Triples8 kick = repeated(a.kick);
  const Float8 kept = splat<Float8>(a.kept), h = splat<Float8>(a.h);
  MotionAccumulator sums;
  std::uint32_t repaired = 0;
  for (std::uint32_t i = r.begin; i < r.end; i += 8) {
    const std::uint32_t count = r.end - i < 8 ? r.end - i : 8;
    Triples8 x = loadTriples(r.x + 3 * std::uint64_t(i), count);
    Triples8 v = loadTriples(r.v + 3 * std::uint64_t(i), count);
    if (anyUnusable(x, v)) {
      const Vec3Of<Float8> at = lanesOf(x), speed = lanesOf(v);
      const Int8 unusable = ~(within(at, kLargestPosition) & within(speed, kLargestVelocity));
      for (std::uint32_t k = 0; k < count; ++k) {
        if (!isSet(unusable, k)) continue;
        a.repair(a.context, i + k);
        ++repaired;
      }
      x = loadTriples(r.x + 3 * std::uint64_t(i), count);
      v = loadTriples(r.v + 3 * std::uint64_t(i), count);
    }
    v = kept * (v + kick);
    const Triples8 y = x + h * v;
    storeTriples(r.v + 3 * std::uint64_t(i), v, count);
    storeTriples(r.y + 3 * std::uint64_t(i), y, count);
    // At x the angular momentum is the same as at y = x + h v, and the arms are short however fast the vertices are.
    sums.addMomentum(loadScalars(r.mass + i, count), lanesOf(x) - reference, lanesOf(v) - moving);
  }
  sums.store(*a.sums);
  return repaired;
}

SINEW_INLINE Float8 pairOfSlots(const ApplyArguments& a, const std::uint32_t* offset) {
  return joined(load4(a.slots + offset[0]), load4(a.slots + offset[1]));
}

#if defined(__AVX512F__)
// y += moves and v += moves / h of sixteen vertices without ground, with as many runs and rows in both use blocks.
SINEW_INLINE void applyToSixteen(const ApplyArguments& a, std::uint32_t i, UseBlock use, UseBlock second) {
  const std::uint32_t* one = a.use_offset + 8 * std::uint64_t(use.first);
  const std::uint32_t* two = a.use_offset + 8 * std::uint64_t(second.first);
  Triples16 moved = {};
  for (std::uint32_t run = 0; run < use.runs; ++run) {
    const float *low = a.slots + one[run], *high = a.slots + two[run];
    moved.part[0] += load16(low);
    moved.part[1] += joined(load8(low + 16), load8(high));
    moved.part[2] += load16(high + 8);
  }
  if (use.rows > 0) {
    one += (use.runs + 7) / 8 * 8;
    two += (use.runs + 7) / 8 * 8;
    Float8 sums[8];
    for (int k = 0; k < 4; ++k) {
      sums[k] = pairOfSlots(a, one + 2 * k);
      sums[4 + k] = pairOfSlots(a, two + 2 * k);
    }
    for (std::uint32_t row = 1; row < use.rows; ++row) {
      one += 8;
      two += 8;
      for (int k = 0; k < 4; ++k) {
        sums[k] += pairOfSlots(a, one + 2 * k);
        sums[4 + k] += pairOfSlots(a, two + 2 * k);
      }
    }
    Float16 moves[4];
    for (int k = 0; k < 4; ++k) moves[k] = joined(sums[2 * k], sums[2 * k + 1]);
    const Triples16 others = triplesOf(moves);
    for (int k = 0; k < 3; ++k) moved.part[k] += others.part[k];
  }
  float* y = a.vertices.y + 3 * std::uint64_t(i);
  float* v = a.vertices.v + 3 * std::uint64_t(i);
  for (int k = 0; k < 3; ++k) {
    store16(v + 16 * k, load16(v + 16 * k) + splat<Float16>(a.inverse_h) * moved.part[k]);
    store16(y + 16 * k, load16(y + 16 * k) + moved.part[k]);
  }
}
#endif

SINEW_INLINE void apply(const ApplyArguments a) {
  const VertexRange& r = a.vertices;
  const Vec3Of<Float8> normal = broadcast(a.normal), reference = broadcast(a.reference), moving = broadcast(a.moving);
  MotionAccumulator sums;
  const auto add = [&](std::uint32_t i, std::uint32_t count, const Triples8& y, const Triples8& v) {
    const Float8 mass = loadScalars(r.mass + i, count);
    const Vec3Of<Float8> arm = lanesOf(y) - reference;
    sums.addMomentum(mass, arm, lanesOf(v) - moving);
    sums.addMass(mass, arm);
  };
  for (std::uint32_t i = r.begin; i < r.end; i += 8) {
#if defined(__AVX512F__)
    const UseBlock* const both = a.uses + (i - r.begin) / 8;
    if (!a.ground && i + 16 <= r.end && both[0].rows == both[1].rows && both[0].runs == both[1].runs) [[likely]] {
      applyToSixteen(a, i, both[0], both[1]);
      if (a.sums != nullptr) {
        for (std::uint32_t k = i; k < i + 16; k += 8) {
          add(k, 8, loadTriples(r.y + 3 * std::uint64_t(k)), loadTriples(r.v + 3 * std::uint64_t(k)));
        }
      }
      i += 8;
      continue;
    }
#endif
    const std::uint32_t count = r.end - i < 8 ? r.end - i : 8;
    const UseBlock use = a.uses[(i - r.begin) / 8];
    const std::uint32_t* offset = a.use_offset + 8 * std::uint64_t(use.first);
    Triples8 moved = {};
    for (std::uint32_t run = 0; run < use.runs; ++run) moved = moved + loadTriples(a.slots + offset[run]);
    if (use.rows > 0) {
      offset += (use.runs + 7) / 8 * 8;
      Float8 moves[4];
      SINEW_UNROLL for (int k = 0; k < 4; ++k) moves[k] = pairOfSlots(a, offset + 2 * k);
      for (std::uint32_t row = 1; row < use.rows; ++row) {
        offset += 8;
        SINEW_UNROLL for (int k = 0; k < 4; ++k) moves[k] += pairOfSlots(a, offset + 2 * k);
      }
      moved = moved + triplesOf(moves);
    }
    const Triples8 start = loadTriples(r.y + 3 * std::uint64_t(i), count);
    if (a.ground) {
      // Rows hold the clusters up; what a vertex keeps of its own below the surface is taken here.
      const Float8 below = dot(normal, lanesOf(start + moved)) - a.offset;
      const Float8 height = dot(normal, lanesOf(loadTriples(r.x + 3 * std::uint64_t(i), count))) - a.offset;
      const Float8 least = select(height >= 0.0F, Float8{}, smaller(height + splat<Float8>(a.recovery), Float8{}));
      const Int8 sunk = below < least;
      if (any(sunk)) moved = moved + triplesOf(select(sunk, least - below, Float8{}) * normal);
    }
    // v = (y - x) / h, but from the move: far from the origin the rounding of positions must not become speed.
    const Triples8 v = loadTriples(r.v + 3 * std::uint64_t(i), count) + splat<Float8>(a.inverse_h) * moved;
    const Triples8 y = start + moved;
    storeTriples(r.v + 3 * std::uint64_t(i), v, count);
    storeTriples(r.y + 3 * std::uint64_t(i), y, count);
    if (a.sums != nullptr) add(i, count, y, v);
  }
  if (a.sums != nullptr) sums.store(*a.sums);
}

SINEW_INLINE void sum(const SumArguments a) {
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
    const Vec3Of<Float8> arm = lanesOf(loadTriples(a.at + 3 * std::uint64_t(i), count)) - reference;
    sums.addMomentum(mass, arm, lanesOf(loadTriples(r.v + 3 * std::uint64_t(i), count)) - moving);
    sums.addMass(mass, arm);
  }
  sums.store(*a.sums);
}

// Differences of speeds are taken before anything is scaled or added: they are exact then, and fast bodies keep their
// momentum to rounding.
SINEW_INLINE void settle(const SettleArguments a) {
  const VertexRange& r = a.vertices;
  const Float8 h = splat<Float8>(a.h);
  const Triples8 moving = repeated(a.moving), shift = repeated(a.shift), change = repeated(a.change);
  const Vec3Of<Float8> center = broadcast(a.center), lost_omega = broadcast(a.lost_omega),
                       change_omega = broadcast(a.change_omega);
  const bool shift_turns = a.shift_omega[0] != 0 || a.shift_omega[1] != 0 || a.shift_omega[2] != 0;
  for (std::uint32_t i = r.begin; i < r.end; i += 8) {
    const std::uint32_t count = r.end - i < 8 ? r.end - i : 8;
    const Triples8 y = loadTriples(r.y + 3 * std::uint64_t(i), count);
    const Triples8 v = loadTriples(r.v + 3 * std::uint64_t(i), count);
    const Vec3Of<Float8> arm = lanesOf(y) - center;
    if (a.free) {
      Triples8 speed = v + shift;
      if (shift_turns) speed = speed + triplesOf(cross(broadcast(a.shift_omega), arm));
      storeTriples(r.x + 3 * std::uint64_t(i), loadTriples(r.x + 3 * std::uint64_t(i), count) + h * speed, count);
    } else {
      storeTriples(r.x + 3 * std::uint64_t(i), y, count);
    }
    if (a.vertex_kept == nullptr) {
      const Float8 lost = splat<Float8>(a.lost);
      const Triples8 turn = triplesOf(cross(change_omega + lost * lost_omega, arm));
      storeTriples(r.v + 3 * std::uint64_t(i), v + ((change - lost * (v - moving)) + turn), count);
    } else {
      const Float8 kept = loadScalars(a.vertex_kept + (i - r.begin), count);
      const Float8 lost = splat<Float8>(1.0F) - (splat<Float8>(1.0F) - splat<Float8>(a.lost)) * kept;
      const Vec3Of<Float8> stopped = lost * (lanesOf(v - moving) - cross(lost_omega, arm));
      const Triples8 turn = triplesOf(cross(change_omega, arm) - stopped);
      storeTriples(r.v + 3 * std::uint64_t(i), v + (change + turn), count);
    }
  }
}

SINEW_INLINE void addMotion(const AddMotionArguments a) {
  const VertexRange& r = a.vertices;
  for (std::uint32_t i = r.begin; i < r.end; i += 8) {
    const std::uint32_t count = r.end - i < 8 ? r.end - i : 8;
    const Triples8 v = loadTriples(r.v + 3 * std::uint64_t(i), count);
    const Vec3Of<Float8> x = lanesOf(loadTriples(r.x + 3 * std::uint64_t(i), count));
    storeTriples(r.v + 3 * std::uint64_t(i), v + triplesOf(velocityAt(a.motion, x)), count);
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

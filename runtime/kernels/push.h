// SPDX-License-Identifier: MIT
//
// Kernels of pushes between pieces (docs/method.md §4). For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/friction.h"
#include "runtime/kernels/lanes.h"
#include "runtime/kernels/push_layout.h"
#include "runtime/kernels/shuffles.h"

namespace sinew::internal::SINEW_KERNELS {

SINEW_INLINE Vec3Of<Float8> loadVector(const float (&lanes)[3][8]) {
  return {load8(lanes[0]), load8(lanes[1]), load8(lanes[2])};
}
SINEW_INLINE void storeVector(float (&lanes)[3][8], const Vec3Of<Float8>& v) {
  store8(lanes[0], v.x);
  store8(lanes[1], v.y);
  store8(lanes[2], v.z);
}
SINEW_INLINE Vec3Of<Float8> select(Int8 mask, const Vec3Of<Float8>& v) {
  return {select(mask, v.x, Float8{}), select(mask, v.y, Float8{}), select(mask, v.z, Float8{})};
}

SINEW_INLINE double totalOf(Float8 a) {
  return ((double(lane(a, 0)) + double(lane(a, 1))) + (double(lane(a, 2)) + double(lane(a, 3)))) +
         ((double(lane(a, 4)) + double(lane(a, 5))) + (double(lane(a, 6)) + double(lane(a, 7))));
}

/// Rows times coefficients. Even and odd functions apart: sums do not wait for one another.
SINEW_INLINE Vec3Of<Float8> sumOf(std::uint32_t functions, const float* rows, const float* c) {
  Vec3Of<Float8> even = {}, odd = {};
  std::uint32_t j = 0;
  for (; j + 1 < functions; j += 2) {
    const Float8 row = load8(rows + 8 * j), next = load8(rows + 8 * j + 8);
    even.x += row * c[4 * j];
    even.y += row * c[4 * j + 1];
    even.z += row * c[4 * j + 2];
    odd.x += next * c[4 * j + 4];
    odd.y += next * c[4 * j + 5];
    odd.z += next * c[4 * j + 6];
  }
  if (j < functions) {
    const Float8 row = load8(rows + 8 * j);
    even.x += row * c[4 * j];
    even.y += row * c[4 * j + 1];
    even.z += row * c[4 * j + 2];
  }
  return even + odd;
}

SINEW_INLINE Float8 gapOf(const PushPack& pack, const Vec3Of<Float8>& normal, const Vec3Of<Float8>& way) {
  return load8(pack.gap) + dot(normal, way);
}
SINEW_INLINE Vec3Of<Float8> slideOf(const PushPack& pack, const Vec3Of<Float8>& normal, const Vec3Of<Float8>& way) {
  return loadVector(pack.slide) + (way - dot(normal, way) * normal);
}

/// From a frame to the world, and back.
SINEW_INLINE Vec3Of<Float8> turned(const float* r, const Vec3Of<Float8>& v) {
  return {r[0] * v.x + (r[3] * v.y + r[6] * v.z), r[1] * v.x + (r[4] * v.y + r[7] * v.z),
          r[2] * v.x + (r[5] * v.y + r[8] * v.z)};
}
SINEW_INLINE Vec3Of<Float8> turnedBack(const float* r, const Vec3Of<Float8>& v) {
  return {r[0] * v.x + (r[1] * v.y + r[2] * v.z), r[3] * v.x + (r[4] * v.y + r[5] * v.z),
          r[6] * v.x + (r[7] * v.y + r[8] * v.z)};
}

/// PushPack::way.
static void pushWays(const PushArguments& arguments) {
  const float* rows = arguments.rows;
  for (std::uint32_t p = 0; p < arguments.count; ++p) {
    Vec3Of<Float8> way = {};
    const PushSide sides[] = {arguments.a, arguments.b};
    for (const PushSide& side : sides) {
      if (side.functions == 0) continue;
      way = way + turned(side.rotation, sumOf(side.functions, rows, side.coefficients));
      rows += std::size_t(8) * side.functions;
    }
    storeVector(arguments.packs[p].way, way);
  }
}

/// PushPack::way and pull. \return the energy, J.
static double pushForces(const PushArguments& a) {
  pushWays(a);
  double energy = 0;
  Int8 pulls = Float8{} < Float8{};
  for (std::uint32_t p = 0; p < a.count; ++p) {
    PushPack& pack = a.packs[p];
    const Vec3Of<Float8> normal = loadVector(pack.normal), way = loadVector(pack.way);
    const Float8 gap = gapOf(pack, normal, way), kappa = load8(pack.kappa);
    const Int8 pushes = gap < Float8{};
    pulls |= pushes;
    const Vec3Of<Float8> slide = slideOf(pack, normal, way);
    const RubOf<Float8> rub = rubOf(kappa, load8(pack.friction), squareRoot(dot(slide, slide)), load8(pack.pressed));
    storeVector(pack.pull, select(pushes, rub.scale * slide + kappa * gap * normal));
    energy += totalOf(select(pushes, rub.energy + 0.5F * kappa * gap * gap, Float8{}));
  }
  *a.pulls = any(pulls);
  return energy;
}

/// Friction takes the load at PushPack::way: pull is how much it has changed, which is added to pulled too. \return
/// change of the energy, J.
static double pushRubs(const PushArguments& a) {
  double energy = 0;
  Int8 pulls = Float8{} < Float8{};
  for (std::uint32_t p = 0; p < a.count; ++p) {
    PushPack& pack = a.packs[p];
    const Vec3Of<Float8> normal = loadVector(pack.normal), way = loadVector(pack.way);
    const Float8 kappa = load8(pack.kappa), friction = load8(pack.friction), before = load8(pack.pressed);
    const Float8 load = kappa * larger(Float8{}, -gapOf(pack, normal, way));
    store8(pack.pressed, load);
    const Vec3Of<Float8> slide = slideOf(pack, normal, way);
    const Float8 length = squareRoot(dot(slide, slide));
    // What sticks under both is the same.
    const Int8 changes = both(load > Float8{}, kappa * length > friction * smaller(before, load));
    pulls |= changes;
    const RubOf<Float8> now = rubOf(kappa, friction, length, load), old = rubOf(kappa, friction, length, before);
    const Vec3Of<Float8> change = select(changes, (now.scale - old.scale) * slide);
    storeVector(pack.pull, change);
    storeVector(pack.pulled, loadVector(pack.pulled) + change);
    energy += totalOf(select(changes, now.energy - old.energy, Float8{}));
  }
  *a.pulls = any(pulls);
  return energy;
}

constexpr std::uint32_t kPacksAtOnce = 8;

/// to += rows of some packs from `first` on times what they pull, in the frame of the piece.
SINEW_INLINE void addRows(const PushSideArguments& a, std::uint32_t first, std::uint32_t count,
                          const Vec3Of<Float8>* pulls) {
  for (std::uint32_t j = 0; j < a.side.functions; ++j) {
    Vec3Of<Float8> sum = {};
    const float* row = a.rows + a.stride * first + 8 * j;
    for (std::uint32_t p = 0; p < count; ++p, row += a.stride) sum = sum + load8(row) * pulls[p];
    store4(a.to + 4 * j, load4(a.to + 4 * j) + sumsOf(sum));
  }
}

/// to += rows times pulls.
static void addPulls(const PushSideArguments& a) {
  for (std::uint32_t first = 0; first < a.count; first += kPacksAtOnce) {
    const std::uint32_t count = a.count - first < kPacksAtOnce ? a.count - first : kPacksAtOnce;
    Vec3Of<Float8> pulls[kPacksAtOnce];
    for (std::uint32_t p = 0; p < count; ++p) {
      pulls[p] = turnedBack(a.side.rotation, loadVector(a.packs[first + p].pull));
    }
    addRows(a, first, count, pulls);
  }
}

/// to += rows times (kappa of what pushes times the way of the side's step less the change from pulled to pull).
static void addBends(const PushSideArguments& a) {
  for (std::uint32_t first = 0; first < a.count; first += kPacksAtOnce) {
    const std::uint32_t count = a.count - first < kPacksAtOnce ? a.count - first : kPacksAtOnce;
    Vec3Of<Float8> more[kPacksAtOnce];
    Int8 counts = Float8{} < Float8{};
    for (std::uint32_t p = 0; p < count; ++p) {
      const PushPack& pack = a.packs[first + p];
      const Int8 pushes = gapOf(pack, loadVector(pack.normal), loadVector(pack.way)) < Float8{};
      const Vec3Of<Float8> pulled = loadVector(pack.pulled);
      counts |= either(pushes, dot(pulled, pulled) > Float8{});
      const Vec3Of<Float8> step = sumOf(a.side.functions, a.rows + a.stride * (first + p), a.side.coefficients);
      more[p] = select(pushes, load8(pack.kappa) * step) + turnedBack(a.side.rotation, pulled - loadVector(pack.pull));
    }
    if (any(counts)) addRows(a, first, count, more);
  }
}

}  // namespace sinew::internal::SINEW_KERNELS

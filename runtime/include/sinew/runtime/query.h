// SPDX-License-Identifier: MIT
//
// What World::rayCast(), sphereCast() and overlaps() are asked and answer.
#pragma once

#include <cstdint>

#include "sinew/runtime/collider.h"

namespace sinew {

/// What counts.
struct QueryFilter {
  std::uint32_t layers = 0xFFFFFFFFU;  ///< bits: those in any of these (BodySettings::layers, ColliderSettings::layers)
  bool bodies = true;                  ///< by the triangles that are drawn
  bool colliders = true;               ///< and the ground
};

/// A body or a collider.
struct QueryObject {
  std::uint32_t body = formats::kNone;  ///< BodyId; none: a collider
  ColliderId collider;                  ///< kGroundCollider: the ground
};

/// Where a cast meets something first.
struct CastHit {
  QueryObject object;
  float distance = 0;                       ///< that the ray, or the ball, has gone, m
  Vec3 point = {0, 0, 0};                   ///< of the surface, metres, world
  Vec3 normal = {0, 1, 0};                  ///< unit, of the surface there
  std::uint32_t triangle = formats::kNone;  ///< visual triangle of a body
};

}  // namespace sinew

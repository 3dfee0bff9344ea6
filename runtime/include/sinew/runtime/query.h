// SPDX-License-Identifier: MIT
//
// What World::rayCast(), sphereCast() and overlaps() are asked and answer.
#pragma once

#include <array>
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

/// A point of a body that stays with its material: of a triangle of visual or physical vertices.
struct BodyPoint {
  std::array<std::uint32_t, 3> vertex = {0, 0, 0};
  Vec3 weight = {1, 0, 0};     ///< of these, sum 1
  std::uint32_t physical = 0;  ///< 1: vertices are physical ones; 0: visual ones

  static BodyPoint visualVertex(std::uint32_t vertex) { return {{vertex, 0, 0}, {1, 0, 0}, 0}; }
  static BodyPoint physicalVertex(std::uint32_t vertex) { return {{vertex, 0, 0}, {1, 0, 0}, 1}; }
};

/// Where a cast meets something first.
struct CastHit {
  QueryObject object;
  float distance = 0;                       ///< that the ray, or the ball, has gone, m
  Vec3 point = {0, 0, 0};                   ///< of the surface, metres, world
  Vec3 normal = {0, 1, 0};                  ///< unit, of the surface there
  std::uint32_t triangle = formats::kNone;  ///< visual triangle of a body
  BodyPoint at;                             ///< `point` of that body
};

}  // namespace sinew

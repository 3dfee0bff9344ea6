// SPDX-License-Identifier: MIT
//
// Filters and answers of World::rayCast(), sphereCast() and overlaps().
#pragma once

#include <array>
#include <cstdint>

#include "sinew/runtime/collider.h"

namespace sinew {

/// The objects that a query sees.
struct QueryFilter {
  std::uint32_t layers =
      0xFFFFFFFFU;        ///< bits: objects in any of them (BodySettings::layers, ColliderSettings::layers)
  bool bodies = true;     ///< their drawn triangles
  bool colliders = true;  ///< and the ground
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

/// The first place that a cast meets.
struct CastHit {
  QueryObject object;
  float distance = 0;                       ///< way of the ray, or the ball, to there, m
  Vec3 point = {0, 0, 0};                   ///< of the surface, metres, world
  Vec3 normal = {0, 1, 0};                  ///< unit, of the surface there
  std::uint32_t triangle = formats::kNone;  ///< visual triangle of a body
  BodyPoint at;                             ///< `point` of that body
};

}  // namespace sinew

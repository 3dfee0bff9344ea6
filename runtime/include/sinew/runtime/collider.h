// SPDX-License-Identifier: MIT
//
// Colliders: shapes beside the ground that a game places and moves (World::addCollider) and bodies collide with.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <variant>

#include "sinew/formats/sections.h"
#include "sinew/runtime/settings.h"

namespace sinew {

/// Names a collider of one world; never reused within it.
struct ColliderId {
  std::uint32_t value = formats::kNone;
  bool operator==(const ColliderId&) const = default;
};

/// The number of WorldSettings::ground, wherever a ColliderId is taken or given.
inline constexpr ColliderId kGroundCollider = {0};

/// Points x with normal . x < offset are inside. In the collider's own coordinates, metres, as all shapes.
struct PlaneShape {
  Vec3 normal = {0, 1, 0};  ///< unit
  float offset = 0;         ///< m
};

struct SphereShape {
  float radius = 0.5F;  ///< m, > 0
};

/// Points nearer than `radius` to the segment from -half_length to half_length on the y axis.
struct CapsuleShape {
  float radius = 0.25F;      ///< m, > 0
  float half_length = 0.5F;  ///< m, > 0
};

struct BoxShape {
  Vec3 half_size = {0.5F, 0.5F, 0.5F};  ///< m, > 0
};

/// The convex hull of points.
struct HullShape {
  std::span<const Vec3> points;  ///< 4 .. 1024, not all in one plane
};

/// Triangles, counter-clockwise from outside. A closed mesh is solid. A mesh with a border is a sheet: it stops bodies
/// that come from the front and lets through bodies from behind.
struct MeshShape {
  std::span<const Vec3> positions;
  std::span<const formats::Triangle> triangles;  ///< 1 .. 2^24
};

/// Heights (y) on a grid, solid below. Corner (column, row) lies at x = column cell, z = row cell; each cell is two
/// triangles, divided from (column, row + 1) to (column + 1, row).
struct HeightFieldShape {
  std::span<const float> heights;  ///< columns a row, m
  std::uint32_t columns = 0;       ///< 2 .. 4096, and as many rows as there are
  float cell = 1;                  ///< m, > 0
};

/// The shape of a collider; World::addCollider() copies what its spans point to.
using ColliderShape =
    std::variant<PlaneShape, SphereShape, CapsuleShape, BoxShape, HullShape, MeshShape, HeightFieldShape>;

/// Place, surface and layers of a collider.
struct ColliderSettings {
  RigidTransform at;      ///< where it is
  float friction = 0.6F;  ///< Coulomb coefficient, 0..1e4; of a pair: BodySettings::friction
  /// Part of the momentum that an impact takes of a free body and that is given back, 0..1: at 1 it leaves as fast as
  /// it came, less what rings in it. At 0 it leaves by its own spring alone, the more slowly the more damped that is
  /// (WorldSettings::deformation_damping_ratio) and the longer the steps.
  float restitution = 0;
  std::uint32_t layers = 1;  ///< bits: two touch if each has a layer that is in the `touches` of the other
  std::uint32_t touches = 0xFFFFFFFFU;
  /// m/s, > 0: moveCollider() is followed no faster than that, as a hand follows a cursor; it may take several steps. A
  /// mass that it has then gives way to what it pushes, and comes back at this speed. Infinity: it is reached in a
  /// step.
  float most_speed = std::numeric_limits<float>::infinity();
  /// Mass of the engine's rigid body that this is, kg: bodies then feel how far it gives way, and where it is moved in
  /// a step it is at World::colliderPose() after it, not where it was told to be (docs/method.md §4). 0: it moves as it
  /// is told, whatever pushes it.
  float mass = 0;
  /// Moments of inertia about the axes of `at`, whose origin is the centre of mass, kg m^2; 0: it does not turn about
  /// that axis.
  Vec3 inertia = {0, 0, 0};
  /// Velocity of its surface against itself along its own axes, m/s, as a belt's: what touches it is taken along. What
  /// points out of the surface does nothing.
  Vec3 surface_velocity = {0, 0, 0};
};

/// Impulse of all bodies on a collider in the last step, or call of advance(): the contact forces times the step,
/// opposite to the impulse on the bodies.
struct ColliderReaction {
  Vec3 impulse = {0, 0, 0};         ///< N s
  Vec3 torque_impulse = {0, 0, 0};  ///< N m s, about the origin of the collider's transform
};

/// A pair of a body and a collider, or of two bodies, that began or ceased to touch in the last step, or call of
/// advance().
struct ContactEvent {
  std::uint32_t body = formats::kNone;   ///< BodyId
  ColliderId collider;                   ///< kGroundCollider: the ground; none of two bodies
  bool began = false;                    ///< else ended
  std::uint32_t other = formats::kNone;  ///< BodyId of the second body, the same one of what touches itself
};

/// A body and what it touched in the last step, or call of advance(): a collider or another body.
struct BodyContact {
  std::uint32_t body = formats::kNone;   ///< BodyId
  ColliderId collider;                   ///< kGroundCollider: the ground; none of two bodies
  std::uint32_t other = formats::kNone;  ///< BodyId of the second body, the same one of what touches itself
  Vec3 point = {0, 0, 0};                ///< mean of the places where they push, by how hard they do, metres, world
  Vec3 normal = {0, 1, 0};               ///< unit, the way in which `body` is pushed, without friction
  Vec3 impulse = {0, 0, 0};              ///< on `body`, friction included, N s; of what touches itself 0
  /// m/s at which the fastest of the places that began to touch came along its normal; 0 where none did.
  float speed = 0;
};

}  // namespace sinew

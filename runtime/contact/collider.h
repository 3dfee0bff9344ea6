// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <memory_resource>

#include "runtime/contact/shapes.h"
#include "sinew/runtime/collider.h"

namespace sinew::internal {

/// A rigid transform in doubles: world = rotation local + position.
struct Pose {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Vector3d position = Vector3d::Zero();

  explicit Pose(const RigidTransform& t = {});
  Vector3d toWorld(const Vector3d& local) const { return rotation * local + position; }
  Vector3d toLocal(const Vector3d& world) const { return rotation.transpose() * (world - position); }
};

/// A body's effect on a collider in a step.
struct ColliderTouch {
  std::uint32_t collider;    ///< ColliderId
  Vector3d impulse, torque;  ///< on the collider; N s, and N m s about its origin
  Vector3d place;            ///< sum of the contacts' loads times their places about its origin, N m
  double load;               ///< N
  Vector3d push;             ///< impulse that it gave along the contacts' normals, N s
  float speed;               ///< m/s at which the fastest point came that did not touch before
};

/// A collider as steps see it.
struct Collider {
  /// \pre Shape::faultOf() of the shape is null. May throw.
  Collider(std::uint32_t number, const ColliderShape& collider_shape, const ColliderSettings& given,
           std::pmr::memory_resource* memory);

  /// A step begins: it goes `share` of the way to its target, at most at its speed.
  void move(double share, double seconds);
  /// A step ends: what has a mass and moved gives way by h times what its impulses change its velocity by, and, where
  /// no hand leads it, so does its target. \param got N s. \param turned N m s. \param left until the target, s.
  void giveWay(const Vector3d& got, const Vector3d& turned, double seconds, double left);
  /// As it was: where it stood before the last step, where it is, where it goes.
  void goTo(const RigidTransform& was, const RigidTransform& now, const RigidTransform& later);
  /// The origin moves: all places are `by` off.
  void shift(const Eigen::Vector3f& by);
  /// Whether it has moved in this step.
  bool moves() const;
  /// Whether it, or its surface, has.
  bool takesAlong() const;
  /// Box of its places in this step, world.
  const Eigen::AlignedBox3d& bounds() const { return bounds_; }
  /// How far a push at a place along a unit direction moves what has its mass and inertia, 1/kg; 0: nothing moves it.
  double inverseMassAt(const Vector3d& place, const Vector3d& direction) const;

  /// kFirmer where no push moves it, else 1.
  double firmer() const;

  std::uint32_t id;  ///< ColliderId
  Shape shape;
  ColliderSettings settings;          ///< `at` as it was added
  RigidTransform before, at, target;  ///< before the last step, now, to go to
  Pose pose_before, pose;
  Vector3d impulse = Vector3d::Zero(), torque = Vector3d::Zero();                ///< ColliderReaction
  Vector3d impulse_before = Vector3d::Zero(), torque_before = Vector3d::Zero();  ///< when the substep began

 private:
  void place();
  Eigen::AlignedBox3d bounds_;
};

}  // namespace sinew::internal

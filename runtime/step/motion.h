// SPDX-License-Identifier: MIT
//
// The rigid motion of a body part from sums over its vertices.
#pragma once

#include <Eigen/Core>
#include <span>

#include "runtime/geometry/rounded.h"
#include "runtime/kernels/layout.h"

namespace sinew::internal {

/// What kernels see of a point: far from the origin or for a fast spin the rest matters, and goes elsewhere.
using geometry::roundedToFloat;

/// Sums that give the rigid motion of a body part, in double, about a reference point.
struct MotionSums {
  double mass = 0;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();     ///< Σ m d, d = position - reference
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero();  ///< Σ m v
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();   ///< Σ m d x v
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();    ///< Σ m d d^T

  /// Adds what a kernel left of one chunk, lane by lane.
  void add(const MotionLanes& lanes);
};

/// A velocity field v + omega x (position - center).
struct RigidMotion {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  Eigen::Vector3d omega = Eigen::Vector3d::Zero();

  MotionOf3 forKernels() const;
};

/// Rigid motions with the linear and angular momentum of `sums`, and with other momenta but the same masses.
/// Directions without inertia (a part collapsed to a line or a point) do not turn.
class RigidMotionSolver {
 public:
  RigidMotionSolver(const MotionSums& sums, const Eigen::Vector3d& reference);
  /// \param momentum, angular about the reference.
  RigidMotion motion(const Eigen::Vector3d& momentum, const Eigen::Vector3d& angular) const;

  /// The motion to add so that momenta change by so much. \param angular about the part's own centre: about a fixed
  /// point that of a fast part changes with the rounding of its centre. \param least_angular less of it about an axis
  /// of little inertia counts as none: what is only rounding would turn a thin or unevenly heavy part fast.
  RigidMotion correction(const Eigen::Vector3d& momentum, const Eigen::Vector3d& angular, double least_angular) const;

  /// Angular velocity with this angular momentum about the part's own centre.
  Eigen::Vector3d turning(const Eigen::Vector3d& angular) const { return inverse_inertia_ * angular; }
  const Eigen::Matrix3d& inertia() const { return inertia_; }
  const Eigen::Vector3d& center() const { return center_; }
  /// Centre of mass relative to the reference.
  const Eigen::Vector3d& offset() const { return offset_; }
  /// Root mean square distance from the centre, metres.
  double gyration() const { return gyration_; }

 private:
  double mass_;
  Eigen::Vector3d offset_, center_;
  Eigen::Matrix3d inertia_, inverse_inertia_;
  double gyration_;
  Eigen::Matrix3d weak_axes_ = Eigen::Matrix3d::Zero();  // columns; zero where an axis has enough inertia
};

}  // namespace sinew::internal

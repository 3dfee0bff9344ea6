// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include "runtime/world/body.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// Sums that give the rigid motion of a body part, in double, about a reference point.
struct MotionSums {
  double mass = 0;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();     ///< Σ m d, d = position - reference
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero();  ///< Σ m v
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();   ///< Σ m d x v
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();    ///< Σ m d d^T

  void add(const MotionSums& other);
};

/// A velocity field v + omega x (position - center).
struct RigidMotion {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  Eigen::Vector3d omega = Eigen::Vector3d::Zero();
};

/// Sums over vertices [begin, end). \param positions Body::x or Body::y. \param anchor_mass added to the mass of each
/// vertex that is pinned or pressed to the ground, kg.
MotionSums motionSums(const Body& body, const std::vector<Vec3>& positions, std::uint32_t begin, std::uint32_t end,
                      const Eigen::Vector3d& reference, double anchor_mass);

/// The rigid motion with the same linear and angular momentum. Directions without inertia (a part collapsed to a line
/// or a point) do not turn.
/// \param least_angular kg m²/s: an angular momentum below it about an axis of little inertia counts as none. What is
/// only rounding would turn a thin or unevenly heavy part fast.
RigidMotion rigidMotionOf(const MotionSums& sums, const Eigen::Vector3d& reference, double least_angular = 0);

/// Whether a vertex can be stepped: position and velocity finite and below 1e15 m, 1e17 m/s.
bool stateIsUsable(const Vec3& x, const Vec3& v);

/// Where its clusters last wanted a physical vertex: Σ share g, metres.
Vector3 blendedGoal(const Body& body, std::uint32_t vertex);

/// v += g h, air damping, y = x + h v for vertices [begin, end). A vertex whose state is not finite is put where its
/// clusters last wanted it, at rest. \return how many were.
std::uint32_t predict(Body& body, const WorldSettings& settings, float pass_seconds, std::uint32_t begin,
                      std::uint32_t end);

/// y += Σ share alpha_h (g - y) (docs/method.md eq. 9), then out of the ground; v = (y - x) / h; for vertices [begin,
/// end).
void applyGoals(Body& body, const GroundPlane& ground, float pass_seconds, std::uint32_t begin, std::uint32_t end);

/// Ends a pass for vertices [begin, end): x becomes y. What of their motion is not the part's rigid motion `found`
/// keeps the part `kept` of itself, or nothing where a cluster was stopped by the guard (an inelastic stop); the rigid
/// motion becomes `wanted`. \param free nothing touches the part: x follows the corrected velocity, so that no
/// rounding of the match ever moves a body by itself.
void settleMotion(Body& body, const RigidMotion& found, const RigidMotion& wanted, bool free, float kept,
                  float pass_seconds, std::uint32_t begin, std::uint32_t end);

/// Adds a rigid motion to the velocities of vertices [begin, end).
void addRigidMotion(Body& body, const RigidMotion& motion, std::uint32_t begin, std::uint32_t end);

}  // namespace sinew::internal

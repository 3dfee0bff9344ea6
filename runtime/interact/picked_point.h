// SPDX-License-Identifier: MIT
#pragma once

#include "runtime/world/body.h"

namespace sinew::internal {

/// Where a point of a body hangs. \pre it is sound.
PickedPoint pickedPoint(const Body& body, const BodyPoint& at);

/// The largest force of a pick, N.
inline double mostForceOf(const Body& body, const Pick& pick) {
  // Pull of a pick that names no force, of the body's weight on Earth.
  constexpr double kWeights = 50, kEarth = 9.81;
  return pick.most_force > 0 ? double(pick.most_force) : kWeights * kEarth * double(body.package().info().total_mass);
}

/// Where the spring of a pick pulls from `at`: its target, or nearer where `firm` (N/m) would pull with more than its
/// largest force.
inline Eigen::Vector3d reachOf(const Body& body, const Pick& pick, const Eigen::Vector3d& at, double firm) {
  const double most = mostForceOf(body, pick);
  const Eigen::Vector3d way = asVector(pick.target).cast<double>() - at;
  const double length = way.norm();
  return firm * length > most ? Eigen::Vector3d(at + most / (firm * length) * way) : at + way;
}

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#include "runtime/step/spin.h"

#include <algorithm>

namespace sinew::internal {

Eigen::Vector3d setSpinAside(const RigidMotionSolver& solver, const Eigen::Vector3d& angular, double pass_seconds,
                             Eigen::Vector3d& aside) {
  aside.setZero();
  Eigen::Vector3d omega = solver.turning(angular);
  if (!(omega.norm() * pass_seconds > kMostTurn)) return omega;
  // Not faster than what has this angular momentum turns about that axis: a thin part that twists about its own is
  // fast with next to none.
  const Eigen::Vector3d axis = angular.normalized();
  const double inertia = axis.dot(solver.inertia() * axis);
  double turn = kMostTurn / pass_seconds;
  if (inertia > 0) turn = std::min(turn, angular.norm() / inertia);  // rounded, it may be none
  Eigen::Vector3d kept = turn * axis;
  aside = angular - solver.inertia() * kept;
  return kept;
}

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#include "runtime/step/spin.h"

namespace sinew::internal {

Eigen::Vector3d setSpinAside(const RigidMotionSolver& solver, const Eigen::Vector3d& angular, double pass_seconds,
                             Eigen::Vector3d& aside) {
  aside.setZero();
  Eigen::Vector3d omega = solver.turning(angular);
  if (!(omega.norm() * pass_seconds > kMostTurn)) return omega;
  Eigen::Vector3d kept = angular.normalized() * (kMostTurn / pass_seconds);
  aside = angular - solver.inertia() * kept;
  return kept;
}

}  // namespace sinew::internal

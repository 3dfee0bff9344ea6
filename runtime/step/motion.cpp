// SPDX-License-Identifier: MIT
#include "runtime/step/motion.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "runtime/clusters/algebra.h"
#include "runtime/geometry/pseudo_inverse.h"

namespace sinew::internal {

void MotionSums::add(const MotionLanes& lanes) {
  double sum[16];
  for (int k = 0; k < 16; ++k) {
    sum[k] = 0;
    for (int lane = 0; lane < 8; ++lane) sum[k] += double(lanes.sum[k][lane]);
  }
  mass += sum[0];
  constexpr int kSecond[3][3] = {{10, 13, 15}, {13, 11, 14}, {15, 14, 12}};
  for (int k = 0; k < 3; ++k) {
    first[k] += sum[1 + k];
    momentum[k] += sum[4 + k];
    angular[k] += sum[7 + k];
    for (int i = 0; i < 3; ++i) second(i, k) += sum[kSecond[k][i]];
  }
}

MotionOf3 RigidMotion::forKernels() const {
  const Eigen::Vector3d at = roundedToFloat(center);
  const Eigen::Vector3d there = velocity + omega.cross(at - center);
  MotionOf3 result;
  for (int k = 0; k < 3; ++k) {
    result.center[k] = float(at[k]);
    result.velocity[k] = float(there[k]);
    result.omega[k] = float(omega[k]);
  }
  return result;
}

RigidMotionSolver::RigidMotionSolver(const MotionSums& sums, const Eigen::Vector3d& reference)
    : mass_(sums.mass),
      offset_(sums.first / sums.mass),
      inertia_(Eigen::Matrix3d::Zero()),
      inverse_inertia_(Eigen::Matrix3d::Zero()),
      gyration_(0) {
  center_ = reference + offset_;
  Eigen::Matrix3d second = sums.second;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) second(i, j) -= sums.mass * offset_[i] * offset_[j];
  }
  const double trace = second(0, 0) + (second(1, 1) + second(2, 2));
  gyration_ = std::sqrt(std::max(0.0, trace / sums.mass));
  double scale = 0;
  bool finite = true;
  for (int k = 0; k < 9; ++k) {
    double& entry = inertia_.data()[k];
    entry = (k % 4 == 0 ? trace : 0) - second.data()[k];
    scale = std::max(scale, std::abs(entry));
    finite &= std::isfinite(entry);
  }
  if (!(scale > 0) || !finite) return;
  Eigen::Matrix3d scaled;
  for (int k = 0; k < 9; ++k) scaled.data()[k] = inertia_.data()[k] / scale;
  // Well away from singular, as nearly every body is, the inverse comes from the cofactors.
  constexpr double kWellConditioned = 1e-3, kLeastInertia = 1e-6, kLittleInertia = 1e-2;
  if (scaled.determinant() > kWellConditioned && scaled(0, 0) > kWellConditioned) {
    inverse_inertia_ = inverseOf(scaled);
    for (int k = 0; k < 9; ++k) inverse_inertia_.data()[k] /= scale;
    return;
  }
  Eigen::Vector3d values;
  Eigen::Matrix3d axes;
  geometry::symmetricEigen(geometry::viewOf(scaled), {values.data(), 3}, geometry::viewOf(axes));
  for (int k = 0; k < 3; ++k) {
    if (values[k] < kLeastInertia) continue;
    const double* const axis = axes.col(k).data();
    for (int j = 0; j < 3; ++j) {
      if (values[k] < kLittleInertia) weak_axes_(j, k) = axis[j];
      for (int i = 0; i < 3; ++i) inverse_inertia_(i, j) += axis[i] * axis[j] / (scale * values[k]);
    }
  }
}

RigidMotion RigidMotionSolver::motion(const Eigen::Vector3d& momentum, const Eigen::Vector3d& angular) const {
  RigidMotion motion;
  motion.center = center_;
  motion.velocity = momentum / mass_;
  motion.omega = inverse_inertia_ * (angular - offset_.cross(momentum));
  return motion;
}

RigidMotion RigidMotionSolver::correction(const Eigen::Vector3d& momentum, const Eigen::Vector3d& angular,
                                          double least_angular) const {
  Eigen::Vector3d about = angular;
  for (int k = 0; k < 3; ++k) {
    const double weak = weak_axes_.col(k).dot(angular);
    if (std::abs(weak) < least_angular) about -= weak * weak_axes_.col(k);
  }
  RigidMotion motion;
  motion.center = center_;
  motion.velocity = momentum / mass_;
  motion.omega = inverse_inertia_ * about;
  return motion;
}

}  // namespace sinew::internal

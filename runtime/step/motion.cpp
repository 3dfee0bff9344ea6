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
  first += Eigen::Vector3d(sum[1], sum[2], sum[3]);
  momentum += Eigen::Vector3d(sum[4], sum[5], sum[6]);
  angular += Eigen::Vector3d(sum[7], sum[8], sum[9]);
  Eigen::Matrix3d part;
  part << sum[10], sum[13], sum[15], sum[13], sum[11], sum[14], sum[15], sum[14], sum[12];
  second += part;
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
  const Eigen::Matrix3d second = sums.second - sums.mass * offset_ * offset_.transpose();
  gyration_ = std::sqrt(std::max(0.0, second.trace() / sums.mass));
  inertia_ = second.trace() * Eigen::Matrix3d::Identity() - second;
  const double scale = inertia_.cwiseAbs().maxCoeff();
  if (!(scale > 0) || !std::isfinite(scale)) return;
  const Eigen::Matrix3d scaled = inertia_ / scale;
  // Well away from singular, as nearly every body is, the inverse comes from the cofactors.
  constexpr double kWellConditioned = 1e-3, kLeastInertia = 1e-6, kLittleInertia = 1e-2;
  if (scaled.determinant() > kWellConditioned && scaled(0, 0) > kWellConditioned) {
    inverse_inertia_ = inverseOf(scaled) / scale;
    return;
  }
  Eigen::Vector3d values;
  Eigen::Matrix3d axes;
  geometry::symmetricEigen(geometry::viewOf(scaled), {values.data(), 3}, geometry::viewOf(axes));
  for (int k = 0; k < 3; ++k) {
    if (values[k] < kLeastInertia) continue;
    const Eigen::Vector3d axis = axes.col(k);
    if (values[k] < kLittleInertia) weak_axes_.col(k) = axis;
    inverse_inertia_ += axis * axis.transpose() / (scale * values[k]);
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

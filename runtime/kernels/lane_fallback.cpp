// SPDX-License-Identifier: MIT
#include <Eigen/Core>
#include <algorithm>

#include "runtime/geometry/rotation.h"
#include "runtime/geometry/svd3.h"
#include "runtime/kernels/kernels.h"

namespace sinew::internal {

void nearestRotationOfLane(const float* matrix, float* quaternion) {
  const Eigen::Matrix3f a = Eigen::Map<const Eigen::Matrix3f>(matrix);
  geometry::Quaternion q = {quaternion[0], quaternion[1], quaternion[2], quaternion[3]};
  geometry::nearestRotation(a, q);
  std::copy(q.begin(), q.end(), quaternion);
}

bool limitStretchOfLane(float* f, int columns) {
  Eigen::Map<Eigen::Matrix3f> linear(f);
  if (!linear.allFinite()) return false;
  const geometry::RotationSvd svd = geometry::rotationSvd(linear);
  const Eigen::Vector3f sigma = svd.sigma.cwiseMax(kLeastStretch).cwiseMin(kLargestStretch);
  if (sigma == svd.sigma) return false;
  linear = svd.u * sigma.asDiagonal() * svd.v.transpose();
  if (columns == 9) {
    Eigen::Map<Eigen::Matrix<float, 3, 6>> bends(f + 9);
    bends = bends.cwiseMax(-kLargestStretch).cwiseMin(kLargestStretch);
  }
  return true;
}

}  // namespace sinew::internal

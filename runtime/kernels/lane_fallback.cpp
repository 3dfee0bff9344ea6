// SPDX-License-Identifier: MIT
#include <Eigen/Core>
#include <algorithm>

#include "runtime/geometry/rotation.h"
#include "runtime/kernels/kernels.h"

namespace sinew::internal {

void nearestRotationOfLane(const float* matrix, float* quaternion) {
  const Eigen::Matrix3f a = Eigen::Map<const Eigen::Matrix3f>(matrix);
  geometry::Quaternion q = {quaternion[0], quaternion[1], quaternion[2], quaternion[3]};
  geometry::nearestRotation(a, q);
  std::copy(q.begin(), q.end(), quaternion);
}

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>

namespace sinew::geometry {

/// The nearest floats of a vector's components, as doubles (infinite beyond the range of float): what a package or a
/// kernel that holds floats sees of it. Volatile, because GCC 12 (-O2) takes a pair of doubles to float and back
/// without rounding them.
inline Eigen::Vector3d roundedToFloat(const Eigen::Vector3d& v) {
  volatile float rounded[3] = {float(v[0]), float(v[1]), float(v[2])};
  return {double(rounded[0]), double(rounded[1]), double(rounded[2])};
}

}  // namespace sinew::geometry

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/moving_state.h"

#include <Eigen/Geometry>
#include <cmath>

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

Vector3d toDouble(const std::array<float, 3>& x) { return {double(x[0]), double(x[1]), double(x[2])}; }
Vec3 toFloat(const Vector3d& x) { return {float(x[0]), float(x[1]), float(x[2])}; }

}  // namespace

MovingState movingState(const Asset& asset) {
  MovingState state;
  const formats::PackageInfo& info = asset.package().info();
  const Vector3d low = toDouble(info.bounds_min), high = toDouble(info.bounds_max), middle = 0.5 * (low + high);
  const double size = (high - low).maxCoeff();
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  const Vector3d spin(1, -2, 3);  // rad/s
  for (const formats::PhysicalVertex& vertex : asset.package().physicalVertices()) {
    const Vector3d rest = (toDouble(vertex.rest_position) - middle) / size;
    const double twist = 0.2 * rest[1];
    const Vector3d bent(rest[0] * std::cos(twist) - rest[2] * std::sin(twist), rest[1] + 0.1 * rest[0] * rest[0],
                        rest[0] * std::sin(twist) + 1.05 * rest[2] * std::cos(twist));
    const Vector3d x = turn * bent;
    const Vector3d v = spin.cross(x) + 0.3 * Vector3d(std::sin(4 * rest[1]), std::cos(5 * rest[2]), rest[0]);
    state.positions.push_back(toFloat(middle + size * x));
    state.velocities.push_back(toFloat(size * v));
  }
  return state;
}

}  // namespace sinew::tools

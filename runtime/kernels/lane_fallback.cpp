// SPDX-License-Identifier: MIT
#include <cmath>

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

namespace {

/// f(phi) of a response curve and its slope: linear between points, constant behind the last, phi before the first.
void curveAt(const float* curve, std::uint32_t points, float phi, float& value, float& slope) {
  value = phi, slope = 1;
  if (!(phi > curve[0])) return;
  std::uint32_t i = 1;
  while (i < points && !(phi < curve[2 * i])) ++i;
  value = curve[2 * points - 1], slope = 0;
  if (i == points) return;
  const float* const before = curve + 2 * (i - 1);
  slope = (before[3] - before[1]) / (before[2] - before[0]);
  value = before[1] + slope * (phi - before[0]);
}

}  // namespace

float addLengthLimits(const SampleLimits& limits, std::uint32_t lane, float stiff, const float* f, float* p) {
  float energy = 0, norm = 0;
  for (int c = 0; c < 3; ++c) {
    const float square = f[3 * c] * f[3 * c] + (f[3 * c + 1] * f[3 * c + 1] + f[3 * c + 2] * f[3 * c + 2]);
    norm += square;
    const float length = std::sqrt(square), beyond = length - limits.row[lane];
    if (!(beyond > 0)) continue;
    energy += 0.5F * stiff * beyond * beyond;
    for (int r = 0; r < 3; ++r) p[3 * c + r] += stiff * beyond / length * f[3 * c + r];
  }
  float response = norm, slope = 1;
  if (limits.curve[lane] != nullptr) {
    curveAt(limits.curve[lane], limits.curve_points[lane], norm, response, slope);
  } else if (norm > limits.norm[lane]) {
    const float room = limits.norm_limit[lane] - limits.norm[lane];
    response = limits.norm_limit[lane] - limits.norm[lane] / norm * room;
    slope = limits.norm[lane] * room / (norm * norm);
  }
  const float size = std::sqrt(norm), wanted = std::sqrt(response), beyond = size - wanted;
  if (!(beyond > 0)) return energy;
  const float pull = stiff * beyond * (1 / size - slope / wanted);
  for (int i = 0; i < 9; ++i) p[i] += pull * f[i];
  return energy + 0.5F * stiff * beyond * beyond;
}

}  // namespace sinew::internal

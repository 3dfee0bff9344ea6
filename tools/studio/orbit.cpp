// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/orbit.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace sinew::tools {

void orbitCamera(Camera& camera, float dx, float dy) {
  constexpr float kRadiansPerPixel = 0.007F;
  constexpr float kSteepest = std::numbers::pi_v<float> / 2 - 0.01F;
  camera.yaw = std::remainder(camera.yaw - dx * kRadiansPerPixel, 2 * std::numbers::pi_v<float>);
  camera.pitch = std::clamp(camera.pitch + dy * kRadiansPerPixel, -kSteepest, kSteepest);
}

void panCamera(Camera& camera, float dx, float dy, float view_height) {
  const float per_pixel = 2 * camera.distance * std::tan(camera.fov_y / 2) / std::max(view_height, 1.0F);
  camera.target += (-dx * camera.right() + dy * camera.up()) * per_pixel;
}

void zoomCamera(Camera& camera, float notches) {
  camera.distance = std::clamp(camera.distance * std::pow(0.9F, notches), 0.02F, 50.0F);
}

std::optional<TriangleHit> hitTriangles(std::span<const Eigen::Vector3f> positions,
                                        std::span<const std::array<std::uint32_t, 3>> triangles,
                                        const Eigen::Vector3f& origin, const Eigen::Vector3f& direction) {
  // Möller and Trumbore 1997, without culling.
  std::optional<TriangleHit> best;
  float nearest = std::numeric_limits<float>::infinity();
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const Eigen::Vector3f& a = positions[triangles[t][0]];
    const Eigen::Vector3f ab = positions[triangles[t][1]] - a;
    const Eigen::Vector3f ac = positions[triangles[t][2]] - a;
    const Eigen::Vector3f p = direction.cross(ac);
    const float determinant = ab.dot(p);
    if (determinant == 0) continue;
    const Eigen::Vector3f s = origin - a;
    const float u = s.dot(p) / determinant;
    if (!(u >= 0 && u <= 1)) continue;
    const Eigen::Vector3f q = s.cross(ab);
    const float v = direction.dot(q) / determinant;
    if (!(v >= 0 && u + v <= 1)) continue;
    const float distance = ac.dot(q) / determinant;
    if (!(distance > 0 && distance < nearest)) continue;
    nearest = distance;
    const std::array<float, 3> weights = {1 - u - v, u, v};
    const auto corner = static_cast<std::size_t>(std::max_element(weights.begin(), weights.end()) - weights.begin());
    best = TriangleHit{t, triangles[t][corner], origin + distance * direction};
  }
  return best;
}

Eigen::Vector3f dragOffset(const Camera& camera, const Eigen::Vector3f& hit, const Eigen::Vector3f& direction) {
  const Eigen::Vector3f normal = camera.back();
  const float along = normal.dot(direction);
  if (std::abs(along) < 1e-6F) return Eigen::Vector3f::Zero();
  const float distance = normal.dot(hit - camera.eye()) / along;
  if (!(distance > 0)) return Eigen::Vector3f::Zero();
  return camera.eye() + distance * direction - hit;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/camera.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace sinew::tools {

namespace {

constexpr std::array<std::string_view, 4> kViewNames = {"front", "side", "top", "three-quarter"};
constexpr std::size_t kDirections = 128;

}  // namespace

std::span<const std::string_view> viewNames() { return kViewNames; }

std::optional<ViewName> viewByName(std::string_view name) {
  for (std::size_t i = 0; i < kViewNames.size(); ++i) {
    if (kViewNames[i] == name) return static_cast<ViewName>(i);
  }
  return std::nullopt;
}

Eigen::Vector3f Camera::right() const { return {std::cos(yaw), 0.0F, -std::sin(yaw)}; }

Eigen::Vector3f Camera::back() const {
  return {std::sin(yaw) * std::cos(pitch), std::sin(pitch), std::cos(yaw) * std::cos(pitch)};
}

Eigen::Vector3f Camera::up() const { return back().cross(right()); }

Eigen::Matrix4f Camera::view() const {
  Eigen::Matrix4f m = Eigen::Matrix4f::Identity();
  m.block<1, 3>(0, 0) = right().transpose();
  m.block<1, 3>(1, 0) = up().transpose();
  m.block<1, 3>(2, 0) = back().transpose();
  m.block<3, 1>(0, 3) = -m.block<3, 3>(0, 0) * eye();
  return m;
}

Eigen::Matrix4f Camera::projection(float aspect) const {
  const float f = 1.0F / std::tan(fov_y / 2);
  Eigen::Matrix4f m = Eigen::Matrix4f::Zero();
  m(0, 0) = f / aspect;
  m(1, 1) = f;
  m(2, 2) = (far_plane + near_plane) / (near_plane - far_plane);
  m(2, 3) = 2 * far_plane * near_plane / (near_plane - far_plane);
  m(3, 2) = -1;
  return m;
}

Eigen::Vector3f Camera::ray(float x, float y, float width, float height) const {
  const float t = std::tan(fov_y / 2);
  const float ndc_x = (2 * x / width - 1) * t * width / height;
  const float ndc_y = (1 - 2 * y / height) * t;
  return (ndc_x * right() + ndc_y * up() - back()).normalized();
}

Camera viewCamera(ViewName view, float front_yaw) {
  Camera camera;
  switch (view) {
    case ViewName::front:
      camera.pitch = 0.10F;
      break;
    case ViewName::side:
      camera.yaw = std::numbers::pi_v<float> / 2;
      camera.pitch = 0.10F;
      break;
    case ViewName::top:
      camera.pitch = std::numbers::pi_v<float> / 2 - 1e-3F;
      break;
    case ViewName::three_quarter:
      camera.yaw = 0.70F;
      camera.pitch = 0.32F;
      break;
  }
  camera.yaw += front_yaw;
  return camera;
}

MotionHull::MotionHull()
    : directions_(kDirections),
      support_(kDirections, Eigen::Vector3f::Zero()),
      reach_(kDirections, -std::numeric_limits<float>::infinity()) {
  // Fibonacci lattice on the sphere.
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  for (std::size_t i = 0; i < kDirections; ++i) {
    const double y = 1 - 2 * (static_cast<double>(i) + 0.5) / static_cast<double>(kDirections);
    const double r = std::sqrt(1 - y * y);
    const double angle = golden * static_cast<double>(i);
    directions_[i] = Eigen::Vector3d(r * std::cos(angle), y, r * std::sin(angle)).cast<float>();
  }
}

void MotionHull::add(std::span<const Eigen::Vector3f> points) {
  for (const Eigen::Vector3f& p : points) {
    if (!p.allFinite()) continue;  // a scene that blew up is still shown
    any_ = true;
    for (std::size_t k = 0; k < kDirections; ++k) {
      const float reach = directions_[k].dot(p);
      if (reach > reach_[k]) {
        reach_[k] = reach;
        support_[k] = p;
      }
    }
  }
}

Eigen::Vector3f MotionHull::center() const {
  Eigen::Vector3f low = Eigen::Vector3f::Zero();
  Eigen::Vector3f high = Eigen::Vector3f::Zero();
  if (any_) {
    low = high = support_[0];
    for (const Eigen::Vector3f& p : support_) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
  }
  return (low + high) / 2;
}

float MotionHull::radius() const {
  float radius = 0;
  if (any_) {
    const Eigen::Vector3f c = center();
    for (const Eigen::Vector3f& p : support_) radius = std::max(radius, (p - c).norm());
  }
  return radius;
}

void fitCamera(Camera& camera, std::span<const Eigen::Vector3f> points, float aspect, float margin) {
  if (points.empty()) return;
  // In the camera's axes a point (a, b, c) is inside the side planes of a camera at (x, y, z) when
  // |a - x| <= tx (z - c) and |b - y| <= ty (z - c): four supports give the nearest eye.
  const float ty = std::tan(camera.fov_y / 2) * (1 - margin);
  const float tx = ty * aspect;
  const Eigen::Vector3f right = camera.right();
  const Eigen::Vector3f up = camera.up();
  const Eigen::Vector3f back = camera.back();
  constexpr float kLowest = std::numeric_limits<float>::lowest();
  float plus_x = kLowest;
  float minus_x = kLowest;
  float plus_y = kLowest;
  float minus_y = kLowest;
  float nearest = kLowest;
  float farthest = -kLowest;
  for (const Eigen::Vector3f& p : points) {
    const float a = right.dot(p);
    const float b = up.dot(p);
    const float c = back.dot(p);
    plus_x = std::max(plus_x, a + tx * c);
    minus_x = std::max(minus_x, -a + tx * c);
    plus_y = std::max(plus_y, b + ty * c);
    minus_y = std::max(minus_y, -b + ty * c);
    nearest = std::max(nearest, c);
    farthest = std::min(farthest, c);
  }
  const float x = (plus_x - minus_x) / 2;
  const float y = (plus_y - minus_y) / 2;
  float z = std::max((plus_x + minus_x) / (2 * tx), (plus_y + minus_y) / (2 * ty));
  const float depth = std::max(nearest - farthest, 1e-4F);
  z = std::max(z, nearest + 0.05F * depth);
  const float middle = (nearest + farthest) / 2;
  camera.distance = z - middle;
  camera.target = x * right + y * up + middle * back;
  camera.near_plane = std::max((z - nearest) * 0.5F, camera.distance * 1e-3F);
  camera.far_plane = (z - farthest) * 2 + 20 * camera.distance;
}

}  // namespace sinew::tools

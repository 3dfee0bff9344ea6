// SPDX-License-Identifier: GPL-3.0-or-later
//
// Where pictures are taken from. Lengths are in drawing units: the rest diagonal of the model is 1.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace sinew::tools {

enum class ViewName { front, side, top, three_quarter };

/// Names in the order of the enum: "front", "side", "top", "three-quarter".
std::span<const std::string_view> viewNames();
std::optional<ViewName> viewByName(std::string_view name);

/// A perspective camera that looks at `target` from a direction.
struct Camera {
  Eigen::Vector3f target = Eigen::Vector3f::Zero();
  float yaw = 0;        ///< rad; 0 looks along -z from +z, positive moves the eye towards +x
  float pitch = 0;      ///< rad, -pi/2 .. pi/2; positive moves the eye up
  float distance = 3;   ///< eye to target, > 0
  float fov_y = 0.50F;  ///< full vertical angle, rad
  float near_plane = 0.01F;
  float far_plane = 100;

  Eigen::Vector3f right() const;
  Eigen::Vector3f up() const;
  Eigen::Vector3f back() const;  ///< unit, from the target to the eye
  Eigen::Vector3f eye() const { return target + distance * back(); }
  Eigen::Matrix4f view() const;
  /// \param aspect width / height.
  Eigen::Matrix4f projection(float aspect) const;
  /// Direction (unit) of the ray from the eye through a pixel centre. \param x,y pixels from the top left.
  Eigen::Vector3f ray(float x, float y, float width, float height) const;
};

/// The camera of a named view; only the direction is set. \param front_yaw rad, from where the front is seen
Camera viewCamera(ViewName view, float front_yaw = 0);

/// Extent of a motion: support points in evenly spread directions over all that was added. Any camera can be fitted
/// to it afterwards; the error is below 3 % of its radius (every direction lies within 13 degrees of one of them).
class MotionHull {
 public:
  MotionHull();
  void add(std::span<const Eigen::Vector3f> points);
  bool empty() const { return !any_; }
  std::span<const Eigen::Vector3f> points() const {
    return any_ ? std::span<const Eigen::Vector3f>(support_) : std::span<const Eigen::Vector3f>{};
  }
  Eigen::Vector3f center() const;  ///< of the bounding box
  float radius() const;            ///< of the points about center()

 private:
  std::vector<Eigen::Vector3f> directions_;
  std::vector<Eigen::Vector3f> support_;
  std::vector<float> reach_;
  bool any_ = false;
};

/// Moves the camera (same direction) so that all points are in the picture with a margin, as near as possible.
/// Sets target, distance and the near and far planes. \param margin part of the picture left free, 0 .. 0.4.
void fitCamera(Camera& camera, std::span<const Eigen::Vector3f> points, float aspect, float margin);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// The camera and the body under the mouse, without a window, so that tests can compute it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "tools/render/camera.h"

namespace sinew::tools {

/// Turns the camera about its target. \param dx,dy pixels of mouse motion, y down.
void orbitCamera(Camera& camera, float dx, float dy);
/// Moves the target in the picture plane so that it follows the mouse. \param view_height pixels.
void panCamera(Camera& camera, float dx, float dy, float view_height);
/// \param notches of the wheel, positive = nearer.
void zoomCamera(Camera& camera, float notches);

struct TriangleHit {
  std::uint32_t triangle = 0;
  std::uint32_t vertex = 0;  ///< corner of the triangle nearest to the hit
  Eigen::Vector3f point = Eigen::Vector3f::Zero();
};

/// The nearest triangle on a ray, from either side. Cost: linear, about 1 ms per 100,000 triangles.
std::optional<TriangleHit> hitTriangles(std::span<const Eigen::Vector3f> positions,
                                        std::span<const std::array<std::uint32_t, 3>> triangles,
                                        const Eigen::Vector3f& origin, const Eigen::Vector3f& direction);

/// How far a point seen under the mouse at `hit` (drawing units) is dragged when the mouse's ray becomes `direction`:
/// within the plane through `hit` that is parallel to the picture. Zero where the ray does not meet it.
Eigen::Vector3f dragOffset(const Camera& camera, const Eigen::Vector3f& hit, const Eigen::Vector3f& direction);

}  // namespace sinew::tools

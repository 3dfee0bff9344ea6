// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Where to look at a mesh from: yaw and pitch of a Camera, rad.
struct Side {
  float yaw = 0, pitch = 0;
};

/// Visibility of a surface from sides all around, so that each of many weights can be shown from where most of it is.
class Sides {
 public:
  /// \param positions any unit; \param triangles both faces of each are seen.
  Sides(std::span<const Eigen::Vector3f> positions, std::span<const Triangle> triangles);
  /// The side from which most of the weight is seen, hidden parts counting as nothing; of sides that show nearly as
  /// much, the one nearest to the front. \param weights per position, 0..1.
  Side best(std::span<const double> weights) const;

 private:
  struct View {
    Side side;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> seen;  // triangle, pixels
  };
  std::vector<View> views_;
  std::vector<Triangle> triangles_;
};

}  // namespace sinew::tools

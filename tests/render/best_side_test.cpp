// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/best_side.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tools/render/camera.h"

namespace sinew::tools {
namespace {

struct Model {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Triangle> triangles;

  // A box, finely enough divided that a weight can be told apart.
  void box(const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
    const auto first = std::uint32_t(positions.size());
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
      positions.emplace_back(corner & 1 ? high.x() : low.x(), corner & 2 ? high.y() : low.y(),
                             corner & 4 ? high.z() : low.z());
    }
    static constexpr std::array<std::array<std::uint32_t, 4>, 6> kFaces = {
        {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};
    for (const auto& f : kFaces) {
      triangles.push_back({first + f[0], first + f[1], first + f[2]});
      triangles.push_back({first + f[0], first + f[2], first + f[3]});
    }
  }

  Eigen::Vector3f eye(const std::vector<double>& weights) const {
    const Side side = Sides(positions, triangles).best(weights);
    Camera camera;
    camera.yaw = side.yaw;
    camera.pitch = side.pitch;
    return camera.back();
  }
};

// A leg looks to all sides: only what stands before it says from where it is seen.
TEST(BestSide, WhatHidesBehindTheBodyIsSeenFromBehind) {
  Model model;
  model.box({-1, -1, -1}, {1, 1, 1});
  for (const float z : {-1.4F, 1.4F}) {
    Model with = model;
    with.box({-0.2F, -0.5F, z - 0.2F}, {0.2F, 0.5F, z + 0.2F});
    std::vector<double> weights(with.positions.size(), 0);
    std::fill(weights.begin() + 8, weights.end(), 1.0);
    EXPECT_GT(with.eye(weights).z() * z, 0.5F * std::abs(z)) << z;
  }
}

TEST(BestSide, ASideThatFacesAwayIsTurnedToTheEye) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const float sign : {-1.0F, 1.0F}) {
      Model model;
      model.box({-1, -1, -1}, {1, 1, 1});
      std::vector<double> weights;
      for (const Eigen::Vector3f& x : model.positions) weights.push_back(x[axis] * sign > 0 ? 1 : 0);
      EXPECT_GT(model.eye(weights)[axis] * sign, 0.3F) << axis << " " << sign;
    }
  }
}

TEST(BestSide, WhatIsEverywhereIsSeenFromTheFront) {
  Model model;
  model.box({-1, -1, -1}, {1, 1, 1});
  EXPECT_GT(model.eye(std::vector<double>(8, 1.0)).z(), 0.5F);
}

}  // namespace
}  // namespace sinew::tools

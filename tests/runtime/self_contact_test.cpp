// SPDX-License-Identifier: MIT
//
// Bodies whose surface touches itself (BodySettings::self_contact).
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "sinew/runtime/world.h"
#include "tests/support/box_package.h"
#include "tests/support/motion.h"
#include "tests/support/touching_box.h"

namespace sinew::test {
namespace {

using Eigen::Vector3d;

Vector3d wide(const Vec3& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

/// Two cubes of one body, half a metre apart.
formats::PackageContent pairContent(double apart) {
  BoxOptions options;
  options.cells = {2, 2, 2};
  options.center = {-0.5 - 0.5 * apart, 0, 0};
  formats::PackageContent content = boxContent(options);
  options.center[0] *= -1;
  appendBody(content, boxContent(options));
  for (const std::uint32_t piece : {0U, 1U}) {
    const std::array<double, 3> center = {(piece == 0 ? -1 : 1) * (0.5 + 0.5 * apart), 0, 0};
    addDistances(content, piece, center, {1, 1, 1}, [&](const std::array<double, 3>& at) {
      return boxDistance(at, center, {1, 1, 1});
    });
  }
  return content;
}

/// Velocities at rest places.
template <class Field>
void throwBy(World& world, BodyId body, const Field& velocity) {
  const auto x = world.positions(body);
  const std::vector<Vec3> at(x.begin(), x.end());
  std::vector<Vec3> moving(at.size());
  for (std::size_t i = 0; i < at.size(); ++i) moving[i] = velocity(at[i]);
  world.setState(body, at, moving);
}

TEST(SelfContact, PiecesOfABodyMeet) {
  const auto asset = makeAsset(pairContent(0.5));
  for (const bool on : {false, true}) {
    World world(inSpace());
    BodySettings settings;
    settings.self_contact = on;
    const BodyId body = *world.addBody(asset, settings);
    throwBy(world, body, [](const Vec3& at) { return Vec3{at[0] < 0 ? 3.0F : -3.0F, 0, 0}; });
    const Motion start = motionOf(world, {body});
    for (int i = 0; i < 60; ++i) {
      world.step(1.0F / 60);
      const Motion now = motionOf(world, {body});
      EXPECT_LE(now.energy, start.energy * (1 + 1e-5)) << i;
      EXPECT_LT(now.momentum.norm(), 1e-3) << i;
    }
    const auto x = world.positions(body);
    const auto rest = world.asset(body).package().physicalVertices();
    double low = 0;
    for (std::size_t i = 0; i < x.size(); ++i) low += rest[i].rest_position[0] < 0 ? double(x[i][0]) : 0;
    EXPECT_EQ(low < 0, on);  // else the left one has gone through to the right
  }
}

TEST(SelfContact, WhatTouchesAtRestPushesNothing) {
  for (const double apart : {0.0, -0.1}) {
    const auto asset = makeAsset(pairContent(apart));
    World world(inSpace());
    BodySettings settings;
    settings.self_contact = true;
    const BodyId body = *world.addBody(asset, settings);
    for (int i = 0; i < 30; ++i) world.step(1.0F / 60);
    const auto x = world.positions(body);
    const auto rest = world.asset(body).package().physicalVertices();
    for (std::size_t i = 0; i < x.size(); ++i) EXPECT_LT((wide(x[i]) - wide(rest[i].rest_position)).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace sinew::test

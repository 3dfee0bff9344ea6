// SPDX-License-Identifier: GPL-3.0-or-later
//
// Bodies on pin sets that move, as flesh on the bones of a character.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "sinew/runtime/world.h"
#include "tests/bake/field_bar.h"
#include "tests/runtime/world_state.h"

namespace sinew::test {
namespace {

constexpr float kStep = 1.0F / 60;

RigidTransform transformOf(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& position) {
  RigidTransform result;
  for (int i = 0; i < 9; ++i) result.rotation[std::size_t(i)] = float(rotation(i / 3, i % 3));
  for (int c = 0; c < 3; ++c) result.position[std::size_t(c)] = float(position[c]);
  return result;
}

/// How far a body is from where a motion of its rest shape takes it, diagonals.
double farFrom(const World& world, BodyId body, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& position) {
  double most = 0;
  const auto vertices = world.asset(body).package().physicalVertices();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Eigen::Vector3d place = rotation * wide(vertices[i].rest_position) + position;
    most = std::max(most, (wide(world.positions(body)[i]) - place).norm());
  }
  return most / double(world.asset(body).package().info().diagonal);
}

WorldSettings weightless(std::uint32_t iterations) {
  WorldSettings settings;
  settings.gravity = {};
  settings.iterations = iterations;
  return settings;
}

class Held : public testing::TestWithParam<bool> {};

// At a constant speed nothing pulls, however fast it is: whether or not pins of weights below 1 are springs.
TEST_P(Held, FleshGoesWithItsBones) {
  const auto asset = *Asset::fromMemory(fieldBar({.pinned = true, .soft = GetParam(), .hz = 8}));
  const double diagonal = double(asset->package().info().diagonal);
  for (const std::uint32_t iterations : {1U, 4U, 16U}) {
    for (const double speed : {0.01, 0.05, 0.2, 1.0}) {  // diagonals a step
      World world(weightless(iterations));
      const BodyId body = *world.addBody(asset);
      double way = 0;
      for (int i = 1; i <= 600; ++i) {
        way += std::min(1.0, i / 60.0) * speed * diagonal;
        world.movePinTarget(body, "world", transformOf(Eigen::Matrix3d::Identity(), {0, 0, way}));
        world.step(kStep);
        if (i < 580) continue;
        ASSERT_LT(farFrom(world, body, Eigen::Matrix3d::Identity(), {0, 0, way}), 1e-4 + 1e-3 * speed)
            << iterations << ' ' << speed << ' ' << i;
      }
    }
  }
}

// About the bar's own axis, so that no centrifugal force bends it.
TEST_P(Held, FleshTurnsWithItsBones) {
  const auto asset = *Asset::fromMemory(fieldBar({.pinned = true, .soft = GetParam(), .hz = 8}));
  for (const std::uint32_t iterations : {1U, 4U, 16U}) {
    World world(weightless(iterations));
    const BodyId body = *world.addBody(asset);
    double angle = 0;
    for (int i = 1; i <= 300; ++i) {
      angle += std::min(1.0, i / 60.0) * 3 * double(kStep);
      const Eigen::Matrix3d rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()).toRotationMatrix();
      world.movePinTarget(body, "world", transformOf(rotation, Eigen::Vector3d::Zero()));
      world.step(kStep);
      if (i < 240) continue;
      ASSERT_LT(farFrom(world, body, rotation, Eigen::Vector3d::Zero()), 5e-3) << iterations << ' ' << i;
    }
  }
}

// Across its own axis, at all steps alike: pulled out by w^2 r, and else where its bones have it.
TEST_P(Held, FleshIsWhereItsBonesTurnIt) {
  const auto asset = *Asset::fromMemory(fieldBar({.pinned = true, .soft = GetParam(), .hz = 8}));
  std::vector<Eigen::Vector3d> tips;
  for (const float h : {1.0F / 60, 1.0F / 240, 1.0F / 1000}) {
    World world(weightless(4));
    const BodyId body = *world.addBody(asset);
    const double speed = 6;
    double angle = 0, seconds = 0;
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    while (seconds < 5) {
      seconds += double(h);
      angle += std::min(1.0, seconds) * speed * double(h);
      rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
      world.movePinTarget(body, "world", transformOf(rotation, Eigen::Vector3d::Zero()));
      world.step(h);
    }
    Eigen::Vector3d tip = Eigen::Vector3d::Zero();
    int count = 0;
    const auto vertices = asset->package().physicalVertices();
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      if (vertices[i].rest_position[0] < 0.499F) continue;
      tip += wide(world.positions(body)[i]);
      ++count;
    }
    tips.push_back(rotation.transpose() * tip / count);
    EXPECT_NEAR(tips.back()[2], 0, 0.01) << h;
    EXPECT_NEAR(tips.back()[1], 0, 1e-3) << h;
    EXPECT_GT(tips.back()[0], 0.501) << h;
    EXPECT_LT((tips.back() - tips.front()).norm(), 2e-3) << h;
  }
}

// A shape's size says when it has settled, whatever the units of what drives it: a vessel of a millimetre hangs and
// comes back as a bar of a metre does.
TEST(Held, SmallOnesBendAsLargeOnesDo) {
  std::vector<double> sags;
  for (const double length : {1.0, 0.01, 0.001}) {
    // The same shape under the same load: frequencies by the root of the length.
    const auto asset =
        *Asset::fromMemory(fieldBar({.pinned = true, .hz = float(20 / std::sqrt(length)), .length = length}));
    WorldSettings settings;
    World world(settings);
    const BodyId body = *world.addBody(asset);
    const auto sag = [&] {
      double low = 0;
      for (const Vec3& x : world.positions(body)) low = std::min(low, double(x[1]));
      return -low / length - 0.1;
    };
    const double h = double(kStep) * std::sqrt(length);
    for (int i = 0; i < 600; ++i) world.step(float(h));
    sags.push_back(sag());
    EXPECT_GT(sags.back(), 5e-3) << length;
    EXPECT_NEAR(sags.back() / sags.front(), 1, 0.01) << length;
    world.settings().gravity = {};
    for (int i = 0; i < 1200; ++i) world.step(float(h));
    EXPECT_LT(std::abs(sag()), 0.005 * sags.back()) << length;
  }
}

// A skeleton that has gone on while its flesh was off screen, or that jumps at a cut.
TEST_P(Held, ComesBackWhereItsBonesAre) {
  const auto asset = *Asset::fromMemory(fieldBar({.pinned = true, .soft = GetParam(), .hz = 8}));
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, 2, 0.5).normalized()).toRotationMatrix();
  const Eigen::Vector3d place(30, 5, -12);
  for (const Activity off : {Activity::paused, Activity::disabled, Activity::active}) {
    World world(weightless(4));
    const BodyId body = *world.addBody(asset);
    for (int i = 0; i < 30; ++i) world.step(kStep);
    world.setActivity(body, off);
    world.movePinTarget(body, "world", transformOf(rotation, place));
    if (off == Activity::active) {
      world.snapToPins(body);
    } else {
      for (int i = 0; i < 30; ++i) world.step(kStep);
      world.setActivity(body, Activity::active);
    }
    for (int i = 0; i < 30; ++i) {
      world.step(kStep);
      ASSERT_LT(farFrom(world, body, rotation, place), 1e-4) << int(off) << ' ' << i;
    }
  }
}

// On pins that the bake did not foresee a bar rings mostly as one that turns, of which its functions' decay knows
// nothing.
TEST(HeldAtRunTime, RingsAsLongAsItIsTold) {
  const auto asset = *Asset::fromMemory(fieldBar({}));
  for (const float ratio : {0.05F, 0.25F}) {
    WorldSettings settings = weightless(4);
    settings.damping = settings.support_damping = 0;
    settings.deformation_damping_ratio = 1;
    World world(settings);
    const BodyId body = *world.addBody(asset);
    std::vector<std::uint32_t> wall;
    std::uint32_t tip = 0;
    const auto vertices = asset->package().physicalVertices();
    for (std::uint32_t v = 0; v < vertices.size(); ++v) {
      if (vertices[v].rest_position[0] < -0.499F) wall.push_back(v);
      if (vertices[v].rest_position[0] > vertices[tip].rest_position[0]) tip = v;
    }
    ASSERT_TRUE(world.addPinSet(body, wall));
    const auto run = [&](int steps, double& most) {
      for (int i = 0; i < steps; ++i) {
        world.step(1.0F / 480);
        most = std::max(most, double(vertices[tip].rest_position[1] - world.positions(body)[tip][1]));
      }
    };
    world.settings().gravity = {0, -1, 0};
    double most = 0;
    run(960, most);
    const double low = double(vertices[tip].rest_position[1] - world.positions(body)[tip][1]);
    ASSERT_GT(low, 1e-5);
    world.settings().gravity = {};
    run(960, most);
    world.settings().gravity = {0, -1, 0};
    world.settings().deformation_damping_ratio = ratio;
    most = 0;
    run(960, most);
    // Set loose it swings by exp(-pi ratio / (1 - ratio^2)^1/2) of its sag beyond it.
    const double expected = std::exp(-std::numbers::pi * double(ratio) / std::sqrt(1 - double(ratio * ratio)));
    EXPECT_NEAR((most - low) / low, expected, 0.1 * expected) << ratio;
  }
}

INSTANTIATE_TEST_SUITE_P(Pins, Held, testing::Bool(),
                         [](const auto& param) { return param.param ? "WithSprings" : "Exact"; });

}  // namespace
}  // namespace sinew::test

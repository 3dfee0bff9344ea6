// SPDX-License-Identifier: MIT
//
// Bodies on the ground, held, and pulled.
#include <gtest/gtest.h>

#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

using Eigen::Vector3d;
using formats::ClusterMode;

WorldSettings onGround(float friction = 0.6F) {
  WorldSettings settings;
  settings.ground.enabled = true;
  settings.ground.friction = friction;
  return settings;
}

// A metre-sized table: a slab on four thin feet that hold 1/8 of its mass and touch on 1/6 of its base.
BoxOptions table(ClusterMode mode, std::uint32_t clusters) {
  BoxOptions box;
  box.cells = {10, 10, 10};
  box.clusters = {clusters, clusters, clusters};
  box.mode = mode;
  box.stretch_hz = box.bend_hz = box.twist_hz = 15;
  box.keep = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    return j >= 4 || ((i < 2 || i >= 8) && (k < 2 || k >= 8));
  };
  return box;
}

struct Standing {
  ClusterMode mode;
  std::uint32_t clusters;
};
class Table : public testing::TestWithParam<Standing> {};

TEST_P(Table, StandsOnItsFeet) {
  World world(onGround());
  BodySettings place;
  place.position = {0, 0.5F + 0.87F, 0};
  const BodyId body = *world.addBody(boxAsset(table(GetParam().mode, GetParam().clusters)), place);
  const double diagonal = double(world.asset(body).package().info().diagonal);
  for (int i = 0; i < 360; ++i) {
    world.step(1.0F / 60);
    ASSERT_GE(lowestDrawn(world, body), -1e-6) << i;
  }
  EXPECT_LT(rmsSpeed(world, body), 0.002);
  // Upright, and no lower than its elasticity allows.
  Mat3 rotation;
  Vec3 translation;
  world.rigidMotion(body, rotation, translation);
  EXPECT_GT(rotation[4], 0.999F);
  const auto vertices = world.asset(body).package().physicalVertices();
  double rest_center = 0, foot_span = 0;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    rest_center += double(vertices[i].mass) * (double(vertices[i].rest_position[1]) + 0.5);
    if (vertices[i].rest_position[1] < -0.49F) foot_span = std::max(foot_span, double(world.positions(body)[i][1]));
  }
  rest_center /= double(world.asset(body).package().info().total_mass);
  EXPECT_GT(motionOf(world, body).center[1], rest_center - 0.03 * diagonal);
  EXPECT_LT(foot_span, 0.02 * diagonal);  // the soles lie flat
}

INSTANTIATE_TEST_SUITE_P(Modes, Table,
                         testing::Values(Standing{ClusterMode::rigid, 1}, Standing{ClusterMode::rigid, 2},
                                         Standing{ClusterMode::linear, 1}, Standing{ClusterMode::linear, 2},
                                         Standing{ClusterMode::linear, 3}));

TEST(Ground, BodyTipsOverWhenItsCenterOverhangsItsSupport) {
  for (const bool overhangs : {false, true}) {
    BoxOptions box;
    box.cells = {10, 10, 4};
    box.mode = ClusterMode::rigid;
    box.keep = [overhangs](std::uint32_t i, std::uint32_t j, std::uint32_t) {
      return j >= 3 || i < (overhangs ? 3U : 7U);
    };
    World world(onGround());
    BodySettings place;
    place.position = {0, 0.5F, 0};
    const BodyId body = *world.addBody(boxAsset(box), place);
    run(world, 2);
    Mat3 rotation;
    Vec3 translation;
    world.rigidMotion(body, rotation, translation);
    if (overhangs) {
      EXPECT_NEAR(rotation[4], std::cos(std::atan(0.3 / 0.7)), 0.02);  // the slab's corner stops it
    } else {
      EXPECT_GT(rotation[4], 0.9999F);
    }
    EXPECT_GE(lowestDrawn(world, body), -1e-6);
  }
}

TEST(Ground, CoulombFrictionOnASlope) {
  // On a slope of angle a: rests if mu > tan a, else slides with g (sin a - mu cos a).
  const double angle = 0.3;
  for (const float mu : {0.0F, 0.15F, 0.6F}) {
    WorldSettings settings = onGround(mu);
    settings.damping = 0;
    settings.gravity = {float(9.81 * std::sin(angle)), float(-9.81 * std::cos(angle)), 0};
    World world(settings);
    BoxOptions box;
    box.size = {1, 0.4, 1};
    box.stretch_hz = 20;
    BodySettings place;
    place.position = {0, 0.2F, 0};
    const BodyId body = *world.addBody(boxAsset(box), place);
    run(world, 1);
    const Motion at_1 = motionOf(world, body);
    run(world, 1);
    const Motion at_2 = motionOf(world, body);
    const double acceleration = (at_2.momentum[0] - at_1.momentum[0]) / at_1.mass;
    const double expected = std::max(0.0, 9.81 * (std::sin(angle) - double(mu) * std::cos(angle)));
    EXPECT_NEAR(acceleration, expected, 0.03) << mu;
    if (expected == 0) {
      EXPECT_LT(std::abs(at_2.center[0] - at_1.center[0]), 2e-5) << "creeps";
    }
  }
}

// A first matrix that holds it across takes what is firm or flat for held, and the way that it has to go for nothing.
TEST(Ground, WhatIsFirmAndFlatSlidesAsFrictionLetsIt) {
  for (const std::array<double, 3>& size : {std::array{0.7, 0.04, 0.7}, {0.3, 0.3, 0.3}, {2.0, 0.1, 0.3}}) {
    for (const double hz : {10.0, 80.0, 200.0}) {
      for (const float mu : {0.0F, 0.3F}) {
        WorldSettings settings = onGround(mu);
        settings.damping = 0;
        settings.sleep_seconds = 0;
        World world(settings);
        BoxOptions box;
        box.size = size;
        box.stretch_hz = box.bend_hz = box.twist_hz = float(hz);
        BodySettings place;
        place.position = {0, float(0.5 * size[1]), 0};
        const BodyId body = *world.addBody(boxAsset(box), place);
        run(world, 2);
        const Motion before = motionOf(world, body);
        const double force = (double(mu) + 0.2) * 9.81;
        for (int i = 0; i < 60; ++i) {
          world.addForce(body, Vec3{float(force * before.mass), 0, 0});
          world.step(1.0F / 60);
        }
        const Motion pushed = motionOf(world, body);
        EXPECT_NEAR((pushed.momentum[0] - before.momentum[0]) / before.mass, 0.2 * 9.81, 0.12)
            << size[1] << ' ' << hz << ' ' << mu;
        if (mu == 0) continue;
        // Nothing pushes it on: it slows down and stays.
        double fastest = pushed.momentum[0] / pushed.mass;
        for (int i = 0; i < 90; ++i) {
          world.step(1.0F / 60);
          const Motion now = motionOf(world, body);
          EXPECT_LT(now.momentum[0] / now.mass, fastest + 0.02) << size[1] << ' ' << hz << ' ' << i;
          fastest = now.momentum[0] / now.mass;
        }
        EXPECT_NEAR(fastest, 0, 0.02) << size[1] << ' ' << hz;
      }
    }
  }
}

// Firm contacts have all of their load, and friction all of its hold, on a way that is nothing beside a step's fall.
TEST(Ground, WhatLiesSlidesWhereGravityTurns) {
  for (const double hz : {10.0, 80.0}) {
    BoxOptions box;
    box.size = {1, 0.05, 1};
    box.stretch_hz = box.bend_hz = box.twist_hz = float(hz);
    const auto asset = boxAsset(box);
    for (const float mu : {0.3F, 0.6F}) {
      for (const double beyond : {0.9, 1.05, 1.3}) {
        for (const float rate : {30.0F, 60.0F}) {
          WorldSettings settings = onGround(mu);
          settings.damping = 0;
          World world(settings);
          BodySettings place;
          place.position = {0, 0.025F, 0};
          const BodyId body = *world.addBody(asset, place);
          for (int i = 0; i < int(2 * rate); ++i) world.step(1 / rate);
          const double slope = std::atan(double(mu) * beyond);
          world.settings().gravity = {float(9.81 * std::sin(slope)), float(-9.81 * std::cos(slope)), 0};
          const Vector3d before = motionOf(world, body).center;
          for (int i = 0; i < int(2 * rate); ++i) world.step(1 / rate);
          const double way = motionOf(world, body).center[0] - before[0];
          const double expected = 2 * std::max(0.0, 9.81 * (std::sin(slope) - double(mu) * std::cos(slope)));
          EXPECT_NEAR(way, expected, 0.1 * expected + 1e-4) << hz << ' ' << mu << ' ' << beyond << ' ' << rate;
        }
      }
    }
  }
}

TEST(Ground, ADropGainsNoEnergyAndComesToRest) {
  for (const ClusterMode mode : {ClusterMode::rigid, ClusterMode::linear, ClusterMode::quadratic}) {
    BoxOptions box;
    box.mode = mode;
    box.clusters = {2, 2, 2};
    World world(onGround());
    BodySettings place;
    // Onto an edge, tilted about z and x.
    const Eigen::Matrix3f r =
        (Eigen::AngleAxisf(0.4F, Eigen::Vector3f::UnitX()) * Eigen::AngleAxisf(0.6F, Eigen::Vector3f::UnitZ()))
            .toRotationMatrix();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) place.rotation[std::size_t(3 * row + column)] = r(row, column);
    }
    place.position = {0, 1.8F, 0};
    const BodyId body = *world.addBody(boxAsset(box), place);
    const double start = 9.81 * motionOf(world, body).mass * motionOf(world, body).center[1];
    for (int i = 0; i < 360; ++i) {
      world.step(1.0F / 60);
      const Motion m = motionOf(world, body);
      ASSERT_LE(m.kinetic + 9.81 * m.mass * m.center[1], start * 1.001) << int(mode) << " " << i;
    }
    EXPECT_LT(rmsSpeed(world, body), 0.002) << int(mode);
    EXPECT_GE(lowestDrawn(world, body), -1e-6);
    const Motion before = motionOf(world, body);
    run(world, 2);
    EXPECT_LT((motionOf(world, body).center - before.center).norm(), 2e-3) << "drifts";
  }
}

// A stiff cube on its corner: one point of firmness kappa and damping c = 2 zeta sqrt(kappa m / 8). By implicit Euler
// changes of its height follow (1 + a + b) d(t + h) = (2 + b) d(t) - d(t - h), a = kappa h^2 / m and b = c h / m, where
// 8 kappa / m = omega^2 = g / (2e-5 diagonals).
TEST(Ground, ContactsAreDampedByTheInnerFriction) {
  BoxOptions box;
  box.stretch_hz = box.bend_hz = box.twist_hz = 10000;
  const auto asset = boxAsset(box);
  const double h = 1.0 / 2000, omega = std::sqrt(9.81 / (2e-5 * double(asset->package().info().diagonal)));
  BodySettings place;
  place.position = {0, float(std::sqrt(0.75)), 0};
  const Eigen::Matrix3f turned =
      Eigen::Quaternionf::FromTwoVectors(Eigen::Vector3f::Ones(), Eigen::Vector3f::UnitY()).toRotationMatrix();
  for (int i = 0; i < 9; ++i) place.rotation[std::size_t(i)] = turned(i / 3, i % 3);
  for (const float ratio : {0.0F, 0.25F, 1.0F}) {
    WorldSettings settings = onGround();
    settings.damping = settings.support_damping = 0;
    settings.deformation_damping_ratio = ratio;
    World world(settings);
    const BodyId body = *world.addBody(asset, place);
    std::vector<double> heights = {motionOf(world, body).center[1]};
    for (int i = 0; i < 60; ++i) {
      world.step(float(h));
      heights.push_back(motionOf(world, body).center[1]);
    }
    // Least squares for the two coefficients.
    Eigen::Matrix2d left = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (std::size_t i = 4; i < heights.size(); ++i) {
      const Eigen::Vector2d known(heights[i - 1] - heights[i - 2], heights[i - 3] - heights[i - 2]);
      left += known * known.transpose();
      right += (heights[i] - heights[i - 1]) * known;
    }
    const Eigen::Vector2d found = left.ldlt().solve(right);
    const double b = found[0] / found[1] - 2, a = 1 / found[1] - 1 - b;
    EXPECT_NEAR(a, h * h * omega * omega / 8, 0.1 * a) << ratio;
    EXPECT_NEAR(b, double(ratio) * h * omega / 4, 0.05 * h * omega / 4) << ratio;
  }
}

TEST(Ground, WhatStartsInsideComesOutGently) {
  World world(onGround());
  BodySettings place;
  place.position = {0, 0.1F, 0};
  const BodyId body = *world.addBody(boxAsset({}), place);
  double fastest = 0;
  for (int i = 0; i < 240; ++i) {
    world.step(1.0F / 60);
    fastest = std::max(fastest, rmsSpeed(world, body));
  }
  EXPECT_LT(fastest, 1.5);
  EXPECT_GE(lowestDrawn(world, body), -1e-6);
}

TEST(Pins, HoldExactlyAndCarryTheBody) {
  for (const ClusterMode mode : {ClusterMode::rigid, ClusterMode::linear, ClusterMode::quadratic}) {
    for (const std::uint32_t clusters : {1U, 3U}) {
      BoxOptions box;
      box.cells = {3, 12, 3};
      box.size = {0.3, 1.2, 0.3};
      box.center = {0, -0.6, 0};
      box.clusters = {1, clusters, 1};
      box.mode = mode;
      box.stretch_hz = box.bend_hz = box.twist_hz = 4;
      World world;
      const BodyId body = *world.addBody(boxAsset(box));
      const std::vector<Vec3> start(world.positions(body).begin(), world.positions(body).end());
      std::vector<std::uint32_t> top;
      for (std::uint32_t i = 0; i < start.size(); ++i) {
        if (start[i][1] > -1e-4F) top.push_back(i);
      }
      for (const std::uint32_t i : top) world.pin(body, i, start[i]);
      run(world, 6);
      for (const std::uint32_t i : top) ASSERT_EQ(world.positions(body)[i], start[i]);
      // Stretched by about g / omega² (0.016 m) times the load's leverage, not torn and not stiff.
      const double sag = motionOf(world, body).center[1] + 0.6;
      if (mode == ClusterMode::rigid) {
        EXPECT_GT(sag, -0.005);
      } else {
        EXPECT_LT(sag, -0.008) << int(mode) << " " << clusters;
        EXPECT_GT(sag, -0.16) << int(mode) << " " << clusters;
      }
      EXPECT_LT(rmsSpeed(world, body), 0.005) << int(mode) << " " << clusters;
      world.unpinAll(body);
      world.step(1.0F / 60);
      EXPECT_LT(motionOf(world, body).momentum[1], 0);
    }
  }
}

TEST(Pins, MovingPinsTakeTheBodyAlong) {
  World world(weightless());
  const BodyId body = *world.addBody(boxAsset({}));
  const std::vector<Vec3> start(world.positions(body).begin(), world.positions(body).end());
  std::vector<std::uint32_t> side;
  for (std::uint32_t i = 0; i < start.size(); ++i) {
    if (start[i][0] < -0.49F) side.push_back(i);
  }
  for (int step = 1; step <= 120; ++step) {
    for (const std::uint32_t i : side) {
      Vec3 target = start[i];
      target[0] -= 0.01F * float(step);
      world.pin(body, i, target);
    }
    world.step(1.0F / 60);
  }
  EXPECT_NEAR(motionOf(world, body).center[0], -1.2, 0.1);
  run(world, 8);
  EXPECT_NEAR(motionOf(world, body).center[0], -1.2, 2e-3);
  EXPECT_LT(restError(world, body).max, 1e-3);
}

TEST(Pick, PullsThePointToItsTargetAndLetsGo) {
  for (const bool cluster_attachment : {false, true}) {
    BoxOptions box;
    box.clusters = {2, 2, 2};
    box.cluster_attachment = cluster_attachment;
    World world(weightless());
    const BodyId body = *world.addBody(boxAsset(box));
    Vec3 point;
    world.visualVertices(body, {point.data(), 12, 1}, {});
    const Vec3 target = {point[0] + 0.5F, point[1] + 0.3F, point[2]};
    const PickId pick = world.pick(body, 0, target);
    run(world, 6);
    world.visualVertices(body, {point.data(), 12, 1}, {});
    EXPECT_LT((wide(point) - wide(target)).norm(), 0.01) << cluster_attachment;
    EXPECT_LT(restError(world, body).max, 2e-3);
    world.movePick(pick, {5, 5, 5});
    world.releasePick(pick);
    // It may swing about the point it was held by, but nothing pulls it any more.
    const Vector3d before = motionOf(world, body).momentum;
    run(world, 1);
    EXPECT_LT((motionOf(world, body).momentum - std::exp(-0.2) * before).norm(), 1e-3 * before.norm() + 0.1);
  }
}

TEST(Pick, PullsWithItsLargestForceHoweverFarTheTarget) {
  // In so short a step the point has hardly begun to move: what its own damper takes is little yet.
  const auto pulled = [](float most_force, double metres) {
    World world(weightless());
    const BodyId body = *world.addBody(boxAsset({}));
    EXPECT_NE(world.pick(body, 0, {float(metres), 0, 0}, 4, most_force), PickId{});
    world.step(1e-4F);
    return motionOf(world, body).momentum.norm() / 1e-4;
  };
  const double weight = 9.81 * double(boxAsset({})->package().info().total_mass);
  EXPECT_NEAR(pulled(20, 100), 20, 0.8);
  EXPECT_NEAR(pulled(20, 1e6), 20, 0.8);
  EXPECT_NEAR(pulled(0, 1e6), 50 * weight, 2 * weight);
  EXPECT_GT(pulled(std::numeric_limits<float>::infinity(), 1e6), 1e4 * weight);
  World world(weightless());
  const BodyId body = *world.addBody(boxAsset({}));
  for (const float wrong : {-1.0F, std::numeric_limits<float>::quiet_NaN()}) {
    EXPECT_EQ(world.pick(body, 0, {1, 0, 0}, 4, wrong), PickId{});
  }
}

// Its damper pulls as well: the two together may do no more.
TEST(Pick, LetsFallWhatItMayNotHold) {
  const auto asset = boxAsset({});
  const double weight = 9.81 * double(asset->package().info().total_mass);
  for (const float hz : {1.0F, 4.0F, 20.0F}) {
    for (const double part : {0.1, 0.9}) {
      WorldSettings settings;
      settings.damping = 0;
      World world(settings);
      const BodyId body = *world.addBody(asset);
      const BodyPoint top = world.nearestPoint(body, {0, 9, 0});
      ASSERT_NE(world.pick(body, top, {0, 5, 0}, {hz, float(part * weight)}), PickId{});
      run(world, 2);
      const Motion now = motionOf(world, body);
      const double expected = 2 * 9.81 * (1 - part);
      EXPECT_NEAR(-now.momentum[1] / now.mass, expected, 0.02 * 9.81) << hz << ' ' << part;
    }
  }
}

TEST(Pick, IsStableAtAnyStepAndFrequency) {
  for (const float h : {1e-4F, 1.0F / 60, 1.0F}) {
    for (const float hz : {0.1F, 100.0F}) {
      World world(weightless());
      const BodyId body = *world.addBody(boxAsset({}));
      world.pick(body, 5, {2, 1, 0}, hz);
      for (int i = 0; i < 300; ++i) {
        world.step(h);
        ASSERT_TRUE(allFinite(world, body));
        ASSERT_LT(motionOf(world, body).center.norm(), 8.0) << h << " " << hz;
      }
    }
  }
}

}  // namespace
}  // namespace sinew::test

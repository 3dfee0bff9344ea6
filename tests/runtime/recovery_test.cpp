// SPDX-License-Identifier: MIT
//
// From any state back to the rest shape, and finite whatever comes in.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <functional>
#include <limits>
#include <random>

#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

using formats::ClusterMode;

struct Recovery {
  const char* name;
  ClusterMode mode;
  std::uint32_t clusters;
};

class Recover : public testing::TestWithParam<Recovery> {
 protected:
  Recover() : world_(weightless()) {
    BoxOptions box;
    box.cells = {6, 5, 4};
    box.size = {1.5, 1, 0.7};
    box.mode = GetParam().mode;
    box.clusters = {GetParam().clusters, GetParam().clusters, 1};
    body_ = *world_.addBody(boxAsset(box));
  }

  void recoverFrom(const std::function<Vec3(const Vec3&)>& deform) {
    std::vector<Vec3> x;
    for (const Vec3& p : world_.positions(body_)) x.push_back(deform(p));
    world_.setState(body_, x, {});
    for (int i = 0; i < 360; ++i) {
      world_.step(1.0F / 60);
      ASSERT_TRUE(allFinite(world_, body_)) << i;
    }
    // restError removes proper rotations only: a mirrored body would show as an error of the order of 1.
    EXPECT_LT(restError(world_, body_).max, 1e-3);
  }

  World world_;
  BodyId body_;
};

TEST_P(Recover, FromAPlane) {
  recoverFrom([](const Vec3& p) { return Vec3{p[0], 0, p[2]}; });
}
TEST_P(Recover, FromALine) {
  recoverFrom([](const Vec3& p) { return Vec3{p[0], 0, 0}; });
}
TEST_P(Recover, FromAPoint) {
  recoverFrom([](const Vec3&) { return Vec3{0.1F, 0.2F, 0.3F}; });
}
TEST_P(Recover, FromItsMirrorImage) {
  for (const std::size_t axis : {0U, 1U, 2U}) {
    recoverFrom([axis](const Vec3& p) {
      Vec3 q = p;
      q[axis] = -q[axis];
      return q;
    });
    world_.resetBody(body_);
  }
}
TEST_P(Recover, FromInsideOut) {
  recoverFrom([](const Vec3& p) { return Vec3{-p[0], -p[1], -p[2]}; });
}
TEST_P(Recover, FromAScatterOfItsOwnSize) {
  std::mt19937 engine(11);
  std::uniform_real_distribution<float> noise(-1, 1);
  recoverFrom([&](const Vec3&) { return Vec3{noise(engine), noise(engine), noise(engine)}; });
}
TEST_P(Recover, FromStretch) {
  recoverFrom([](const Vec3& p) { return Vec3{p[0] * 4, p[1], p[2]}; });
}

INSTANTIATE_TEST_SUITE_P(
    Modes, Recover,
    testing::Values(Recovery{"rigid1", ClusterMode::rigid, 1}, Recovery{"linear1", ClusterMode::linear, 1},
                    Recovery{"quadratic1", ClusterMode::quadratic, 1}, Recovery{"rigid2", ClusterMode::rigid, 2},
                    Recovery{"linear2", ClusterMode::linear, 2}, Recovery{"quadratic2", ClusterMode::quadratic, 2}),
    [](const auto& tested) { return tested.param.name; });

TEST(Extremes, RigidClustersMoveOnWithoutDamping) {
  WorldSettings settings = weightless();
  settings.damping = settings.deformation_damping_ratio = 0;
  World world(settings);
  BoxOptions box;
  box.mode = ClusterMode::rigid;
  box.clusters = {2, 1, 1};
  const BodyId body = *world.addBody(boxAsset(box));
  const std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end()), v(x.size(), Vec3{1, 0, 0});
  world.setState(body, x, v);
  world.step(1.0F / 60);
  EXPECT_NEAR(motionOf(world, body).momentum[0] / motionOf(world, body).mass, 1, 1e-5);
}

TEST(Extremes, EverythingStaysFinite) {
  for (const ClusterMode mode : {ClusterMode::rigid, ClusterMode::linear, ClusterMode::quadratic}) {
    for (const float h : {1e-5F, 1.0F / 60, 1.0F}) {
      for (const float hz : {0.0F, 5.0F, 1e5F}) {
        for (const float size : {1e-6F, 1.0F, 1e6F}) {
          BoxOptions box;
          box.mode = mode;
          box.clusters = {2, 1, 1};
          box.stretch_hz = box.bend_hz = box.twist_hz = hz;
          WorldSettings settings;
          settings.ground.enabled = true;
          World world(settings);
          const BodyId body = *world.addBody(boxAsset(box));
          std::mt19937 engine(5);
          std::normal_distribution<float> noise(0, 1);
          std::vector<Vec3> x, v;
          for (std::size_t i = 0; i < world.positions(body).size(); ++i) {
            x.push_back({size * noise(engine), size * noise(engine), size * noise(engine)});
            v.push_back({1e6F * noise(engine), 1e6F * noise(engine), 1e6F * noise(engine)});
          }
          world.setState(body, x, v);
          for (int i = 0; i < 60; ++i) world.step(h);
          EXPECT_TRUE(allFinite(world, body)) << int(mode) << " h " << h << " f " << hz << " size " << size;
          EXPECT_EQ(world.repairedVertices(body), 0U);
        }
      }
    }
  }
}

// A rod that twists by more than a step can follow, with little angular momentum, and tumbles slowly, with most of it:
// turned about the axis of the whole as fast as it twists it would have many times its energy.
TEST(Extremes, AThinPartThatTwistsFastGainsNoEnergy) {
  for (const ClusterMode mode : {ClusterMode::rigid, ClusterMode::linear, ClusterMode::quadratic}) {
    BoxOptions box;
    box.cells = {12, 1, 1};
    box.size = {1, 0.02F, 0.02F};
    box.mode = mode;
    box.stretch_hz = 100;  // what bursts at this speed is no rod
    WorldSettings settings = weightless();
    settings.damping = 0;
    World world(settings);
    const BodyId body = *world.addBody(boxAsset(box));
    const std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
    const Eigen::Vector3d center = motionOf(world, body).center;
    std::vector<Vec3> v;
    for (const Vec3& p : x) {
      const Eigen::Vector3d u = Eigen::Vector3d(600, 0, 2).cross(wide(p) - center);
      v.push_back({float(u[0]), float(u[1]), float(u[2])});
    }
    world.setState(body, x, v);
    const double start = motionOf(world, body).kinetic;
    for (int i = 0; i < 120; ++i) {
      world.step(1.0F / 240);
      ASSERT_LE(motionOf(world, body).kinetic, 1.001 * start) << int(mode) << " step " << i;
    }
    EXPECT_LT(restError(world, body).max, 0.05) << int(mode);
  }
}

TEST(Extremes, ALostVertexIsPutWhereTheOthersHaveIt) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const Vec3& bad : {Vec3{nan, 0, 0}, Vec3{0, inf, 0}, Vec3{1e30F, 0, 0}}) {
    for (const bool in_velocity : {false, true}) {
      BoxOptions box;
      box.clusters = {2, 2, 2};
      World world(weightless());
      BodySettings place;
      place.position = {100, 50, -20};
      const BodyId body = *world.addBody(boxAsset(box), place);
      std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end()), v(x.size());
      (in_velocity ? v : x)[7] = bad;
      world.setState(body, x, v);
      EXPECT_TRUE(allFinite(world, body));
      EXPECT_LT(restError(world, body).max, 1e-4);
      world.step(1.0F / 60);
      EXPECT_EQ(world.repairedVertices(body), 0U);
      EXPECT_LT(rmsSpeed(world, body), 1e-3);
    }
  }
}

TEST(Extremes, ABodyThatIsLostAltogetherComesBackWhereItWasAdded) {
  BoxOptions box;
  box.clusters = {2, 2, 2};
  formats::PackageContent content = boxContent(box);
  formats::ClusterMechanics mechanics = formats::kPlainMechanics;
  mechanics.plastic_yield = 0.1F;
  mechanics.plastic_creep = 1;
  mechanics.plastic_limit = 0.2F;
  content.mechanics.assign(content.clusters.size(), mechanics);
  const auto asset = makeAsset(content);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  using Deed = std::function<void(World&, BodyId)>;
  const std::array<std::pair<const char*, Deed>, 3> kDeeds = {{
      {"fell out of the world",
       [](World& world, BodyId) {
         world.settings().gravity = {0, -1e15F, 0};
         for (int i = 0; i < 10; ++i) world.step(1);
       }},
      {"a step of a minute", [](World& world, BodyId) { world.step(60); }},
      {"nothing but NaN",
       [nan](World& world, BodyId body) {
         world.setState(body, std::vector<Vec3>(world.positions(body).size(), Vec3{nan, nan, nan}), {});
       }},
  }};
  for (const auto& [name, deed] : kDeeds) {
    World world(weightless());
    BodySettings place;
    place.position = {3, 4, 5};
    const BodyId body = *world.addBody(asset, place);
    world.settings().damping = 0;
    deed(world, body);
    world.settings().gravity = {0, 0, 0};
    for (int i = 0; i < 60; ++i) world.step(1.0F / 60);
    EXPECT_EQ(world.repairedVertices(body), 0U) << name;
    EXPECT_TRUE(allFinite(world, body)) << name;
    EXPECT_LT(restError(world, body).max, 1e-3) << name;
    EXPECT_LT((motionOf(world, body).center - Eigen::Vector3d(3, 4, 5)).norm(), 1e-3) << name;
  }
}

/// Two boxes in one package, far enough apart for each to be on its own. \return the first vertex of the second.
std::uint32_t twoPieces(std::shared_ptr<const Asset>& asset) {
  BoxOptions box;
  box.cells = {3, 3, 3};
  box.clusters = {2, 1, 1};
  box.stretch_hz = 8;
  box.center = {-3, 0, 0};
  formats::PackageContent content = boxContent(box);
  box.center = {3, 0, 0};
  appendBody(content, boxContent(box));
  asset = makeAsset(content);
  return asset->package().pieces()[1].first_vertex;
}

/// What may become of the first box.
struct Scatter {
  const char* name;
  void (*apply)(std::vector<Vec3>& x, std::vector<Vec3>& v, std::uint32_t end, std::mt19937& random);
};

const Scatter kScatters[] = {
    {"anywhere",
     [](auto& x, auto&, std::uint32_t end, auto& random) {
       std::uniform_real_distribution<float> any(-200, 200);
       for (std::uint32_t i = 0; i < end; ++i) x[i] = {any(random), any(random), any(random)};
     }},
    {"lost, by its speed",
     [](auto&, auto& v, std::uint32_t end, auto&) {
       for (std::uint32_t i = 0; i < end; ++i) v[i] = {0, 9e16F, 0};
     }},
    {"inside out, below the ground",
     [](auto& x, auto&, std::uint32_t end, auto&) {
       for (std::uint32_t i = 0; i < end; ++i) x[i] = {-6 - x[i][0], -5 + x[i][1], x[i][2]};
     }},
    {"in part no number",
     [](auto& x, auto&, std::uint32_t end, auto&) {
       for (std::uint32_t i = 0; i < end; i += 2) x[i][1] = std::numeric_limits<float>::quiet_NaN();
     }},
};

// A package of several pieces is one body, but what happens to one piece is nothing to the others: neither their pins,
// picks and ground, nor where they are, by a bit.
TEST(RecoverPieces, WhatIsScatteredLeavesTheOthersAlone) {
  std::shared_ptr<const Asset> asset;
  const std::uint32_t second = twoPieces(asset);
  for (const Scatter& scatter : kScatters) {
    SCOPED_TRACE(scatter.name);
    WorldSettings settings;
    settings.ground = {true, {0, 1, 0}, -0.55F, 0.6F};
    std::array<World, 2> worlds{World(settings), World(settings)};
    std::array<BodyId, 2> bodies;
    for (std::size_t w = 0; w < 2; ++w) {
      World& world = worlds[w];
      bodies[w] = *world.addBody(asset);
      world.pin(bodies[w], second, {3.2F, 0.3F, 0});
      const std::array<std::uint32_t, 2> held = {second + 20, second + 21};
      ASSERT_TRUE(world.addPinSet(bodies[w], held));
      static_cast<void>(world.pick(bodies[w], std::uint32_t(asset->package().visualPositions().size()) - 1, {3, 2, 1}));
      // The first box is held as well, so that there is something to take.
      world.pin(bodies[w], 3, {-2, 0.1F, 0});
      for (int step = 0; step < 30; ++step) world.step(1.0F / 60);
      const auto x = world.positions(bodies[w]), v = world.velocities(bodies[w]);
      std::vector<Vec3> places(x.begin(), x.end()), speeds(v.begin(), v.end());
      std::mt19937 random(5);
      if (w == 1) scatter.apply(places, speeds, second, random);
      world.setState(bodies[w], places, speeds);
    }
    for (int step = 0; step < 120; ++step) {
      const auto x = worlds[0].positions(bodies[0]), y = worlds[1].positions(bodies[1]);
      ASSERT_TRUE(std::equal(x.begin() + second, x.end(), y.begin() + second)) << step;
      ASSERT_TRUE(allFinite(worlds[1], bodies[1])) << step;
      ASSERT_LE(worlds[1].repairedVertices(bodies[1]), second) << step;
      for (World& world : worlds) world.step(1.0F / 60);
    }
  }
}

// Vertices without a number go where their own piece has them, not where all pieces together would.
TEST(RecoverPieces, LostVerticesFollowTheirOwnPiece) {
  std::shared_ptr<const Asset> asset;
  const std::uint32_t second = twoPieces(asset);
  World world(weightless());
  const BodyId body = *world.addBody(asset);
  const auto rest = world.positions(body);
  std::vector<Vec3> x(rest.begin(), rest.end()), v(x.size(), Vec3{});
  for (std::uint32_t i = 0; i < second; ++i) {  // the first one far up, turned, and moving
    x[i] = {-x[i][1], 50 + x[i][0], x[i][2]};
    v[i] = {0, 7, 0};
  }
  const std::vector<Vec3> wanted = x;
  for (const std::uint32_t i : {2U, 9U, second + 4, second + 11}) x[i][2] = std::numeric_limits<float>::infinity();
  world.setState(body, x, v);
  for (std::uint32_t i = 0; i < x.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(world.positions(body)[i][c], wanted[i][c], 1e-3) << i;
      EXPECT_NEAR(world.velocities(body)[i][c], v[i][c], 1e-3) << i;
    }
  }
}

}  // namespace
}  // namespace sinew::test

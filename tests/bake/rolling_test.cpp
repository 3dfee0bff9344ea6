// SPDX-License-Identifier: GPL-3.0-or-later
//
// A baked ball rolls as mechanics say: in a step of 1/60 s it turns by up to a radian.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <vector>

#include "sinew/runtime/world.h"
#include "tests/bake/baked_obj.h"
#include "tests/support/motion.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using test::Motion;
using test::motionOf;

constexpr double kRadius = 0.05;

/// Rings of a globe.
void writeBall(std::ofstream& obj) {
  constexpr int kRings = 20, kAround = 40;
  const auto vertex = [](int ring, int i) {
    if (ring == 0) return 1;
    if (ring == kRings) return 2;
    return 3 + (ring - 1) * kAround + i % kAround;
  };
  obj << "v 0 " << kRadius << " 0\nv 0 " << -kRadius << " 0\n";
  for (int ring = 1; ring < kRings; ++ring) {
    for (int i = 0; i < kAround; ++i) {
      const double down = std::numbers::pi * ring / kRings, around = 2 * std::numbers::pi * i / kAround;
      obj << "v " << kRadius * std::sin(down) * std::cos(around) << ' ' << kRadius * std::cos(down) << ' '
          << kRadius * std::sin(down) * std::sin(around) << '\n';
    }
  }
  for (int ring = 0; ring < kRings; ++ring) {
    for (int i = 0; i < kAround; ++i) {
      const int a = vertex(ring, i), b = vertex(ring, i + 1), c = vertex(ring + 1, i + 1), d = vertex(ring + 1, i);
      if (ring > 0) obj << "f " << a << ' ' << b << ' ' << (ring + 1 < kRings ? c : d) << '\n';
      if (ring + 1 < kRings) obj << "f " << a << ' ' << c << ' ' << d << '\n';
    }
  }
}

/// \param hz that it rings at
std::shared_ptr<const Asset> ballOf(int hz) {
  return bakedObj("ball", writeBall, [hz](Settings& settings) {
    settings.clusters.stretch_hz = settings.clusters.bend_hz = settings.clusters.twist_hz = double(hz);
    settings.field.points = 1024;  // of 256 it is a polyhedron
  });
}

WorldSettings withoutDamping() {
  WorldSettings settings;
  settings.damping = settings.support_damping = 0;
  settings.ground.enabled = true;
  settings.ground.friction = 0.3F;
  return settings;
}

// On level ground it may lose a little to its own damping, and gains nothing.
TEST(Rolling, GoesOn) {
  for (const int hz : {40, 120}) {
    const auto asset = ballOf(hz);
    for (const int rate : {60, 120}) {
      for (const double speed : {0.7, 1.5, 3.0}) {
        World world(withoutDamping());
        BodySettings at;
        at.position = {0, float(kRadius), 0};
        const BodyId body = *world.addBody(asset, at);
        for (int i = 0; i < rate; ++i) world.step(1.0F / float(rate));
        world.setVelocity(body, {float(speed), 0, 0}, {0, 0, float(-speed / kRadius)});
        const double start = motionOf(world, {body}).energy;
        double most = 0;
        for (int i = 0; i < 3 * rate; ++i) {
          world.step(1.0F / float(rate));
          most = std::max(most, motionOf(world, {body}).energy / start);
        }
        const Motion end = motionOf(world, {body});
        const Vector3d v = end.momentum / end.mass;
        const std::string what =
            std::to_string(hz) + " Hz, " + std::to_string(rate) + " steps/s, " + std::to_string(speed) + " m/s";
        EXPECT_LT(most, 1.15) << what;
        EXPECT_GT(v[0], 0.65 * speed) << what;
        EXPECT_LT(std::abs(v[2]), 0.1 * speed) << what;
      }
    }
  }
}

// 5/7 g sin a. As a polyhedron of contact points it lies still on less than about two degrees.
TEST(Rolling, GoesDown) {
  for (const int hz : {40, 120}) {
    const auto asset = ballOf(hz);
    for (const int rate : {60, 120}) {
      for (const double slope : {5.0, 10.0}) {
        const double angle = slope * std::numbers::pi / 180;
        WorldSettings settings = withoutDamping();
        settings.ground.normal = {float(std::sin(angle)), float(std::cos(angle)), 0};
        World world(settings);
        BodySettings at;
        at.position = {float(kRadius * std::sin(angle)), float(kRadius * std::cos(angle)), 0};
        const BodyId body = *world.addBody(asset, at);
        for (int i = 0; i < 2 * rate; ++i) world.step(1.0F / float(rate));
        const Motion end = motionOf(world, {body});
        const double wanted = 2 * 9.81 * std::sin(angle) * 5 / 7;
        EXPECT_NEAR((end.momentum / end.mass).norm(), wanted, 0.1 * wanted) << hz << ' ' << rate << ' ' << slope;
      }
    }
  }
}

// Places of narrow colliders' own points change within the ball from step to step, and with them its first matrix.
TEST(Rolling, GoesOnOverTipsFromASavedState) {
  const auto asset = ballOf(12);
  const auto setOut = [&](World& world) {
    for (const float x : {-0.03F, 0.02F}) {
      for (const float z : {-0.025F, 0.03F}) {
        ColliderSettings tip;
        tip.at.position = {x, -0.1F, z};
        EXPECT_TRUE(world.addCollider(CapsuleShape{0.003F, 0.1F}, tip));
      }
    }
    BodySettings at;
    at.position = {0, 0.12F, 0};
    return *world.addBody(asset, at);
  };
  World world;
  const BodyId body = setOut(world);
  for (int saved = 0; saved < 30; ++saved) {
    for (int i = 0; i < 5; ++i) world.step(1.0F / 60);
    std::vector<std::byte> bytes(world.stateBytes(body));
    ASSERT_EQ(world.saveState(body, bytes), bytes.size());
    World other;
    const BodyId same = setOut(other);
    ASSERT_TRUE(other.restoreState(same, bytes));
    for (int i = 0; i < 5; ++i) {
      world.step(1.0F / 60);
      other.step(1.0F / 60);
    }
    const auto x = world.positions(body), y = other.positions(same);
    EXPECT_TRUE(std::equal(x.begin(), x.end(), y.begin(), y.end())) << saved;
  }
}

}  // namespace
}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// A baked body whose surface touches itself (BodySettings::self_contact): two arms, one above the other, joined at one
// end.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <vector>

#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"
#include "tests/bake/baked_obj.h"
#include "tests/support/motion.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using test::inSpace;
using test::Motion;
using test::motionOf;

constexpr double kCell = 0.05, kArm = 0.15, kGap = 0.1, kDiagonal = 1.27;

/// The surface of cells 0..23, 0..7, 0..2 without a slot between arms of three.
void writeTongs(std::ofstream& obj) {
  const auto is_there = [](std::array<int, 3> c) {
    return c[0] >= 0 && c[0] < 24 && c[1] >= 0 && c[1] < 8 && c[2] >= 0 && c[2] < 3 &&
           (c[0] < 4 || (c[1] != 3 && c[1] != 4));
  };
  std::map<std::array<int, 3>, int> number;
  std::vector<std::array<int, 4>> faces;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [place, added] = number.try_emplace(at, int(number.size()) + 1);
    if (added) obj << "v " << kCell * at[0] << ' ' << kCell * (at[1] - 4) << ' ' << kCell * at[2] << '\n';
    return place->second;
  };
  for (int x = 0; x < 24; ++x) {
    for (int y = 0; y < 8; ++y) {
      for (int z = 0; z < 3; ++z) {
        if (!is_there({x, y, z})) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          for (const int side : {0, 1}) {
            std::array<int, 3> beyond = {x, y, z};
            beyond[axis] += side == 1 ? 1 : -1;
            if (is_there(beyond)) continue;
            const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
            std::array<int, 4> face;
            for (std::size_t k = 0; k < 4; ++k) {
              std::array<int, 3> corner = {x, y, z};
              corner[axis] += side;
              corner[side == 1 ? u : v] += k == 1 || k == 2 ? 1 : 0;
              corner[side == 1 ? v : u] += k >= 2 ? 1 : 0;
              face[k] = vertex(corner);
            }
            faces.push_back(face);
          }
        }
      }
    }
  }
  for (const auto& f : faces) obj << "f " << f[0] << ' ' << f[1] << ' ' << f[2] << ' ' << f[3] << '\n';
}

WorldSettings onGround() {
  WorldSettings settings;
  settings.collisions = true;
  settings.ground.enabled = true;
  settings.sleep_seconds = 0.5F;
  return settings;
}

class SelfContact : public ::testing::Test {
 protected:
  /// Too soft to hold its upper arm.
  static BodyId addSagging(World& world, float x, float y) {
    BodySettings soft;
    soft.self_contact = true;
    soft.stiffness_scale = 0.15F;
    soft.position = {x, y + float(asset_->package().info().origin[1]), 0};
    return *world.addBody(asset_, soft);
  }
  static void SetUpTestSuite() { asset_ = bakedObj("tongs", writeTongs); }
  static void TearDownTestSuite() { asset_.reset(); }

  /// Least height of the upper arm's lower side over the lower arm's upper one, at what is one above the other at rest.
  static double gapOf(const World& world, BodyId body) {
    const auto rest = asset_->package().visualPositions();
    std::vector<Vec3> now(rest.size());
    world.visualVertices(body, {now[0].data(), 12, std::uint32_t(now.size())}, {});
    const double origin = double(asset_->package().info().origin[1]);
    double least = 1e30;
    for (std::size_t i = 0; i < rest.size(); ++i) {
      if (std::abs(double(rest[i][1]) + origin - 0.5 * kGap) > 1e-5) continue;
      for (std::size_t j = 0; j < rest.size(); ++j) {
        if (std::abs(double(rest[j][1]) + origin + 0.5 * kGap) > 1e-5 ||
            std::hypot(rest[i][0] - rest[j][0], rest[i][2] - rest[j][2]) > 1e-5F) {
          continue;
        }
        least = std::min(least, double(now[i][1]) - double(now[j][1]));
      }
    }
    return least;
  }

  /// Arms turn toward each other about the joint, at so many rad/s.
  static void close(World& world, BodyId body, float speed) {
    const auto x = world.positions(body);
    const std::vector<Vec3> at(x.begin(), x.end());
    std::vector<Vec3> moving(at.size());
    const auto& origin = asset_->package().info().origin;
    const float joint = 0.2F - float(origin[0]);
    for (std::size_t i = 0; i < at.size(); ++i) {
      const float lever = std::max(0.0F, at[i][0] - joint);
      const bool upper = double(at[i][1]) + origin[1] > 0;
      moving[i] = {0, (upper ? -speed : speed) * lever, 0};
    }
    world.setState(body, at, moving);
  }

  static std::shared_ptr<const Asset> asset_;
};
std::shared_ptr<const Asset> SelfContact::asset_;

TEST_F(SelfContact, ArmsMeetAndPart) {
  for (const double rate : {30.0, 60.0, 240.0}) {
    for (const bool alternating : {false, true}) {
      double least[2] = {1, 1};
      for (const bool on : {false, true}) {
        World world(inSpace());
        BodySettings settings;
        settings.self_contact = on;
        settings.stiffness_scale = 0.5F;
        const BodyId body = *world.addBody(asset_, settings);
        close(world, body, 8);
        const Motion start = motionOf(world, {body});
        double most = start.energy;
        for (int i = 0; i < int(rate); ++i) {
          world.step(float((alternating ? (i % 2 == 0 ? 1.6 : 0.4) : 1) / rate));
          least[on ? 1 : 0] = std::min(least[on ? 1 : 0], gapOf(world, body));
          if (!on) continue;
          const Motion now = motionOf(world, {body});
          EXPECT_LT((now.momentum - start.momentum).norm(), 1e-3 * std::sqrt(start.energy)) << rate << ", " << i;
          EXPECT_LT((now.spin - start.spin).norm(), 1e-3 * std::sqrt(start.energy)) << rate << ", " << i;
          EXPECT_LE(now.energy, most + 1e-4 * start.energy) << rate << ", " << i;
          most = std::min(most, now.energy);
        }
      }
      EXPECT_GT(least[1], -0.02 * kDiagonal) << rate << ", " << alternating;
      EXPECT_LT(least[0], least[1] - 0.03) << rate << ", " << alternating;  // without it they pass through each other
    }
  }
}

TEST_F(SelfContact, WhatDoesNotTouchMovesAsWithoutIt) {
  std::vector<Vec3> places[2];
  for (const bool on : {false, true}) {
    World world(inSpace());
    BodySettings settings;
    settings.self_contact = on;
    const BodyId body = *world.addBody(asset_, settings);
    close(world, body, -0.5F);
    world.setVelocity(body, {1, 2, 3}, {0.5F, 0, 1});
    for (int i = 0; i < 120; ++i) world.step(1.0F / 60);
    const auto x = world.positions(body);
    places[on ? 1 : 0].assign(x.begin(), x.end());
  }
  EXPECT_EQ(places[0], places[1]);
}

// It lies on its lower arm; the upper one is too heavy for its stiffness, and comes down on it.
TEST_F(SelfContact, WhatSagsOnItselfSleeps) {
  for (const double rate : {60.0, 240.0}) {
    for (const double far : {0.0, 4000.0}) {
      for (const bool hitches : {false, true}) {
        if (hitches && rate > 60) continue;  // below
        World world(onGround());
        const BodyId body = addSagging(world, float(far), 0.2F);
        for (int i = 0; i < int(10 * rate); ++i) {
          world.step(hitches && i < int(2 * rate) && i % 20 == 19 ? 0.5F : float(1 / rate));
        }
        EXPECT_TRUE(world.isAsleep(body)) << rate << ", " << far << ", " << hitches;
        EXPECT_LT(gapOf(world, body), 0.02 * kArm) << rate << ", " << far << ", " << hitches;
        EXPECT_GT(gapOf(world, body), -0.01 * kDiagonal) << rate << ", " << far << ", " << hitches;
      }
    }
  }
}

// A part that goes farther in a step than it is thick may pass into another, and stays: in few of many starts.
TEST_F(SelfContact, HitchesRarelyPressItIntoItself) {
  int pressed_in = 0;
  for (int start = 0; start < 16; ++start) {
    World world(onGround());
    const BodyId body = addSagging(world, 0, 0.2F + 0.001F * float(start));
    for (int i = 0; i < 2400; ++i) world.step(i < 480 && i % 20 == 19 ? 0.5F : 1.0F / 240);
    EXPECT_TRUE(world.isAsleep(body)) << start;
    EXPECT_LT(gapOf(world, body), 0.02 * kArm) << start;
    pressed_in += gapOf(world, body) > -0.01 * kDiagonal ? 0 : 1;
  }
  EXPECT_LE(pressed_in, 4);
}

// A snapshot taken while arms touch goes on as before, and so do a hundred bodies with any number of threads.
TEST_F(SelfContact, SnapshotsAndThreadsChangeNothing) {
  ThreadPool threads(3);
  std::vector<Vec3> places[2];
  for (const bool threaded : {false, true}) {
    WorldResources resources;
    if (threaded) resources.jobs = &threads;
    World world(inSpace(), resources);
    std::vector<BodyId> bodies;
    for (int i = 0; i < 100; ++i) {
      BodySettings settings;
      settings.self_contact = true;
      settings.stiffness_scale = 0.5F;
      bodies.push_back(*world.addBody(asset_, settings));
      close(world, bodies.back(), 4 + 0.06F * float(i));
      world.teleport(bodies.back(), {1, 0, 0, 0, 1, 0, 0, 0, 1}, {3.0F * float(i), 0, 0});
    }
    for (int i = 0; i < 6; ++i) world.step(1.0F / 60);
    std::vector<std::byte> snapshot(world.snapshotBytes());
    ASSERT_TRUE(world.saveSnapshot(snapshot));
    std::vector<Vec3> first, again;
    for (std::vector<Vec3>* to : {&first, &again}) {
      ASSERT_TRUE(world.restoreSnapshot(snapshot));
      for (int i = 0; i < 20; ++i) world.step(1.0F / 60);
      for (const BodyId body : bodies)
        to->insert(to->end(), world.positions(body).begin(), world.positions(body).end());
    }
    EXPECT_EQ(first, again);
    places[threaded ? 1 : 0] = first;
  }
  EXPECT_EQ(places[0], places[1]);
}

}  // namespace
}  // namespace sinew::tools

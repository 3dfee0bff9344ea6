// SPDX-License-Identifier: MIT
//
// Bodies that touch each other, and what rests.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "runtime/contact/touch.h"
#include "runtime/load/rest_constants.h"
#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"
#include "tests/support/box_package.h"
#include "tests/support/motion.h"
#include "tests/support/touching_box.h"

namespace sinew::test {
namespace {

using Eigen::Vector3d;

constexpr float kStep = 1.0F / 60;

/// Settings of bodies that lie on the ground.
WorldSettings onGround() {
  WorldSettings settings;
  settings.collisions = true;
  settings.ground.enabled = true;
  return settings;
}

/// Cubes of 1 m in line on the ground.
std::vector<BodyId> addColumn(World& world, const std::shared_ptr<const Asset>& asset, int count, float apart,
                              float stiffness_scale) {
  std::vector<BodyId> bodies;
  for (int i = 0; i < count; ++i) {
    BodySettings at;
    at.position = {0, 0.5F + apart * float(i), 0};
    at.stiffness_scale = stiffness_scale;
    bodies.push_back(*world.addBody(asset, at));
  }
  return bodies;
}

BodyId addMoving(World& world, const std::shared_ptr<const Asset>& asset, const Vec3& position, const Vec3& velocity) {
  BodySettings settings;
  settings.position = position;
  const BodyId body = *world.addBody(asset, settings);
  const auto x = world.positions(body);
  const std::vector<Vec3> at(x.begin(), x.end()), moving(x.size(), velocity);
  world.setState(body, at, moving);
  return body;
}

TEST(Touch, KeepsMomentumAndGainsNoEnergy) {
  const auto asset = touchingBox({1, 1, 1});
  World world(inSpace());
  const std::vector<BodyId> bodies = {addMoving(world, asset, {-0.9F, 0.2F, 0}, {2, 0, 0}),
                                      addMoving(world, asset, {0.9F, 0, 0.1F}, {-1, 0, 0})};
  const Motion before = motionOf(world, bodies);
  double most = before.energy;
  for (int i = 0; i < 120; ++i) {
    world.step(kStep);
    const Motion now = motionOf(world, bodies);
    EXPECT_LT((now.momentum - before.momentum).norm(), 1e-5 * before.momentum.norm()) << i;
    EXPECT_LT((now.spin - before.spin).norm(), 1e-4 * before.spin.norm()) << i;
    EXPECT_LE(now.energy, most * (1 + 1e-5)) << i;
    most = std::min(most, now.energy);
  }
  // They have met and part.
  const Motion first = motionOf(world, {bodies[0]}), second = motionOf(world, {bodies[1]});
  EXPECT_LT(first.center[0], second.center[0]);
  EXPECT_LE(first.momentum[0] / first.mass, second.momentum[0] / second.mass + 1e-3);
  EXPECT_LT(first.momentum[0] / first.mass, 1.5);
}

TEST(Touch, TellsWhichBodiesBeganAndCeased) {
  const auto asset = touchingBox({1, 1, 1});
  World world(inSpace());
  const BodyId one = addMoving(world, asset, {-0.9F, 0.2F, 0}, {2, 0, 0}),
               other = addMoving(world, asset, {0.9F, 0, 0.1F}, {-1, 0, 0});
  std::vector<ContactEvent> events;
  std::vector<std::byte> snapshot;
  for (int i = 0; i < 120; ++i) {
    world.step(kStep);
    const auto now = world.contactEvents();
    if (!now.empty() && events.empty()) {
      snapshot.resize(world.snapshotBytes());
      ASSERT_TRUE(world.saveSnapshot(snapshot));
    }
    events.insert(events.end(), now.begin(), now.end());
  }
  ASSERT_EQ(events.size(), 2U);
  for (const ContactEvent& event : events) {
    EXPECT_EQ(event.body, one.value);
    EXPECT_EQ(event.other, other.value);
    EXPECT_TRUE(event.collider == ColliderId{});
    EXPECT_EQ(event.began, &event == &events[0]);
  }
  // What a snapshot has touching does not begin again, and ends.
  ASSERT_TRUE(world.restoreSnapshot(snapshot));
  int began = 0, ended = 0;
  for (int i = 0; i < 120; ++i) {
    world.step(kStep);
    for (const ContactEvent& event : world.contactEvents()) ++(event.began ? began : ended);
  }
  EXPECT_EQ(began, 0);
  EXPECT_EQ(ended, 1);
}

TEST(Touch, TellsWhereHowHardAndHowFast) {
  const auto asset = touchingBox({1, 1, 1});
  WorldSettings settings = inSpace();
  settings.damping = 0;
  settings.report_contacts = true;
  World world(settings);
  const BodyId one = addMoving(world, asset, {-0.9F, 0.2F, 0}, {2, 0, 0}),
               other = addMoving(world, asset, {0.9F, 0, 0.1F}, {-1, 0, 0});
  const double mass = double(world.motion(one).mass);
  const auto momentumOf = [&](BodyId body) -> Eigen::Vector3d {
    return mass * internal::asVector(world.motion(body).velocity).cast<double>();
  };
  float fastest = 0;
  int steps = 0;
  Eigen::Vector3d all = Eigen::Vector3d::Zero();
  for (int i = 0; i < 120; ++i) {
    const Eigen::Vector3d before = momentumOf(one), before_other = momentumOf(other);
    world.step(kStep);
    Eigen::Vector3d impulse = Eigen::Vector3d::Zero();
    EXPECT_LE(world.contacts().size(), 1U);
    for (const BodyContact& contact : world.contacts()) {
      EXPECT_EQ(contact.body, one.value);
      EXPECT_EQ(contact.other, other.value);
      EXPECT_TRUE(contact.collider == ColliderId{});
      EXPECT_LT(contact.normal[0], -0.9F);
      const float left = world.motion(one).center[0], right = world.motion(other).center[0];
      EXPECT_GT(contact.point[0], left + 0.3F);
      EXPECT_LT(contact.point[0], right - 0.3F);
      EXPECT_NEAR(contact.point[1], 0.1F, 0.3F);
      if (steps++ == 0) fastest = contact.speed;
      EXPECT_LE(contact.speed, fastest);
      impulse = internal::asVector(contact.impulse).cast<double>();
    }
    // Minimizing stops before forces are inertia's to the last digit.
    EXPECT_LT((momentumOf(one) - before - impulse).norm(), 0.01 * mass * 1.5) << i;
    EXPECT_LT((momentumOf(other) - before_other + impulse).norm(), 0.01 * mass * 1.5) << i;
    all += impulse;
  }
  EXPECT_GT(steps, 2);
  EXPECT_NEAR(fastest, 3, 0.1);
  EXPECT_LT(all[0], -mass);
  EXPECT_NEAR(all[0], momentumOf(one)[0] - 2 * mass, 0.01 * mass);
}

TEST(Touch, TellsOfWhatRestsAndSleeps) {
  const auto asset = touchingBox({1, 1, 1});
  WorldSettings settings;
  settings.collisions = true;
  settings.ground.enabled = true;
  settings.sleep_seconds = 0.5F;
  settings.substep_seconds = 1.0F / 240;
  World world(settings);
  std::vector<BodyId> bodies;
  for (int i = 0; i < 2; ++i) {
    BodySettings box;
    box.position = {0.03F * float(i), 0.7F + 1.2F * float(i), 0};
    box.stiffness_scale = 5;
    bodies.push_back(*world.addBody(asset, box));
  }
  world.advance(kStep);
  EXPECT_TRUE(world.contacts().empty());
  world.settings().report_contacts = true;
  const float weight = 9.81F * world.motion(bodies[0]).mass;
  float landing = 0;
  for (int i = 0; i < 600; ++i) {
    world.advance(kStep);
    for (const BodyContact& contact : world.contacts()) {
      if (contact.collider == kGroundCollider) landing = std::max(landing, contact.speed);
    }
    if (i < 300 && !world.isAsleep(bodies[0])) continue;
    // The lower box stands on the ground and carries the upper one: a frame's time of their weights.
    ASSERT_EQ(world.contacts().size(), 2U) << i;
    const BodyContact &ground = world.contacts()[0], &pair = world.contacts()[1];
    EXPECT_TRUE(ground.collider == kGroundCollider);
    EXPECT_EQ(ground.other, formats::kNone);
    EXPECT_NEAR(ground.impulse[1], 2 * weight * kStep, 0.02F * weight * kStep) << i;
    EXPECT_NEAR(ground.normal[1], 1, 1e-3);
    EXPECT_NEAR(ground.point[1], 0, 0.02);
    EXPECT_EQ(pair.other, bodies[1].value);
    EXPECT_NEAR(pair.impulse[1], -weight * kStep, 0.02F * weight * kStep) << i;
    EXPECT_NEAR(pair.normal[1], -1, 0.02);
    EXPECT_NEAR(pair.point[1], 1, 0.05);
    EXPECT_LT(std::max(ground.speed, pair.speed), 0.01F) << i;
  }
  EXPECT_TRUE(world.isAsleep(bodies[0]));
  EXPECT_NEAR(landing, std::sqrt(2 * 9.81F * 0.2F), 0.15);
}

TEST(Touch, WhatRestsTellsNothing) {
  const auto asset = touchingBox({1, 1, 1});
  WorldSettings settings;
  settings.collisions = true;
  settings.ground.enabled = true;
  World world(settings);
  for (int i = 0; i < 3; ++i) {
    BodySettings box;
    box.position = {0.03F * float(i), 0.5F + 1.001F * float(i), 0};
    box.stiffness_scale = 5;
    ASSERT_TRUE(world.addBody(asset, box));
  }
  std::size_t told = 0, late = 0;
  for (int i = 0; i < 900; ++i) {
    world.step(i % 2 == 0 ? kStep : kStep / 4);
    (i < 600 ? told : late) += world.contactEvents().size();
  }
  EXPECT_GE(told, 3U);  // of the lowest with the ground, and of two pairs
  EXPECT_EQ(late, 0U);
}

TEST(Touch, LeavesWhatIsFarAsItIs) {
  const auto asset = touchingBox({1, 1, 1});
  for (const bool collisions : {false, true}) {
    WorldSettings settings = inSpace();
    settings.collisions = collisions;
    World pair(settings), alone(settings);
    const BodyId one = addMoving(pair, asset, {0, 0, 0}, {0.5F, 0, 0}),
                 same = addMoving(alone, asset, {0, 0, 0}, {0.5F, 0, 0});
    addMoving(pair, asset, {0, 3, 0}, {0, 1, 0});
    for (int i = 0; i < 30; ++i) {
      pair.step(kStep);
      alone.step(kStep);
    }
    const auto x = pair.positions(one), y = alone.positions(same);
    EXPECT_TRUE(std::equal(x.begin(), x.end(), y.begin(), y.end())) << collisions;
  }
}

TEST(Touch, StacksComeToRest) {
  const auto asset = touchingBox({1, 0.6, 1});
  WorldSettings settings;
  settings.collisions = true;
  settings.ground.enabled = true;
  World world(settings);
  std::vector<BodyId> bodies;
  for (int i = 0; i < 4; ++i) {
    BodySettings at;
    at.position = {i % 2 == 0 ? 0.05F : -0.05F, 0.3F + 0.61F * float(i), 0.02F * float(i)};
    at.stiffness_scale = 8;
    bodies.push_back(*world.addBody(asset, at));
  }
  // Steps as games have them, a hitch among them.
  for (int i = 0; i < 420; ++i) world.step(i == 100 ? 0.5F : i % 3 == 0 ? 0.02F : kStep);
  const Motion at_rest = motionOf(world, bodies);
  EXPECT_LT(at_rest.speed, 1e-3);
  EXPECT_GT(at_rest.high, 0.98 * 4 * 0.6);
  for (int i = 1; i < 4; ++i) {
    const double lower = motionOf(world, {bodies[std::size_t(i) - 1]}).center[1];
    EXPECT_NEAR(motionOf(world, {bodies[std::size_t(i)]}).center[1] - lower, 0.6, 0.02) << i;
  }
}

TEST(Touch, RestsOnWhatIsPausedAndFallsThroughWhatIsDisabled) {
  const auto asset = touchingBox({1, 0.6, 1});
  WorldSettings settings;
  settings.collisions = true;
  settings.sleep_seconds = 0.5F;
  World world(settings);
  BodySettings at;
  at.stiffness_scale = 8;
  const BodyId rock = *world.addBody(asset, at);
  world.setActivity(rock, Activity::paused);
  const std::vector<Vec3> there(world.positions(rock).begin(), world.positions(rock).end());
  at.position = {0.1F, 0.7F, 0};
  const BodyId body = *world.addBody(asset, at);
  for (int i = 0; i < 1200 && !world.isAsleep(body); ++i) world.step(i % 3 == 0 ? 0.02F : kStep);
  EXPECT_TRUE(world.isAsleep(body));
  EXPECT_NEAR(motionOf(world, {body}).center[1], 0.6, 0.02);
  EXPECT_TRUE(std::ranges::equal(there, world.positions(rock)));
  world.setActivity(rock, Activity::disabled);
  for (int i = 0; i < 60; ++i) world.step(kStep);
  EXPECT_LT(motionOf(world, {body}).center[1], -1);
  EXPECT_TRUE(std::ranges::equal(there, world.positions(rock)));
}

// The origin moves, and nothing against anything else: sleepers sleep on, and wake where they should.
TEST(Touch, SleepersSleepThroughAShiftOfTheOrigin) {
  const auto asset = touchingBox({1, 0.6, 1});
  WorldSettings settings;
  settings.collisions = settings.ground.enabled = true;
  settings.sleep_seconds = 0.5F;
  World world(settings);
  ColliderSettings shelf;
  shelf.at.position = {5, 0.5F, 0};
  ASSERT_TRUE(world.addCollider(BoxShape{{1, 0.5F, 1}}, shelf));
  std::vector<BodyId> bodies;
  for (const Vec3& place : {Vec3{0, 0.3F, 0}, Vec3{0, 0.92F, 0}, Vec3{5, 1.3F, 0}}) {
    BodySettings at;
    at.position = place;
    at.stiffness_scale = 8;
    bodies.push_back(*world.addBody(asset, at));
  }
  const auto asleep = [&] {
    return std::count_if(bodies.begin(), bodies.end(), [&](BodyId body) { return world.isAsleep(body); });
  };
  for (int i = 0; i < 1200 && asleep() < 3; ++i) world.step(kStep);
  ASSERT_EQ(asleep(), 3);
  const double high = motionOf(world, {bodies[1]}).center[1];
  for (const Vec3& by : {Vec3{100, -20, 3}, Vec3{-40, 30.5F, 0}}) {
    world.shiftOrigin(by);
    for (int i = 0; i < 5; ++i) {  // less than it takes to fall asleep again
      world.step(kStep);
      EXPECT_EQ(asleep(), 3) << i;
    }
  }
  EXPECT_NEAR(motionOf(world, {bodies[1]}).center[1], high - 10.5, 1e-4);
  BodySettings at;
  at.position = {-60, 0.92F - 10.5F + 0.8F, -3};
  ASSERT_TRUE(world.addBody(asset, at));
  for (int i = 0; i < 60; ++i) world.step(kStep);
  EXPECT_FALSE(world.isAsleep(bodies[0]));
  EXPECT_TRUE(world.isAsleep(bodies[2]));
}

TEST(Touch, ASnapshotGoesOnBitForBit) {
  const auto asset = touchingBox({1, 0.6, 1});
  WorldSettings settings;
  settings.collisions = true;
  settings.ground.enabled = true;
  settings.sleep_seconds = 0.5F;
  World world(settings);
  std::vector<BodyId> bodies;
  for (int i = 0; i < 3; ++i) {
    BodySettings at;
    at.position = {i % 2 == 0 ? 0.05F : -0.05F, 0.3F + 0.61F * float(i), 0.02F * float(i)};
    at.stiffness_scale = 8;
    bodies.push_back(*world.addBody(asset, at));
  }
  for (const int before : {20, 50, 400}) {
    for (int i = 0; i < before; ++i) world.step(kStep);
    std::vector<std::byte> bytes(world.snapshotBytes());
    ASSERT_EQ(world.saveSnapshot(bytes), bytes.size());
    const auto play = [&] {
      std::vector<Vec3> all;
      for (int i = 0; i < 40; ++i) {
        world.step(kStep);
        for (const BodyId body : bodies) {
          all.insert(all.end(), world.positions(body).begin(), world.positions(body).end());
        }
      }
      return all;
    };
    const std::vector<Vec3> expected = play();
    const auto restored = world.restoreSnapshot(bytes);
    ASSERT_TRUE(restored) << restored.reason();
    EXPECT_TRUE(play() == expected) << before;
  }
}

// Sides in line and twice as many points on a face as carry: at edges the nearest way out is another one in each step.
// The column sways: at 4 s by up to 1.3e-3 m/s where each step is solved to its end, and as much in a few iterations.
TEST(Touch, TenInLineRestAtAnyRate) {
  const auto asset = touchingBox({1, 1, 1}, 6);
  for (const auto& [even, odd] : {std::pair{60.0F, 60.0F}, {240.0F, 240.0F}, {60.0F, 240.0F}}) {
    World world(onGround());
    const std::vector<BodyId> bodies = addColumn(world, asset, 10, 1.001F, 30);
    float seconds = 0;
    for (int i = 0; seconds < 5; ++i) {
      const float step = 1 / (i % 2 == 0 ? even : odd);
      world.step(step);
      seconds += step;
    }
    const Motion at_rest = motionOf(world, bodies);
    EXPECT_LT(at_rest.speed, 1e-3) << even << " " << odd;
    EXPECT_GT(at_rest.high, 0.98 * 10) << even << " " << odd;
    EXPECT_LT(std::abs(at_rest.center[0]) + std::abs(at_rest.center[2]), 0.03) << even << " " << odd;
  }
}

TEST(Touch, PartsWhatStartedInside) {
  const auto asset = touchingBox({1, 1, 1});
  World world(inSpace());
  const std::vector<BodyId> bodies = {addMoving(world, asset, {0, 0, 0}, {0, 0, 0}),
                                      addMoving(world, asset, {0.1F, 0.75F, -0.1F}, {0, 0, 0})};
  for (int i = 0; i < 180; ++i) {
    world.step(kStep);
    // A recovery speed of one diagonal per second, of both.
    EXPECT_LT(motionOf(world, bodies).energy, 2 * 0.5 * 1000 * 3) << i;
  }
  EXPECT_GT(motionOf(world, {bodies[1]}).center[1] - motionOf(world, {bodies[0]}).center[1], 0.98);
}

// Turned and placed by chance, half of one in the other and more: they part at the recovery speed, a diagonal a second.
TEST(Touch, NoStartInsideExplodes) {
  const auto asset = touchingBox({1, 1, 1}, 4);
  std::mt19937 random(3);
  const auto draw = [&random](float most) { return most * (2 * float(random()) / 4294967295.0F - 1); };
  for (int start = 0; start < 60; ++start) {
    WorldSettings settings = inSpace();
    World world(settings);
    std::vector<BodyId> bodies;
    for (int b = 0; b < 2; ++b) {
      BodySettings at;
      if (b == 1) at.position = {draw(0.8F), draw(0.8F), draw(0.8F)};
      at.stiffness_scale = start % 2 == 0 ? 1.0F : 10.0F;
      const Eigen::Quaternionf turn(Eigen::Vector4f(draw(1), draw(1), draw(1), draw(1)).normalized());
      Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(at.rotation.data()) = turn.toRotationMatrix();
      bodies.push_back(*world.addBody(asset, at));
    }
    const float step = start % 3 == 0 ? 1.0F / 240 : kStep;
    double most = 0;
    for (float seconds = 0; seconds < 2; seconds += step) {
      world.step(step);
      const Motion now = motionOf(world, bodies);
      most = std::max(most, now.energy / now.mass);
    }
    EXPECT_LT(most, 1) << start;  // J/kg: of 0.8 diagonals a second
  }
}

// Pushed by 0.2 of its weight beyond what friction holds. Held across by first matrices it does not move; a coarse
// level that is made once a step leaves a quarter undone.
TEST(Touch, WhatIsFlatSlidesOnABody) {
  const auto base = touchingBox({2, 0.3, 1}, 4), plate = touchingBox({0.6, 0.06, 0.6}, 4);
  for (const float mu : {0.0F, 0.3F}) {
    for (const float step : {1.0F / 75, 1.0F / 90, 1.0F / 120, 1.0F / 240}) {  // in longer ones 0.58 to 0.88 m/s
      World world(onGround());
      BodySettings at;
      at.stiffness_scale = 20;
      at.friction = 1;
      at.position = {0, 0.15F, 0};
      ASSERT_TRUE(world.addBody(base, at));
      at.friction = mu * mu;  // the geometric mean counts
      at.position = {-0.5F, 0.332F, 0};
      const BodyId body = *world.addBody(plate, at);
      for (float seconds = 0; seconds < 2; seconds += step) world.step(step);
      const double mass = double(world.motion(body).mass), force = (double(mu) + 0.2) * 9.81 * mass;
      for (float seconds = 0; seconds < 0.5F - 0.5F * step; seconds += step) {
        world.addForce(body, Vec3{float(force), 0, 0});
        world.step(step);
      }
      EXPECT_NEAR(double(world.motion(body).velocity[0]), 0.5 * 0.2 * 9.81, 0.3) << mu << ' ' << step;
    }
  }
}

// However deep, and with friction: on one way for all points.
TEST(Touch, PartsWhateverStartedInside) {
  const std::array assets = {touchingBox({1, 1, 1}, 4), touchingBox({2, 0.4, 0.4}, 4), touchingBox({1.2, 0.2, 1.2}, 4)};
  std::mt19937 random(5);
  const auto draw = [&random](float most) { return most * (2 * float(random()) / 4294967295.0F - 1); };
  int parted = 0;
  constexpr int kStarts = 60;
  for (int start = 0; start < kStarts; ++start) {
    World world(inSpace());
    std::array<BodyId, 2> bodies;
    for (std::size_t b = 0; b < 2; ++b) {
      BodySettings at;
      if (b == 1) at.position = {draw(0.3F), draw(0.3F), draw(0.3F)};
      const Eigen::Quaternionf turn(Eigen::Vector4f(draw(1), draw(1), draw(1), draw(1)).normalized());
      Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(at.rotation.data()) = turn.toRotationMatrix();
      bodies[b] = *world.addBody(assets[random() % assets.size()], at);
    }
    for (int i = 0; i < 480; ++i) world.step(kStep);
    // A corner of the one in the other: what lies there at rest.
    double deepest = 0;
    for (std::size_t b = 0; b < 2; ++b) {
      const auto x = world.positions(bodies[b]), y = world.positions(bodies[1 - b]);
      const auto rest = world.asset(bodies[1 - b]).package().physicalVertices();
      Eigen::Vector3f low = Eigen::Vector3f::Constant(1e9F), high = -low;
      for (const auto& vertex : rest) {
        const Eigen::Vector3f at(vertex.rest_position.data());
        low = low.cwiseMin(at), high = high.cwiseMax(at);
      }
      Mat3 rotation;
      Vec3 translation;
      world.rigidMotion(bodies[1 - b], rotation, translation);
      const Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>> turn(rotation.data());
      for (const Vec3& corner : x) {
        const Eigen::Vector3f at =
            turn.transpose() * (Eigen::Vector3f(corner.data()) - Eigen::Vector3f(translation.data()));
        deepest = std::max(deepest, double(std::min((at - low).minCoeff(), (high - at).minCoeff())));
      }
    }
    parted += deepest < 0.02 ? 1 : 0;
  }
  EXPECT_GE(parted, kStarts - 1);
}

// What rests at an edge swings by a hair from step to step: a normal that jumps there is energy for the next step.
TEST(Touch, WaysOutDoNotJump) {
  const auto asset = touchingBox({1, 1, 1});
  const internal::DepthMap map(asset->package(), asset->package().distanceGrids()[0]);
  // Past an edge, across many cells; a way out turns by a right angle within a few cells of 1/16 m.
  constexpr float kApart = 1e-4F;
  Eigen::Vector3f before = map.outward({0.1F, 0.3F, 0.55F});
  EXPECT_GT(before.z(), 0.99F);
  for (int i = 1; i <= 2500; ++i) {
    const float along = float(i) * kApart;
    const Eigen::Vector3f now = map.outward({0.1F + 0.3F * along, 0.3F + along, 0.55F - along});
    EXPECT_NEAR(now.norm(), 1, 1e-5F);
    EXPECT_LT((now - before).norm(), 0.01F) << along;
    before = now;
  }
  EXPECT_GT(before.y(), 0.99F);
}

/// A piece of a box asset whose rest places lie where `bend` has them, as a search for touches sees it.
struct SeenPiece {
  SeenPiece(const std::shared_ptr<const Asset>& of, std::uint32_t body,
            const std::function<Vector3d(const Vector3d&)>& bend)
      : asset(of) {
    const internal::Field& field = asset->constants().fields[0];
    coefficients.assign(4 * std::size_t(field.k), 0);
    points.resize(internal::pointFloats(field));
    // The functions are orthonormal under the masses.
    const auto vertices = asset->package().physicalVertices();
    for (std::uint32_t j = 0; j < field.k; ++j) {
      for (std::uint32_t i = 0; i < field.vertex_count; ++i) {
        const auto& rest = vertices[i].rest_position;
        const Vector3d at = bend(Vector3d(double(rest[0]), double(rest[1]), double(rest[2])));
        for (std::uint32_t c = 0; c < 3; ++c) {
          coefficients[4 * j + c] += vertices[i].mass * field.valueAt(i, j) * float(at[int(c)]);
        }
      }
    }
    seen.body = body;
    seen.field = &field;
    seen.map = asset->constants().depthsOf(0);
    seen.base = seen.before = coefficients.data();
    seen.mass = field.mass;
    seen.weight = 9.81 * field.mass;
    seen.diagonal = double(asset->package().info().diagonal);
    seen.points = points;
    internal::placePoints(seen);
  }
  Vector3d placeOf(const float* row) const {
    return internal::sumOfRows(row, coefficients.data(), seen.field->k).matrix().head<3>().cast<double>();
  }
  std::shared_ptr<const Asset> asset;
  std::vector<float> coefficients, points;
  internal::TouchingPiece seen;
};

/// The touches of a's points with b.
struct SeenTouches {
  explicit SeenTouches(const SeenPiece& a, const SeenPiece& b, const std::vector<internal::TouchMemory>& known = {})
      : list(std::pmr::get_default_resource()) {
    internal::TouchingPiece one = a.seen, other = b.seen;
    one.known = internal::touchesOf(known, one.body, one.piece);
    other.known = internal::touchesOf(known, other.body, other.piece);
    internal::findTouches(one, other, 0, 1, double(kStep), list);
  }
  const internal::FoundTouch* of(std::uint32_t point) const {
    const auto is = [point](const internal::FoundTouch& touch) { return touch.memory.point == point; };
    const auto* const found = std::find_if(list.touches.begin(), list.touches.end(), is);
    return found == list.touches.end() ? nullptr : found;
  }
  internal::TouchList list;
};

/// The contact point nearest to a place at rest.
std::uint32_t pointAt(const Asset& asset, const Eigen::Vector3f& place) {
  const auto points = asset.constants().fields[0].points;
  const auto way = [&](const formats::FieldPoint& p) { return (Eigen::Vector3f(p.at.data()) - place).norm(); };
  return std::uint32_t(
      std::min_element(points.begin(), points.end(), [&](const auto& p, const auto& q) { return way(p) < way(q); }) -
      points.begin());
}

// A corner that pushes is not let go where its way out, beside a side that is near, is a long one.
TEST(Touch, ACornerStaysUnderWhatItPushes) {
  const auto asset = touchingBox({1, 1, 1});
  const SeenPiece upper(asset, 2, [](const Vector3d& x) { return x; });
  const std::uint32_t corner = pointAt(*asset, {-0.5F, 0.5F, -0.5F});
  for (const float deep : {0.005F, 0.01F, 0.02F, 0.04F}) {
    const Vector3d at(-0.476, -0.5 + double(deep), -0.495);
    const SeenPiece lower(asset, 1, [&](const Vector3d& x) { return Vector3d(x + at - Vector3d(-0.5, 0.5, -0.5)); });
    const std::vector<internal::TouchMemory> known = {
        {1, 0, 2, 0, corner, 0, deep, 3e6F, {-0.476F, -0.5F, -0.495F}, {0, -0.954F, -0.3F}, 0}};
    EXPECT_NE(SeenTouches(lower, upper, known).of(corner), nullptr) << deep;
  }
}

// A surface that is round between its contact points reaches beyond the box around them.
TEST(Touch, FindsWhatIsUnderTheSurfaceBetweenContactPoints) {
  BoxOptions options;
  formats::PackageContent content = boxContent(options);
  const std::array<double, 3> round = {1.1, 1.1, 1.1};
  addDistances(content, 0, {0, 0, 0}, round, [&](const auto& at) { return boxDistance(at, {0, 0, 0}, round); });
  const auto large = makeAsset(std::move(content)), box = touchingBox({1, 1, 1});
  EXPECT_NEAR(large->constants().depths[0].bulge(), 0.05 * std::sqrt(3.0), 0.01);  // at its corners
  EXPECT_LT(box->constants().depths[0].bulge(), 1e-3F);
  World world(inSpace());
  BodySettings at;
  const BodyId one = *world.addBody(large, at);
  at.position = {1.03F, 0, 0};
  const BodyId other = *world.addBody(box, at);
  for (int i = 0; i < 60; ++i) world.step(kStep);
  EXPECT_GT(motionOf(world, {other}).center[0] - motionOf(world, {one}).center[0], 1.04);
}

// The ends of a bar that turn by more than a radian against the whole of it: from where that has a point they are not
// found, or others are that lie there as well.
TEST(Touch, GoesOnWhereItWas) {
  const auto bar = touchingBox({4, 1, 1}, 8), box = touchingBox({0.5, 0.5, 0.5});
  const auto bend = [](const Vector3d& x) {
    return Vector3d(x[0] + 0.6 * x[0] * x[1] - 0.1 * x[0] * x[0], x[1] - 0.4 * x[0] * x[0], x[2]);
  };
  const SeenPiece under(bar, 1, bend);
  const std::uint32_t corner = pointAt(*box, {-0.25F, -0.25F, -0.25F});
  for (const float along : {-1.5F, 1.5F}) {
    const Vector3d place = bend(Vector3d(double(along), 0.49, 0.1));
    const SeenPiece over(box, 0, [&](const Vector3d& x) { return Vector3d(x + place + Vector3d(0.25, 0.25, 0.25)); });
    internal::TouchMemory known = {};
    known.body_b = 1;
    known.point = corner;
    known.depth = 0.01F;
    known.anchor = {along, 0.49F, 0.1F};
    known.outward = {0, 1, 0};
    const SeenTouches touches(over, under, {known});
    ASSERT_NE(touches.of(corner), nullptr) << along;
    EXPECT_NEAR(touches.of(corner)->left_at[0], along, 1e-3F) << along;
    EXPECT_NEAR(touches.of(corner)->left_at[1], 0.5F, 1e-3F) << along;
  }
}

// Two that push each other at different places would turn themselves.
TEST(Touch, PushesBothWhereThePointIs) {
  const auto box = touchingBox({1, 1, 1});
  const auto bend = [](const Vector3d& x) { return Vector3d(x[0] + 0.3 * x[1], x[1], x[2] - 0.2 * x[1]); };
  const SeenPiece under(box, 1, bend);
  const std::uint32_t corner = pointAt(*box, {-0.5F, -0.5F, -0.5F});
  for (const float deep : {0.01F, 0.05F, 0.1F}) {
    const Vector3d place = bend(Vector3d(0.1, 0.5 - double(deep), 0.2));
    const SeenPiece over(box, 0, [&](const Vector3d& x) { return Vector3d(x + place + Vector3d(0.5, 0.5, 0.5)); });
    const SeenTouches touches(over, under);
    const internal::FoundTouch* const touch = touches.of(corner);
    ASSERT_NE(touch, nullptr) << deep;
    EXPECT_NEAR(touch->touch.gap + touch->touch.floor, -deep, 1e-3F) << deep;
    EXPECT_LT((under.placeOf(touches.list.rows.data() + touch->row_b) - place).norm(), 5e-4) << deep;
  }
}

// Between nodes of the grid distances near an edge are shorter than the ways out: a known way stays the way all the
// same.
TEST(Touch, AKnownWayStaysNearAnEdge) {
  const auto box = touchingBox({1, 1, 1});
  const auto still = [](const Vector3d& x) { return x; };
  const SeenPiece under(box, 1, still);
  const std::uint32_t corner = pointAt(*box, {-0.5F, -0.5F, -0.5F});
  const Vector3d place(0.1, 0.497, 0.4968);
  const SeenPiece over(box, 0, [&](const Vector3d& x) { return Vector3d(x + place + Vector3d(0.5, 0.5, 0.5)); });
  internal::TouchMemory known = {};
  known.body_b = 1;
  known.point = corner;
  known.depth = 0.01F;
  known.anchor = {0.1F, 0.5F, 0.4968F};
  known.outward = {0, 0.7F, 0.71F};
  const SeenTouches touches(over, under, {known});
  ASSERT_NE(touches.of(corner), nullptr);
  EXPECT_EQ(touches.of(corner)->memory.outward, known.outward);
}

// A light body beside a heavy one is solved as well as alone: a bound of what both have left would let it be.
TEST(Touch, LightBodiesRingBesideHeavyOnes) {
  const auto asset = [](double side, double density) {
    BoxOptions options;
    options.size = {side, side, side};
    options.density = density;
    formats::PackageContent content = boxContent(options);
    addDistances(content, 0, {0, 0, 0}, options.size, [&](const auto& at) {
      return boxDistance(at, {0, 0, 0}, options.size);
    });
    return makeAsset(std::move(content));
  };
  const auto heavy = asset(1, 1e8), light = asset(0.5, 1);
  const auto heights = [&](bool beside) {
    World world(inSpace());
    const auto addStretched = [&](const std::shared_ptr<const Asset>& of, float x, float stretch) {
      BodySettings at;
      at.position = {x, 0, 0};
      const BodyId body = *world.addBody(of, at);
      std::vector<Vec3> places(world.positions(body).begin(), world.positions(body).end());
      const std::vector<Vec3> still(places.size());
      for (Vec3& place : places) place[1] *= stretch;
      world.setState(body, places, still);
      return body;
    };
    const BodyId body = addStretched(light, 0, 1.5F);
    if (beside) addStretched(heavy, 0.751F, 1.001F);
    std::vector<float> result;
    for (int i = 0; i < 25; ++i) {
      world.step(1.0F / 240);
      float highest = 0;
      for (const Vec3& place : world.positions(body)) highest = std::max(highest, place[1]);
      result.push_back(highest);
    }
    return result;
  };
  const std::vector<float> alone = heights(false), together = heights(true);
  for (std::size_t i = 0; i < alone.size(); ++i) EXPECT_NEAR(together[i], alone[i], 5e-3F) << i;
  EXPECT_LT(alone.back(), 0.25F);
}

// What is far from its rest shape has a second derivative that its first matrix does not know: each of many bodies
// finds its own.
TEST(Touch, ManyBentBodiesSettleInAFewIterations) {
  const auto asset = touchingBox({1, 1, 1});
  World world(inSpace()), exact(inSpace());
  exact.settings().iterations = 16;
  std::vector<Vec3> before, after, wanted;
  for (World* const each : {&world, &exact}) {
    std::minstd_rand random(1);
    std::uniform_real_distribution<float> stretch(0.5F, 1.8F);
    std::vector<BodyId> bodies;
    before.clear();
    for (int i = 0; i < 40; ++i) {
      BodySettings at;
      at.position = {0, 1.3F * float(i), 0};
      at.stiffness_scale = i % 2 == 0 ? 1.0F : 20.0F;
      bodies.push_back(*each->addBody(asset, at));
      const auto x = each->positions(bodies.back());
      std::vector<Vec3> places(x.begin(), x.end());
      const std::vector<Vec3> still(places.size());
      const float wide = stretch(random), deep = stretch(random);
      for (Vec3& place : places) {
        place = {wide * place[0], at.position[1] + 1.301F * (place[1] - at.position[1]), deep * place[2]};
      }
      each->setState(bodies.back(), places, still);
      const auto bent = each->positions(bodies.back());
      before.insert(before.end(), bent.begin(), bent.end());
    }
    each->step(kStep);
    std::vector<Vec3>& found = each == &world ? after : wanted;
    for (const BodyId body : bodies) {
      const auto x = each->positions(body);
      found.insert(found.end(), x.begin(), x.end());
    }
  }
  const auto distance = [](const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
    const auto size = Eigen::Index(3 * a.size());
    return (Eigen::Map<const Eigen::VectorXf>(a[0].data(), size) - Eigen::Map<const Eigen::VectorXf>(b[0].data(), size))
        .cast<double>()
        .norm();
  };
  EXPECT_LT(distance(after, wanted), 1e-3 * distance(before, wanted));
}

// Of a column that rocks joints open and close within a step. One step says little: what is left scatters tenfold.
TEST(Touch, ARockingColumnIsSolvedInAFewIterations) {
  const auto asset = touchingBox({1, 1, 1});
  World column(onGround());
  const std::vector<BodyId> bodies = addColumn(column, asset, 8, 0.999F, 10);
  for (int i = 0; i < 180; ++i) column.step(kStep);
  for (const BodyId body : bodies) {
    const auto x = column.positions(body);
    const std::vector<Vec3> places(x.begin(), x.end());
    std::vector<Vec3> rocking;
    for (const Vec3& place : places) rocking.push_back({2 * place[1], -2 * (place[0] + 0.5F), 0});
    column.setState(body, places, rocking);
  }
  const auto placesOf = [&] {
    std::vector<double> all;
    for (const BodyId body : bodies) {
      for (const Vec3& place : column.positions(body)) all.insert(all.end(), place.begin(), place.end());
    }
    return Eigen::VectorXd(Eigen::VectorXd::Map(all.data(), Eigen::Index(all.size())));
  };
  std::vector<double> left;
  for (int step = 0; step < 41; ++step) {
    std::vector<std::byte> bytes(column.snapshotBytes());
    column.saveSnapshot(bytes);
    const Eigen::VectorXd before = placesOf();
    column.settings().iterations = 16;
    column.step(kStep);
    const Eigen::VectorXd exact = placesOf();
    ASSERT_TRUE(column.restoreSnapshot(bytes));
    column.settings().iterations = 4;
    column.step(kStep);
    left.push_back((placesOf() - exact).norm() / (before - exact).norm());
  }
  std::nth_element(left.begin(), left.begin() + 20, left.end());
  EXPECT_LT(left[20], 3e-4);  // 7.5e-4 without the coarse level
}

// What trembles goes nowhere, however fast.
TEST(Touch, WhatTremblesInItsPlaceSleeps) {
  WorldSettings settings;
  settings.collisions = true;
  settings.ground.enabled = true;
  settings.sleep_seconds = 0.5F;
  World world(settings);
  BodySettings at;
  at.position = {0, 0.5F, 0};
  const BodyId body = *world.addBody(touchingBox({1, 1, 1}), at);
  for (int i = 0; i < 600 && !world.isAsleep(body); ++i) world.step(kStep);
  ASSERT_TRUE(world.isAsleep(body));
  const auto x = world.positions(body);
  const std::vector<Vec3> places(x.begin(), x.end());
  std::vector<Vec3> moving(places.size());
  for (std::size_t i = 0; i < moving.size(); ++i) moving[i] = {0.02F * places[i][0], 0, -0.02F * places[i][2]};
  world.setState(body, places, moving);
  for (int i = 0; i < 125; ++i) world.step(kStep / 4);
  EXPECT_TRUE(world.isAsleep(body)) << motionOf(world, {body}).speed;
}

// Friction holds places of the rest shape, and what is pressed flat would take them anywhere.
TEST(Touch, WhatIsPressedFlatDoesNotExplode) {
  const auto asset = touchingBox({1, 1, 1});
  WorldSettings settings;
  settings.collisions = true;
  settings.ground.enabled = true;
  World world(settings);
  std::vector<BodyId> bodies;
  for (int i = 0; i < 108; ++i) {
    BodySettings at;
    const int row = i / 6, layer = row / 6;
    at.position = {0.97F * float(i % 6) + 0.1F * float(layer), 0.5F + 0.95F * float(layer), 0.97F * float(row % 6)};
    at.stiffness_scale = i % 2 == 0 ? 0.1F : 4.0F;
    bodies.push_back(*world.addBody(asset, at));
  }
  for (int i = 0; i < 200; ++i) {
    world.step(kStep);
    ASSERT_LT(motionOf(world, bodies).speed, 3) << i;  // they fall at 2.2
  }
}

// A row whose neighbours overlap a little is one island: of twenty, and of so many that its vectors are shared as well;
// or pairs apart, which are solved side by side.
TEST(Touch, IsTheSameForAnyThreads) {
  const auto asset = touchingBox({1, 1, 1});
  struct Row {
    int bodies, in_touch, steps;
  };
  for (const Row row : {Row{20, 20, 40}, Row{120, 120, 8}, Row{40, 2, 30}}) {
    std::vector<Vec3> expected;
    for (const unsigned threads : {0U, 2U, 5U}) {
      ThreadPool pool(std::max(1U, threads));
      WorldSettings settings;
      settings.collisions = true;
      settings.ground.enabled = true;
      World world(settings, threads > 0 ? &pool : nullptr);
      std::vector<BodyId> bodies;
      for (int i = 0; i < row.bodies; ++i) {
        BodySettings at;
        at.position = {0.999F * float(i) + 0.5F * float(i / row.in_touch), 0.5F + 0.02F * float(i % 3), 0};
        bodies.push_back(*world.addBody(asset, at));
      }
      for (int i = 0; i < row.steps; ++i) world.step(kStep);
      std::vector<Vec3> found;
      for (const BodyId body : bodies) {
        const auto x = world.positions(body);
        found.insert(found.end(), x.begin(), x.end());
      }
      if (threads == 0) expected = found;
      EXPECT_EQ(found, expected) << threads << " threads, " << row.bodies << " bodies, islands of " << row.in_touch;
    }
  }
}

// What flies into the end of a row of 24: those far from it stay where all have come to while those near it take more
// iterations.
TEST(Touch, AnImpactIsSolvedNearIt) {
  const auto asset = touchingBox({1, 1, 1});
  std::vector<Vec3> expected;
  for (const unsigned threads : {1U, 2U}) {
    ThreadPool pool(threads);
    World world(inSpace(), threads > 1 ? &pool : nullptr);
    std::vector<BodyId> bodies = {addMoving(world, asset, {-1.4F, 0.1F, 0}, {30, 0, 0})};
    for (int i = 0; i < 24; ++i) {
      BodySettings at;
      at.position = {0.999F * float(i), 0, 0};
      bodies.push_back(*world.addBody(asset, at));
    }
    const Motion start = motionOf(world, bodies);
    for (int i = 0; i < 90; ++i) {
      world.step(kStep);
      const Motion now = motionOf(world, bodies);
      EXPECT_LE(now.energy, start.energy * (1 + 1e-5)) << i;
      EXPECT_LT((now.momentum - start.momentum).norm(), 1e-4 * start.momentum.norm()) << i;
    }
    // It has gone on to those in the middle.
    EXPECT_GT(motionOf(world, {bodies[14]}).momentum.x(), 0.02 * start.momentum.x());
    std::vector<Vec3> found;
    for (const BodyId body : bodies) {
      const auto x = world.positions(body);
      found.insert(found.end(), x.begin(), x.end());
    }
    if (threads == 1) expected = found;
    EXPECT_EQ(found, expected);
  }
}

// In a step of 1/60 s what flies at 100 m/s goes 1.7 m: through all of what it meets. Where in a step it comes decides
// how the thin plate springs, by a tenth of what it gets: of eight such speeds the mean counts.
TEST(Touch, NothingFliesThrough) {
  const auto bullet = touchingBox({0.3, 0.3, 0.3}), cube = touchingBox({1, 1, 1}), plate = touchingBox({0.1, 1, 1});
  for (const auto& target : {cube, plate}) {
    for (const double rate : {30.0, 60.0, 240.0}) {
      for (int aim = 0; aim < 6; ++aim) {
        double fast = 0;
        for (const double speed : {10.0, 30.0, 98.3, 98.9, 99.6, 100.0, 100.231, 100.7, 101.3, 101.8}) {
          World world(inSpace());
          const float high = 0.07F * float(aim), c = std::cos(0.2F * float(aim)), s = std::sin(0.2F * float(aim));
          BodySettings far;
          far.position = {3 + 0.31F * float(aim), 0, 0};
          far.rotation = {1, 0, 0, 0, c, -s, 0, s, c};
          const std::vector<BodyId> bodies = {addMoving(world, bullet, {0, high, 0.5F * high}, {float(speed), 0, 0}),
                                              *world.addBody(target, far)};
          const Motion start = motionOf(world, bodies);
          for (int i = 0; double(i) < rate * (6 / speed + 0.2); ++i) world.step(float(1 / rate));
          const Motion end = motionOf(world, bodies);
          const std::string what = std::to_string(speed) + " m/s, " + std::to_string(rate) + " Hz, aim " +
                                   std::to_string(aim) + (target == plate ? ", plate" : ", cube");
          EXPECT_LE(end.energy, start.energy * (1 + 1e-4)) << what;
          EXPECT_LT((end.momentum - start.momentum).norm(), 1e-4 * start.momentum.norm()) << what;
          // Off its middle the target turns away, and gets less: that of bodies that stick together where they meet.
          const Motion one = motionOf(world, {bodies[0]}), other = motionOf(world, {bodies[1]});
          const double thick = target == plate ? 0.1 : 1, inertia = other.mass * (1 + thick * thick) / 12;
          const double off = 1.25 * double(high * high);
          const double stuck = start.momentum.x() / (1 + one.mass * (1 / other.mass + off / inertia));
          const double part = other.momentum.x() / stuck;
          EXPECT_GT(part, speed < 50 ? 0.7 : 0.6) << what;
          if (speed > 50) fast += part / 8;
        }
        EXPECT_GT(fast, 0.7) << rate << " Hz, aim " << aim << (target == plate ? ", plate" : ", cube");
      }
    }
  }
}

// Nothing moves what is paused: two such bodies that overlap have no mass between them by which to damp.
TEST(Touch, PausedBodiesMayOverlapBelowWhatLiesOnThem) {
  const auto cube = touchingBox({1, 1, 1});
  WorldSettings settings;
  settings.collisions = true;
  World world(settings);
  for (int i = 0; i < 2; ++i) {
    BodySettings at;
    at.position = {0.5F * float(i), 0.1F * float(i), 0};
    world.setActivity(*world.addBody(cube, at), Activity::paused);
  }
  BodySettings above;
  above.position = {0.3F, 1.2F, 0};
  const BodyId body = *world.addBody(cube, above);
  for (int i = 0; i < 300; ++i) {
    world.step(kStep);
    ASSERT_TRUE(std::isfinite(motionOf(world, {body}).energy)) << i;
  }
  const Motion m = motionOf(world, {body});
  EXPECT_GT(m.center.y(), 0.9);
  EXPECT_LT(m.momentum.norm(), 1e-3 * m.mass);
}

// Its surface stops; what is inside is stopped by the body's own stiffness, and may come through for a while.
TEST(Touch, NothingFliesThroughWhatStands) {
  const auto bullet = touchingBox({0.3, 0.3, 0.3}), plate = touchingBox({0.1, 1, 1});
  for (const float stiffness : {1.0F, 10.0F}) {
    for (const double speed : {10.0, 30.0, 100.0, 100.231}) {
      for (const double rate : {30.0, 60.0, 240.0}) {
        for (int aim = 0; aim < 4; ++aim) {
          World world(inSpace());
          BodySettings far, near;
          far.position = {3 + 0.31F * float(aim), 0, 0};
          const BodyId target = *world.addBody(plate, far);
          world.setActivity(target, Activity::paused);
          near.position = {0, 0.1F * float(aim), 0};
          near.stiffness_scale = stiffness;
          const std::vector<BodyId> flying = {*world.addBody(bullet, near)};
          world.setVelocity(flying[0], {float(speed), 0, 0}, {0, 0, 0});
          const Motion start = motionOf(world, flying);
          for (int i = 0; double(i) < rate * (6 / speed + 1); ++i) {
            world.step(i % 7 == 6 ? float(2 / rate) : float(1 / rate));
          }
          const Motion end = motionOf(world, flying);
          const auto x = world.positions(flying[0]);
          const auto beyond = std::count_if(x.begin(), x.end(), [&](const Vec3& v) { return v[0] > far.position[0]; });
          const std::string what = std::to_string(stiffness) + ", " + std::to_string(speed) + " m/s, " +
                                   std::to_string(rate) + " Hz, aim " + std::to_string(aim);
          EXPECT_EQ(beyond, 0) << what;
          EXPECT_LE(end.energy, start.energy) << what;
          EXPECT_LT(end.momentum.x(), 0.1 * start.momentum.x()) << what;
        }
      }
    }
  }
}

/// Two boxes on the ground, one on the other, after `seconds`.
struct Pair {
  World world;
  std::vector<BodyId> bodies;

  explicit Pair(float sleep_seconds) : world(settings(sleep_seconds)) {
    const auto asset = touchingBox({1, 0.6, 1});
    for (int i = 0; i < 2; ++i) {
      BodySettings at;
      at.position = {0.05F * float(i), 0.3F + 0.61F * float(i), 0};
      at.stiffness_scale = 8;
      bodies.push_back(*world.addBody(asset, at));
    }
  }
  static WorldSettings settings(float sleep_seconds) {
    WorldSettings result;
    result.collisions = true;
    result.ground.enabled = true;
    result.sleep_seconds = sleep_seconds;
    return result;
  }
  void run(int steps) {
    for (int i = 0; i < steps; ++i) world.step(kStep);
  }
  std::vector<bool> asleep() const { return {world.isAsleep(bodies[0]), world.isAsleep(bodies[1])}; }
};

TEST(Sleep, WhatRestsFallsAsleepWhereItRestsAwake) {
  Pair sleeping(0.5F), awake(0);
  sleeping.run(400);
  awake.run(400);
  EXPECT_EQ(sleeping.asleep(), std::vector<bool>({true, true}));
  EXPECT_EQ(awake.asleep(), std::vector<bool>({false, false}));
  for (int b = 0; b < 2; ++b) {
    const Motion one = motionOf(sleeping.world, {sleeping.bodies[std::size_t(b)]}),
                 other = motionOf(awake.world, {awake.bodies[std::size_t(b)]});
    EXPECT_LT((one.center - other.center).norm(), 1e-3) << b;
    EXPECT_EQ(one.speed, 0) << b;
  }
  const auto x = sleeping.world.positions(sleeping.bodies[1]);
  const std::vector<Vec3> before(x.begin(), x.end());
  sleeping.run(100);
  const auto y = sleeping.world.positions(sleeping.bodies[1]);
  EXPECT_TRUE(std::equal(before.begin(), before.end(), y.begin(), y.end()));
}

// Forces of what sleeps go on, whatever the length of the step that it fell asleep in.
TEST(Sleep, WeighsWhatItDid) {
  const auto asset = touchingBox({1, 0.6, 1});
  WorldSettings settings;
  settings.sleep_seconds = 0.3F;
  World world(settings);
  const ColliderId table = *world.addCollider(PlaneShape{});
  BodySettings at;
  at.position = {0, 0.3F, 0};
  at.stiffness_scale = 8;
  const BodyId body = *world.addBody(asset, at);
  const double weight = double(world.motion(body).mass) * 9.81;
  for (int i = 0; i < 1200 && !world.isAsleep(body); ++i) world.step(i % 2 == 0 ? 0.004F : 0.02F);
  ASSERT_TRUE(world.isAsleep(body));
  for (const float seconds : {0.002F, 0.03F, 0.5F}) {
    world.step(seconds);
    EXPECT_NEAR(double(world.colliderReaction(table).impulse[1]), -weight * double(seconds),
                0.01 * weight * double(seconds))
        << seconds;
  }
}

TEST(Sleep, WakesWithAllThatItTouches) {
  const auto wakes = [](const char* what, const auto& act) {
    Pair pair(0.5F);
    pair.run(400);
    ASSERT_EQ(pair.asleep(), std::vector<bool>({true, true})) << what;
    act(pair);
    pair.run(1);
    EXPECT_EQ(pair.asleep(), std::vector<bool>({false, false})) << what;
  };
  wakes("wake", [](Pair& p) { p.world.wake(p.bodies[0]); });
  wakes("pick", [](Pair& p) { (void)p.world.pick(p.bodies[1], 0, {0, 2, 0}); });
  wakes("pin", [](Pair& p) { p.world.pin(p.bodies[1], 0, {0, 2, 0}); });
  wakes("teleport", [](Pair& p) { p.world.teleport(p.bodies[0], {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 1, 0}); });
  wakes("gravity", [](Pair& p) { p.world.settings().gravity = {0, -5, 0}; });
  wakes("ground", [](Pair& p) { p.world.settings().ground.offset = -1; });
  wakes("collider", [](Pair& p) { ASSERT_TRUE(p.world.addCollider(SphereShape{})); });
  wakes("moved", [](Pair& p) {
    const auto ball = p.world.addCollider(SphereShape{}, {.at = {.position = {0, 9, 0}}});
    ASSERT_TRUE(ball);
    p.run(1);
    ASSERT_TRUE(p.world.isAsleep(p.bodies[1])) << "what is far lets sleep";
    p.world.moveCollider(*ball, {.position = {0, 1.5F, 0}});
  });
  wakes("never", [](Pair& p) { p.world.settings().sleep_seconds = 0; });
  Pair removed(0.5F);
  removed.run(400);
  removed.world.removeBody(removed.bodies[0]);
  removed.run(20);
  EXPECT_LT(motionOf(removed.world, {removed.bodies[1]}).center[1], 0.9);
}

TEST(Sleep, WhatFallsOntoItWakesIt) {
  Pair pair(0.5F);
  pair.run(400);
  const auto asset = touchingBox({1, 0.6, 1});
  BodySettings at;
  at.position = {0, 4, 0};
  at.stiffness_scale = 8;
  pair.bodies.push_back(*pair.world.addBody(asset, at));
  pair.run(10);
  EXPECT_EQ(pair.asleep(), std::vector<bool>({true, true}));  // it is still far
  pair.run(80);
  EXPECT_EQ(pair.asleep(), std::vector<bool>({false, false}));
  pair.run(420);
  EXPECT_EQ(pair.asleep(), std::vector<bool>({true, true}));
  EXPECT_GT(motionOf(pair.world, pair.bodies).high, 1.75);
}

TEST(Sleep, FloatingBodiesDriftAwake) {
  WorldSettings settings = inSpace();
  settings.sleep_seconds = 0.1F;
  World world(settings);
  const BodyId body = addMoving(world, touchingBox({1, 1, 1}), {0, 0, 0}, {2e-4F, 0, 0});
  for (int i = 0; i < 600; ++i) world.step(kStep);
  EXPECT_FALSE(world.isAsleep(body));
  EXPECT_NEAR(motionOf(world, {body}).center[0], 2e-3, 1e-5);
}

TEST(Sleep, IsPartOfASavedState) {
  Pair pair(0.5F), other(0.5F);
  pair.run(400);
  std::vector<std::byte> bytes(pair.world.stateBytes(pair.bodies[1]));
  ASSERT_EQ(pair.world.saveState(pair.bodies[1], bytes), bytes.size());
  ASSERT_TRUE(other.world.restoreState(other.bodies[1], bytes));
  EXPECT_TRUE(other.world.isAsleep(other.bodies[1]));
}

}  // namespace
}  // namespace sinew::test

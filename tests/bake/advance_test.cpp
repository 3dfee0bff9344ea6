// SPDX-License-Identifier: GPL-3.0-or-later
//
// World::advance(): frames of any length, inner steps of one, what is drawn between them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "sinew/runtime/world.h"
#include "tests/bake/field_bar.h"

namespace sinew {
namespace {

constexpr float kStep = 1.0F / 60;

std::shared_ptr<const Asset> bar() {
  static const auto asset = *Asset::fromMemory(test::fieldBar({.hz = 8}));
  return asset;
}

std::shared_ptr<const Asset> heldBar() {
  static const auto asset = *Asset::fromMemory(test::fieldBar({.pinned = true, .hz = 8}));
  return asset;
}

WorldSettings space() {
  WorldSettings settings;
  settings.gravity = {};
  settings.damping = settings.deformation_damping_ratio = settings.support_damping = 0;
  return settings;
}

std::vector<Vec3> drawn(const World& world, BodyId body) {
  std::vector<Vec3> x(world.asset(body).package().visualPositions().size());
  world.visualVertices(body, {x[0].data(), 12, std::uint32_t(x.size())}, {});
  return x;
}

std::vector<Vec3> stateOf(const World& world, BodyId body) {
  const auto x = world.positions(body);
  return {x.begin(), x.end()};
}

double farthest(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) most = std::max(most, std::abs(double(a[i][c]) - double(b[i][c])));
  }
  return most;
}

/// Moves at v and turns at w about y, as rigidly as vertices say.
void setMotion(World& world, BodyId body, Vec3 v, float w) {
  const std::vector<Vec3> x = stateOf(world, body);
  std::vector<Vec3> velocities;
  velocities.reserve(x.size());
  for (const Vec3& at : x) velocities.push_back({v[0] + w * at[2], v[1], v[2] - w * at[0]});
  world.setState(body, x, velocities);
}

TEST(Advance, AFrameOfOneInnerStepIsAStep) {
  World by_steps, by_frames;
  const BodyId a = *by_steps.addBody(heldBar()), b = *by_frames.addBody(heldBar());
  for (int frame = 0; frame < 100; ++frame) {
    by_steps.step(kStep);
    ASSERT_EQ(by_frames.advance(kStep), 1U) << frame;
    ASSERT_EQ(stateOf(by_steps, a), stateOf(by_frames, b)) << frame;
  }
}

// Bones as rigid as what is drawn of the flesh on them.
TEST(Advance, DrawsPinSetsWhereTheFleshIs) {
  World world(space());
  const BodyId body = *world.addBody(heldBar());
  const PinSetId pins = world.pinSet(body, "held");
  double time = 0;
  for (int frame = 0; frame < 200; ++frame) {
    const float seconds = frame % 3 == 0 ? 0.004F : frame % 3 == 1 ? 0.031F : 0.011F;
    time += double(seconds);
    world.movePinTarget(body, "world", {{float(2 * time), 0, 0}});
    world.advance(seconds);
    const std::vector<Vec3> x = drawn(world, body);
    const auto rest = world.asset(body).package().visualPositions();
    const RigidTransform at = world.drawnPose(pins);
    double most = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (rest[i][0] > -0.499F) continue;
      for (std::size_t c = 0; c < 3; ++c)
        most = std::max(most, std::abs(double(x[i][c] - rest[i][c] - at.position[c])));
    }
    ASSERT_LT(most, 2e-6) << frame;
    // One substep before the end of the frame.
    if (frame < 100) continue;
    ASSERT_NEAR(at.position[0], 2 * (time - double(kStep)), 1e-3) << frame;
  }
}

TEST(Advance, TheRateOfFramesDoesNotChangeTheMotion) {
  World by_steps;
  const BodyId body = *by_steps.addBody(heldBar());
  std::vector<std::vector<Vec3>> states = {stateOf(by_steps, body)};
  for (int step = 0; step < 123; ++step) {
    by_steps.step(kStep);
    states.push_back(stateOf(by_steps, body));
  }
  const std::vector<std::vector<float>> rates = {{1.0F / 144}, {1.0F / 30}, {0.001F, 0.04F, 0.013F}, {1e-4F}};
  for (const std::vector<float>& frames : rates) {
    World world;
    const BodyId other = *world.addBody(heldBar());
    std::uint32_t steps = 0;
    double time = 0;
    for (std::size_t frame = 0; steps < 120; ++frame) {
      const float seconds = frames[frame % frames.size()];
      steps += world.advance(seconds);
      time += double(seconds);
      ASSERT_NEAR(steps, time / double(kStep), 1) << frames[0];
      ASSERT_EQ(stateOf(world, other), states[steps]) << frames[0] << " " << steps;
    }
  }
}

TEST(Advance, WhatIsDrawnMovesEvenlyAndKeepsItsShapeWhileItTurns) {
  World world(space());
  BodySettings stiff;  // spinning stretches it by 1e-3
  stiff.stiffness_scale = 20;
  const BodyId body = *world.addBody(bar(), stiff);
  const float speed = 3, turning = 25;  // 0.42 rad an inner step
  setMotion(world, body, {speed, 0, 0}, turning);
  const std::vector<Vec3> rest = drawn(world, body);
  double time = -double(kStep);
  for (int frame = 0; frame < 60; ++frame) {
    const float seconds = frame % 3 == 0 ? 1.0F / 90 : 1.0F / 240;
    world.advance(seconds);
    time += double(seconds);
    if (time < 0) continue;
    // Where it was an inner step ago.
    const double c = std::cos(double(turning) * time), s = std::sin(double(turning) * time);
    std::vector<Vec3> wanted;
    wanted.reserve(rest.size());
    for (const Vec3& x : rest) {
      wanted.push_back({float(double(speed) * time + c * double(x[0]) + s * double(x[2])), x[1],
                        float(c * double(x[2]) - s * double(x[0]))});
    }
    // A straight line between the two states would be 2 % of the bar's half length off, a state 20 %.
    EXPECT_LT(farthest(drawn(world, body), wanted), 0.012) << frame;
  }
}

TEST(Advance, WhatIsDrawnIsTheStateWhereNoTimeIsLeftOver) {
  World world;
  const BodyId body = *world.addBody(heldBar());
  world.advance(2 * kStep);
  const std::vector<Vec3> between = drawn(world, body), state = stateOf(world, body);
  world.advance(0.999F * kStep);
  const std::vector<Vec3> later = drawn(world, body);
  EXPECT_EQ(stateOf(world, body), state);  // no inner step
  EXPECT_GT(farthest(between, later), 1e-5);
  World stepped;
  const BodyId other = *stepped.addBody(heldBar());
  stepped.step(kStep);
  stepped.step(kStep);
  EXPECT_LT(farthest(drawn(stepped, other), later), 1e-5);
  // A step of the caller's own is drawn as it ends.
  stepped.step(kStep);
  world.step(kStep);
  EXPECT_EQ(drawn(stepped, other), drawn(world, body));
}

TEST(Advance, AHitchIsCutShortAndCostsNoMoreThanAllowed) {
  WorldSettings settings;
  settings.most_substeps = 5;
  World world(settings);
  const BodyId body = *world.addBody(heldBar());
  EXPECT_EQ(world.advance(0.5F), 5U);
  EXPECT_EQ(world.advance(0.5F), 5U);
  EXPECT_LE(world.advance(kStep), 2U);
  World by_steps;
  const BodyId other = *by_steps.addBody(heldBar());
  for (int step = 0; step < 10; ++step) by_steps.step(kStep);
  world.resetBody(body);
  world.advance(0.5F);
  world.advance(0.5F);
  EXPECT_EQ(stateOf(world, body), stateOf(by_steps, other));
}

TEST(Advance, PinSetsMoveEvenlyAndAreDrawnSo) {
  World world(space());
  const BodyId body = *world.addBody(heldBar());
  const PinSetId set = world.pinSet(body, "held");
  const std::vector<Vec3> start = drawn(world, body);
  const auto held = std::size_t(std::min_element(start.begin(), start.end()) - start.begin());
  const float frame = 1.0F / 25, speed = 2;  // two or three inner steps
  float last = 0, asked = 0;
  for (int i = 0; i < 50; ++i) {
    asked += speed * frame;
    RigidTransform to;
    to.position = {0, asked, 0};
    world.movePinSet(set, to);
    world.advance(frame);
    const float now = drawn(world, body)[held][1] - start[held][1];
    // Targets are for the ends of frames: inner steps, two or three a frame, stop on the way.
    if (i > 1) {
      EXPECT_NEAR(now - last, speed * frame, 0.01F * speed * frame) << i;
    }
    last = now;
  }
}

TEST(Advance, PreviousPositionsAreThoseDrawnBefore) {
  World world;
  BodySettings settings;
  settings.keep_previous = true;
  const BodyId body = *world.addBody(heldBar(), settings);
  std::vector<Vec3> before = drawn(world, body);
  for (int frame = 0; frame < 20; ++frame) {
    world.advance(1.0F / 100);
    std::vector<Vec3> previous(before.size()), now(before.size());
    const auto count = std::uint32_t(before.size());
    VisualOutput output;
    output.positions = {now[0].data(), 12, count};
    output.previous_positions = {previous[0].data(), 12, count};
    world.visualVertices(body, output);
    EXPECT_LT(farthest(previous, before), 1e-6) << frame;
    before = now;
  }
}

// Impulses and events are those of one call: a frame that takes no step has none.
TEST(Advance, WhatTouchesIsToldOnce) {
  WorldSettings settings;
  settings.ground.enabled = true;
  World world(settings);
  BodySettings placed;
  placed.position = {0, 0.6F, 0};
  const BodyId body = *world.addBody(bar(), placed);
  const float mass = world.motion(body).mass;
  double sum = 0;
  for (int frame = 0; frame < 4 * 144; ++frame) {
    const bool stepped = world.advance(1.0F / 144) > 0;
    const float impulse = world.colliderReaction(kGroundCollider).impulse[1];
    if (!stepped) {
      EXPECT_EQ(impulse, 0);
      EXPECT_TRUE(world.contactEvents().empty());
    }
    sum += double(impulse);
  }
  EXPECT_NEAR(sum, -4 * 9.81 * double(mass), 0.05 * 4 * 9.81 * double(mass));
}

TEST(Advance, WhatIsNoTimeDoesNothing) {
  World world;
  const BodyId body = *world.addBody(heldBar());
  world.advance(0.5F * kStep);
  const std::vector<Vec3> before = drawn(world, body);
  for (const float seconds : {-1.0F, std::numeric_limits<float>::quiet_NaN(), 2e6F}) {
    EXPECT_EQ(world.advance(seconds), 0U);
    EXPECT_EQ(drawn(world, body), before);
  }
  EXPECT_EQ(world.advance(0), 0U);
  EXPECT_EQ(world.advance(0.51F * kStep), 1U);
}

}  // namespace
}  // namespace sinew

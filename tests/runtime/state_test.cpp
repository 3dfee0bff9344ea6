// SPDX-License-Identifier: MIT
//
// The state of a body as a whole: saved and restored bit for bit, moved elsewhere without a trace.
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <thread>

#include "sinew/formats/checksum.h"
#include "sinew/runtime/thread_pool.h"
#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"
#include "tests/support/field_content.h"

namespace sinew::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using formats::ClusterMode;

BoxOptions softBox(ClusterMode mode = ClusterMode::quadratic) {
  BoxOptions box;
  box.mode = mode;
  box.clusters = {2, 2, 2};
  return box;
}

WorldSettings onGround() {
  WorldSettings settings;
  settings.ground.enabled = true;
  return settings;
}

// A body that falls, is pinned and picked, and hits the ground: all state there is.
BodyId addBusyBody(World& world, const std::shared_ptr<const Asset>& asset, bool history = true) {
  BodySettings settings;
  settings.position = {0, 0.55F, 0};
  settings.keep_previous = history;
  const BodyId body = *world.addBody(asset, settings);
  world.pin(body, 11, world.positions(body)[11]);
  world.pin(body, 3, world.positions(body)[3]);
  world.pick(body, 30, {1, 2, 0});
  return body;
}

std::vector<std::byte> saved(const World& world, BodyId body) {
  std::vector<std::byte> bytes(world.stateBytes(body));
  EXPECT_EQ(world.saveState(body, bytes), bytes.size());
  return bytes;
}

struct Snapshot {
  std::vector<Vec3> x, v, visual, previous;
  bool operator==(const Snapshot&) const = default;
};

Snapshot snapshotOf(const World& world, BodyId body) {
  Snapshot s;
  s.x.assign(world.positions(body).begin(), world.positions(body).end());
  s.v.assign(world.velocities(body).begin(), world.velocities(body).end());
  const std::size_t n = world.asset(body).package().visualPositions().size();
  s.visual.resize(n);
  s.previous.resize(n);
  VisualOutput out;
  out.positions = {s.visual[0].data(), 12, std::uint32_t(n)};
  out.previous_positions = {s.previous[0].data(), 12, std::uint32_t(n)};
  world.visualVertices(body, out);
  return s;
}

TEST(State, MechanicsGoOnBitForBit) {
  // What is permanent, what is activated and what damping remembers are state too.
  formats::PackageContent content = boxContent(softBox());
  formats::ClusterMechanics m = formats::kPlainMechanics;
  m.damping = 3;
  m.plastic_yield = 0.02F;
  m.plastic_creep = 4;
  m.fibre = {1, 0, 0};
  m.channel = 0;
  m.contraction = 0.3F;
  content.channels = {{content.addText("flex")}};
  content.mechanics.assign(content.clusters.size(), m);
  World world(onGround());
  const BodyId body = addBusyBody(world, makeAsset(content));
  ASSERT_TRUE(world.setActivation(body, "flex", 0.7F));
  run(world, 0.5);
  const std::vector<std::byte> bytes = saved(world, body);
  run(world, 0.5);
  const Snapshot expected = snapshotOf(world, body);
  ASSERT_TRUE(world.setActivation(body, "flex", 0.1F));
  run(world, 0.5);
  ASSERT_TRUE(world.restoreState(body, bytes));
  run(world, 0.5);
  EXPECT_EQ(snapshotOf(world, body), expected);
}

TEST(State, ARestoredBodyGoesOnBitForBit) {
  for (const ClusterMode mode : {ClusterMode::rigid, ClusterMode::linear, ClusterMode::quadratic}) {
    const auto asset = boxAsset(softBox(mode));
    World world(onGround());
    const BodyId body = addBusyBody(world, asset);
    run(world, 0.5);
    const std::vector<std::byte> bytes = saved(world, body);
    const Snapshot start = snapshotOf(world, body);
    std::vector<Snapshot> expected;
    for (int i = 0; i < 60; ++i) {
      world.step(1.0F / 60);
      expected.push_back(snapshotOf(world, body));
    }
    ASSERT_FALSE(expected.back() == start);

    // Into the same body, far away in time; and into another one of another world that has just begun.
    World other(onGround());
    BodySettings settings;
    settings.keep_previous = true;
    settings.position = {7, 7, 7};
    ASSERT_TRUE(other.addBody(asset));
    const BodyId fresh = *other.addBody(asset, settings);
    for (const auto& [w, id] : {std::pair<World*, BodyId>{&world, body}, {&other, fresh}}) {
      const Result<std::size_t> restored = w->restoreState(id, bytes);
      ASSERT_TRUE(restored) << restored.reason();
      EXPECT_EQ(*restored, bytes.size());
      EXPECT_TRUE(snapshotOf(*w, id) == start);
      EXPECT_EQ(saved(*w, id), bytes);
      for (int i = 0; i < 60; ++i) {
        w->step(1.0F / 60);
        ASSERT_TRUE(snapshotOf(*w, id) == expected[std::size_t(i)]) << int(mode) << " step " << i;
      }
    }
  }
}

TEST(State, WhatIsHeldByResidualModesGoesOnBitForBit) {
  formats::PackageContent content = boxContent(softBox(ClusterMode::linear));
  addFields(content);
  addResiduals(content);
  const auto asset = makeAsset(content);
  World world(onGround()), other(onGround());
  const BodyId body = *world.addBody(asset), twin = *other.addBody(asset);
  const std::vector<std::uint32_t> some = {0, 1, 2, 9};
  ASSERT_TRUE(world.addPinSet(body, some, {}, PinMethod::constrained_fit));
  world.pin(body, 20, {1, 1, 1});
  ASSERT_NE(world.pick(body, 30, {0, 2, 0}).value, PickId{}.value);
  run(world, 0.5);
  const std::vector<std::byte> bytes = saved(world, body);
  const Snapshot start = snapshotOf(world, body);
  // Of the twin nothing but what is drawn is up to date.
  other.step(1.0F / 60);
  std::vector<Vec3> drawn(asset->package().visualPositions().size());
  other.visualVertices(twin, {drawn[0].data(), 12, std::uint32_t(drawn.size())}, {});
  ASSERT_TRUE(other.restoreState(twin, bytes));
  EXPECT_TRUE(snapshotOf(other, twin) == start);
  for (int i = 0; i < 60; ++i) {
    const float h = i % 2 == 0 ? 1.0F / 60 : 1.0F / 240;
    world.step(h);
    other.step(h);
    ASSERT_TRUE(snapshotOf(other, twin) == snapshotOf(world, body)) << "step " << i;
  }
}

// Damping, plasticity, activation, elastic modes and moving pin sets of two methods: all that mechanics remember.
TEST(State, MechanicsAndPinSetsGoOnBitForBit) {
  formats::PackageContent content = boxContent(softBox());
  formats::ClusterMechanics m = formats::kPlainMechanics;
  m.damping = 3;
  m.plastic_yield = 0.05F;
  m.plastic_creep = 5;
  m.fibre = {0.6F, 0.8F, 0};
  m.channel = 0;
  m.contraction = 0.4F;
  content.channels = {{content.addText("flex")}};
  content.mechanics.assign(content.clusters.size(), m);
  const auto asset = makeAsset(content);
  const RigidTransform turned = {{0.3F, 0.6F, 0}, {0, -1, 0, 1, 0, 0, 0, 0, 1}};
  for (const PinMethod method :
       {PinMethod::hold, PinMethod::infinite_mass, PinMethod::matrix, PinMethod::constrained_fit}) {
    World world(onGround());
    BodySettings settings;
    settings.position = {0, 0.7F, 0};
    const BodyId body = *world.addBody(asset, settings);
    const std::array<std::uint32_t, 4> corner = {0, 1, 5, 25};
    const std::array<std::uint32_t, 3> other = {119, 123, 124};
    const PinSetId set = *world.addPinSet(body, corner, {}, method);
    ASSERT_TRUE(world.addPinSet(body, other, {}, PinMethod::hold));
    ASSERT_TRUE(world.setActivation(body, "flex", 0.7F));
    run(world, 0.1);
    world.movePinSet(set, turned);
    const auto bytes = saved(world, body);
    const auto go_on = [](World& w, BodyId id, PinSetId pins) {
      std::vector<Snapshot> states;
      std::vector<Vec3> forces;
      for (int i = 0; i < 30; ++i) {
        w.step(1.0F / 60);
        states.push_back(snapshotOf(w, id));
        forces.push_back(w.pinReaction(pins).force);
      }
      return std::pair(states, forces);
    };
    const auto expected = go_on(world, body, set);
    ASSERT_TRUE(world.restoreState(body, bytes));
    EXPECT_EQ(saved(world, body), bytes);
    EXPECT_TRUE(go_on(world, body, set) == expected) << int(method);
    World fresh(onGround());
    const BodyId another = *fresh.addBody(asset);
    ASSERT_TRUE(fresh.restoreState(another, bytes));
    EXPECT_TRUE(go_on(fresh, another, set) == expected) << int(method);
    ASSERT_TRUE(fresh.addBody(asset));
  }
}

TEST(State, PicksComeBackWithTheirIdsUnlessTaken) {
  const auto asset = boxAsset(softBox());
  World world;
  const BodyId a = addBusyBody(world, asset), b = addBusyBody(world, asset);
  std::array<PickId, 4> ids;
  ASSERT_EQ(world.picks(a, ids), 1U);
  const PickId pick = ids[0];
  const auto bytes = saved(world, a);
  world.releasePick(pick);
  EXPECT_EQ(world.picks(a, ids), 0U);
  ASSERT_TRUE(world.restoreState(a, bytes));
  ASSERT_EQ(world.picks(a, ids), 1U);
  EXPECT_EQ(ids[0], pick);
  ASSERT_TRUE(world.restoreState(b, bytes));
  ASSERT_EQ(world.picks(b, ids), 1U);
  EXPECT_FALSE(ids[0] == pick);
  const PickId next = world.pick(a, 1, {0, 0, 0});
  EXPECT_FALSE(next == pick);
  EXPECT_FALSE(next == ids[0]);
}

// Bytes of a saved state before its vertices; the checksum is the last eight.
constexpr std::size_t kHeader = 96;

// Makes the checksum of damaged bytes right again.
void seal(std::vector<std::byte>& bytes) {
  const std::uint64_t none = 0;
  std::memcpy(bytes.data() + kHeader - 8, &none, 8);
  const std::uint64_t sum = formats::checksum(bytes);
  std::memcpy(bytes.data() + kHeader - 8, &sum, 8);
}

TEST(State, DamagedBytesAreRefusedAndChangeNothing) {
  const auto asset = boxAsset(softBox());
  World world(onGround());
  const BodyId body = addBusyBody(world, asset);
  run(world, 0.2);
  const std::vector<std::byte> bytes = saved(world, body);
  run(world, 0.2);
  const std::vector<std::byte> now = saved(world, body);
  EXPECT_EQ(world.saveState(body, std::span(const_cast<std::vector<std::byte>&>(now)).first(now.size() - 1)), 0U);
  for (std::size_t size = 0; size < bytes.size(); size += 1 + size / 7) {
    const auto restored = world.restoreState(body, std::span(bytes).first(size));
    ASSERT_FALSE(restored) << size;
    EXPECT_FALSE(restored.reason().empty());
  }
  for (std::size_t place = 0; place < bytes.size(); ++place) {
    auto damaged = bytes;
    damaged[place] ^= std::byte{1};
    const auto restored = world.restoreState(body, damaged);
    ASSERT_FALSE(restored) << place;
    if (place >= kHeader) {
      ASSERT_NE(restored.reason().find("checksum"), std::string::npos) << restored.reason();
    }
  }
  for (const std::size_t place : {0UL, 4UL, 8UL, 16UL, 24UL, 28UL, 32UL, 36UL, 40UL, 48UL, 52UL, 56UL, 60UL, 64UL}) {
    auto damaged = bytes;
    damaged[place] ^= std::byte(0x41);
    seal(damaged);
    EXPECT_FALSE(world.restoreState(body, damaged)) << place;
  }
  // Not a number among the positions, a pin of no vertex, and a piece with more functions than its field has.
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::uint32_t far = 1U << 30;
  std::uint64_t solver_bytes = 0;
  std::memcpy(&solver_bytes, bytes.data() + 80, sizeof solver_bytes);
  const std::size_t positions = kHeader, pins = positions + 24 * world.positions(body).size();
  const std::size_t piece = bytes.size() - solver_bytes;
  const auto refused = [&](std::size_t place, const void* value) {
    auto damaged = bytes;
    std::memcpy(damaged.data() + place, value, 4);
    seal(damaged);
    return !world.restoreState(body, damaged);
  };
  EXPECT_TRUE(refused(positions, &nan));
  EXPECT_TRUE(refused(pins, &far));
  EXPECT_TRUE(refused(piece + 4, &far));
  BoxOptions another = softBox();
  another.density = 500;
  const BodyId stranger = *world.addBody(boxAsset(another));
  EXPECT_FALSE(world.restoreState(stranger, bytes));
  EXPECT_EQ(saved(world, body), now);
}

TEST(State, TeleportTurnsTheWholeMotionAlong) {
  // Weightless, swinging and deformed: moved bodies move as the unmoved one, seen from the new place.
  const auto asset = boxAsset(softBox());
  const Matrix3d turn = Eigen::AngleAxisd(1.1, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  const Vector3d shift(3, -2, 1);
  Mat3 rotation;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) rotation[3 * r + c] = float(turn(Eigen::Index(r), Eigen::Index(c)));
  }
  World stay(weightless()), go(weightless());
  BodySettings settings;
  settings.keep_previous = true;
  const BodyId a = *stay.addBody(asset, settings), b = *go.addBody(asset, settings);
  std::vector<Vec3> x, v;
  for (const Vec3& p : stay.positions(a)) {
    x.push_back({1.3F * p[0], 0.8F * p[1], p[2]});
    v.push_back({1 - 2 * p[1], 2 * p[0], 0.5F * p[2]});
  }
  for (World* w : {&stay, &go}) {
    w->setState(a, x, v);
    w->pick(a, 5, {0.2F, 0.9F, 0.3F});
  }
  run(stay, 0.2);
  run(go, 0.2);
  go.teleport(b, rotation, {3, -2, 1});
  const Motion before = motionOf(stay, a), after = motionOf(go, b);
  EXPECT_LT((after.momentum - turn * before.momentum).norm(), 1e-5 * before.momentum.norm());
  EXPECT_NEAR(after.kinetic, before.kinetic, 1e-5 * before.kinetic);
  EXPECT_LT((after.center - turn * before.center - shift).norm(), 1e-5);
  for (int i = 0; i < 30; ++i) {
    const Snapshot one = snapshotOf(stay, a), other = snapshotOf(go, b);
    // Bodies differ by rounding, of a pick's target in the world among it, until a step of one ends an iteration before
    // the other's: it is solved to a thousandth of its way from the prediction, which is long where a pick pulls.
    const double way = i < 10 ? 2e-6 : 1e-3, speed = i < 10 ? 5e-5 : 1e-2;
    for (std::size_t k = 0; k < one.x.size(); ++k) {
      ASSERT_LT((wide(other.x[k]) - turn * wide(one.x[k]) - shift).norm(), way) << i;
      ASSERT_LT((wide(other.v[k]) - turn * wide(one.v[k])).norm(), speed) << i;
    }
    for (std::size_t k = 0; k < one.visual.size(); ++k) {
      ASSERT_LT((wide(other.visual[k]) - turn * wide(one.visual[k]) - shift).norm(), way) << i;
      ASSERT_LT((wide(other.previous[k]) - turn * wide(one.previous[k]) - shift).norm(), way) << i;
    }
    stay.step(1.0F / 60);
    go.step(1.0F / 60);
  }
}

TEST(State, ATeleportedBodyAtRestStaysAtRest) {
  World world(weightless());
  const BodyId body = *world.addBody(boxAsset(softBox()));
  world.pin(body, 0, world.positions(body)[0]);
  world.step(1.0F / 60);
  world.teleport(body, {0, -1, 0, 1, 0, 0, 0, 0, 1}, {3, 0, 0});
  run(world, 0.5);
  EXPECT_LT(rmsSpeed(world, body), 1e-4);
  EXPECT_LT(restError(world, body).max, 1e-4);
  const Snapshot before = snapshotOf(world, body);
  world.teleport(body, {1, 0, 0, 0, -1, 0, 0, 0, 1}, {0, 0, 0});  // a reflection is refused
  world.teleport(body, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, std::numeric_limits<float>::infinity(), 0});
  EXPECT_TRUE(snapshotOf(world, body) == before);
}

// Worlds in threads of their own, sharing an asset whose lazy parts nobody has asked for yet; each equals the one that
// ran alone. Under ThreadSanitizer this also shows that nothing is shared that should not be.
TEST(State, WorldsRunSideBySide) {
  const auto play = [](const std::shared_ptr<const Asset>& asset, JobSystem* jobs) {
    World world(onGround(), jobs);
    const BodyId body = addBusyBody(world, asset);
    std::vector<Snapshot> states;
    for (int i = 0; i < 20; ++i) {
      world.step(1.0F / 60);
      std::array<float, 4> tangent{};
      VisualOutput out;
      out.tangents = {tangent.data(), 16, 1};
      world.visualVertices(body, out);
      states.push_back(snapshotOf(world, body));
      const auto bytes = saved(world, body);
      EXPECT_TRUE(world.restoreState(body, bytes));
    }
    return states;
  };
  const auto expected = play(boxAsset(softBox()), nullptr);
  const auto asset = boxAsset(softBox());
  std::array<std::vector<Snapshot>, 4> found;
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < found.size(); ++i) {
    threads.emplace_back([&, i] {
      if (i == 0) {
        ThreadPool pool(2);
        found[i] = play(asset, &pool);
      } else {
        found[i] = play(asset, nullptr);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const auto& states : found) EXPECT_TRUE(states == expected);
}

}  // namespace
}  // namespace sinew::test

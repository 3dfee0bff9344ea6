// SPDX-License-Identifier: MIT
//
// What a game does to bodies: impulses, forces, air, picks, stops, a hand that pushes, snapshots of all of it.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

using Eigen::Vector3d;

/// A cube of 0.3 m.
BoxOptions cube(double density = 1000) {
  BoxOptions box;
  box.size = {0.3, 0.3, 0.3};
  box.density = density;
  box.stretch_hz = box.bend_hz = box.twist_hz = 15;
  return box;
}

WorldSettings vacuum() {
  WorldSettings settings = weightless();
  settings.damping = 0;
  return settings;
}

BodySettings spinning() {
  BodySettings settings;
  settings.position = {0.3F, -0.2F, 0.5F};
  return settings;
}

TEST(Pushes, GiveTheirMomentumAtAnyStep) {
  for (const bool force : {false, true}) {
    for (const float h : {1e-3F, 1.0F / 60, 0.1F}) {
      World world(vacuum());
      const BodyId body = *world.addBody(boxAsset(cube()), spinning());
      world.setVelocity(body, {0.2F, 0, -0.1F}, {0, 1, 0.5F});
      for (int i = 0; i < 5; ++i) world.step(h);
      const Motion before = motionOf(world, body);
      const BodyPoint corner = BodyPoint::physicalVertex(0);
      const Vector3d at = wide(world.placeOf(body, corner)), impulse(0.5, 1, -0.25);
      if (force) {
        world.addForce(body, corner, {float(impulse[0]) / h, float(impulse[1]) / h, float(impulse[2]) / h});
      } else {
        world.addImpulse(body, corner, {0.5F, 1, -0.25F});
        EXPECT_LT((motionOf(world, body).momentum - before.momentum - impulse).norm(), 1e-5);
      }
      for (int i = 0; i < 5; ++i) {
        world.step(h);
        const Motion after = motionOf(world, body);
        EXPECT_LT((after.momentum - before.momentum - impulse).norm(), 2e-5) << force << ' ' << h;
        // A force acts over its step, in which its point goes on with the body.
        const Vector3d moved = force ? Vector3d(0.5 * double(h) * before.momentum / before.mass) : Vector3d::Zero();
        EXPECT_LT((after.angular - before.angular - (at + moved).cross(impulse)).norm(), 4e-5) << force << ' ' << h;
      }
    }
  }
}

TEST(Pushes, OnAllOfTheMassDeformNothing) {
  World world(vacuum());
  const BodyId body = *world.addBody(boxAsset(cube()), spinning());
  world.addImpulse(body, {27, 0, 0});
  world.addForce(body, {0, 27 * 60, 0});
  world.step(1.0F / 60);
  const BodyMotion motion = world.motion(body);
  EXPECT_NEAR(motion.mass, 27, 1e-4);
  EXPECT_NEAR(motion.velocity[0], 1, 1e-6);
  EXPECT_NEAR(motion.velocity[1], 1, 1e-6);
  EXPECT_NEAR(Vector3d(wide(motion.angular_velocity)).norm(), 0, 1e-6);
  EXPECT_LT(restError(world, body).max, 1e-6);
}

TEST(Pushes, AForceThatStaysHoldsTheSameShapeAtAnyStep) {
  // Pulled at two corners: an elastic answer, which no damping and no step may share in.
  std::vector<double> lengths;
  for (const float h : {1.0F / 240, 1.0F / 60, 1.0F / 15}) {
    World world(vacuum());
    const BodyId body = *world.addBody(boxAsset(cube()));
    const auto count = std::uint32_t(world.positions(body).size());
    for (float t = 0; t < 4; t += h) {
      world.addForce(body, BodyPoint::physicalVertex(0), {-40, -40, -40});
      world.addForce(body, BodyPoint::physicalVertex(count - 1), {40, 40, 40});
      world.step(h);
    }
    lengths.push_back((wide(world.positions(body)[0]) - wide(world.positions(body)[count - 1])).norm());
  }
  EXPECT_GT(lengths[1], 0.3 * std::sqrt(3) * 1.005);
  EXPECT_NEAR(lengths[0], lengths[1], 1e-4 * lengths[1]);
  // A long step's minimization ends at 1e-3 of its way from the prediction, which is h^2 times the acceleration.
  EXPECT_NEAR(lengths[2], lengths[1], 0.04 * (lengths[1] - 0.3 * std::sqrt(3)));
}

TEST(Velocity, IsSetWithoutTouchingTheShape) {
  World world(vacuum());
  const BodyId body = *world.addBody(boxAsset(cube()), spinning());
  world.setVelocity(body, {1, 2, 3}, {0, 0, 2});
  const BodyMotion motion = world.motion(body);
  EXPECT_LT((wide(motion.velocity) - Vector3d(1, 2, 3)).norm(), 1e-6);
  EXPECT_LT((wide(motion.angular_velocity) - Vector3d(0, 0, 2)).norm(), 1e-5);
  EXPECT_LT(restError(world, body).max, 1e-6);
}

TEST(Gravity, IsScaledByBody) {
  WorldSettings settings;
  settings.damping = 0;
  World world(settings);
  BodySettings floats;
  floats.gravity_scale = 0;
  BodySettings heavy;
  heavy.gravity_scale = 2;
  const auto asset = boxAsset(cube());
  const BodyId a = *world.addBody(asset), b = *world.addBody(asset, floats), c = *world.addBody(asset, heavy);
  run(world, 0.5);
  EXPECT_NEAR(world.motion(a).velocity[1], -9.81 * 0.5, 1e-3);
  EXPECT_NEAR(world.motion(b).velocity[1], 0, 1e-6);
  EXPECT_NEAR(world.motion(c).velocity[1], -9.81, 2e-3);
  heavy.gravity_scale = 20000;
  EXPECT_FALSE(world.setBodySettings(c, heavy));
  heavy.gravity_scale = -1;
  EXPECT_TRUE(world.setBodySettings(c, heavy));
  world.step(0.1F);
  EXPECT_NEAR(world.motion(c).velocity[1], -9.81 + 0.981, 5e-3);
}

TEST(Air, SlowsAsAQuadraticDragDoesAtAnyStep) {
  // v = v0 / (1 + k v0 t), k = 1/2 density drag area / mass.
  for (const float h : {1.0F / 240, 1.0F / 60, 0.5F}) {
    World world(vacuum());
    BodySettings settings;
    settings.drag = 2;
    const auto asset = boxAsset(cube(50));
    double area = 0;
    const BodyId body = *world.addBody(asset, settings);
    for (const auto& point : asset->package().fieldPoints()) area += double(point.area);
    world.setVelocity(body, {4, 0, 0});
    const double k = 0.5 * 1.2 * 2 * area / double(world.motion(body).mass);
    double last = world.energy(body).kinetic;
    for (int i = 0; i < std::lround(1 / h); ++i) {
      world.step(h);
      const BodyEnergy energy = world.energy(body);
      EXPECT_LE(energy.kinetic + energy.elastic, last * (1 + 1e-6)) << h;
      last = energy.kinetic + energy.elastic;
    }
    EXPECT_NEAR(world.motion(body).velocity[0], 4 / (1 + k * 4), 0.01 * 4 / (1 + k * 4)) << h;
  }
}

TEST(Air, CarriesWhatFallsAtTheSpeedWhereDragIsWeight) {
  for (const float h : {1.0F / 240, 1.0F / 60, 0.25F}) {
    WorldSettings world_settings;
    world_settings.damping = 0;
    world_settings.wind = {3, 0, 0};
    World world(world_settings);
    BodySettings settings;
    settings.drag = 20;
    const auto asset = boxAsset(cube(50));
    const BodyId body = *world.addBody(asset, settings);
    double area = 0;
    for (const auto& point : asset->package().fieldPoints()) area += double(point.area);
    for (float t = 0; t < 6; t += h) world.step(h);
    const double speed = std::sqrt(9.81 * double(world.motion(body).mass) / (0.5 * 1.2 * 20 * area));
    EXPECT_NEAR(world.motion(body).velocity[1], -speed, 0.01 * speed) << h;
    EXPECT_NEAR(world.motion(body).velocity[0], 3, 0.03) << h;
  }
}

TEST(Activity, APausedBodyIsTouchedAndADisabledOneIsNot) {
  World world;
  const auto asset = boxAsset(cube());
  const BodyId body = *world.addBody(asset);
  world.setVelocity(body, {1, 0, 0});
  world.step(1.0F / 60);
  const std::vector<Vec3> there(world.positions(body).begin(), world.positions(body).end());
  world.setActivity(body, Activity::paused);
  run(world, 0.5);
  EXPECT_TRUE(std::ranges::equal(there, world.positions(body)));
  EXPECT_FALSE(world.isAsleep(body));
  EXPECT_TRUE(world.rayCast({0, 1, 0}, {0, -1, 0}, 5));
  world.setActivity(body, Activity::disabled);
  EXPECT_FALSE(world.rayCast({0, 1, 0}, {0, -1, 0}, 5));
  world.setActivity(body, Activity::active);
  EXPECT_NEAR(world.motion(body).velocity[0], 1, 0.01);
  run(world, 0.1);
  EXPECT_GT(world.motion(body).center[0], 0.1);
}

TEST(Lists, NameAllThereIs) {
  World world;
  const auto asset = boxAsset(cube());
  const BodyId a = *world.addBody(asset), b = *world.addBody(asset), c = *world.addBody(asset);
  world.removeBody(b);
  const ColliderId wall = *world.addCollider(SphereShape{1});
  const std::array<std::uint32_t, 2> vertices = {0, 1};
  const PinSetId set = *world.addPinSet(c, vertices);
  std::vector<BodyId> bodies(5);
  ASSERT_EQ(world.bodies(bodies), 2U);
  EXPECT_EQ(bodies[0], a);
  EXPECT_EQ(bodies[1], c);
  std::array<ColliderId, 1> colliders;
  ASSERT_EQ(world.colliders(colliders), 1U);
  EXPECT_EQ(colliders[0], wall);
  std::array<PinSetId, 1> sets;
  ASSERT_EQ(world.pinSets(c, sets), 1U);
  EXPECT_EQ(sets[0], set);
}

TEST(Picks, ARayPicksTheTriangleAndALockedPickStays) {
  World world(vacuum());
  const BodyId body = *world.addBody(boxAsset(cube()));
  const PickId pick = world.pickRay({0.04F, 0.01F, 1}, {0, 0, -1}, 5);
  ASSERT_FALSE(pick == PickId{});
  const PickState picked = world.pickState(pick);
  EXPECT_EQ(picked.body, body);
  EXPECT_LT((wide(picked.point) - Vector3d(0.04, 0.01, 0.15)).norm(), 1e-5);
  EXPECT_TRUE(world.pickRay({4, 0, 1}, {0, 0, -1}, 5) == PickId{});
  world.movePick(pick, {0.04F, 0.01F, 0.5F});
  world.lockPick(pick);
  world.letGoPick(pick);
  std::array<PickId, 4> ids;
  ASSERT_EQ(world.picks(body, ids), 1U);
  run(world, 2);
  EXPECT_LT((wide(world.pickState(pick).point) - Vector3d(0.04, 0.01, 0.5)).norm(), 1e-3);
  EXPECT_EQ(world.pickAlong({0.05F, 0, 2}, {0, 0, -1}, 5, 0.1F), pick);
  EXPECT_TRUE(world.pickAlong({0.5F, 0, 2}, {0, 0, -1}, 5, 0.1F) == PickId{});
  EXPECT_TRUE(world.pickAlong({0.05F, 0, 2}, {0, 0, -2}, 5, 0.1F) == PickId{});  // no unit vector
  world.lockPick(pick, false);
  world.letGoPick(pick);
  EXPECT_EQ(world.picks(body, ids), 0U);
  world.pick(body, BodyPoint::physicalVertex(3), {0, 0, 0});
  world.pick(body, 1, {0, 0, 0});
  world.releasePicks();
  EXPECT_EQ(world.picks(body, ids), 0U);
}

TEST(Picks, PullHeavyAndLightAlike) {
  std::vector<double> reached;
  for (const double density : {10.0, 1000.0}) {
    World world(vacuum());
    const BodyId body = *world.addBody(boxAsset(cube(density)));
    const PickId pick = world.pick(body, 0, {1, 0, 0});
    run(world, 0.2);
    reached.push_back(double(world.pickState(pick).point[0]));
  }
  EXPECT_NEAR(reached[0], reached[1], 1e-3);
  EXPECT_GT(reached[0], 0);
}

TEST(Push, AHandFollowsItsCursorAtItsSpeedAndGivesWayByItsMass) {
  for (const float mass : {0.0F, 5.0F}) {
    World world(vacuum());
    const BodyId body = *world.addBody(boxAsset(cube()));
    ColliderSettings settings;
    settings.at.position = {-1, 0, 0};
    settings.most_speed = 2;
    settings.mass = mass;
    const ColliderId hand = *world.addCollider(SphereShape{0.1F}, settings);
    world.moveCollider(hand, {{1, 0, 0}});
    double given = 0;
    for (int i = 0; i < 60; ++i) {
      world.step(1.0F / 60);
      given += double(world.colliderReaction(hand).impulse[0]);
    }
    EXPECT_GT(world.motion(body).velocity[0], mass > 0 ? 0.1 : 1.5) << mass;
    EXPECT_LT(world.motion(body).velocity[0], 3) << mass;
    EXPECT_NEAR(-given, motionOf(world, body).momentum[0], 0.01 * motionOf(world, body).momentum[0]);
  }
}

TEST(TwoWay, AnOffCentreHitTurnsTheEnginesBody) {
  World world(vacuum());
  const auto asset = boxAsset(cube());
  BodySettings place;
  place.position = {-0.6F, 0.25F, 0};
  const BodyId body = *world.addBody(asset, place);
  world.setVelocity(body, {2, 0, 0});
  const double energy = world.energy(body).kinetic;
  ColliderSettings block;
  block.mass = 20;
  block.inertia = {1, 1, 1};
  const ColliderId wall = *world.addCollider(BoxShape{{0.2F, 0.3F, 0.3F}}, block);
  const Motion before = motionOf(world, body);
  Vector3d velocity = Vector3d::Zero(), omega = Vector3d::Zero(), at = Vector3d::Zero();
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  Vector3d moment = Vector3d::Zero();
  for (int i = 0; i < 60; ++i) {
    world.step(1.0F / 120);
    const ColliderReaction reaction = world.colliderReaction(wall);
    moment += at.cross(wide(reaction.impulse)) + wide(reaction.torque_impulse);
    velocity += wide(reaction.impulse) / 20;
    omega += wide(reaction.torque_impulse);
    at += velocity / 120;
    if (omega.norm() > 0) turn = Eigen::AngleAxisd(omega.norm() / 120, omega.normalized()).toRotationMatrix() * turn;
    RigidTransform to;
    to.position = {float(at[0]), float(at[1]), float(at[2])};
    for (int k = 0; k < 9; ++k) to.rotation[std::size_t(k)] = float(turn(k / 3, k % 3));
    world.moveCollider(wall, to);
  }
  const Motion after = motionOf(world, body);
  EXPECT_GT(velocity[0], 0.3);
  EXPECT_LT(omega[2], -0.2);
  EXPECT_LT((after.momentum + 20 * velocity - before.momentum).norm(), 0.01 * before.momentum.norm());
  EXPECT_LT((after.angular + moment - before.angular).norm(), 0.02 * before.momentum.norm() * 0.25);
  EXPECT_LT(world.energy(body).kinetic + 10 * velocity.squaredNorm() + 0.5 * omega.squaredNorm(), energy * 1.01);
}

/// All that can be in a world.
struct Busy {
  explicit Busy(World& made) : world(made) {
    BodySettings settings;
    settings.position = {0, 0.5F, 0};
    bodies.push_back(*world.addBody(asset, settings));
    settings.position = {0.1F, 0.9F, 0.1F};
    settings.drag = 1;
    bodies.push_back(*world.addBody(asset, settings));
    std::vector<Vec3> corners = {{-1, 0, -1}, {1, 0, -1}, {1, 0.3F, 1}, {-1, 0, 1}};
    std::vector<formats::Triangle> triangles = {{0, 2, 1}, {0, 3, 2}};
    EXPECT_TRUE(world.addCollider(MeshShape{corners, triangles}));
    hand = *world.addCollider(SphereShape{0.2F}, {.at = {{-1, 0.3F, 0}}, .most_speed = 1, .mass = 3});
    world.moveCollider(hand, {{1, 0.3F, 0}});
    world.lockPick(world.pick(bodies[1], 4, {0.2F, 1.2F, 0}));
    world.addForce(bodies[0], BodyPoint::visualVertex(2), {0, 20, 0});
  }
  std::vector<Vec3> run(int steps) {
    std::vector<Vec3> all;
    for (int i = 0; i < steps; ++i) {
      world.advance(0.013F);
      for (const BodyId body : bodies) {
        all.insert(all.end(), world.positions(body).begin(), world.positions(body).end());
      }
    }
    return all;
  }
  World& world;
  std::shared_ptr<const Asset> asset = boxAsset(cube());
  std::vector<BodyId> bodies;
  ColliderId hand;
};

WorldSettings windy() {
  WorldSettings settings;
  settings.ground.enabled = true;
  settings.wind = {2, 0, 1};
  settings.sleep_seconds = 0.5F;
  return settings;
}

TEST(Snapshots, GoOnBitForBitHereAndElsewhere) {
  World world(windy());
  Busy busy(world);
  busy.run(20);
  world.addForce(busy.bodies[1], {5, 0, 0});
  std::vector<std::byte> bytes(world.snapshotBytes());
  ASSERT_EQ(world.saveSnapshot(bytes), bytes.size());
  EXPECT_EQ(world.saveSnapshot(std::span(bytes).first(bytes.size() - 1)), 0U);
  const std::vector<Vec3> expected = busy.run(60);
  world.removeBody(busy.bodies[0]);
  world.removeCollider(busy.hand);
  ASSERT_TRUE(world.addBody(busy.asset));
  world.settings().gravity = {0, 0, 0};
  auto restored = world.restoreSnapshot(bytes);
  ASSERT_TRUE(restored) << restored.reason();
  EXPECT_EQ(*restored, bytes.size());
  std::vector<std::byte> again(world.snapshotBytes());
  ASSERT_EQ(world.saveSnapshot(again), bytes.size());
  EXPECT_TRUE(busy.run(60) == expected);
  World other;
  EXPECT_FALSE(other.restoreSnapshot(bytes));
  restored = other.restoreSnapshot(bytes, std::array{busy.asset});
  ASSERT_TRUE(restored) << restored.reason();
  const auto play = [&] {
    std::vector<Vec3> all;
    for (int i = 0; i < 60; ++i) {
      other.advance(0.013F);
      for (const BodyId body : busy.bodies) {
        all.insert(all.end(), other.positions(body).begin(), other.positions(body).end());
      }
    }
    return all;
  };
  EXPECT_TRUE(play() == expected);
}

TEST(Snapshots, DamagedBytesAreRefusedAndChangeNothing) {
  World world(windy());
  Busy busy(world);
  busy.run(20);
  std::vector<std::byte> bytes(world.snapshotBytes()), now(bytes.size());
  ASSERT_EQ(world.saveSnapshot(bytes), bytes.size());
  busy.run(3);
  now.resize(world.snapshotBytes());
  world.saveSnapshot(now);
  for (std::size_t size = 0; size < bytes.size(); size += 1 + size / 5) {
    EXPECT_FALSE(world.restoreSnapshot(std::span(bytes).first(size))) << size;
  }
  for (std::size_t place = 0; place < bytes.size(); place += 1 + place / 40) {
    auto damaged = bytes;
    damaged[place] ^= std::byte{1};
    EXPECT_FALSE(world.restoreSnapshot(damaged)) << place;
  }
  std::vector<std::byte> after(world.snapshotBytes());
  world.saveSnapshot(after);
  EXPECT_TRUE(after == now);
}

}  // namespace
}  // namespace sinew::test

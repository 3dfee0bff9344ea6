// SPDX-License-Identifier: MIT
//
// Bodies against the shapes that a game hands in.
#include <gtest/gtest.h>

#include <random>

#include "tests/runtime/world_state.h"
#include "tests/support/touching_box.h"

namespace sinew::test {
namespace {

using Eigen::Vector3d;

/// A cube of 0.3 m, whose diagonal is 0.52 m.
BoxOptions cube() {
  BoxOptions box;
  box.size = {0.3, 0.3, 0.3};
  box.stretch_hz = box.bend_hz = box.twist_hz = 15;
  return box;
}

struct Surface {
  std::vector<Vec3> positions;
  std::vector<formats::Triangle> triangles;
};

/// y over a square about the origin, of 2 x side metres and n x n cells, its front above.
template <class Height>
Surface surface(double side, std::uint32_t n, const Height& height) {
  Surface s;
  for (std::uint32_t i = 0; i <= n; ++i) {
    for (std::uint32_t j = 0; j <= n; ++j) {
      const double x = side * (2.0 * j / n - 1), z = side * (2.0 * i / n - 1);
      s.positions.push_back({float(x), float(height(x, z)), float(z)});
    }
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * (n + 1) + j, c = a + n + 1;
      s.triangles.push_back({a, c, a + 1});
      s.triangles.push_back({a + 1, c, c + 1});
    }
  }
  return s;
}

double bowl(double x, double z) { return 0.5 * (x * x + z * z); }

struct Named {
  const char* name;
  ColliderShape shape;
  RigidTransform at;
};

/// Each kind, its top at y = 0 about the origin (the bowl's bottom, the hills' valley).
struct Shapes {
  Shapes() {
    for (int i = 0; i < 8; ++i) {
      corners.push_back({i % 2 != 0 ? 1.0F : -1.0F, i / 2 % 2 != 0 ? 0.0F : -0.5F, i / 4 != 0 ? 1.0F : -1.0F});
    }
    for (int i = 0; i < 21 * 21; ++i) heights.push_back(float(bowl(0.1 * (i % 21 - 10), 0.1 * (i / 21 - 10))));
    all = {{"plane", PlaneShape{}, {}},
           {"sphere", SphereShape{1}, {{0, -1, 0}}},
           {"capsule", CapsuleShape{0.5F, 1}, {{0, -0.5F, 0}, {0, 1, 0, -1, 0, 0, 0, 0, 1}}},
           {"box", BoxShape{{1, 0.5F, 1}}, {{0, -0.5F, 0}}},
           {"hull", HullShape{corners}, {}},
           {"mesh", MeshShape{dish.positions, dish.triangles}, {}},
           {"height field", HeightFieldShape{heights, 21, 0.1F}, {{-1, 0, -1}}}};
  }
  std::vector<Vec3> corners;
  Surface dish = surface(1, 20, bowl);
  std::vector<float> heights;
  std::vector<Named> all;
};

Mat3 turned(double angle, const Vector3d& axis) {
  const Eigen::Matrix3d r = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
  Mat3 result;
  for (int i = 0; i < 9; ++i) result[std::size_t(i)] = float(r(i / 3, i % 3));
  return result;
}

BodySettings placed(double x, double y, double z, const Mat3& rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}) {
  BodySettings settings;
  settings.position = {float(x), float(y), float(z)};
  settings.rotation = rotation;
  return settings;
}

void throwBody(World& world, BodyId body, const Vector3d& velocity, const Vector3d& spin = Vector3d::Zero()) {
  const std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
  const Vector3d center = motionOf(world, body).center;
  std::vector<Vec3> v;
  for (const Vec3& p : x) {
    const Vector3d own = velocity + spin.cross(wide(p) - center);
    v.push_back({float(own[0]), float(own[1]), float(own[2])});
  }
  world.setState(body, x, v);
}

TEST(Colliders, APlaneIsTheGround) {
  const auto asset = boxAsset(cube());
  for (const float restitution : {0.0F, 0.8F}) {
    WorldSettings grounded;
    grounded.ground.enabled = true;
    grounded.ground.restitution = restitution;
    World ground(grounded), plane;
    ColliderSettings settings;
    settings.restitution = restitution;
    ASSERT_TRUE(plane.addCollider(PlaneShape{}, settings));
    const BodyId a = *ground.addBody(asset, placed(0, 0.5, 0, turned(0.4, {1, 0, 1})));
    const BodyId b = *plane.addBody(asset, placed(0, 0.5, 0, turned(0.4, {1, 0, 1})));
    for (int i = 0; i < 120; ++i) {
      ground.step(1.0F / 60);
      plane.step(1.0F / 60);
      ASSERT_TRUE(std::ranges::equal(ground.positions(a), plane.positions(b))) << restitution << ' ' << i;
    }
    EXPECT_NE(ground.colliderReaction(kGroundCollider).impulse[1], 0);
  }
}

// On ice a body's turn about the vertical decays as it says, or as the world does; a snapshot keeps which.
TEST(Colliders, ABodyMayTurnOnWhatCarriesIt) {
  for (const float own : {-1.0F, 0.0F, 1.0F}) {
    WorldSettings settings;
    settings.damping = 0;
    settings.support_damping = 2;
    settings.ground.enabled = true;
    settings.ground.friction = 0;
    World world(settings);
    BodySettings given = placed(0, 0.31, 0);
    given.support_damping = own;
    given.stiffness_scale = 3;
    const BodyId body = *world.addBody(boxAsset(cube()), given);
    run(world, 2);
    std::vector<std::byte> snapshot(world.snapshotBytes());
    ASSERT_TRUE(world.saveSnapshot(snapshot));
    BodySettings other = given;
    other.support_damping = 9;
    ASSERT_TRUE(world.setBodySettings(body, other));
    ASSERT_TRUE(world.restoreSnapshot(snapshot));
    EXPECT_EQ(world.bodySettings(body).support_damping, own);
    world.setVelocity(body, {0, 0, 0}, {0, 1, 0});
    run(world, 1);
    // Minimizing leaves a turn on ice up to 6 % of itself off, either way.
    EXPECT_NEAR(world.motion(body).angular_velocity[1], std::exp(own < 0 ? -2 : -own), 0.08) << own;
  }
}

TEST(Colliders, ABodyComesToRestOnEachShape) {
  const Shapes shapes;
  const auto asset = boxAsset(cube());
  for (const Named& shape : shapes.all) {
    SCOPED_TRACE(shape.name);
    World world;
    ColliderSettings settings;
    settings.at = shape.at;
    const ColliderId collider = *world.addCollider(shape.shape, settings);
    const BodyId body = *world.addBody(asset, placed(0, 0.3, 0));
    run(world, 5);
    EXPECT_LT(rmsSpeed(world, body), 1e-3);
    const Motion m = motionOf(world, body);
    EXPECT_NEAR(m.center[0], 0, 0.03);
    EXPECT_NEAR(m.center[2], 0, 0.03);
    // What carries it is its weight.
    const ColliderReaction reaction = world.colliderReaction(collider);
    EXPECT_NEAR(reaction.impulse[1] * 60, -9.81 * m.mass, 0.01 * 9.81 * m.mass);
    EXPECT_NEAR(reaction.impulse[0] * 60, 0, 0.01 * 9.81 * m.mass);
  }
}

TEST(Colliders, NothingPassesAt100MetresASecond) {
  const auto asset = boxAsset(cube());
  // A wall of two triangles across z, its front towards +z.
  const Surface wall = {{{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}};
  const std::vector<float> flat(41 * 41, 0.0F);
  const Mat3 upright = turned(M_PI / 2, {1, 0, 0});  // y becomes z
  const std::vector<Named> shapes = {{"box", BoxShape{{1, 1, 0.005F}}, {}},
                                     {"mesh", MeshShape{wall.positions, wall.triangles}, {}},
                                     {"height field", HeightFieldShape{flat, 41, 0.05F}, {{-1, 1, 0}, upright}}};
  for (const Named& shape : shapes) {
    for (int way = 0; way < 12; ++way) {
      SCOPED_TRACE(testing::Message() << shape.name << " " << way);
      World world(weightless());
      ColliderSettings settings;
      settings.at = shape.at;
      ASSERT_TRUE(world.addCollider(shape.shape, settings));
      // From anywhere within a step's reach, turned anyhow, and a little aslant at what is wide.
      const BodyId body = *world.addBody(asset, placed(0, 0, 0.4 + 0.13 * way, turned(0.5 * way, {1, 0.3 * way, 0.2})));
      const double aslant = shape.shape.index() == 1 ? 0 : 4 * (way % 3);
      throwBody(world, body, {aslant, 0, -100});
      for (int i = 0; i < 40; ++i) {
        world.step(1.0F / 60);
        ASSERT_TRUE(allFinite(world, body));
      }
      const Motion m = motionOf(world, body);
      EXPECT_GT(m.center[2], 0) << "passed";
    }
  }
}

TEST(Colliders, MomentumGoesIntoTheCollider) {
  const Shapes shapes;
  const auto asset = boxAsset(cube());
  for (const Named& shape : shapes.all) {
    SCOPED_TRACE(shape.name);
    WorldSettings settings = weightless();
    settings.damping = 0;
    World world(settings);
    ColliderSettings collider_settings;
    collider_settings.at = shape.at;
    const ColliderId collider = *world.addCollider(shape.shape, collider_settings);
    const BodyId body = *world.addBody(asset, placed(0.05, 0.4, 0.02, turned(0.5, {1, 0, 1})));
    throwBody(world, body, {1, -3, 0.5}, {2, 1, 0});
    double passed = 0;
    for (int i = 0; i < 60; ++i) {
      const Vector3d before = motionOf(world, body).momentum;
      world.step(1.0F / 60);
      const Vector3d impulse = wide(world.colliderReaction(collider).impulse);
      ASSERT_LT((motionOf(world, body).momentum - before + impulse).norm(), 1e-6 * (before.norm() + impulse.norm()))
          << i;
      passed += impulse.norm();
    }
    EXPECT_GT(passed, 10);
  }
}

TEST(Colliders, EnergyNeverGrows) {
  const Shapes shapes;
  const auto asset = boxAsset(cube());
  std::mt19937 random(3);
  std::uniform_real_distribution<double> in(-1, 1);
  for (const Named& shape : shapes.all) {
    double worst = -1;
    WorldSettings still;
    still.damping = 0;
    World world(still);
    ColliderSettings settings;
    settings.at = shape.at;
    ASSERT_TRUE(world.addCollider(shape.shape, settings));
    for (int t = 0; t < 143; ++t) {
      const BodyId body = *world.addBody(asset, placed(0.3 * in(random), 0.6, 0.3 * in(random),
                                                       turned(3 * in(random), {in(random), in(random), in(random)})));
      throwBody(world, body, Vector3d(2 * in(random), -5 + 5 * in(random), 2 * in(random)),
                5 * Vector3d(in(random), in(random), in(random)));
      const auto energy = [&] {
        const Motion m = motionOf(world, body);
        const BodyEnergy e = world.energy(body);
        return e.kinetic + e.elastic + 9.81 * m.mass * (m.center[1] + 2);
      };
      // Its contacts' springs may give back what they took.
      const double start = energy();
      for (int i = 0; i < 30; ++i) {
        world.step(1.0F / 60);
        worst = std::max(worst, energy() / start - 1);
      }
      world.removeBody(body);
    }
    EXPECT_LT(worst, 1e-5) << shape.name;
  }
}

TEST(Colliders, PoseIsWhereItIsNotWhereItWasTold) {
  World world;
  ColliderSettings settings;
  settings.at = {{1, 2, 3}, turned(0.3, {0, 1, 0})};
  settings.most_speed = 3;
  const ColliderId hand = *world.addCollider(SphereShape{0.1F}, settings);
  world.moveCollider(hand, {{11, 2, 3}, settings.at.rotation});
  world.step(0.1F);
  const RigidTransform at = world.colliderPose(hand);
  EXPECT_NEAR(at.position[0], 1.3, 1e-5);
  EXPECT_NEAR(at.position[2], 3, 1e-6);
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(at.rotation[i], settings.at.rotation[i], 1e-6) << i;
}

// A cube laid flush on a slope, as a level's editor does, whose lowest points rounding has on either side of it.
TEST(Colliders, HoldWhatIsLaidFlushOnThem) {
  const std::vector<Vec3> corners = {{-5, 0, -5}, {5, 0, -5}, {5, 0, 5}, {-5, 0, 5}};
  const std::vector<formats::Triangle> triangles = {{0, 2, 1}, {0, 3, 2}};
  const auto asset = boxAsset(cube());
  for (const double degrees : {0.0, 7.0, 15.0, 25.0, 33.0}) {
    World world;
    const Mat3 slope = turned(degrees * M_PI / 180, {0, 0, 1});
    ColliderSettings settings;
    settings.at = {{0, 0, 0}, slope};
    settings.friction = 1.5F;
    ASSERT_TRUE(world.addCollider(MeshShape{corners, triangles}, settings));
    const double half = 0.5 * double(asset->package().info().bounds_max[1] - asset->package().info().bounds_min[1]);
    BodySettings firm = placed(-half * double(slope[3]), half * double(slope[0]), 0, slope);
    firm.stiffness_scale = 5;
    const BodyId body = *world.addBody(asset, firm);
    const Vector3d start = motionOf(world, body).center;
    run(world, 3);
    EXPECT_LT((motionOf(world, body).center - start).norm(), 0.03 * half) << degrees;
  }
}

// Belts that stand still: a floor, a drum of many edges, a wire, whose points are of the other kind.
TEST(Colliders, ABeltTakesABodyAlong) {
  const auto asset = touchingBox({0.3, 0.3, 0.3}, 4);
  for (const float h : {1.0F / 60, 1.0F / 240}) {
    for (const bool wires : {false, true}) {
      WorldSettings airless;  // against the air's drag a body on wires, whose contacts come and go, creeps by 2.5 %
      airless.damping = 0;
      World world(airless);
      std::vector<ColliderId> belts;
      for (const float z : {-0.1F, 0.1F}) {
        ColliderSettings belt;
        // Its own axes are turned: along its -z it runs along the world's x.
        belt.at = {{0, wires ? -0.01F : -0.5F, wires ? z : 0}, turned(-M_PI / 2, {0, 1, 0})};
        belt.surface_velocity = {0, 0, -0.8F};
        const Vec3 half = wires ? Vec3{0.01F, 0.01F, 5} : Vec3{5, 0.5F, 5};
        belts.push_back(*world.addCollider(BoxShape{half}, belt));
        if (!wires) break;
      }
      BodySettings firm = placed(0, 0.151, 0);
      firm.stiffness_scale = 5;
      const BodyId body = *world.addBody(asset, firm);
      for (float t = 0; t < 2; t += h) world.step(h);
      EXPECT_NEAR(motionOf(world, body).momentum[0] / motionOf(world, body).mass, 0.8, 0.02) << wires << ' ' << h;
      for (const ColliderId belt : belts) {
        ColliderSettings stopped = world.colliderSettings(belt);
        EXPECT_EQ(stopped.surface_velocity[2], -0.8F);
        stopped.surface_velocity = {};
        ASSERT_TRUE(world.setColliderSettings(belt, stopped));
      }
      for (float t = 0; t < 2; t += h) world.step(h);
      EXPECT_NEAR(motionOf(world, body).momentum[0] / motionOf(world, body).mass, 0, 0.005) << wires << ' ' << h;
    }
  }
}

// Friction pulls what a belt cannot take along, and a sleeper on it wakes.
TEST(Colliders, ABeltPullsNoMoreThanFrictionDoes) {
  const auto asset = touchingBox({0.3, 0.3, 0.3}, 4);
  WorldSettings sleepy;
  sleepy.sleep_seconds = 0.25F;
  sleepy.damping = 0;
  World world(sleepy);
  ColliderSettings belt;
  belt.at.position = {0, -0.5F, 0};
  belt.friction = 0.3F;
  const ColliderId floor = *world.addCollider(BoxShape{{50, 0.5F, 50}}, belt);
  BodySettings firm = placed(0, 0.151, 0);
  firm.stiffness_scale = 5;
  firm.friction = 0.3F;
  const BodyId body = *world.addBody(asset, firm);
  run(world, 3);
  ASSERT_TRUE(world.isAsleep(body));
  belt = world.colliderSettings(floor);
  belt.surface_velocity = {20, 0, 0};
  ASSERT_TRUE(world.setColliderSettings(floor, belt));
  run(world, 1);
  EXPECT_FALSE(world.isAsleep(body));
  EXPECT_NEAR(motionOf(world, body).momentum[0] / motionOf(world, body).mass, 0.3 * 9.81, 0.15);
  belt.surface_velocity = {std::numeric_limits<float>::quiet_NaN(), 0, 0};
  EXPECT_FALSE(world.setColliderSettings(floor, belt));
}

TEST(Colliders, AMovingFloorTakesABodyAlong) {
  const auto asset = boxAsset(cube());
  World world;
  const ColliderId floor = *world.addCollider(BoxShape{{2, 0.5F, 2}}, {{{0, -0.5F, 0}}});
  const BodyId body = *world.addBody(asset, placed(0, 0.151, 0));
  run(world, 1);
  // A turntable, then a sledge: both begin gently.
  double angle = 0, x = 0;
  for (int i = 0; i < 90; ++i) {
    angle += 0.01 * std::min(i, 30) / 30;
    world.moveCollider(floor, {{0, -0.5F, 0}, turned(angle, {0, 1, 0})});
    world.step(1.0F / 60);
  }
  Mat3 rotation;
  Vec3 translation;
  world.rigidMotion(body, rotation, translation);
  EXPECT_NEAR(std::atan2(rotation[2], rotation[0]), angle, 0.01);
  for (int i = 0; i < 120; ++i) {
    x += std::min(i, 60) / 60.0 / 60;
    world.moveCollider(floor, {{float(x), -0.5F, 0}, turned(angle, {0, 1, 0})});
    world.step(1.0F / 60);
  }
  EXPECT_NEAR(motionOf(world, body).center[0], x, 2e-3);
  EXPECT_NEAR(motionOf(world, body).momentum[0] / motionOf(world, body).mass, 1, 1e-2);
}

// What begins within a convex collider comes out on one side, as it is: its points do not part to several.
TEST(Colliders, WhatBeginsInsideComesOutWhole) {
  const auto asset = boxAsset(cube());
  std::vector<Vec3> corners;
  for (int i = 0; i < 8; ++i) {
    const auto side = [i](int bit) { return (i >> bit & 1) != 0 ? 0.4F : -0.4F; };
    corners.push_back({side(0), side(1), side(2)});
  }
  const std::array<ColliderShape, 4> shapes = {BoxShape{{0.4F, 0.4F, 0.4F}}, SphereShape{0.4F},
                                               CapsuleShape{0.3F, 0.5F}, HullShape{corners}};
  for (const ColliderShape& shape : shapes) {
    for (const Vector3d& start : {Vector3d(0.02, 0.01, 0), Vector3d(0.1, 0.15, 0.05)}) {
      World world(weightless());
      ASSERT_TRUE(world.addCollider(shape));
      const BodyId body = *world.addBody(asset, placed(start.x(), start.y(), start.z()));
      for (int i = 0; i < 900; ++i) world.step(1.0F / 60);
      EXPECT_GT(Eigen::Map<const Eigen::Vector3f>(world.motion(body).center.data()).norm(), 0.35);
      const auto x = world.positions(body);
      double longest = 0;
      for (const Vec3& a : x) {
        for (const Vec3& b : x)
          longest = std::max(longest, std::hypot(double(a[0] - b[0]), double(a[1] - b[1]), double(a[2] - b[2])));
      }
      EXPECT_LT(longest, 1.05 * 0.3 * std::sqrt(3.0)) << shape.index() << " at " << start.transpose();
    }
  }
}

// A step as long as a hitch in which a body meets the ground ends there, not where it began.
TEST(Colliders, LongStepsEndAtTheGround) {
  BoxOptions hard = cube();
  hard.stretch_hz = hard.bend_hz = hard.twist_hz = 100;
  const auto asset = boxAsset(hard);
  for (const float step : {0.2F, 0.3F, 0.5F, 1.0F}) {
    for (const double height : {0.3, 1.0, 2.0}) {
      World world;
      ASSERT_TRUE(world.addCollider(PlaneShape{}));
      const BodyId body = *world.addBody(asset, placed(0, height, 0));
      throwBody(world, body, {0, -5, 0});
      for (int i = 0; i < 20; ++i) world.step(step);
      EXPECT_NEAR(world.visualBounds(body).low[1], 0, 0.01) << step << ' ' << height;
    }
  }
}

TEST(Colliders, RestitutionIsThePartOfTheSpeedThatIsLeft) {
  BoxOptions hard = cube();
  hard.stretch_hz = hard.bend_hz = hard.twist_hz = 200;
  const auto asset = boxAsset(hard);
  for (const float e : {0.0F, 0.5F, 1.0F}) {
    for (const double height : {0.2, 0.3, 0.4}) {
      WorldSettings settings;
      settings.damping = 0;
      World world(settings);
      ColliderSettings floor;
      floor.at.position = {0, -0.5F, 0};
      floor.restitution = e;
      ASSERT_TRUE(world.addCollider(BoxShape{{2, 0.5F, 2}}, floor));
      const BodyId body = *world.addBody(asset, placed(0, 0.15 + height, 0));
      double fastest = 0, left = 0;
      for (int i = 0; i < 40; ++i) {
        world.step(1.0F / 60);
        const double up = motionOf(world, body).momentum[1] / motionOf(world, body).mass;
        fastest = std::min(fastest, up);
        left = std::max(left, up);
      }
      // A step's weight goes into the floor as well.
      const double fall = 9.81 / 60, a = -fastest;
      EXPECT_NEAR(left, std::sqrt(fall * fall + double(e * e) * a * a) - fall, 0.03 * a);
    }
  }
}

// The two sides push thousands of times as hard as what they push together: only that is returned.
TEST(Colliders, WhatIsSqueezedBouncesOffNeitherSide) {
  const auto asset = boxAsset(cube());
  for (const float e : {0.05F, 0.5F, 1.0F}) {
    for (const bool below : {false, true}) {
      World world;
      ColliderSettings floor, press;
      floor.restitution = below ? e : 0;
      press.restitution = below ? 0 : e;
      ASSERT_TRUE(world.addCollider(PlaneShape{}, floor));
      const BodyId body = *world.addBody(asset, placed(0, 0.15, 0));
      double bottom = 0.31;
      press.at.position = {0.02F, float(bottom + 0.1), 0.01F};
      const auto box = world.addCollider(BoxShape{{0.5F, 0.1F, 0.5F}}, press);
      ASSERT_TRUE(box);
      double fastest = 0;
      for (int i = 0; i < 120; ++i) {
        bottom = std::max(0.21, bottom - 0.2 / 60);
        world.moveCollider(*box, {{0.02F, float(bottom + 0.1), 0.01F}});
        world.step(1.0F / 60);
        const Motion now = motionOf(world, body);
        fastest = std::max(fastest, now.momentum.norm() / now.mass);
      }
      EXPECT_LT(fastest, 0.4) << e << ' ' << below;  // twice as fast as the press comes
    }
  }
}

// A slender bar that falls aslant: its ends arrive again and again as it rings.
TEST(Colliders, RestitutionMakesNoEnergy) {
  BoxOptions slender;
  slender.size = {1, 0.1F, 0.1F};
  slender.cells = {8, 1, 1};
  const auto asset = boxAsset(slender);
  for (const float e : {0.3F, 0.5F, 0.8F, 1.0F}) {
    for (const float rate : {60.0F, 240.0F}) {
      World world;
      ColliderSettings floor;
      floor.restitution = e;
      ASSERT_TRUE(world.addCollider(PlaneShape{}, floor));
      BodySettings aslant = placed(0, 2, 0);
      aslant.rotation = {0.9F, -0.435889894F, 0, 0.435889894F, 0.9F, 0, 0, 0, 1};
      const BodyId body = *world.addBody(asset, aslant);
      const auto energyOf = [&] {
        const auto motion = world.motion(body);
        const auto energy = world.energy(body);
        return motion.mass * 9.81 * double(motion.center[1]) + energy.kinetic + energy.elastic;
      };
      const double before = energyOf();
      double most = 0;
      for (int i = 0; i < int(3 * rate); ++i) {
        world.step(1 / rate);
        most = std::max(most, energyOf());
      }
      EXPECT_LT(most, 1.01 * before) << e << ' ' << rate;
    }
  }
}

TEST(Colliders, AColliderWithAMassGivesWay) {
  const auto asset = boxAsset(cube());
  // Thrown at a wall, at a block of its own mass (as an engine would: it goes on from where the step has left it), at a
  // feather.
  for (const float mass : {0.0F, 1.0F, 0.01F}) {
    WorldSettings settings = weightless();
    settings.damping = 0;
    World world(settings);
    ColliderSettings block;
    const BodyId body = *world.addBody(asset, placed(0, 0.3, 0));
    const double m = motionOf(world, body).mass;
    block.mass = mass * float(m);
    const ColliderId collider = *world.addCollider(BoxShape{{0.15F, 0.15F, 0.15F}}, block);
    throwBody(world, body, {0, -1, 0});
    double velocity = 0;
    for (int i = 0; i < 60; ++i) {
      const double place = double(world.colliderPose(collider).position[1]) + velocity / 60;
      world.moveCollider(collider, {{0, float(place), 0}});
      world.step(1.0F / 60);
      const double impulse = double(world.colliderReaction(collider).impulse[1]);
      if (mass > 0) velocity += impulse / double(block.mass);
    }
    const double left = motionOf(world, body).momentum[1] / m;
    if (mass == 0) {
      EXPECT_GT(left, 0);
    } else {
      EXPECT_NEAR(double(mass) * velocity + left, -1, 1e-3);
      EXPECT_LE(double(mass) * velocity * velocity + left * left, 1.001);
      EXPECT_LE(velocity, -1 / (1 + double(mass)));  // no less than what sticks
    }
  }
}

/// A box of an engine, dropped onto a body that rests on the ground.
struct Crate {
  /// \param part of the body's mass.
  Crate(World& in, BodyId on, double part, double half, double drop)
      : world(in), mass(part * motionOf(in, on).mass), moment(mass * half * half * 2 / 3) {
    ColliderSettings box;
    box.mass = float(mass);
    box.inertia = {float(moment), float(moment), float(moment)};
    box.at.position = {0.02F, in.physicalBounds(on).high[1] + float(half + drop), 0};
    const float size = float(half);
    collider = *in.addCollider(BoxShape{{size, size, size}}, box);
  }
  /// What docs/runtime.md tells an engine to do in a step.
  void step(float h) {
    velocity[1] -= 9.81 * double(h);
    RigidTransform at = world.colliderPose(collider);
    const Vector3d place = wide(at.position) + double(h) * velocity;
    Eigen::Matrix3d rotation;
    for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = double(at.rotation[std::size_t(i)]);
    rotation = Eigen::AngleAxisd(double(h) * spin.norm(), spin.stableNormalized()) * rotation;
    for (int i = 0; i < 9; ++i) at.rotation[std::size_t(i)] = float(rotation(i / 3, i % 3));
    at.position = {float(place[0]), float(place[1]), float(place[2])};
    world.moveCollider(collider, at);
    world.step(h);
    const ColliderReaction got = world.colliderReaction(collider);
    velocity += wide(got.impulse) / mass;
    spin += wide(got.torque_impulse) / moment;
  }
  World& world;
  ColliderId collider;
  double mass, moment;
  Vector3d velocity = Vector3d::Zero(), spin = Vector3d::Zero();
};

// From a thirtieth of the body's mass to three of it, dropped from as high as it is.
TEST(Colliders, AnEnginesBoxesRest) {
  const auto asset = touchingBox({0.5, 0.5, 0.5}, 6);
  WorldSettings ground;
  ground.ground.enabled = true;
  for (const float stiffness : {3.0F, 30.0F}) {
    for (const double part : {0.03, 0.1, 0.3, 1.0, 3.0}) {
      if (stiffness == 3.0F && part > 1) continue;  // it buckles
      for (const double drop : {0.01, 0.5}) {
        if (part > 1 && drop > 0.1) continue;  // it rocks on (docs/decisions/0035-held.md)
        World world(ground);
        BodySettings firm = placed(0, 0.25, 0);
        firm.stiffness_scale = stiffness;
        const BodyId body = *world.addBody(asset, firm);
        run(world, 2);
        Crate crate(world, body, part, 0.2, drop);
        double fastest = 0;
        for (int i = 0; i < 900; ++i) {
          const Vector3d before = wide(world.colliderPose(crate.collider).position);
          crate.step(1.0F / 60);
          const Vector3d way = wide(world.colliderPose(crate.collider).position) - before;
          if (i >= 720) fastest = std::max(fastest, 60 * way.norm());
        }
        EXPECT_LT(fastest, 0.05) << stiffness << ' ' << part << ' ' << drop;
        EXPECT_GT(world.colliderPose(crate.collider).position[1], 0.6F) << stiffness << ' ' << part << ' ' << drop;
      }
    }
  }
}

/// How far what is drawn of a body is from a place, m.
double wayTo(const World& world, BodyId body, const Vector3d& place) {
  const Vec3 at = {float(place[0]), float(place[1]), float(place[2])};
  return (wide(world.placeOf(body, world.nearestPoint(body, at))) - place).norm();
}

/// Whether a collider pushes though nothing is near a segment of it, of this radius.
bool pushesThroughAGap(const World& world, ColliderId collider, BodyId body, const Vector3d& from, const Vector3d& to,
                       double radius) {
  if (wide(world.colliderReaction(collider).impulse).norm() < 1e-3) return false;
  double least = 1e9;
  for (int i = 0; i <= 20; ++i) least = std::min(least, wayTo(world, body, from + i / 20.0 * (to - from)));
  return least > radius + 0.05;
}

// A point that goes on beyond the end of what it touched is not carried by the plane that it had there.
TEST(Colliders, PushOnlyWhatTheyTouch) {
  const auto asset = touchingBox({0.3, 0.3, 0.3}, 8);
  for (const float radius : {0.03F, 0.08F}) {
    for (const double x : {0.0, 0.05, 0.1, 0.14, 0.18}) {
      World world;
      ColliderSettings rail;
      rail.at.rotation = turned(M_PI / 2, {1, 0, 0});
      const ColliderId collider = *world.addCollider(CapsuleShape{radius, 1}, rail);
      const BodyId body = *world.addBody(asset, placed(x, 0.3, 0, turned(0.4, {0, 1, 0})));
      for (int i = 0; i < 180; ++i) {
        world.step(1.0F / 60);
        ASSERT_FALSE(pushesThroughAGap(world, collider, body, {0, 0, -1}, {0, 0, 1}, double(radius)))
            << radius << ' ' << x << ' ' << i;
      }
    }
  }
  for (const float friction : {0.0F, 0.6F}) {
    for (const double z : {0.0, 0.1, 0.2}) {
      WorldSettings ground;
      ground.ground.enabled = true;
      World world(ground);
      ColliderSettings walker;
      walker.friction = friction;
      walker.at.position = {-1.5F, 0.9F, 0};
      const ColliderId collider = *world.addCollider(CapsuleShape{0.35F, 0.55F}, walker);
      const BodyId body = *world.addBody(asset, placed(0, 0.2, z));
      for (int i = 0; i < 240; ++i) {
        const double x = i < 60 ? std::min(2.0, -1.5 + 7 * i / 60.0) : std::max(-1.5, 2 - 7 * (i - 60) / 60.0);
        world.moveCollider(collider, {{float(x), 0.9F, 0}});
        world.step(1.0F / 60);
        ASSERT_FALSE(pushesThroughAGap(world, collider, body, {x, 0.35, 0}, {x, 1.45, 0}, 0.35))
            << friction << ' ' << z << ' ' << i;
      }
    }
  }
}

// What a hand gives way by is no distance at which it pushes.
TEST(Colliders, AHandPressesWhatItTouchesAndLetsGo) {
  const auto asset = touchingBox({0.3, 0.3, 0.3}, 8);
  WorldSettings ground;
  ground.ground.enabled = true;
  for (const float mass : {0.5F, 5.0F, 50.0F}) {
    World world(ground);
    ColliderSettings plate;
    plate.most_speed = 3;
    plate.mass = mass;
    plate.at.position = {0, 0.8F, 0};
    const ColliderId hand = *world.addCollider(BoxShape{{0.2F, 0.1F, 0.2F}}, plate);
    const BodyId body = *world.addBody(asset, placed(0, 0.16, 0));
    for (int i = 0; i < 360; ++i) {
      world.moveCollider(hand, {{0, i < 240 ? 0.2F : 1.0F, 0}});
      world.step(1.0F / 60);
      const double under = double(world.colliderPose(hand).position[1]) - 0.1;
      if (world.colliderReaction(hand).impulse[1] > 1e-3F) {
        ASSERT_LT(under - double(world.physicalBounds(body).high[1]), 0.01) << mass << ' ' << i;
      }
    }
    EXPECT_EQ(world.colliderReaction(hand).impulse[1], 0) << mass;
    EXPECT_NEAR(world.colliderPose(hand).position[1], 1, 1e-3) << mass;
  }
}

/// Force of a tool that a soft block on the ground holds up, N: least, mean and most in its last second.
struct Held {
  double least = 1e9, mean = 0, most = 0, fastest = 0;
};

Held pressedBy(const ColliderShape& tool, double half_height, const std::function<double(int)>& lengthOf) {
  WorldSettings ground;
  ground.ground.enabled = true;
  World world(ground);
  BodySettings firm = placed(0, 0.05, 0);
  firm.stiffness_scale = 30;
  const BodyId body = *world.addBody(touchingBox({0.2, 0.1, 0.2}, 6), firm);
  ColliderSettings at;
  double height = 0.11 + half_height;
  at.at.position = {0.01F, float(height), 0.013F};
  const ColliderId collider = *world.addCollider(tool, at);
  Held held;
  double impulse = 0, since = 0;
  int step = 0;
  for (double time = 0; time < 5;) {
    const double h = lengthOf(step++);
    height = std::max(0.08 + half_height, height - 0.2 * h);
    world.moveCollider(collider, {{0.01F, float(height), 0.013F}});
    world.step(float(h));
    time += h;
    if (time < 4) continue;
    const double got = double(world.colliderReaction(collider).impulse[1]);
    held.least = std::min(held.least, got / h);
    held.most = std::max(held.most, got / h);
    held.fastest = std::max(held.fastest, rmsSpeed(world, body));
    impulse += got;
    since += h;
  }
  held.mean = impulse / since;
  return held;
}

// A prediction falls by g h^2, here by as much as the tool is deep in the block: what is held up does not.
TEST(Colliders, AStillToolIsPushedAlikeAtEveryStep) {
  const std::vector<std::tuple<const char*, ColliderShape, double>> tools = {
      {"blade", BoxShape{{0.012F, 0.05F, 0.002F}}, 0.05},
      {"needle", CapsuleShape{0.004F, 0.05F}, 0.054},
      {"ball", SphereShape{0.02F}, 0.02},
      {"bar", BoxShape{{0.03F, 0.02F, 0.03F}}, 0.02}};
  std::mt19937 random(5);
  const auto jitter = [&random](int) { return 0.004 + 0.026 * double(random()) / 4294967296.0; };
  for (const auto& [name, tool, half_height] : tools) {
    const double fine = pressedBy(tool, half_height, [](int) { return 0.002; }).mean;
    EXPECT_GT(fine, 0.1) << name;
    for (const auto& [steps, lengthOf] :
         {std::pair<const char*, std::function<double(int)>>{"60", [](int) { return 1.0 / 60; }},
          {"30", [](int) { return 1.0 / 30; }},
          {"alternating", [](int i) { return i % 2 == 0 ? 0.030 : 0.004; }},
          {"4 to 30 ms", jitter}}) {
      const Held held = pressedBy(tool, half_height, lengthOf);
      EXPECT_NEAR(held.mean, fine, 0.05 * fine) << name << ' ' << steps;
      EXPECT_LT(held.most - held.least, 0.01 * fine) << name << ' ' << steps;
      EXPECT_LT(held.fastest, 1e-4) << name << ' ' << steps;
    }
  }
}

// What is squeezed gives way, not what it is squeezed by: else it comes through thin fingers and hangs on them.
TEST(Colliders, FingersLetGo) {
  const auto asset = touchingBox({0.3, 0.3, 0.3}, 6);
  for (const float half : {0.0075F, 0.015F, 0.03F}) {
    for (const double left : {0.8, 0.65, 0.5}) {
      World world(weightless());
      const BodyId body = *world.addBody(asset, placed(0, 0, 0));
      const auto at = [&](double part, float side) {
        return RigidTransform{{side * (0.15F * float(part) + half), 0, 0}};
      };
      std::vector<ColliderId> fingers;
      for (const float side : {-1.0F, 1.0F}) {
        ColliderSettings finger;
        finger.at = at(1.2, side);
        fingers.push_back(*world.addCollider(BoxShape{{half, 0.2F, 0.2F}}, finger));
      }
      double deepest = 0;
      for (int i = 0; i < 400; ++i) {
        const double part = i < 36   ? 1.2 + (left - 1.2) * i / 36
                            : i < 66 ? left
                                     : std::min(3.0, left + 0.05 * (i - 66));
        for (std::size_t k = 0; k < 2; ++k) world.moveCollider(fingers[k], at(part, k == 0 ? -1.0F : 1.0F));
        world.step(1.0F / 60);
        if (i >= 66) continue;
        for (const Vec3& x : world.positions(body)) {
          deepest = std::max(deepest, std::abs(double(x[0])) - 0.15 * part);
        }
      }
      EXPECT_LT(deepest, 0.04 * 0.3) << half << ' ' << left;
      for (const ColliderId finger : fingers) {
        EXPECT_EQ(wide(world.colliderReaction(finger).impulse).norm(), 0) << half << ' ' << left;
      }
      EXPECT_LT(world.energy(body).elastic, 1e-4 * motionOf(world, body).mass) << half << ' ' << left;
    }
  }
}

// What it gives way by is no way that it has gone: its impulse moves it after the step.
TEST(Colliders, AnEnginesBodyDoesNotSink) {
  const auto asset = touchingBox({0.5, 0.5, 0.5}, 6);
  WorldSettings ground;
  ground.ground.enabled = true;
  for (const float part : {0.5F, 1.0F}) {  // of the cube's mass
    World world(ground);
    BodySettings firm = placed(0, 0.25, 0);
    firm.stiffness_scale = 3;
    const BodyId body = *world.addBody(asset, firm);
    run(world, 2);
    ColliderSettings box;
    box.mass = part * float(motionOf(world, body).mass);
    const float moment = box.mass * 0.2F * 0.2F * 2 / 3;
    box.inertia = {moment, moment, moment};
    Vector3d place(0, double(world.physicalBounds(body).high[1]) + 0.2, 0), velocity(0, 0, 0), spin = velocity;
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    box.at.position = {0, float(place[1]), 0};
    const ColliderId collider = *world.addCollider(BoxShape{{0.2F, 0.2F, 0.2F}}, box);
    double least = 1;
    for (int i = 0; i < 300; ++i) {
      velocity[1] -= 9.81 / 60;
      place += velocity / 60;
      rotation = Eigen::AngleAxisd(spin.norm() / 60, spin.stableNormalized()).toRotationMatrix() * rotation;
      RigidTransform to = {{float(place[0]), float(place[1]), float(place[2])}, {}};
      for (int c = 0; c < 9; ++c) to.rotation[std::size_t(c)] = float(rotation(c / 3, c % 3));
      world.moveCollider(collider, to);
      world.step(1.0F / 60);
      const ColliderReaction got = world.colliderReaction(collider);
      velocity += wide(got.impulse) / double(box.mass);
      spin += wide(got.torque_impulse) / double(moment);
      if (i > 150) least = std::min(least, place[1] - 0.2);
    }
    EXPECT_GT(least, 0.42) << part;
  }
}

// More points come in than carry, and some with the step's end alone: they leave by the side by which they came, not by
// the nearer one.
TEST(Colliders, NothingHangsOnAThinWall) {
  const auto asset = touchingBox({0.3, 0.3, 0.3}, 12);
  for (const float half : {0.005F, 0.01F, 0.025F}) {
    for (const double angle : {0.0, 0.3, 0.8, 1.2}) {
      WorldSettings ground;
      ground.ground.enabled = true;
      World world(ground);
      ColliderSettings wall;
      wall.at.position = {1, 1, 0};
      ASSERT_TRUE(world.addCollider(BoxShape{{half, 1, 1}}, wall));
      const BodyId body = *world.addBody(asset, placed(0.5, 1, 0, turned(angle, {0.3, 1, 0})));
      throwBody(world, body, {20, 0, 0});
      run(world, 3);
      const Motion m = motionOf(world, body);
      EXPECT_LT(m.center[0], 1 - 0.1) << half << ' ' << angle;
      EXPECT_LT(m.center[1], 0.3) << half << ' ' << angle;
    }
  }
}

/// A half ball of a wall, open above, its rim at y = 0.
Surface ballBowl(double radius, double wall) {
  constexpr std::uint32_t kRings = 16, kAround = 32, kShell = kRings * kAround + 1;  // the last ring is one place
  Surface mesh;
  for (const double r : {radius - wall, radius}) {
    for (std::uint32_t i = 0; i < kRings; ++i) {
      for (std::uint32_t k = 0; k < kAround; ++k) {
        const double polar = 0.5 * M_PI * i / kRings, around = 2 * M_PI * k / kAround;
        mesh.positions.push_back({float(r * std::cos(polar) * std::cos(around)), float(-r * std::sin(polar)),
                                  float(r * std::cos(polar) * std::sin(around))});
      }
    }
    mesh.positions.push_back({0, float(-r), 0});
  }
  for (std::uint32_t k = 0; k < kAround; ++k) {
    const std::uint32_t next = (k + 1) % kAround;
    const auto add = [&mesh](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
      mesh.triangles.push_back({a, b, c});                             // of the hollow
      mesh.triangles.push_back({kShell + a, kShell + c, kShell + b});  // of the outside
    };
    for (std::uint32_t i = 0; i + 1 < kRings; ++i) {
      const std::uint32_t a = i * kAround + k, b = i * kAround + next;
      add(a, a + kAround, b);
      add(b, a + kAround, b + kAround);
    }
    const std::uint32_t last = (kRings - 1) * kAround;
    add(last + k, kShell - 1, last + next);
    mesh.triangles.push_back({k, next, kShell + k});
    mesh.triangles.push_back({next, kShell + next, kShell + k});
  }
  return mesh;
}

// A thin wall has two sides: what came in by one does not leave by the other. Corners lie half-way in it at rest.
TEST(Colliders, WhatLiesInABowlStaysThere) {
  const auto asset = touchingBox({0.07, 0.02, 0.07}, 6);
  constexpr double kRadius = 0.09, kWall = 0.008;
  const Surface bowl = ballBowl(kRadius, kWall);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> chance(-1, 1);
  for (int i = 0; i < 40; ++i) {
    World world;
    ASSERT_TRUE(world.addCollider(MeshShape{bowl.positions, bowl.triangles}, {}));
    const double x = 0.015 * chance(random), z = 0.015 * chance(random);
    BodySettings food = placed(x, 0.08, z, turned(3 * chance(random), {0, 0, 1}));
    food.stiffness_scale = 25;
    const BodyId body = *world.addBody(asset, food);
    run(world, 3);
    double farthest = 0;
    for (const Vec3& place : world.positions(body)) {
      if (place[1] < 0) farthest = std::max(farthest, wide(place).norm());
    }
    EXPECT_LT(farthest, kRadius - 0.4 * kWall) << i;
    EXPECT_LT(rmsSpeed(world, body), 2e-3) << i;
  }
}

// What fits between contact points has points of its own.
TEST(Colliders, NarrowOnesCarry) {
  const auto asset = touchingBox({1, 1, 1}, 6);
  // Tops at y = 0, under a cube whose points are 0.17 m apart.
  const std::vector<std::array<double, 2>> corners = {{-0.31, -0.27}, {0.29, -0.33}, {0.27, 0.31}, {-0.33, 0.29}};
  const std::vector<Vec3> spike = {
      {0, 0, 0}, {0.2F, -1, 0.2F}, {-0.2F, -1, 0.2F}, {-0.2F, -1, -0.2F}, {0.2F, -1, -0.2F}};
  const std::vector<Vec3> roof = {{0, 0, -20},       {0, 0, 20},          {0.2F, -0.5F, -20},
                                  {0.2F, -0.5F, 20}, {-0.2F, -0.5F, -20}, {-0.2F, -0.5F, 20}};
  std::vector<float> ridges;
  for (int i = 0; i < 9 * 9; ++i) ridges.push_back(i % 9 == 3 || i % 9 == 5 ? 0.0F : -1.0F);
  using Add = std::function<void(World&)>;
  const auto atCorners = [&corners](const ColliderShape& shape, float y) -> Add {
    return [&corners, shape, y](World& world) {
      for (const auto& at : corners) {
        ColliderSettings place;
        place.at.position = {float(at[0]), y, float(at[1])};
        ASSERT_TRUE(world.addCollider(shape, place));
      }
    };
  };
  const std::vector<std::pair<const char*, Add>> supports = {
      {"spheres", atCorners(SphereShape{0.04F}, -0.04F)},
      {"needles", atCorners(CapsuleShape{0.005F, 1}, -1.005F)},
      {"poles", atCorners(CapsuleShape{0.04F, 1}, -1.04F)},
      {"spikes", atCorners(HullShape{spike}, 0)},
      {"nails",
       [&](World& world) {
         for (int i = 0; i < 100; ++i) {
           ColliderSettings place;
           place.at.position = {0.1F * float(i % 10) - 0.45F, -1.005F, 0.1F * float(i / 10) - 0.45F};
           ASSERT_TRUE(world.addCollider(CapsuleShape{0.005F, 1}, place));
         }
       }},
      {"wires",
       [&](World& world) {
         for (const float x : {-0.24F, 0.26F}) {
           ColliderSettings place;
           place.at.position = {x, -0.01F, 0};
           ASSERT_TRUE(world.addCollider(BoxShape{{0.01F, 0.01F, 2}}, place));
         }
       }},
      {"roofs",
       [&](World& world) {
         for (const float x : {-0.24F, 0.26F}) {
           ColliderSettings place;
           place.at.position = {x, 0, 0.1F};
           ASSERT_TRUE(world.addCollider(HullShape{roof}, place));
         }
       }},
      {"ridges", [&](World& world) {
         ColliderSettings place;
         place.at.position = {-0.99F, 0, -1.02F};
         ASSERT_TRUE(world.addCollider(HeightFieldShape{ridges, 9, 0.25F}, place));
       }}};
  for (const auto& [name, add] : supports) {
    for (const double speed : {0.0, 5.0, 20.0}) {
      World world;
      add(world);
      BodySettings stiff = placed(0, 0.55, 0);
      stiff.stiffness_scale = 5;
      const BodyId body = *world.addBody(asset, stiff);
      throwBody(world, body, {0, -speed, 0});
      run(world, 4);
      const Motion m = motionOf(world, body);
      EXPECT_NEAR(m.center[1], 0.5, 0.06) << name << ' ' << speed;
      EXPECT_LT(rmsSpeed(world, body), 2e-3) << name << ' ' << speed;
    }
  }
}

// Targets that are reached in parts, a rotation rounded in each, are reached: what stands wakes nothing.
TEST(Colliders, LetSleepWhereTheyStand) {
  const auto asset = touchingBox({1, 1, 1});
  for (const float frames : {72.0F, 90.0F, 144.0F}) {
    for (const double yaw : {0.3, 1.1, -2.3}) {
      World world;
      world.settings().sleep_seconds = 0.5F;
      ColliderSettings floor;
      floor.at.position = {0, -0.2F, 0};
      const ColliderId id = *world.addCollider(BoxShape{{2, 0.1F, 2}}, floor);
      const BodyId body = *world.addBody(asset, placed(0, 0.5, 0));
      const RigidTransform end = {{0, -0.1F, 0}, turned(yaw, Vector3d(0.02, 1, 0.01))};
      for (int i = 0; i < int(8 * frames); ++i) {
        if (i == 10) world.moveCollider(id, end);
        world.advance(1 / frames);
      }
      EXPECT_TRUE(world.isAsleep(body)) << frames << ' ' << yaw;
      EXPECT_EQ(world.colliderPose(id).rotation, end.rotation);
    }
  }
}

TEST(Colliders, LayersAndFrictionOfPairs) {
  const auto asset = boxAsset(cube());
  World world;
  ColliderSettings floor;
  floor.at.position = {0, -0.5F, 0};
  floor.layers = 2;
  floor.friction = 0.9F;
  ASSERT_TRUE(world.addCollider(BoxShape{{20, 0.5F, 20}}, floor));
  BodySettings falls = placed(0, 0.2, 0), slides = placed(3, 0.15, 0), sticks = placed(6, 0.15, 0);
  falls.touches = 1;
  slides.friction = 0.1F;  // 0.3 with the floor's
  const BodyId a = *world.addBody(asset, falls), b = *world.addBody(asset, slides), c = *world.addBody(asset, sticks);
  for (const BodyId body : {b, c}) throwBody(world, body, {1, 0, 0});
  run(world, 0.5);
  EXPECT_LT(motionOf(world, a).center[1], -0.5);
  EXPECT_NEAR(motionOf(world, b).center[0], 3 + 0.5 / (0.3 * 9.81), 0.03);
  EXPECT_NEAR(motionOf(world, c).center[0], 6 + 0.5 / (0.9 * 9.81), 0.05);
}

TEST(Colliders, EventsSayWhatBeganAndEnded) {
  const auto asset = boxAsset(cube());
  WorldSettings settings;
  settings.ground.enabled = true;
  World world(settings);
  const ColliderId table = *world.addCollider(BoxShape{{1, 0.1F, 1}}, {{{0, 0.5F, 0}}});
  const BodyId body = *world.addBody(asset, placed(0, 0.9, 0));
  std::vector<ContactEvent> events;
  const auto watch = [&](double seconds) {
    for (double t = 0; t < seconds; t += 1.0 / 60) {
      world.step(1.0F / 60);
      events.insert(events.end(), world.contactEvents().begin(), world.contactEvents().end());
    }
  };
  watch(2);
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.back().collider, table);
  EXPECT_TRUE(events.back().began);
  events.clear();
  world.removeCollider(table);
  watch(1.5);
  ASSERT_GE(events.size(), 2U);
  EXPECT_EQ(events[0].collider, table);
  EXPECT_FALSE(events[0].began);
  EXPECT_EQ(events.back().collider, kGroundCollider);
  EXPECT_TRUE(events.back().began);
  EXPECT_EQ(events.back().body, body.value);
  EXPECT_EQ(world.colliderReaction(table).impulse, (Vec3{0, 0, 0}));
}

TEST(Queries, RaysAndBallsMeetWhatIsThere) {
  const Shapes shapes;
  const auto asset = boxAsset(cube());
  for (const Named& shape : shapes.all) {
    SCOPED_TRACE(shape.name);
    World world;
    ColliderSettings settings;
    settings.at = shape.at;
    const ColliderId collider = *world.addCollider(shape.shape, settings);
    const auto ray = world.rayCast({0, 2, 0}, {0, -1, 0}, 10);
    ASSERT_TRUE(ray);
    EXPECT_EQ(ray->object.collider, collider);
    EXPECT_NEAR(ray->distance, 2, 1e-4);
    EXPECT_NEAR(ray->normal[1], 1, 0.02);
    EXPECT_FALSE(world.rayCast({0, 2, 0}, {0, -1, 0}, 1.9F));
    EXPECT_FALSE(world.rayCast({0, 2, 0}, {0, 1, 0}, 10));
    const auto ball = world.sphereCast({0, 2, 0}, 0.2F, {0, -1, 0}, 10);
    ASSERT_TRUE(ball);
    EXPECT_NEAR(ball->distance, 1.8, 1e-3);
    EXPECT_NEAR(ball->point[1], 0, 1e-3);
    // Bodies by what is drawn of them.
    const BodyId body = *world.addBody(asset, placed(0, 1, 0));
    const auto met = world.rayCast({0.01F, 2, 0.02F}, {0, -1, 0}, 10);
    ASSERT_TRUE(met);
    EXPECT_EQ(met->object.body, body.value);
    EXPECT_NEAR(met->distance, 0.85, 1e-4);
    EXPECT_LT(met->triangle, world.asset(body).package().visualTriangles().size());
    QueryFilter others;
    others.bodies = false;
    EXPECT_NEAR(world.rayCast({0, 2, 0}, {0, -1, 0}, 10, others)->distance, 2, 1e-4);
    EXPECT_NEAR(world.sphereCast({0.01F, 2, 0.02F}, 0.1F, {0, -1, 0}, 10)->distance, 0.75, 1e-3);
  }
}

TEST(Queries, OverlapsAreThoseOfSamples) {
  const Shapes shapes;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> in(-1, 1);
  for (const Named& shape : shapes.all) {
    SCOPED_TRACE(shape.name);
    World world;
    ColliderSettings settings;
    settings.at = shape.at;
    ASSERT_TRUE(world.addCollider(shape.shape, settings));
    const bool sheet = shape.shape.index() == 5;
    for (int i = 0; i < 60; ++i) {
      const Vec3 center = {float(in(random)), float(0.6 * in(random)), float(in(random))};
      const RigidTransform at = {center, turned(3 * in(random), {in(random), in(random), in(random)})};
      const BoxShape box = {{0.3F, 0.1F, 0.2F}};
      // A small ball overlaps where its centre is nearer than its radius: many of them fill the box.
      bool filled = false;
      for (int p = 0; p < 11 * 11 * 11; ++p) {
        const Vector3d part(p % 11 / 5.0 - 1, p / 11 % 11 / 5.0 - 1, p / 121 / 5.0 - 1);
        const Vector3d local = part.cwiseProduct(wide(box.half_size));
        Vec3 place = center;
        for (std::size_t r = 0; r < 3; ++r) {
          for (std::size_t c = 0; c < 3; ++c) place[r] += at.rotation[3 * r + c] * float(local[int(c)]);
        }
        filled = filled || world.overlaps(place, sheet ? 0.035F : 1e-5F, {}) > 0;
      }
      const bool found = world.overlaps(box, at, {}) > 0;
      if (filled && !sheet) {
        EXPECT_TRUE(found) << i;
      }
      if (found && sheet) {
        EXPECT_TRUE(filled) << i;
      }
      if (!found) {
        EXPECT_FALSE(filled && !sheet) << i;
      }
    }
  }
  World world;
  const BodyId body = *world.addBody(boxAsset(cube()), placed(0, 0, 0));
  std::vector<QueryObject> objects(2);
  EXPECT_EQ(world.overlaps({0, 0, 0}, 0.01F, objects), 1U);  // inside
  EXPECT_EQ(objects[0].body, body.value);
  EXPECT_EQ(world.overlaps({0, 0.16F, 0}, 0.02F, objects), 1U);
  EXPECT_EQ(world.overlaps({0, 0.18F, 0}, 0.02F, objects), 0U);
  EXPECT_EQ(world.overlaps(BoxShape{{0.01F, 0.03F, 0.01F}}, {{0, 0.17F, 0}}, objects), 1U);
}

}  // namespace
}  // namespace sinew::test

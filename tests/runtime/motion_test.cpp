// SPDX-License-Identifier: MIT
//
// Free bodies: what physics says of momentum, paths and rest.
#include <gtest/gtest.h>

#include <random>

#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

using Eigen::Vector3d;
using formats::ClusterMode;

const ClusterMode kModes[] = {ClusterMode::rigid, ClusterMode::linear, ClusterMode::quadratic};

BoxOptions overlapping(ClusterMode mode) {
  BoxOptions box;
  box.cells = {6, 4, 4};
  box.size = {1.5, 1, 0.8};
  box.clusters = {3, 2, 2};
  box.mode = mode;
  return box;
}

TEST(FreeBody, AtRestStaysAtRest) {
  for (const ClusterMode mode : kModes) {
    World world(weightless());
    BodySettings place;
    place.position = {0.3F, 1.7F, -2.1F};
    const BodyId body = *world.addBody(boxAsset(overlapping(mode)), place);
    const std::vector<Vec3> start(world.positions(body).begin(), world.positions(body).end());
    run(world, 6);
    double worst = 0;
    for (std::size_t i = 0; i < start.size(); ++i) {
      worst = std::max(worst, (wide(world.positions(body)[i]) - wide(start[i])).norm());
    }
    EXPECT_LT(worst / double(world.asset(body).package().info().diagonal), 2e-5) << int(mode);
    EXPECT_LT(rmsSpeed(world, body), 1e-4) << int(mode);
  }
}

// Steps in which it turns by up to three radians: a long body that tumbles goes on as a rigid one would, whatever the
// steps.
TEST(FreeBody, TumblesThroughLongSteps) {
  WorldSettings settings = weightless();
  settings.damping = 0;
  const auto tumbled = [&](const std::vector<float>& steps) {
    World world(settings);
    BodySettings stiff;  // else its turn stretches it, and what has stretched turns more slowly
    stiff.stiffness_scale = 5;
    const BodyId body = *world.addBody(boxAsset(overlapping(ClusterMode::linear)), stiff);
    const std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
    const Vector3d center = motionOf(world, body).center, spin(1, 2, 2);
    std::vector<Vec3> v;
    for (const Vec3& p : x) {
      const Vector3d speed = spin.cross(wide(p) - center);
      v.push_back({float(speed[0]), float(speed[1]), float(speed[2])});
    }
    world.setState(body, x, v);
    const double energy = motionOf(world, body).kinetic;
    double seconds = 0;
    for (std::size_t i = 0; seconds < 20; ++i) {
      world.step(steps[i % steps.size()]);
      seconds += double(steps[i % steps.size()]);
    }
    EXPECT_NEAR(motionOf(world, body).kinetic / energy, 1, 0.01) << steps[0];
    EXPECT_LT(restError(world, body).max, 0.01) << steps[0];
  };
  tumbled({1.0F / 60});
  tumbled({0.25F});
  tumbled({1.0F});
  tumbled({0.9F, 1e-3F, 0.05F});
}

// What floats round as it comes back from a heap must not move its centre.
TEST(FreeBody, KeepsItsCentreAsItUnfolds) {
  WorldSettings settings = weightless();
  settings.damping = 0;
  World world(settings);
  const BodyId body = *world.addBody(boxAsset(overlapping(ClusterMode::linear)));
  std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
  std::mt19937 random(7);
  std::uniform_real_distribution<float> off(-0.6F, 0.6F);
  for (Vec3& p : x) {
    for (float& c : p) c += off(random);
  }
  world.setState(body, x, {});
  const Vector3d start = motionOf(world, body).center;
  run(world, 4);
  EXPECT_LT((motionOf(world, body).center - start).norm(), 1e-6);
  EXPECT_LT(restError(world, body).max, 1e-3);
}

TEST(FreeBody, FallsOnAParabola) {
  for (const ClusterMode mode : kModes) {
    WorldSettings settings;
    settings.damping = 0;
    World world(settings);
    const BodyId body = *world.addBody(boxAsset(overlapping(mode)));
    std::vector<Vec3> v(world.positions(body).size(), Vec3{2, 5, -1});
    world.setState(body, std::vector<Vec3>(world.positions(body).begin(), world.positions(body).end()), v);
    const Vector3d start = motionOf(world, body).center;
    run(world, 1);
    const Vector3d expected = start + Vector3d(2, 5, -1) + Vector3d(0, -9.81, 0) * 0.5;
    EXPECT_LT((motionOf(world, body).center - expected).norm(), 2e-5) << int(mode);
    EXPECT_LT(restError(world, body).max, 1e-4) << int(mode);
  }
}

// What is pressed askew between two plates and rests there stores much, and has no momentum when both are taken away.
TEST(FreeBody, TakesNoSpinFromPlatesThatLetItGo) {
  WorldSettings settings = weightless();
  settings.damping = 0;
  settings.iterations = 1;
  World world(settings);
  BoxOptions box = overlapping(ClusterMode::linear);
  box.keep = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) { return j < 2 ? i < 2 || k < 1 : i > 2; };
  const BodyId body = *world.addBody(boxAsset(box));
  float low = 0, high = 0;
  for (const Vec3& x : world.positions(body)) {
    low = std::min(low, x[1]);
    high = std::max(high, x[1]);
  }
  ColliderSettings below, above;
  below.at.position = {0, low, 0};
  above.at.position = {0, high, 0};
  const ColliderId plates[] = {*world.addCollider(PlaneShape{{0, 1, 0}}, below),
                               *world.addCollider(PlaneShape{{0, -1, 0}}, above)};
  for (int i = 1; i <= 120; ++i) {
    above.at.position[1] = high - 0.5F * (high - low) * std::min(1.0F, float(i) / 30);
    world.moveCollider(plates[1], above.at);
    world.step(1.0F / 60);
  }
  for (const ColliderId plate : plates) world.removeCollider(plate);
  const auto spin = [&] {
    const Motion now = motionOf(world, body);
    return (now.angular - now.center.cross(now.momentum)).norm();
  };
  const double diagonal = double(world.asset(body).package().info().diagonal);
  const double before = spin();
  world.step(1.0F / 60);
  const Motion now = motionOf(world, body);
  const double size = std::sqrt(2 * now.kinetic * now.mass);  // kg m/s, of its parts
  ASSERT_GT(size, 0.01 * now.mass);
  EXPECT_LT(std::abs(spin() - before), 1e-4 * size * diagonal);
  EXPECT_LT(before, 1e-4 * size * diagonal);
}

TEST(FreeBody, KeepsMomentumWhileItTumblesAndWobbles) {
  for (const ClusterMode mode : kModes) {
    WorldSettings settings = weightless();
    settings.damping = 0;
    World world(settings);
    const BodyId body = *world.addBody(boxAsset(overlapping(mode)));
    std::mt19937 engine(3);
    std::uniform_real_distribution<float> noise(-1, 1);
    std::vector<Vec3> x, v;
    for (const Vec3& p : world.positions(body)) {
      x.push_back({p[0] * 1.2F + 0.1F * noise(engine), p[1] + 0.1F * noise(engine), p[2] * 0.9F});
      const Vector3d spin = Vector3d(3, 4, -2).cross(wide(p));
      v.push_back({float(spin[0]) + noise(engine), float(spin[1]) + 1, float(spin[2]) + noise(engine)});
    }
    world.setState(body, x, v);
    const Motion before = motionOf(world, body);
    run(world, 4);
    const Motion after = motionOf(world, body);
    const Vector3d spin_before = before.angular - before.center.cross(before.momentum);
    const Vector3d spin_after = after.angular - after.center.cross(after.momentum);
    EXPECT_LT((after.momentum - before.momentum).norm(), 1e-5 * before.momentum.norm()) << int(mode);
    EXPECT_LT((spin_after - spin_before).norm(), 1e-4 * spin_before.norm()) << int(mode);
  }
}

TEST(FreeBody, LosesNoEnergyToNothingAndGainsNone) {
  // Free energy (kinetic; the shape starts at rest) never exceeds the start, whatever the step.
  for (const float h : {1e-4F, 1.0F / 240, 1.0F / 60, 0.1F, 1.0F}) {
    WorldSettings settings = weightless();
    World world(settings);
    const BodyId body = *world.addBody(boxAsset(overlapping(ClusterMode::quadratic)));
    std::mt19937 engine(4);
    std::normal_distribution<float> noise(0, 2);
    std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end()), v(x.size());
    for (Vec3& p : v) p = {noise(engine), noise(engine), noise(engine)};
    world.setState(body, x, v);
    const double start = motionOf(world, body).kinetic;
    for (int i = 0; i < 200; ++i) {
      world.step(h);
      ASSERT_LE(motionOf(world, body).kinetic, start * 1.0001) << "h " << h << " step " << i;
    }
    EXPECT_TRUE(allFinite(world, body));
  }
}

// Its turn stretches a body: rho w^2 l^3 / (12 E) of a bar's length l (the mean of its tension over E). At all steps it
// comes to the same shape and turn, and what is stretched beforehand pays for the turn that it gains as it draws in.
TEST(FreeBody, IsStretchedByItsTurn) {
  WorldSettings settings = weightless();
  settings.damping = 0;
  for (const double speed : {2.0, 6.0}) {
    for (const float stretched : {1.0F, 1.4F}) {
      std::vector<double> lengths, turns;
      for (const float h : {1.0F / 30, 1.0F / 60, 1.0F / 240}) {
        World world(settings);
        const BodyId body = *world.addBody(boxAsset(overlapping(ClusterMode::linear)));
        std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
        for (Vec3& p : x) p[0] *= stretched;
        world.setState(body, x, {});
        world.setVelocity(body, {0, 0, 0}, {0, float(speed), 0});
        const auto length = [&] {
          Vec3 low{}, high{};
          Mat3 turn;
          Vec3 moved;
          world.rigidMotion(body, turn, moved);
          for (const Vec3& p : world.positions(body)) {
            const float along = turn[0] * (p[0] - moved[0]) + turn[3] * (p[1] - moved[1]) + turn[6] * (p[2] - moved[2]);
            low[0] = std::min(low[0], along);
            high[0] = std::max(high[0], along);
          }
          return double(high[0] - low[0]);
        };
        world.step(h);
        double most = world.energy(body).kinetic + world.energy(body).elastic;
        for (double seconds = 0; seconds < 6; seconds += double(h)) {
          world.step(h);
          const double energy = world.energy(body).kinetic + world.energy(body).elastic;
          ASSERT_LE(energy, most * (1 + 2e-3)) << speed << ' ' << stretched << ' ' << h << ' ' << seconds;
          most = std::min(most, energy);
        }
        lengths.push_back(length());
        turns.push_back(double(world.motion(body).angular_velocity[1]));
        EXPECT_NEAR(lengths.back() / lengths.front(), 1, 2e-3) << speed << ' ' << stretched << ' ' << h;
        EXPECT_NEAR(turns.back() / turns.front(), 1, 5e-3) << speed << ' ' << stretched << ' ' << h;
      }
      World still(settings);
      const BodyId body = *still.addBody(boxAsset(overlapping(ClusterMode::linear)));
      float rest = 0;
      for (const Vec3& p : still.positions(body)) rest = std::max(rest, 2 * p[0]);
      EXPECT_GT(lengths.front(), double(rest) * (1 + 1e-4 * speed * speed)) << speed;
    }
  }
}

// Where nothing touches it a step is as long as it likes.
TEST(FreeBody, FallsAlikeAtAnySteps) {
  WorldSettings settings;
  settings.damping = 0;
  for (const std::vector<float>& steps :
       {std::vector<float>{1.0F / 30}, {0.004F, 0.05F}, {0.5F, 1.0F / 60, 1.0F / 60}}) {
    World world(settings);
    const BodyId body = *world.addBody(boxAsset(overlapping(ClusterMode::linear)));
    const Vector3d start = motionOf(world, body).center;
    world.setVelocity(body, {2, 5, -1});
    double seconds = 0;
    for (std::size_t i = 0; seconds < 2; ++i) {
      world.step(steps[i % steps.size()]);
      seconds += double(steps[i % steps.size()]);
    }
    const Vector3d expected = start + seconds * Vector3d(2, 5, -1) + 0.5 * seconds * seconds * Vector3d(0, -9.81, 0);
    EXPECT_LT((motionOf(world, body).center - expected).norm(), 1e-4) << steps[0];
  }
}

TEST(FreeBody, WorksFarFromTheOrigin) {
  World world(weightless());
  BodySettings place;
  place.position = {10000, 0, -10000};
  const BodyId body = *world.addBody(boxAsset(overlapping(ClusterMode::linear)), place);
  // Floats are 1/1024 m apart there: every vertex flickers by about one of them, as one over the root of the damping,
  // and for 20 s that is all. Now and then the whole body shows it (1.4 to 1.6 of them); the mean of looks two seconds
  // apart says whether it grows.
  double mean = 0;
  for (int i = 0; i < 10; ++i) {
    run(world, 2);
    mean += restError(world, body).rms / 10;
    EXPECT_LT(restError(world, body).max, 4.4 / 1024);
  }
  EXPECT_LT(mean, 1.0 / 1024);
  EXPECT_LT((motionOf(world, body).center - Vector3d(10000, 0, -10000)).norm(), 0.05);
}

TEST(FreeBody, DampingDecaysAtTheStatedRate) {
  WorldSettings settings = weightless();
  settings.damping = 0.7F;
  World world(settings);
  const BodyId body = *world.addBody(boxAsset(overlapping(ClusterMode::linear)));
  std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end()), v(x.size(), Vec3{1, 0, 0});
  world.setState(body, x, v);
  run(world, 2);
  const Motion m = motionOf(world, body);
  EXPECT_NEAR(m.momentum[0] / m.mass, std::exp(-1.4), 1e-3);
}

}  // namespace
}  // namespace sinew::test

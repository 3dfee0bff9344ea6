// SPDX-License-Identifier: MIT
//
// The report's scheme: what Henriques 2006 and Müller et al. 2005 say of it, and that it stays behind its seam.
#include "sinew/runtime/report.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "runtime/geometry/rotation.h"
#include "runtime/report/limits.h"
#include "sinew/c_api.h"
#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

using Eigen::Matrix3f;
using formats::ClusterMechanics;
using formats::ClusterMode;
using formats::LimitMethod;

BodySettings byReport(Vec3 position = {0, 0, 0}) {
  BodySettings settings;
  settings.position = position;
  settings.solver = &reportSolver();
  return settings;
}

std::shared_ptr<const Asset> blockOf(ClusterMode mode, const ClusterMechanics& mechanics = formats::kPlainMechanics,
                                     std::uint32_t clusters = 2) {
  BoxOptions box;
  box.mode = mode;
  box.clusters = {clusters, clusters, clusters};
  formats::PackageContent content = boxContent(box);
  content.mechanics.assign(content.clusters.size(), mechanics);
  return makePlainAsset(content);
}

TEST(Report, ABlockWithoutFieldsFallsAndLiesOnTheGround) {
  for (const ClusterMode mode : {ClusterMode::rigid, ClusterMode::linear, ClusterMode::quadratic}) {
    WorldSettings settings;
    settings.ground.enabled = true;
    World world(settings);
    const auto body = world.addBody(blockOf(mode), byReport({0, 2, 0}));
    ASSERT_TRUE(body) << body.reason();
    world.step(1.0F / 60);
    const double kept = 1.0 / 60;
    EXPECT_NEAR(motionOf(world, *body).momentum[1] / motionOf(world, *body).mass, -9.81 * kept, 1e-4);
    for (int i = 0; i < 360; ++i) {
      world.step(1.0F / 60);
      ASSERT_TRUE(allFinite(world, *body)) << i;
      ASSERT_GE(lowestPoint(world, *body), -1e-6) << i;
    }
    EXPECT_EQ(world.repairedVertices(*body), 0U);
    EXPECT_LT(motionOf(world, *body).center[1], 1.0);
    EXPECT_EQ(world.energy(*body).elastic, 0);
  }
}

// A stretched free cluster whose beta is that of a step keeps that part of its stretch in one step, whatever the step's
// length: F = beta A + (1 - beta) R, and with alpha = 1 every vertex goes there (Henriques 2006, 3.1).
TEST(Report, AStepKeepsBetaOfADeformationHoweverLongItIs) {
  for (const float beta : {0.0F, 0.3F, 0.9F}) {
    for (const float h : {1.0F / 30, 1.0F / 240}) {
      ClusterMechanics mechanics = formats::kPlainMechanics;
      mechanics.stiffness = formats::StiffnessModel::per_step;
      mechanics.per_step_beta.fill(beta);
      World world(weightless());
      const BodyId body = *world.addBody(blockOf(ClusterMode::quadratic, mechanics, 1), byReport());
      const std::vector<Vec3> rest(world.positions(body).begin(), world.positions(body).end());
      std::vector<Vec3> x;
      for (const Vec3& p : rest) x.push_back({1.2F * p[0], p[1], p[2]});
      world.setState(body, x, {});
      world.step(h);
      for (std::size_t i = 0; i < x.size(); ++i) {
        const float expected = rest[i][0] * (1 + 0.2F * beta);
        ASSERT_NEAR(world.positions(body)[i][0], expected, 1e-5F) << beta << ' ' << h;
        ASSERT_NEAR(world.velocities(body)[i][0], (expected - x[i][0]) / h, 2e-5F / h);
      }
    }
  }
}

// So a load sags the less the shorter the step: beta per step makes the way back per second.
TEST(Report, StiffnessDependsOnTheStep) {
  const auto sagOf = [](float h) {
    WorldSettings settings;
    settings.damping = 5;
    World world(settings);
    const BodyId body = *world.addBody(blockOf(ClusterMode::linear, formats::kPlainMechanics, 1), byReport());
    const std::vector<Vec3> rest(world.positions(body).begin(), world.positions(body).end());
    std::vector<std::uint32_t> top;
    for (std::uint32_t i = 0; i < rest.size(); ++i) {
      if (rest[i][1] > 0.49F) top.push_back(i);
    }
    EXPECT_TRUE(world.addPinSet(body, top, {}, PinMethod::hold));
    run(world, 6, h);
    for (const std::uint32_t i : top) EXPECT_EQ(world.positions(body)[i], rest[i]) << "held to the bit";
    return -motionOf(world, body).center[1];
  };
  const double coarse = sagOf(1.0F / 60), fine = sagOf(1.0F / 240);
  EXPECT_GT(fine, 0);
  EXPECT_GT(coarse, 4 * fine);
}

Matrix3f someMatrix(std::mt19937& engine) {
  std::normal_distribution<float> noise(0, 1.2F);
  Matrix3f a;
  for (int k = 0; k < 9; ++k) a.data()[k] = noise(engine);
  return a;
}

TEST(Report, LimitsBoundWhatTheySay) {
  std::mt19937 engine(3);
  const std::array<formats::CurvePoint, 3> curve = {{{3, 3}, {6, 4}, {20, 5}}};
  ClusterMechanics m = formats::kPlainMechanics;
  m.norm_max = 4;
  m.norm_limit = 6;
  int acted = 0;
  for (int i = 0; i < 500; ++i) {
    const Matrix3f a = someMatrix(engine), r = geometry::nearestRotation(a);
    const float phi = a.squaredNorm();
    const auto blended = [&](LimitMethod method) {
      m.limit = method;
      const float gamma = internal::blendOf(m, curve, a, r);
      EXPECT_GE(gamma, 0);
      EXPECT_LE(gamma, 1);
      acted += gamma < 1 ? 1 : 0;
      return (r + gamma * (a - r)).squaredNorm();
    };
    const float frobenius = blended(LimitMethod::frobenius);
    EXPECT_NEAR(frobenius, phi > 4 ? 4 : phi, 1e-4F * phi);
    const float soft = blended(LimitMethod::soft);
    EXPECT_NEAR(soft, phi > 4 ? 6 - 4 / phi * 2 : phi, 1e-4F * phi);
    EXPECT_LE(blended(LimitMethod::frobenius_cheap), phi + 1e-4F);
    EXPECT_NEAR(internal::blendOf(m, curve, a, r), phi > 4 ? 4 / phi : 1, 1e-6F);
    EXPECT_LE(blended(LimitMethod::curve), 5 + 1e-4F * phi);
    EXPECT_LE(internal::rowsLimited(a, 1.5F).rowwise().norm().maxCoeff(), 1.5F + 1e-5F);
    const Matrix3f within = internal::stretchesLimited(a, 0.5F, 1.5F);
    const Eigen::JacobiSVD<Matrix3f> svd(within);
    EXPECT_GE(svd.singularValues()[2], 0.5F - 1e-4F);
    EXPECT_LE(svd.singularValues()[0], 1.5F + 1e-4F);
    EXPECT_GT(within.determinant(), 0) << "never mirrored";
    EXPECT_NEAR(std::abs(internal::volumeKept(a).determinant()), 1, 1e-3F);
    EXPECT_EQ(internal::volumeKept(a).determinant() > 0, a.determinant() > 0);
  }
  EXPECT_GT(acted, 500);
  EXPECT_EQ(internal::volumeKept(Matrix3f::Zero()), Matrix3f::Zero());
}

TEST(Report, EveryPinMethodHoldsToTheBitAndCarriesTheWeight) {
  for (const PinMethod method :
       {PinMethod::hold, PinMethod::infinite_mass, PinMethod::matrix, PinMethod::constrained_fit}) {
    for (const ClusterMode mode : {ClusterMode::linear, ClusterMode::quadratic}) {
      World world;
      const BodyId body = *world.addBody(blockOf(mode, formats::kPlainMechanics, 1), byReport());
      const std::vector<Vec3> rest(world.positions(body).begin(), world.positions(body).end());
      std::vector<std::uint32_t> wall;
      for (std::uint32_t i = 0; i < rest.size(); ++i) {
        if (rest[i][0] < -0.49F) wall.push_back(i);
      }
      const auto set = world.addPinSet(body, wall, {}, method);
      ASSERT_TRUE(set) << set.reason();
      for (int i = 0; i < 240; ++i) {
        world.step(1.0F / 60);
        for (const std::uint32_t v : wall) ASSERT_EQ(world.positions(body)[v], rest[v]) << int(method);
        ASSERT_TRUE(allFinite(world, body));
      }
      EXPECT_LT(world.pinReaction(*set).force[1], 0) << int(method);
      EXPECT_LT(motionOf(world, body).center.norm(), 1) << "it hangs there";
    }
  }
}

TEST(Report, APickPullsAndStaysFiniteAtAnyFrequency) {
  for (const float h : {1e-4F, 1.0F / 60}) {
    for (const float hz : {0.1F, 4.0F, 100.0F}) {
      World world(weightless());
      const BodyId body = *world.addBody(blockOf(ClusterMode::linear), byReport());
      world.pick(body, 3, {1, 1, 0}, hz);
      for (int i = 0; i < 240; ++i) world.step(h);
      EXPECT_TRUE(allFinite(world, body)) << hz;
      EXPECT_LT(motionOf(world, body).center.norm(), 5) << hz;
      EXPECT_GT(motionOf(world, body).center[0], 0) << hz;
    }
  }
}

TEST(Report, SavedStatesGoOnBitForBitAndAreNotTheOthers) {
  WorldSettings settings;
  settings.ground.enabled = true;
  World world(settings);
  BoxOptions box;
  box.mode = ClusterMode::quadratic;
  box.clusters = {2, 2, 2};
  const auto asset = boxAsset(box);
  const BodyId body = *world.addBody(asset, byReport({0, 0.8F, 0}));
  const BodyId coupled = *world.addBody(asset);
  world.pin(body, 7, {0.5F, 1, 0});
  run(world, 0.5);
  std::vector<std::byte> bytes(world.stateBytes(body));
  ASSERT_EQ(world.saveState(body, bytes), bytes.size());
  run(world, 0.5);
  const std::vector<Vec3> expected(world.positions(body).begin(), world.positions(body).end());
  EXPECT_FALSE(world.restoreState(coupled, bytes));
  ASSERT_TRUE(world.restoreState(body, bytes));
  run(world, 0.5);
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), world.positions(body).begin()));
}

TEST(Report, WhatIsNotFiniteIsPutBackAtRest) {
  WorldSettings settings;
  settings.gravity = {0, -1e15F, 0};
  World world(settings);
  const BodyId body = *world.addBody(blockOf(ClusterMode::linear), byReport({1, 2, 3}));
  std::uint32_t repaired = 0;
  for (int i = 0; i < 10; ++i) {
    world.step(1);
    repaired += world.repairedVertices(body);
    ASSERT_TRUE(allFinite(world, body));
  }
  EXPECT_GT(repaired, 0U);
  EXPECT_EQ(sinew_report_solver(), reinterpret_cast<const sinew_solver*>(&reportSolver()));
}

}  // namespace
}  // namespace sinew::test

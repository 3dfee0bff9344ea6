// SPDX-License-Identifier: GPL-3.0-or-later
//
// The judge itself: what it leaves out, how strong it makes gravity, how it holds, and what it calls an error.
#include "tools/study/held_body.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/support/box_package.h"
#include "tools/study/assets.h"
#include "tools/study/beam.h"
#include "tools/study/packages.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// \param fields so that the runtime can play it.
std::shared_ptr<const Asset> bar(double young, bool fields = false) {
  BoxBody box;
  box.cells = {12, 3, 3};
  box.size = {2, 0.5, 0.5};
  box.clusters = {3, 1, 1};
  StudyPackageOptions options;
  options.mechanics = formats::kPlainMechanics;
  options.mechanics->stiffness = formats::StiffnessModel::elastic;
  options.mechanics->young = float(young);
  options.mechanics->poisson = 0.25F;
  options.fields = fields;
  return boxPackage(box, options);
}

std::vector<ElasticMaterial> elasticOf(const Asset& asset) {
  std::vector<ElasticMaterial> materials;
  for (const PieceMaterial& m : materialsOf(asset.package())) materials.push_back(m.material);
  return materials;
}

TEST(HeldBody, WhatDoesNotMoveIsWholeWrongAndWhatIsTheReferenceIsRight) {
  const auto asset = bar(1e5);
  const PackageSolid solid = packageSolid(asset->package());
  for (const HoldScene scene : {HoldScene::hang, HoldScene::lean, HoldScene::cantilever, HoldScene::press,
                                HoldScene::squeeze, HoldScene::twist}) {
    const HeldCase held = heldCase(solid, asset->package(), scene);
    const ReferenceShape reference = referenceShape(solid, elasticOf(*asset), held, 0.01 * solid.diagonal);
    ASSERT_FALSE(reference.compared.empty());
    const HeldScore still =
        scoreOf(reference.compared, std::vector<Vector3d>(solid.rest.size(), Vector3d::Zero()), reference.displacement);
    EXPECT_DOUBLE_EQ(still.rms, 1);
    EXPECT_DOUBLE_EQ(still.largest, 1);
    EXPECT_DOUBLE_EQ(still.way, 0);
    const HeldScore right = scoreOf(reference.compared, reference.displacement, reference.displacement);
    EXPECT_EQ(right.rms, 0);
    EXPECT_EQ(right.largest, 0);
    EXPECT_DOUBLE_EQ(right.way, 1);
    std::vector<Vector3d> half = reference.displacement;
    for (Vector3d& x : half) x *= 0.5;
    EXPECT_NEAR(scoreOf(reference.compared, half, reference.displacement).rms, 0.5, 1e-12);
    EXPECT_NEAR(scoreOf(reference.compared, half, reference.displacement).way, 0.5, 1e-12);
  }
}

// Twice as stiff wants twice the gravity and gives the same shape.
TEST(HeldBody, GravityIsAsStrongAsMovesTheReferenceAsAsked) {
  std::vector<double> gravity;
  std::vector<std::vector<Vector3d>> shapes;
  for (const double young : {1e5, 2e5}) {
    const auto asset = bar(young);
    EXPECT_EQ(materialsOf(asset->package()).front().source, StiffnessSource::clusters);
    EXPECT_NEAR(materialsOf(asset->package()).front().material.young, young, 1e-3 * young);
    EXPECT_NEAR(materialsOf(asset->package()).front().material.poisson, 0.25, 1e-6);
    const PackageSolid solid = packageSolid(asset->package());
    const HeldCase held = heldCase(solid, asset->package(), HoldScene::cantilever);
    const ReferenceShape reference = referenceShape(solid, elasticOf(*asset), held, 0.1 * solid.diagonal);
    EXPECT_TRUE(reference.on_target);
    EXPECT_TRUE(reference.stable);
    EXPECT_NEAR(reference.rms, 0.1 * solid.diagonal, 3e-3 * 0.1 * solid.diagonal);
    gravity.push_back(reference.gravity.norm());
    shapes.push_back(reference.displacement);
  }
  EXPECT_NEAR(gravity[1] / gravity[0], 2, 1e-2);
  double apart = 0;
  for (std::size_t v = 0; v < shapes[0].size(); ++v) apart = std::max(apart, (shapes[0][v] - shapes[1][v]).norm());
  EXPECT_LT(apart, 1e-2 * 0.1 * 2);
}

// Quadratic tetrahedra bend further by what linear ones are too stiff by, under the same weight.
TEST(HeldBody, TheReferenceIsSofterThanLinearTetrahedra) {
  const auto asset = bar(1e5);
  const PackageSolid solid = packageSolid(asset->package());
  HeldCase held = heldCase(solid, asset->package(), HoldScene::cantilever);
  held.gravity *= 0.05;
  const ReferenceShape reference = referenceShape(solid, elasticOf(*asset), held, 0);
  EXPECT_TRUE(reference.stable);
  ElasticSolid linear{solid.rest, solid.tetrahedra, {}, {}};
  linear.prescribed.resize(solid.rest.size());
  for (const std::uint32_t v : held.regions[0].vertices) linear.prescribed[v] = solid.rest[v];
  ElasticLoad load{elasticOf(*asset), {}};
  for (const double m : solid.masses) load.forces.push_back(m * held.gravity);
  const Equilibrium rest = equilibrium(linear, load, {}, 1e-8);
  double square = 0;
  for (const std::uint32_t v : reference.compared) square += (rest.positions[v] - solid.rest[v]).squaredNorm();
  const double rms = std::sqrt(square / double(reference.compared.size()));
  EXPECT_GT(reference.rms, 1.02 * rms);
  EXPECT_LT(reference.rms, 1.5 * rms);
}

TEST(HeldBody, PressAndTwistTakeWhatTheyHoldWhereTheySay) {
  const auto asset = bar(1e5, true);
  const PackageSolid solid = packageSolid(asset->package());
  const HeldCase twist = heldCase(solid, asset->package(), HoldScene::twist);
  ASSERT_EQ(twist.regions.size(), 2U);
  const Eigen::AngleAxisd turn(std::numbers::pi / 3, Vector3d::UnitX());
  const ReferenceShape reference = referenceShape(solid, elasticOf(*asset), twist, 0);
  PlayOptions play;
  play.seconds = kMotionSeconds + 0.2;
  const PlayedShape played = playHeld(asset, solid, twist, reference, play);
  for (const std::uint32_t v : twist.regions[0].vertices) EXPECT_LT(reference.displacement[v].norm(), 1e-12);
  for (const std::uint32_t v : twist.regions[1].vertices) {
    const Vector3d way = turn * solid.rest[v] - solid.rest[v];
    EXPECT_LT((reference.displacement[v] - way).norm(), 1e-6);
    EXPECT_LT((played.displacement[v] - way).norm(), 0.02 * solid.diagonal);
  }
  const HeldCase press = heldCase(solid, asset->package(), HoldScene::press);
  EXPECT_NEAR(press.regions[1].shift[1], -0.2 * 0.5, 1e-6);
  const HeldCase squeeze = heldCase(solid, asset->package(), HoldScene::squeeze);
  EXPECT_NEAR(squeeze.regions[1].shift[1], -0.05 * 0.5, 1e-6);
  EXPECT_TRUE(heldCase(solid, asset->package(), HoldScene::pins).regions.empty());
}

TEST(HeldBody, ABodyThatNothingPullsRestsWhereItWas) {
  const auto asset = bar(1e5, true);
  const PackageSolid solid = packageSolid(asset->package());
  HeldCase held = heldCase(solid, asset->package(), HoldScene::hang);
  held.gravity.setZero();
  const ReferenceShape reference = referenceShape(solid, elasticOf(*asset), held, 0);
  PlayOptions play;
  play.rest_speed = 1e-5 * solid.diagonal;
  const PlayedShape played = playHeld(asset, solid, held, reference, play);
  EXPECT_TRUE(played.finite);
  EXPECT_GT(played.rest_seconds, 0);
  EXPECT_LT(played.rest_seconds, 5);
  for (const Vector3d& x : played.displacement) EXPECT_LT(x.norm(), 1e-4);
}

// Of 4 x 4 x 4 cells one half without an edge, and a cell that touches it by an edge only: a hinge, which has no
// equilibrium.
TEST(HeldBody, CrumbsAndPiecesThatNothingHoldsAreLeftOut) {
  test::BoxOptions options;
  options.keep = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    return i < 2 || (i == 2 && j == 0 && k == 0) ? !(i == 1 && j == 0) : false;
  };
  formats::PackageContent content = test::boxContent(options);
  const PackageSolid alone = packageSolid(test::makeAsset(content)->package());
  EXPECT_EQ(alone.left_out, 5U);
  EXPECT_EQ(alone.tetrahedra.size(), 5U * (2 * 4 * 4 - 4));
  std::size_t loose = 0;
  for (const std::uint8_t kept : alone.kept) loose += kept == 0 ? 1 : 0;
  EXPECT_EQ(loose, 6U);
  // A second piece above it is held by its top, the first one is not.
  test::BoxOptions above;
  above.center = {0, 3, 0};
  test::appendBody(content, test::boxContent(above));
  const auto asset = test::makeAsset(content);
  const PackageSolid solid = packageSolid(asset->package());
  ASSERT_EQ(solid.pieces, 2U);
  const HeldCase held = heldCase(solid, asset->package(), HoldScene::hang);
  const ReferenceShape reference =
      referenceShape(solid, std::vector<ElasticMaterial>(2, kPresumed), held, 0.01 * solid.diagonal);
  ASSERT_FALSE(reference.compared.empty());
  for (const std::uint32_t v : reference.compared) EXPECT_EQ(solid.piece[v], 1U);
  for (const std::uint32_t v : reference.left_out) EXPECT_EQ(solid.piece[v], 0U);
  EXPECT_TRUE(reference.stable);
  // The one that is not held stays where it is in the world, too.
  PlayOptions play;
  play.seconds = 1;
  const PlayedShape played = playHeld(asset, solid, held, reference, play);
  EXPECT_TRUE(played.finite);
  for (const std::uint32_t v : reference.left_out) EXPECT_LT(played.displacement[v].norm(), 1e-3);
}

TEST(HeldBody, ASwingsFrequencyAndDampingAreThoseItWasMadeWith) {
  for (const double ratio : {0.0, 0.01, 0.1}) {
    constexpr double kHz = 3.3;
    const double omega = 2 * std::numbers::pi * kHz, damped = omega * std::sqrt(1 - ratio * ratio);
    std::vector<double> way;
    for (int i = 0; i < 960; ++i) {
      const double t = i / 240.0;
      way.push_back(0.01 * std::exp(-ratio * omega * t) *
                    (std::cos(damped * t) + ratio * omega / damped * std::sin(damped * t)));
    }
    const Swing swing = swingOf(way, 1.0 / 240);
    EXPECT_NEAR(swing.frequency_hz, damped / (2 * std::numbers::pi), 0.005 * kHz);
    EXPECT_NEAR(swing.damping_ratio, ratio, 0.02 * ratio + 1e-3);
  }
  EXPECT_EQ(swingOf({1, 0.5, 0.2, 0.1, 0.05}, 0.1).frequency_hz, 0);
}

}  // namespace
}  // namespace sinew::tools

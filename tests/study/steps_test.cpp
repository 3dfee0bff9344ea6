// SPDX-License-Identifier: GPL-3.0-or-later
//
// The judge of `study steps` can fail: its measures on states made by hand.
#include "tools/study/steps.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <set>

#include "tools/study/packages.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

constexpr double kStep = 1.0 / 60;
// 10 km, in a direction in which all coordinates are rounded.
const Vector3d kFar(4800, 6000, 6400);

Vector3d wideOf(const Vec3& v) { return {double(v[0]), double(v[1]), double(v[2])}; }
Vec3 narrow(const Vector3d& v) { return {float(v[0]), float(v[1]), float(v[2])}; }

std::shared_ptr<const Asset> boxAsset() {
  static const auto asset = boxPackage({.cells = {4, 3, 2}, .size = {1, 0.6, 0.4}}, {.fields = true, .surface = true});
  return asset;
}

// A state that can be spoilt.
struct Hand {
  const formats::PackageView& package = boxAsset()->package();
  double diagonal = double(package.info().diagonal);
  std::vector<Vec3> positions, velocities;

  Hand() { rest(Vector3d::Zero()); }
  BodyState state() const { return {positions, velocities}; }
  // At rest, in its rest shape.
  void rest(const Vector3d& at) { turning(0, at, 0); }
  // As a rigid body that has turned about an oblique axis for so long.
  void turning(double speed, const Vector3d& at, double seconds) {
    positions.clear();
    velocities.clear();
    const Vector3d axis(1.0 / 3, 2.0 / 3, 2.0 / 3);
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(speed * seconds, axis).toRotationMatrix();
    Vector3d centre = Vector3d::Zero();
    double mass = 0;
    for (const auto& vertex : package.physicalVertices()) {
      mass += double(vertex.mass);
      centre += double(vertex.mass) * wideOf(vertex.rest_position);
    }
    centre /= mass;
    for (const auto& vertex : package.physicalVertices()) {
      const Vector3d d = rotation * (wideOf(vertex.rest_position) - centre);
      positions.push_back(narrow(Vector3d(at + centre + d)));
      velocities.push_back(narrow(Vector3d(speed * axis.cross(d))));
    }
  }
  double kinetic() const { return motionOf(package, state()).front().kinetic; }
};

const StepsFinding* find(const std::vector<StepsFinding>& findings, StepsCriterion criterion) {
  for (const StepsFinding& finding : findings) {
    if (finding.criterion == criterion) return &finding;
  }
  return nullptr;
}

// Over the limit: 0 where it was not judged.
double ratio(const std::vector<StepsFinding>& findings, StepsCriterion criterion) {
  const StepsFinding* finding = find(findings, criterion);
  return finding == nullptr ? 0 : finding->ratio();
}

TEST(StepsFinding, NoNumberIsOverAnyLimit) {
  EXPECT_EQ((StepsFinding{StepsCriterion::energy, std::numeric_limits<double>::quiet_NaN(), 1}.ratio()),
            std::numeric_limits<double>::infinity());
  EXPECT_EQ((StepsFinding{StepsCriterion::finite, 1, 0}.ratio()), std::numeric_limits<double>::infinity());
  EXPECT_EQ((StepsFinding{StepsCriterion::finite, 0, 0}.ratio()), 0);
  EXPECT_EQ((StepsFinding{StepsCriterion::energy, 3, 2}.ratio()), 1.5);
}

TEST(StepsMeasure, CountsWhatIsNotFinite) {
  Hand body;
  EXPECT_EQ(notFinite(body.state()), 0U);
  body.positions[3][1] = std::numeric_limits<float>::quiet_NaN();
  body.velocities[5][2] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(notFinite(body.state()), 2U);
}

TEST(StepsMeasure, RoundingOfCoordinatesBoundsWhatFloatsDo) {
  const Hand near;
  Hand far;
  far.rest(kFar);
  const double rounding = coordinateRounding(far.positions);
  EXPECT_NEAR(rounding, 6400 * 0x1p-24, 1e-6);
  double worst = 0;
  for (std::size_t v = 0; v < far.positions.size(); ++v) {
    worst = std::max(worst, (wideOf(far.positions[v]) - kFar - wideOf(near.positions[v])).norm());
  }
  EXPECT_GT(worst, 0.3 * rounding);
  EXPECT_LT(worst, std::sqrt(3.0) * rounding * 1.001);
}

TEST(FreeJudge, ABodyAtRestPassesAndOneThatMovesDoesNot) {
  for (const Vector3d& at : {Vector3d(Vector3d::Zero()), kFar}) {
    Hand body;
    body.rest(at);
    FreeJudge judge(body.package, body.state(), {0, 0}, false);
    for (int i = 0; i < 120; ++i) judge.observe(body.state(), kStep);
    EXPECT_EQ(ratio(judge.findings(), StepsCriterion::speed), 0);
    ASSERT_NE(find(judge.findings(), StepsCriterion::speed), nullptr);
    // Once, for one step.
    for (Vec3& v : body.velocities) v[1] = float(1.1e-3 * body.diagonal);
    judge.observe(body.state(), kStep);
    EXPECT_NEAR(ratio(judge.findings(), StepsCriterion::speed), 1.1, 0.01);
  }
}

TEST(FreeJudge, SeesABodyAtRestThatGoesAwayWithoutASpeed) {
  Hand body;
  FreeJudge judge(body.package, body.state(), {0, 0}, false);
  for (int i = 1; i <= 120; ++i) {
    body.rest({2e-3 * body.diagonal * i * kStep, 0, 0});
    judge.observe(body.state(), kStep);
  }
  EXPECT_GT(ratio(judge.findings(), StepsCriterion::speed), 1.5);
}

TEST(FreeJudge, WhatTurnsAsARigidBodyPassesAnywhere) {
  for (const Vector3d& at : {Vector3d(Vector3d::Zero()), kFar}) {
    Hand body;
    body.turning(3, at, 0);
    FreeJudge judge(body.package, body.state(), {body.kinetic(), 0}, true);
    // Turning about an axis that is none of its inertia it would need a torque: its angular momentum turns with it.
    const auto motion = motionOf(body.package, body.state()).front();
    for (int i = 1; i <= 600; ++i) {
      body.turning(3, at, i * kStep);
      judge.observe(body.state(), kStep);
    }
    EXPECT_LE(ratio(judge.findings(), StepsCriterion::momentum), 1);
    EXPECT_LE(ratio(judge.findings(), StepsCriterion::centre), 1);
    EXPECT_LE(ratio(judge.findings(), StepsCriterion::energy), 1);
    EXPECT_GT(ratio(judge.findings(), StepsCriterion::energy), 0.98);
    EXPECT_GT(ratio(judge.findings(), StepsCriterion::angular), 1);  // the torque is seen
    EXPECT_GT(motion.angular.norm(), 0);
  }
}

TEST(FreeJudge, SeesEnergyThatWasGained) {
  Hand body;
  body.turning(3, Vector3d::Zero(), 0);
  FreeJudge judge(body.package, body.state(), {body.kinetic(), 0}, true);
  for (Vec3& v : body.velocities) {
    for (float& x : v) x *= 1.01F;
  }
  judge.observe(body.state(), kStep);
  EXPECT_GT(ratio(judge.findings(), StepsCriterion::energy), 1.005);
}

TEST(FreeJudge, KineticEnergyMayBeWhatADeformedStartHeld) {
  Hand body;
  const Hand start = body;
  body.turning(2, Vector3d::Zero(), 0);
  const double kinetic = body.kinetic();
  FreeJudge enough(body.package, start.state(), {0, kinetic}, true);
  enough.observe(body.state(), kStep);
  EXPECT_LE(ratio(enough.findings(), StepsCriterion::energy), 1);
  FreeJudge little(body.package, start.state(), {0, 0.9 * kinetic}, true);
  little.observe(body.state(), kStep);
  EXPECT_GT(ratio(little.findings(), StepsCriterion::energy), 1.05);
  FreeJudge unknown(body.package, start.state(), {0, std::nullopt}, true);
  unknown.observe(body.state(), kStep);
  EXPECT_EQ(find(unknown.findings(), StepsCriterion::energy), nullptr);
}

TEST(FreeJudge, SeesMomentumThatCameFromNowhere) {
  for (const Vector3d& at : {Vector3d(Vector3d::Zero()), kFar}) {
    Hand body;
    body.turning(3, at, 0);
    const Hand start = body;
    FreeJudge pushed(body.package, start.state(), {body.kinetic(), 0}, true);
    for (Vec3& v : body.velocities) v[0] += 1e-3F;
    pushed.observe(body.state(), kStep);
    EXPECT_GT(ratio(pushed.findings(), StepsCriterion::momentum), 3);
    // Far away the arms are not known to more than 2 √3 ε: a twist has to be larger to be seen.
    body.turning(at.isZero() ? 3.003 : 3.03, at, 0);
    FreeJudge twisted(body.package, start.state(), {body.kinetic(), 0}, true);
    twisted.observe(body.state(), kStep);
    EXPECT_GT(ratio(twisted.findings(), StepsCriterion::angular), 1.5);
    EXPECT_LE(ratio(twisted.findings(), StepsCriterion::momentum), 1);
  }
}

TEST(FreeJudge, SeesACentreThatGoesElsewhereThanItsMomentum) {
  Hand body;
  body.turning(3, Vector3d::Zero(), 0);
  FreeJudge judge(body.package, body.state(), {body.kinetic(), 0}, true);
  for (int i = 1; i <= 60; ++i) {
    body.turning(3, {1e-2 * i * kStep, 0, 0}, i * kStep);
    judge.observe(body.state(), kStep);
  }
  EXPECT_LE(ratio(judge.findings(), StepsCriterion::momentum), 1);
  EXPECT_GT(ratio(judge.findings(), StepsCriterion::centre), 10);
}

TEST(RestJudge, TellsRestFromMotion) {
  Hand body;
  RestJudge still(body.package, body.state(), kSteadyRestSpeed);
  for (int i = 0; i < 60; ++i) still.observe(body.state(), kStep);
  ASSERT_NE(find(still.findings(), StepsCriterion::speed), nullptr);
  EXPECT_EQ(ratio(still.findings(), StepsCriterion::speed), 0);
  EXPECT_EQ(find(still.findings(), StepsCriterion::creep), nullptr);

  Hand shaking;
  for (std::size_t v = 0; v < shaking.velocities.size(); ++v) {
    shaking.velocities[v][2] = float((v % 2 == 0 ? 2e-4 : -2e-4) * shaking.diagonal);
  }
  RestJudge steady(body.package, body.state(), kSteadyRestSpeed), any(body.package, body.state(), kRestSpeed);
  for (int i = 0; i < 60; ++i) {
    const Hand& now = i == 30 ? shaking : body;  // in one step alone
    steady.observe(now.state(), kStep);
    any.observe(now.state(), kStep);
  }
  EXPECT_NEAR(ratio(steady.findings(), StepsCriterion::speed), 2, 0.01);
  EXPECT_NEAR(ratio(any.findings(), StepsCriterion::speed), 0.2, 0.01);
}

TEST(RestJudge, SeesDriftWithoutSpeedButNotRounding) {
  Hand body;
  RestJudge drift(body.package, body.state(), kSteadyRestSpeed);
  for (int i = 1; i <= 60; ++i) {
    body.rest({0, 2e-4 * body.diagonal * i * kStep, 0});
    drift.observe(body.state(), kStep);
  }
  EXPECT_GT(ratio(drift.findings(), StepsCriterion::speed), 1.5);

  Hand far;
  far.rest(kFar);
  RestJudge rounded(far.package, far.state(), kSteadyRestSpeed);
  far.rest(kFar + Vector3d(2e-4, 2e-4, 2e-4));  // less than ε: other floats, the same place
  rounded.observe(far.state(), 1);
  EXPECT_LE(ratio(rounded.findings(), StepsCriterion::speed), 1);
}

TEST(RestJudge, SeesCreepAlongASlopeOnly) {
  const Vector3d normal(-0.6, 0.8, 0), down(-0.8, -0.6, 0);
  for (const bool sliding : {true, false}) {
    Hand body;
    RestJudge judge(body.package, body.state(), kRestSpeed, narrow(normal));
    for (int i = 1; i <= 60; ++i) {
      body.rest((sliding ? down : normal) * (3e-5 * body.diagonal * i * kStep));
      judge.observe(body.state(), kStep);
    }
    const double creep = ratio(judge.findings(), StepsCriterion::creep);
    EXPECT_TRUE(sliding ? creep > 2 : creep < 1) << creep;
    EXPECT_LE(ratio(judge.findings(), StepsCriterion::speed), 1);
  }
  // By velocities too, where nothing seems to move.
  Hand body;
  RestJudge judge(body.package, body.state(), kRestSpeed, narrow(normal));
  for (Vec3& v : body.velocities) v = narrow(Vector3d(down * (3e-5 * body.diagonal)));
  judge.observe(body.state(), 1);
  EXPECT_NEAR(ratio(judge.findings(), StepsCriterion::creep), 3, 0.01);
}

TEST(StepsMeasure, ShapeIsWhatARigidMotionDoesNotExplain) {
  Hand body;
  for (const Vector3d& at : {Vector3d(Vector3d::Zero()), kFar}) {
    body.turning(3, at, 0.7);
    EXPECT_LE(shapeOf(body.package, body.positions).ratio(), 1);
  }
  EXPECT_GT(shapeOf(body.package, body.positions).value, 1e-5);  // rounding at 10 km is seen, and allowed for
  body.rest(Vector3d::Zero());
  EXPECT_LT(shapeOf(body.package, body.positions).ratio(), 1e-3);
  std::vector<Vec3> stretched = body.positions, mirrored = stretched;
  for (Vec3& x : stretched) x[0] *= 1.01F;
  for (Vec3& x : mirrored) x[1] = -x[1];
  EXPECT_GT(shapeOf(body.package, stretched).ratio(), 1);
  EXPECT_GT(shapeOf(body.package, mirrored).ratio(), 100);
}

TEST(StepsMeasure, BelowTheGroundIsSeenOfWhatHangsElseOfPhysicalVertices) {
  const Hand body;
  GroundPlane ground;
  ground.offset = float(lowestAlong(body.positions, ground.normal));
  EXPECT_LE(groundOf(body.package, body.positions, {}, ground).ratio(), 1e-3);
  const std::vector<Vec3> drawn = {{0, ground.offset - 0.02F * float(body.diagonal), 0}};
  EXPECT_NEAR(groundOf(body.package, body.positions, drawn, ground).ratio(), 2, 0.01);
  ground.offset += 0.05F * float(body.diagonal);
  EXPECT_NEAR(groundOf(body.package, body.positions, {}, ground).ratio(), 5, 0.01);
}

TEST(StepsMeasure, EnergyOfABodyIsThatOfItsVelocities) {
  World world;
  const BodyId id = *world.addBody(boxAsset());
  EXPECT_EQ(energyOf(world, id, true).kinetic, 0);
  Hand body;
  body.turning(3, Vector3d::Zero(), 0);
  world.setState(id, body.positions, body.velocities);
  EXPECT_NEAR(energyOf(world, id, true).kinetic, body.kinetic(), 1e-6 * body.kinetic());
}

TEST(Steps, SequencesAreWhatTheyAreCalled) {
  StepLengths hitch(StepsSequence::hitch, 1), slow(StepsSequence::slow_frame, 1), random(StepsSequence::random, 1),
      jitter(StepsSequence::jitter, 1), far(StepsSequence::alternating_far, 1);
  double second = 0, longest = 0;
  for (int i = 0; i < 31; ++i) {
    const double h = double(hitch.next());
    second += h;
    longest = std::max(longest, h);
  }
  EXPECT_NEAR(second, 1, 1e-6);
  EXPECT_EQ(longest, 0.5);
  int slow_frames = 0;
  for (int i = 0; i < 59; ++i) slow_frames += slow.next() > 0.03F ? 1 : 0;
  EXPECT_EQ(slow_frames, 1);
  EXPECT_EQ(far.next(), 0.05F);
  EXPECT_EQ(far.next(), 0.001F);
  double least = 1, most = 0;
  for (int i = 0; i < 2000; ++i) {
    const double h = double(random.next()), j = double(jitter.next());
    EXPECT_TRUE(h >= 0.999e-5 && h <= 1 && j >= 0.00499 && j <= 0.0501);
    least = std::min(least, h);
    most = std::max(most, h);
  }
  EXPECT_LT(least, 2e-5);
  EXPECT_GT(most, 0.5);
}

TEST(Steps, DesignsHoldWhatTheySay) {
  const std::vector<StepsBody> bodies = {{"one", boxAsset()}, {"other", boxAsset()}};
  StepsOptions options;
  options.design = StepsDesign::full;
  const auto full = stepsCells(options, bodies);
  EXPECT_EQ(full.size(), 2U * 3 * kStepsSequenceCount * 4 * kStepsSceneCount);
  EXPECT_EQ(std::set<StepsCell>(full.begin(), full.end()).size(), full.size());
  for (const StepsDesign design : {StepsDesign::pairs, StepsDesign::triples}) {
    options.design = design;
    const auto cells = stepsCells(options, bodies);
    EXPECT_EQ(cells, stepsCells(options, bodies));
    std::set<std::pair<int, int>> seen;
    for (const StepsCell& cell : cells) seen.insert({cell[2], cell[4]});
    EXPECT_EQ(seen.size(), kStepsSequenceCount * kStepsSceneCount);
    EXPECT_LT(cells.size(), full.size());
  }
  options.design = StepsDesign::chance;
  options.chance = 500;
  const auto drawn = stepsCells(options, bodies);
  EXPECT_EQ(drawn.size(), 500U);
  EXPECT_EQ(drawn, stepsCells(options, bodies));
  options.seed = 2;
  EXPECT_NE(drawn, stepsCells(options, bodies));
  options.only = "scene=tumble place=4km";
  for (const StepsCell& cell : stepsCells(options, bodies)) {
    EXPECT_EQ(cell[4], std::uint8_t(StepsScene::tumble));
    EXPECT_EQ(cell[3], 2);
  }
}

TEST(Steps, ARestingBodyPassesAndACellIsTheSameEachTime) {
  const std::vector<StepsBody> bodies = {{"box", boxAsset()}};
  const auto of = [](StepsScene scene) {
    return StepsCell{0, std::uint8_t(StepsMaterial::usual), std::uint8_t(StepsSequence::constant), 0,
                     std::uint8_t(scene)};
  };
  const StepsResult rest = runStepsCell(of(StepsScene::rest), bodies);
  EXPECT_TRUE(rest.passed()) << nameOf(rest.worst().criterion) << " " << rest.worst().ratio();
  EXPECT_NE(find(rest.findings, StepsCriterion::speed), nullptr);
  EXPECT_NE(find(rest.findings, StepsCriterion::shape), nullptr);
  for (const StepsScene scene : {StepsScene::scattered, StepsScene::move, StepsScene::handled}) {
    const StepsResult one = runStepsCell(of(scene), bodies), two = runStepsCell(of(scene), bodies);
    ASSERT_EQ(one.findings.size(), two.findings.size());
    for (std::size_t i = 0; i < one.findings.size(); ++i) EXPECT_EQ(one.findings[i].value, two.findings[i].value);
  }
}

TEST(Steps, MinutesOfABodyThatStandsAndHangs) {
  const std::vector<StepsBody> bodies = {{"box", boxAsset()}};
  StepsOptions options;
  options.only = "material=usual";
  options.threads = 1;
  const std::vector<LongRun> runs = runLong(2, options, bodies);
  ASSERT_EQ(runs.size(), 2U);
  for (const LongRun& run : runs) {
    EXPECT_TRUE(run.finite);
    ASSERT_EQ(run.minutes.size(), 2U);
    EXPECT_GT(run.minutes[0].moved, 0);                     // it gives way
    EXPECT_LT(run.minutes[1].moved, run.minutes[0].moved);  // and has done so
  }
}

TEST(StepsBodies, AreBakedAndStandOnTheGround) {
  const std::vector<StepsBody> bodies = builtInStepsBodies(SINEW_TEST_IMPORT_WORKER);
  ASSERT_EQ(bodies.size(), 7U);
  for (const StepsBody& body : bodies) {
    const formats::PackageView& package = body.asset->package();
    EXPECT_EQ(package.pieces().size(), body.name == "uneven" ? 2U : 1U) << body.name;
    EXPECT_LT(package.physicalVertices().size(), 1000U) << body.name;
    EXPECT_FALSE(package.visualPositions().empty()) << body.name;
    EXPECT_NEAR(package.info().origin[1] + double(package.info().bounds_min[1]), 0, 1e-6) << body.name;
  }
  EXPECT_EQ(bodies.back().asset->package().tetrahedra().size(), 1U);
}

}  // namespace
}  // namespace sinew::tools

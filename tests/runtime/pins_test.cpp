// SPDX-License-Identifier: MIT
//
// Pin sets on the wall beam of Henriques 2006, figures 4 to 6: 1 x 0.2 x 0.2 m, held at one end.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "sinew/runtime/world.h"
#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"
#include "tests/support/field_content.h"

namespace sinew::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using formats::ClusterMechanics;
using formats::ClusterMode;

constexpr double kMass = 40;  // kg: 0.04 m³ of 1000 kg/m³

struct Beam {
  std::array<std::uint32_t, 3> cells = {20, 4, 4};
  std::uint32_t clusters = 1;
  ClusterMode mode = ClusterMode::quadratic;
  ClusterMechanics mechanics = formats::kPlainMechanics;
  float hz = 3;
  PinMethod method = PinMethod::constrained_fit;
  float gravity = 9.81F;
  std::uint32_t iterations = 4;
  bool residuals = false;
};

ClusterMechanics elastic(float young, float poisson) {
  ClusterMechanics m = formats::kPlainMechanics;
  m.stiffness = formats::StiffnessModel::elastic;
  m.young = young;
  m.poisson = poisson;
  m.damping = 2;
  return m;
}

struct HeldBeam {
  explicit HeldBeam(const Beam& beam) : world(settingsOf(beam)) {
    BoxOptions box;
    box.cells = beam.cells;
    box.size = {1, 0.2, 0.2};
    box.center = {0.5, 0, 0};
    box.clusters = {beam.clusters, 1, 1};
    box.mode = beam.mode;
    box.stretch_hz = box.bend_hz = box.twist_hz = beam.hz;
    formats::PackageContent content = boxContent(box);
    content.mechanics.assign(content.clusters.size(), beam.mechanics);
    if (beam.residuals) {
      addFields(content);
      addResiduals(content);
    }
    asset = makeAsset(content);
    body = *world.addBody(asset);
    const auto vertices = asset->package().physicalVertices();
    for (std::uint32_t i = 0; i < vertices.size(); ++i) {
      const Vector3d x = wide(vertices[i].rest_position);
      if (x[0] < 1e-6) wall.push_back(i);
      if (x[0] > 1 - 1e-6) end.push_back(i);
    }
    auto set = world.addPinSet(body, wall, {}, beam.method);
    EXPECT_TRUE(set) << set.reason();
    pins = *set;
  }
  static WorldSettings settingsOf(const Beam& beam) {
    WorldSettings settings;
    settings.gravity = {0, -beam.gravity, 0};
    settings.iterations = beam.iterations;
    return settings;
  }
  Vector3d endMean() const {
    Vector3d mean = Vector3d::Zero();
    for (const std::uint32_t i : end) mean += wide(world.positions(body)[i]) / double(end.size());
    return mean;
  }
  double sag() const { return -endMean()[1]; }
  double wallError() const {
    double worst = 0;
    for (const std::uint32_t i : wall) {
      worst = std::max(
          worst, (wide(world.positions(body)[i]) - wide(asset->package().physicalVertices()[i].rest_position)).norm());
    }
    return worst;
  }
  double volume() const {
    double sum = 0;
    for (const auto& t : asset->package().tetrahedra()) {
      const auto x = world.positions(body);
      const Vector3d a = wide(x[t.vertex[0]]);
      sum += (wide(x[t.vertex[1]]) - a).cross(wide(x[t.vertex[2]]) - a).dot(wide(x[t.vertex[3]]) - a) / 6;
    }
    return sum;
  }
  World world;
  std::shared_ptr<const Asset> asset;
  BodyId body;
  PinSetId pins;
  std::vector<std::uint32_t> wall, end;
};

TEST(PinSets, TheWallStaysExactlyAndCarriesTheWeight) {
  for (const ClusterMechanics& mechanics : {formats::kPlainMechanics, elastic(1e6F, 0.3F)}) {
    for (const std::uint32_t clusters : {1U, 3U}) {
      Beam beam;
      beam.mechanics = mechanics;
      beam.clusters = clusters;
      HeldBeam held(beam);
      run(held.world, 6);
      EXPECT_EQ(held.wallError(), 0);
      const PinReaction reaction = held.world.pinReaction(held.pins);
      // The reaction is what the body does to the wall: its weight, and the moment of it about the wall's middle.
      const Motion motion = motionOf(held.world, held.body);
      EXPECT_NEAR(double(reaction.force[1]), -kMass * 9.81, 0.01 * kMass * 9.81);
      EXPECT_NEAR(double(reaction.force[0]), 0, 0.01 * kMass * 9.81);
      EXPECT_NEAR(double(reaction.torque[2]), -kMass * 9.81 * motion.center[0], 0.02 * kMass * 9.81 * 0.5);
      EXPECT_NEAR(double(reaction.torque[0]), 0, 0.01 * kMass * 9.81);
    }
  }
}

TEST(PinSets, EveryMethodHoldsTheWallAndStaysFinite) {
  for (const PinMethod method :
       {PinMethod::hold, PinMethod::infinite_mass, PinMethod::matrix, PinMethod::constrained_fit}) {
    for (const ClusterMode mode : {ClusterMode::rigid, ClusterMode::linear, ClusterMode::quadratic}) {
      Beam beam;
      beam.method = method;
      beam.mode = mode;
      HeldBeam held(beam);
      run(held.world, 3);
      EXPECT_TRUE(allFinite(held.world, held.body));
      EXPECT_LT(held.wallError(), 1e-6);
      EXPECT_LT(rmsSpeed(held.world, held.body), 20);
    }
  }
}

TEST(PinSets, ABodyFollowsItsTransformRigidly) {
  // Moved and turned slowly, a stiff body keeps its shape; the transform is where it was told to be.
  Beam beam;
  beam.hz = 30;
  beam.gravity = 0;
  HeldBeam held(beam);
  const float h = 1.0F / 60;
  const double turn = 1.2;
  RigidTransform at;
  for (int step = 1; step <= 120; ++step) {
    const double part = step / 120.0;
    const Matrix3d r = Eigen::AngleAxisd(turn * part, Vector3d(0.3, 1, 0.2).normalized()).toRotationMatrix();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) at.rotation[std::size_t(3 * i + j)] = float(r(i, j));
    }
    at.position = {float(part), float(2 * part), 0};
    held.world.movePinSet(held.pins, at);
    held.world.step(h);
  }
  run(held.world, 4);
  const Matrix3d r = Eigen::AngleAxisd(turn, Vector3d(0.3, 1, 0.2).normalized()).toRotationMatrix();
  const auto vertices = held.asset->package().physicalVertices();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Vector3d expected = r * wide(vertices[i].rest_position) + Vector3d(1, 2, 0);
    EXPECT_LT((wide(held.world.positions(held.body)[i]) - expected).norm(), 1e-3);
  }
  for (const std::uint32_t i : held.wall) {
    const Vector3d expected = r * wide(vertices[i].rest_position) + Vector3d(1, 2, 0);
    EXPECT_LT((wide(held.world.positions(held.body)[i]) - expected).norm(), 2e-6);
  }
}

TEST(PinSets, AHangingBodyPullsWithItsWeightWhateverTheMethod) {
  for (const PinMethod method : {PinMethod::hold, PinMethod::infinite_mass, PinMethod::constrained_fit}) {
    Beam beam;
    beam.method = method;
    beam.hz = 8;
    HeldBeam held(beam);
    run(held.world, 6);
    const PinReaction reaction = held.world.pinReaction(held.pins);
    EXPECT_NEAR(double(reaction.force[1]), -kMass * 9.81, 0.02 * kMass * 9.81) << int(method);
  }
}

TEST(PinSets, WeightsMakeSpringsOrNothing) {
  BoxOptions box;
  box.cells = {10, 2, 2};
  box.size = {1, 0.2, 0.2};
  box.mode = ClusterMode::quadratic;
  formats::PackageContent content = boxContent(box);
  content.pin_weights.assign(content.physical_vertices.size(), 0.0F);
  std::vector<std::uint32_t> wall;
  for (std::uint32_t i = 0; i < content.physical_vertices.size(); ++i) {
    if (content.physical_vertices[i].rest_position[0] > -0.5F + 1e-6F) continue;
    wall.push_back(i);
    content.pin_weights[i] = 0.5F;
  }
  WorldSettings settings;
  World world(settings);
  const BodyId body = *world.addBody(makeAsset(content));
  const std::uint32_t free_vertex = std::uint32_t(content.physical_vertices.size() - 1);
  EXPECT_FALSE(world.addPinSet(body, std::span(&free_vertex, 1)));
  const auto pins = world.addPinSet(body, wall);
  ASSERT_TRUE(pins);
  run(world, 6);
  double lowest = 0;
  for (const std::uint32_t i : wall) {
    lowest = std::min(lowest, double(world.positions(body)[i][1] - content.physical_vertices[i].rest_position[1]));
  }
  EXPECT_LT(lowest, -1e-5);  // they give
  EXPECT_GT(lowest, -0.1);   // and hold
  EXPECT_NEAR(double(world.pinReaction(*pins).force[1]), -kMass * 9.81, 0.02 * kMass * 9.81);
}

TEST(PinSets, RefusesWhatItCannotHold) {
  World world;
  const BodyId body = *world.addBody(boxAsset());
  const std::uint32_t missing = 100000, first = 0;
  const std::array<std::uint32_t, 2> twice = {3, 3};
  RigidTransform mirrored;
  mirrored.rotation[0] = -1;
  EXPECT_NE(world.addPinSet(body, std::span(&missing, 1)).reason().find("100000 does not exist"), std::string::npos);
  EXPECT_NE(world.addPinSet(body, twice).reason().find("given twice"), std::string::npos);
  EXPECT_FALSE(world.addPinSet(body, {}));
  EXPECT_FALSE(world.addPinSet(body, std::span(&first, 1), mirrored));
  EXPECT_FALSE(world.addPinSet(BodyId{7}, std::span(&first, 1)));
  const auto set = world.addPinSet(body, std::span(&first, 1));
  ASSERT_TRUE(set);
  EXPECT_NE(world.addPinSet(body, std::span(&first, 1)).reason().find("pinned already"), std::string::npos);
  world.removePinSet(*set);
  EXPECT_TRUE(world.addPinSet(body, std::span(&first, 1)));
  world.resetBody(body);
  EXPECT_TRUE(world.addPinSet(body, std::span(&first, 1)));
  EXPECT_EQ(world.pinReaction(*set).force, Vec3{});
}

// A box whose ends are pin sets of the package: "left" follows the world, "right" a bone.
std::shared_ptr<const Asset> boxWithPinSets() {
  BoxOptions box;
  box.cells = {10, 2, 2};
  box.size = {1, 0.2, 0.2};
  formats::PackageContent content = boxContent(box);
  content.pin_weights.assign(content.physical_vertices.size(), 1.0F);
  const auto add = [&](const char* name, const char* target, PinMethod method, float low, float high) {
    const auto first = std::uint32_t(content.pin_set_vertices.size());
    for (std::uint32_t i = 0; i < content.physical_vertices.size(); ++i) {
      const float x = content.physical_vertices[i].rest_position[0];
      if (x >= low && x <= high) content.pin_set_vertices.push_back(i);
    }
    content.pin_sets.push_back({content.addText(name), content.addText(target), std::uint32_t(method), first,
                                std::uint32_t(content.pin_set_vertices.size()) - first, 0});
  };
  add("left", "world", PinMethod::constrained_fit, -1, -0.49F);
  add("right", "bone", PinMethod::hold, 0.49F, 1);
  add("left again", "bone", PinMethod::hold, -1, -0.39F);  // shares its outer half with "left"
  return makeAsset(content);
}

Matrix3d turnAboutX(double angle) { return Eigen::AngleAxisd(angle, Vector3d::UnitX()).toRotationMatrix(); }

RigidTransform transformOf(const Matrix3d& rotation, const Vector3d& position) {
  RigidTransform result;
  for (int r = 0; r < 3; ++r) {
    result.position[std::size_t(r)] = float(position[r]);
    for (int c = 0; c < 3; ++c) result.rotation[std::size_t(3 * r + c)] = float(rotation(r, c));
  }
  return result;
}

// Largest distance of a package's pinned vertices from where a motion of the rest shape takes them, over all sets.
double packagePinError(const World& world, BodyId body, const std::array<RigidTransform, 3>& motions) {
  const formats::PackageView& package = world.asset(body).package();
  std::vector<std::uint8_t> held(package.physicalVertices().size(), 0);
  double worst = 0;
  for (std::size_t s = 0; s < package.pinSets().size(); ++s) {
    const formats::PinSet& set = package.pinSets()[s];
    for (const std::uint32_t v : package.pinSetVertices().subspan(set.first, set.count)) {
      if (held[v]++ != 0) continue;
      const Vector3d rest = wide(package.physicalVertices()[v].rest_position);
      Vector3d place = wide(motions[s].position);
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) place[r] += double(motions[s].rotation[std::size_t(3 * r + c)]) * rest[c];
      }
      worst = std::max(worst, (wide(world.positions(body)[v]) - place).norm());
    }
  }
  return worst;
}

TEST(PackagePins, HoldFromTheStartAndFollowTheirTargets) {
  World world;
  BodySettings placement;
  const RigidTransform placed = transformOf(turnAboutX(0.5), {1, 2, 3});
  placement.position = placed.position;
  placement.rotation = placed.rotation;
  const auto asset = boxWithPinSets();
  const BodyId body = *world.addBody(asset, placement);
  ASSERT_NE(world.pinSet(body, "left"), PinSetId{});
  EXPECT_EQ(world.pinSet(body, "nobody"), PinSetId{});
  run(world, 1);
  EXPECT_LT(packagePinError(world, body, {placed, placed, placed}), 1e-6);

  const RigidTransform moved = transformOf(turnAboutX(0.9), {1.1, 2, 3});
  EXPECT_EQ(world.movePinTarget(body, "bone", moved), 2U);  // "right", and of "left again" what "left" does not hold
  EXPECT_EQ(world.movePinTarget(body, "hand", moved), 0U);
  run(world, 0.5);
  EXPECT_LT(packagePinError(world, body, {placed, moved, moved}), 2e-6);
}

TEST(PackagePins, AreLetGoResetAndRestoredAsTheOthers) {
  World world;
  const auto asset = boxWithPinSets();
  const BodyId body = *world.addBody(asset);
  std::vector<std::byte> state(world.stateBytes(body));
  ASSERT_EQ(world.saveState(body, state), state.size());
  world.unpinAll(body);
  EXPECT_EQ(world.pinSet(body, "left"), PinSetId{});
  run(world, 0.5);
  EXPECT_LT(world.positions(body)[0][1], -0.5F);  // it falls
  ASSERT_TRUE(world.restoreState(body, state));
  EXPECT_NE(world.pinSet(body, "left"), PinSetId{});
  run(world, 0.5);
  EXPECT_LT(packagePinError(world, body, {}), 1e-6);
  world.unpinAll(body);
  world.resetBody(body);
  run(world, 0.5);
  EXPECT_LT(packagePinError(world, body, {}), 1e-6);

  BodySettings loose;
  loose.package_pins = false;
  const BodyId free_body = *world.addBody(asset, loose);
  EXPECT_EQ(world.pinSet(free_body, "left"), PinSetId{});
  run(world, 0.5);
  EXPECT_LT(world.positions(free_body)[0][1], -0.5F);
}

// The ends of an L drawn to twice their distance: its one cluster stretches by half at most, so the pins ask for what
// cannot be. It stays where the pins leave it; remembered impulses once shook it to 20 lengths a second.
TEST(Pins, DrawnBeyondTheLimitsTheBodyStaysCalm) {
  BoxOptions box;
  box.cells = {12, 8, 2};
  box.size = {1, 0.6, 0.16};
  box.mode = ClusterMode::quadratic;
  box.stretch_hz = 30;
  box.bend_hz = box.twist_hz = 10;
  box.keep = [](std::uint32_t x, std::uint32_t y, std::uint32_t) { return x < 4 || y < 2; };
  WorldSettings settings = weightless();
  settings.iterations = 8;
  World world(settings);
  formats::PackageContent content = boxContent(box);
  ClusterMechanics mechanics = formats::kPlainMechanics;
  mechanics.limit = formats::LimitMethod::principal;
  mechanics.stretch_min = 0.5F;
  mechanics.stretch_max = 1.5F;
  mechanics.volume = formats::VolumeMethod::principal;
  content.mechanics.assign(content.clusters.size(), mechanics);
  const BodyId body = *world.addBody(makeAsset(content));
  const std::vector<Vec3> start(world.positions(body).begin(), world.positions(body).end());
  for (int step = 0; step < 90; ++step) {
    const float pull = 0.5F * std::min(1.0F, float(step) / 30);
    for (std::uint32_t v = 0; v < start.size(); ++v) {
      if (std::abs(start[v][0]) < 0.45F) continue;
      world.pin(body, v, {start[v][0] + (start[v][0] > 0 ? pull : -pull), start[v][1], start[v][2]});
    }
    world.step(1.0F / 60);
  }
  EXPECT_LT(rmsSpeed(world, body), 0.05);
}

// The end of a bent beam, caught as it is and taken along: by one set, in a frame of its own, and vertex by vertex.
TEST(PinSets, HoldAsPinsOfTheirVerticesDo) {
  Beam beam;
  beam.residuals = true;
  HeldBeam by_set(beam), by_pins(beam);
  run(by_set.world, 1);
  run(by_pins.world, 1);
  ASSERT_GT(by_set.sag(), 0.01);
  const auto turned = [](double angle) {
    return Eigen::AngleAxisd(angle, Vector3d(1, 2, 2).normalized()).toRotationMatrix();
  };
  const Matrix3d begin = turned(0.7);
  const Vector3d origin(1, 2, -0.5);
  const auto transformOf = [](const Matrix3d& rotation, const Vector3d& position) {
    RigidTransform at;
    for (int i = 0; i < 9; ++i) at.rotation[std::size_t(i)] = float(rotation(i / 3, i % 3));
    for (int i = 0; i < 3; ++i) at.position[std::size_t(i)] = float(position[i]);
    return at;
  };
  const PinSetId set = *by_set.world.addPinSet(by_set.body, by_set.end, transformOf(begin, origin));
  const std::vector<Vec3> caught(by_set.world.positions(by_set.body).begin(),
                                 by_set.world.positions(by_set.body).end());
  for (const std::uint32_t v : by_pins.end) by_pins.world.pin(by_pins.body, v, caught[v]);
  double way = 0, off = 0;
  for (int step = 1; step <= 90; ++step) {
    const Matrix3d rotation = turned(0.7 + 0.3 * std::min(1.0, step / 60.0));
    const Vector3d position = origin + Vector3d(0.05, 0.1, 0.02) * std::min(1.0, step / 60.0);
    by_set.world.movePinSet(set, transformOf(rotation, position));
    for (const std::uint32_t v : by_pins.end) {
      const Vector3d at = position + rotation * begin.transpose() * (wide(caught[v]) - origin);
      by_pins.world.pin(by_pins.body, v, {float(at[0]), float(at[1]), float(at[2])});
    }
    by_set.world.step(1 / 60.0F);
    by_pins.world.step(1 / 60.0F);
    const auto x = by_set.world.positions(by_set.body), y = by_pins.world.positions(by_pins.body);
    for (std::size_t v = 0; v < x.size(); ++v) {
      way = std::max(way, (wide(x[v]) - wide(caught[v])).norm());
      off = std::max(off, (wide(x[v]) - wide(y[v])).norm());
    }
  }
  EXPECT_GT(way, 0.3);
  EXPECT_LT(off, 5e-4);
}

// A game draws, and changes what holds a body between two steps: nothing moves by that.
TEST(Pins, ComeAndGoWithoutMovingTheBody) {
  Beam beam;
  beam.residuals = true;
  HeldBeam drawing(beam), asking(beam);
  std::vector<Vec3> drawn(drawing.asset->package().visualPositions().size());
  const std::uint32_t middle = drawing.wall[drawing.wall.size() / 2] + 10;
  ASSERT_LT(middle, drawing.asset->package().physicalVertices().size());
  const Vec3 at = drawing.world.positions(drawing.body)[middle];
  using Change = std::function<void(HeldBeam&)>;
  const std::vector<std::pair<Change, bool>> changes = {
      {[&](HeldBeam& held) {
         held.world.pin(held.body, middle, {at[0], at[1] - 0.05F, at[2]});
       },
       true},
      {[](HeldBeam& held) {
         held.world.pick(held.body, 0, {0.5F, 0.5F, 0});
       },
       false},
      {[&](HeldBeam& held) { held.world.unpin(held.body, middle); }, false},
      {[](HeldBeam& held) { held.world.releasePicks(held.body); }, false},
      {[](HeldBeam& held) { EXPECT_TRUE(held.world.addPinSet(held.body, held.end)); }, false},
      {[](HeldBeam& held) { held.world.unpinAll(held.body); }, false},
  };
  for (std::size_t c = 0; c < changes.size(); ++c) {
    run(drawing.world, 0.3);
    run(asking.world, 0.3);
    const auto asked = asking.world.positions(asking.body);
    const std::vector<Vec3> before(asked.begin(), asked.end());
    drawing.world.visualVertices(drawing.body, {drawn[0].data(), 12, std::uint32_t(drawn.size())}, {});
    changes[c].first(asking);
    changes[c].first(drawing);
    const auto after = drawing.world.positions(drawing.body);
    double most = 0;
    for (std::size_t v = 0; v < before.size(); ++v) {
      if (changes[c].second && v == middle) continue;  // a new pin's own vertex may be drawn there at once
      most = std::max(most, (wide(after[v]) - wide(before[v])).norm());
    }
    EXPECT_EQ(most, 0) << "change " << c;
  }
}

// Nothing but the minimum itself says how fast what hangs on pins is.
TEST(Pins, AStiffPendulumGainsNothing) {
  BoxOptions box;
  box.size = {1, 0.1, 0.1};
  box.cells = {10, 2, 2};
  box.stretch_hz = box.bend_hz = box.twist_hz = 60;
  formats::PackageContent content = boxContent(box);
  addFields(content);
  addResiduals(content);
  const auto asset = makeAsset(content);
  WorldSettings settings;
  settings.damping = settings.support_damping = settings.deformation_damping_ratio = 0;
  World world(settings);
  const BodyId body = *world.addBody(asset);
  const auto places = world.positions(body);
  std::vector<std::pair<std::uint32_t, Vec3>> hinge;
  for (std::uint32_t v = 0; v < places.size(); ++v) {
    if (places[v][0] < -0.499F && std::abs(places[v][1]) < 0.01F) hinge.emplace_back(v, places[v]);
  }
  ASSERT_EQ(hinge.size(), 3U);
  for (const auto& [vertex, at] : hinge) world.pin(body, vertex, at);
  const auto energyOf = [&] {
    const auto energy = world.energy(body);
    const Motion motion = motionOf(world, body);
    return energy.kinetic + energy.elastic + 9.81 * motion.mass * motion.center[1];
  };
  // From the side: half a length above the lowest place.
  const double first = energyOf(), swing = 0.5 * 9.81 * motionOf(world, body).mass;
  double most = first;
  for (int i = 0; i < 1200; ++i) {
    world.step(1.0F / 60);
    most = std::max(most, energyOf());
  }
  EXPECT_LT(most - first, 0.05 * swing);
}

// What gives way at picks turns with the piece: pulls that are not toward their targets would turn it for ever.
TEST(Picks, PullTowardTheirTargets) {
  BoxOptions box;
  box.cells = {8, 8, 3};
  box.size = {0.5, 0.5, 0.2};
  box.keep = [](std::uint32_t x, std::uint32_t y, std::uint32_t) { return x < 2 || y < 2; };
  box.stretch_hz = box.bend_hz = box.twist_hz = 10;
  formats::PackageContent content = boxContent(box);
  addFields(content);
  addResiduals(content);
  content.field_residuals[0].scale *= 8;
  const auto asset = makeAsset(content);
  for (const std::uint32_t vertex : {0U, 70U, 150U}) {
    World world;
    const BodyId body = *world.addBody(asset);
    const Vec3 at = world.positions(body)[vertex];
    world.pick(body, BodyPoint::physicalVertex(vertex), at, {10, 0});
    run(world, 30);
    ASSERT_LT(rmsSpeed(world, body), 1e-3) << vertex;
    const Vec3 center = world.motion(body).center;
    EXPECT_NEAR(center[0], at[0], 1e-3) << vertex;  // it hangs below
    EXPECT_NEAR(center[2], at[2], 1e-3) << vertex;
  }
}

// Residual modes ring all over a piece that is pulled at a point: what gives way to a pick is drawn near it alone.
TEST(Picks, FarFromThemTheFunctionsAreDrawn) {
  Beam beam;
  beam.residuals = true;
  beam.gravity = 0;
  HeldBeam held(beam);
  held.world.unpinAll(held.body);
  const std::uint32_t picked = held.end[0];
  const formats::PackageView& package = held.asset->package();
  const auto restOf = [&](std::size_t v) { return wide(package.physicalVertices()[v].rest_position); };
  const Vector3d target = restOf(picked) + Vector3d(0.1, 0.3, 0);
  ASSERT_NE(held.world.pick(held.body, BodyPoint::physicalVertex(picked),
                            {float(target[0]), float(target[1]), float(target[2])}),
            PickId{});
  run(held.world, 0.2);
  // What the functions leave of the drawn places, near and far.
  const formats::Field& field = package.fields()[0];
  const Eigen::Index k = field.function_count;
  const double reach = double(package.info().diagonal) / std::cbrt(double(k));
  for (const bool far : {true, false}) {
    std::vector<std::size_t> chosen;
    for (std::size_t v = 0; v < package.physicalVertices().size(); ++v) {
      if (((restOf(v) - restOf(picked)).norm() > reach) == far) chosen.push_back(v);
    }
    const auto rows = Eigen::Index(chosen.size());
    ASSERT_GT(rows, 2 * k);
    Eigen::MatrixXd values(rows, k), places(rows, 3);
    for (Eigen::Index i = 0; i < rows; ++i) {
      const std::size_t v = chosen[std::size_t(i)];
      for (Eigen::Index j = 0; j < k; ++j) {
        values(i, j) =
            double(package.fieldValues()[field.first_value + std::size_t(k) * (v / 8) + std::size_t(j)][v % 8]);
      }
      places.row(i) = wide(held.world.positions(held.body)[v]).transpose();
    }
    const double left = (values * values.colPivHouseholderQr().solve(places) - places).cwiseAbs().maxCoeff();
    if (far) {
      EXPECT_LT(left, 1e-5);
    } else {
      EXPECT_GT(left, 1e-4);
    }
  }
}

TEST(PinSets, ALetGoBodyIsFree) {
  Beam beam;
  beam.gravity = 0;
  HeldBeam held(beam);
  held.world.removePinSet(held.pins);
  const Motion before = motionOf(held.world, held.body);
  std::vector<Vec3> x(held.world.positions(held.body).begin(), held.world.positions(held.body).end());
  std::vector<Vec3> v(x.size(), Vec3{1, 2, 3});
  held.world.setState(held.body, x, v);
  run(held.world, 1);
  const Motion after = motionOf(held.world, held.body);
  const double kept = std::exp(-double(held.world.settings().damping));
  EXPECT_LT((after.momentum - kept * before.mass * Vector3d(1, 2, 3)).norm(), 1e-4 * after.momentum.norm());
}

}  // namespace
}  // namespace sinew::test

// SPDX-License-Identifier: GPL-3.0-or-later
//
// What clusters say of their material beside its stiffness, as terms of a piece's energy: limits, plasticity,
// activation, damping of their own.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <vector>

#include "sinew/runtime/world.h"
#include "tests/support/box_package.h"
#include "tools/bake/fields.h"

namespace sinew {
namespace {

using Mechanics = formats::ClusterMechanics;

/// A bar of 1 x 0.2 x 0.2 m about the origin, of one cluster. \param pinned its face at x = -0.5 is held.
std::shared_ptr<const Asset> barOf(bool pinned, float hz, const std::function<void(formats::PackageContent&)>& change) {
  test::BoxOptions box;
  box.cells = {10, 2, 2};
  box.size = {1, 0.2, 0.2};
  box.clusters = {1, 1, 1};
  box.stretch_hz = hz;
  formats::PackageContent content = test::boxContent(box);
  content.mechanics.assign(content.clusters.size(), formats::kPlainMechanics);
  if (pinned) {
    for (std::uint32_t v = 0; v < content.physical_vertices.size(); ++v) {
      if (content.physical_vertices[v].rest_position[0] < -0.499F) content.pin_set_vertices.push_back(v);
    }
    content.pin_sets.push_back(
        {content.addText("held"), content.addText("world"), 3, 0, std::uint32_t(content.pin_set_vertices.size()), 0});
  }
  change(content);
  tools::addFields({}, content);
  return *Asset::fromMemory(formats::writePackage(content));
}

struct Box {
  std::array<double, 3> low = {1e9, 1e9, 1e9}, high = {-1e9, -1e9, -1e9};
  double size(std::size_t c) const { return high[c] - low[c]; }
};

Box boxOf(const World& world, BodyId body) {
  Box box;
  for (const Vec3& x : world.positions(body)) {
    for (std::size_t c = 0; c < 3; ++c) {
      box.low[c] = std::min(box.low[c], double(x[c]));
      box.high[c] = std::max(box.high[c], double(x[c]));
    }
  }
  return box;
}

/// What sections of a bar say of F: the largest stretch along x between neighbours, and the largest |F|^2 that this and
/// their width make.
struct Strain {
  double stretch = 0, norm = 0;
};

Strain strainOf(const World& world, BodyId body) {
  struct Section {
    double x = 0, count = 0, wide2 = 0, rest_wide2 = 0;
  };
  std::array<Section, 11> sections;
  const auto x = world.positions(body);
  const auto vertices = world.asset(body).package().physicalVertices();
  for (std::size_t i = 0; i < x.size(); ++i) {
    const formats::Float3& rest = vertices[i].rest_position;
    Section& section = sections[std::size_t(std::lround(double(rest[0] + 0.5F) * 10))];
    section.x += double(x[i][0]);
    section.count += 1;
    for (std::size_t c = 1; c < 3; ++c) {
      section.wide2 += double(x[i][c]) * double(x[i][c]);
      section.rest_wide2 += double(rest[c]) * double(rest[c]);
    }
  }
  Strain strain;
  for (std::size_t s = 0; s + 1 < sections.size(); ++s) {
    const Section &a = sections[s], &b = sections[s + 1];
    const double stretch = 10 * (b.x / b.count - a.x / a.count);
    strain.stretch = std::max(strain.stretch, stretch);
    strain.norm = std::max(strain.norm, stretch * stretch + 2 * (a.wide2 + b.wide2) / (a.rest_wide2 + b.rest_wide2));
  }
  return strain;
}

/// x of the centre of mass.
double centerOf(const World& world, BodyId body) {
  double sum = 0, mass = 0;
  const auto vertices = world.asset(body).package().physicalVertices();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    sum += double(vertices[i].mass) * double(world.positions(body)[i][0]);
    mass += double(vertices[i].mass);
  }
  return sum / mass;
}

struct LimitCase {
  const char* name;
  std::function<void(formats::PackageContent&)> change;
  double stretch, norm;  ///< bounds; 0: none
};

std::vector<LimitCase> limitCases() {
  const auto with = [](formats::LimitMethod method, const std::function<void(Mechanics&)>& change) {
    return [method, change](formats::PackageContent& content) {
      content.mechanics[0].limit = method;
      if (method == formats::LimitMethod::curve) content.curve_points = {{3.2F, 3.2F}, {4, 3.5F}, {6, 3.6F}};
      change(content.mechanics[0]);
    };
  };
  const auto stretches = [](Mechanics& m) { m.stretch_min = 0.8F, m.stretch_max = 1.25F; };
  const auto norms = [](Mechanics& m) { m.norm_max = m.norm_limit = 3.6F; };
  using enum formats::LimitMethod;
  return {{"principal", with(principal, stretches), 1.25, 0},
          {"rows", with(rows, stretches), 1.25, 0},
          {"frobenius", with(frobenius, norms), 0, 3.6},
          {"frobenius_cheap", with(frobenius_cheap, norms), 0, 3.6},
          {"soft", with(soft, [](Mechanics& m) { m.norm_max = 3.3F, m.norm_limit = 3.6F; }), 0, 3.6},
          {"curve", with(curve, [](Mechanics& m) { m.curve_point_count = 3; }), 0, 3.6}};
}

Strain hung(const std::function<void(formats::PackageContent&)>& change) {
  WorldSettings settings;
  settings.gravity = {120, 0, 0};
  World world(settings);
  const BodyId body = *world.addBody(barOf(true, 2, change));
  for (int step = 0; step < 1200; ++step) world.step(1.0F / 60);
  double speed = 0;
  for (const Vec3& v : world.velocities(body)) {
    for (const float c : v) speed = std::max(speed, std::abs(double(c)));
  }
  EXPECT_LT(speed, 0.02);
  return strainOf(world, body);
}

// Beyond a limit a sample is 10 (2 mu + lambda) stiffer: a bar that is drawn out without one is a few hundredths
// beyond.
TEST(Materials, EveryLimitHoldsAHangingBar) {
  const Strain loose = hung([](formats::PackageContent&) {});
  EXPECT_GT(loose.stretch, 1.7);
  EXPECT_GT(loose.norm, 4);
  for (const LimitCase& limit : limitCases()) {
    const Strain strain = hung(limit.change);
    EXPECT_GT(strain.stretch, 1.1) << limit.name;
    if (limit.stretch > 0) {
      EXPECT_LT(strain.stretch, limit.stretch + 0.06) << limit.name;
    }
    if (limit.norm > 0) {
      EXPECT_LT(strain.norm, limit.norm + 0.2) << limit.name;
    }
  }
}

double lengthAfterPull(float creep, float limit, float step) {
  const auto asset = barOf(true, 4, [&](formats::PackageContent& content) {
    content.mechanics[0].plastic_yield = 0.05F;
    content.mechanics[0].plastic_creep = creep;
    content.mechanics[0].plastic_limit = limit;
  });
  WorldSettings settings;
  settings.gravity = {250, 0, 0};
  World world(settings);
  const BodyId body = *world.addBody(asset);
  const double rest = boxOf(world, body).size(0);
  for (float t = 0; t < 1.5F; t += step) world.step(step);
  EXPECT_GT(boxOf(world, body).size(0), 1.15 * rest);
  world.settings().gravity = {0, 0, 0};
  for (float t = 0; t < 4; t += step) world.step(step);
  return boxOf(world, body).size(0) / rest;
}

TEST(Materials, WhatYieldsStaysAtAnyStep) {
  EXPECT_NEAR(lengthAfterPull(0, 0.5F, 1.0F / 60), 1, 2e-3);
  const double coarse = lengthAfterPull(4, 0.5F, 1.0F / 60), fine = lengthAfterPull(4, 0.5F, 1.0F / 240);
  EXPECT_GT(coarse, 1.1);
  EXPECT_NEAR(coarse, fine, 0.03 * coarse);
  // |S - 1| of a stretch by s that keeps the volume is about 1.2 (s - 1).
  EXPECT_LT(lengthAfterPull(4, 0.1F, 1.0F / 60), 1.1);
}

// At its limit a shape flows no more, and the body sleeps.
TEST(Materials, APlasticBodyFallsAsleep) {
  const auto asset = barOf(false, 2, [](formats::PackageContent& content) {
    content.mechanics[0].plastic_yield = 0.02F;
    content.mechanics[0].plastic_creep = 5;
    content.mechanics[0].plastic_limit = 0.1F;
  });
  WorldSettings settings;
  settings.gravity = {0, -30, 0};
  settings.ground.enabled = true;
  settings.ground.offset = -0.5F;
  settings.sleep_seconds = 0.5F;
  World world(settings);
  BodySettings turned;
  turned.rotation = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  const BodyId body = *world.addBody(asset, turned);
  for (int step = 0; step < 3000 && !world.isAsleep(body); ++step) world.step(1.0F / 60);
  EXPECT_TRUE(world.isAsleep(body));
}

// More points lie on the ground than there are contacts: walls have their share.
TEST(Contacts, WhatLiesOnTheGroundMeetsWalls) {
  test::BoxOptions box;
  box.cells = {24, 1, 24};
  box.size = {1, 0.06, 1};
  formats::PackageContent content = test::boxContent(box);
  tools::Settings baked;
  baked.field.points = 1024;
  tools::addFields(baked, content);
  const auto asset = *Asset::fromMemory(formats::writePackage(content));
  WorldSettings settings;
  settings.ground.enabled = true;
  settings.ground.offset = -0.03F;
  World world(settings);
  ColliderSettings wall;
  wall.at.position = {1.1F, 0, 0};
  ASSERT_TRUE(world.addCollider(BoxShape{{0.1F, 1, 1}}, wall));
  const BodyId body = *world.addBody(asset);
  for (int step = 0; step < 60; ++step) world.step(1.0F / 60);
  world.setVelocity(body, {4, 0, 0});
  double farthest = 0;
  for (int step = 0; step < 90; ++step) {
    world.step(1.0F / 60);
    for (const Vec3& x : world.positions(body)) farthest = std::max(farthest, double(x[0]));
  }
  EXPECT_GT(farthest, 0.9);
  EXPECT_LT(farthest, 1.1);
}

TEST(Materials, APlasticBodyIsSavedAndRestored) {
  const auto asset = barOf(true, 4, [](formats::PackageContent& content) { content.mechanics[0].plastic_creep = 4; });
  WorldSettings settings;
  settings.gravity = {250, 0, 0};
  World world(settings), other(settings);
  const BodyId body = *world.addBody(asset), twin = *other.addBody(asset);
  for (int step = 0; step < 60; ++step) world.step(1.0F / 60);
  std::vector<std::byte> bytes(world.stateBytes(body));
  ASSERT_EQ(world.saveState(body, bytes), bytes.size());
  ASSERT_TRUE(other.restoreState(twin, bytes));
  world.settings().gravity = other.settings().gravity = {0, -9.81F, 0};
  for (int step = 0; step < 60; ++step) {
    world.step(1.0F / 60);
    other.step(1.0F / 60);
  }
  for (std::size_t i = 0; i < world.positions(body).size(); ++i) {
    EXPECT_EQ(world.positions(body)[i], other.positions(twin)[i]);
  }
  EXPECT_GT(world.clusterRestShape(body, 0)[0], 1.02F);
}

// Nothing holds the bar: its tension shortens it as the cluster says, and leaves it where it is.
TEST(Materials, AFibreContractsABarAndLetsGo) {
  const auto asset = barOf(false, 10, [](formats::PackageContent& content) {
    content.channels.push_back({content.addText("biceps")});
    Mechanics& m = content.mechanics[0];
    m.fibre = {1, 0, 0};
    m.channel = 0;
    m.contraction = 0.3F;
  });
  WorldSettings settings;
  settings.gravity = {0, 0, 0};
  World world(settings);
  const BodyId body = *world.addBody(asset);
  const Box rest = boxOf(world, body);
  const auto run = [&] {
    for (int step = 0; step < 300; ++step) world.step(step % 2 == 0 ? 1.0F / 60 : 1.0F / 240);
  };
  EXPECT_FALSE(world.setActivation(body, "triceps", 1));
  EXPECT_FALSE(world.setActivation(body, "biceps", std::numeric_limits<float>::quiet_NaN()));
  for (const float active : {1.0F, 0.5F, 0.0F}) {
    ASSERT_TRUE(world.setActivation(body, "biceps", active));
    run();
    const Box now = boxOf(world, body);
    EXPECT_NEAR(now.size(0) / rest.size(0), 1 - 0.3 * double(active), 0.02) << active;
    EXPECT_GT(now.size(1) / rest.size(1), 1 + 0.08 * double(active) - 1e-3) << active;
    EXPECT_NEAR(centerOf(world, body), 0, 1e-6) << active;
    EXPECT_LT(world.energy(body).kinetic, 1e-8) << active;
  }
}

double ringingAfter(float damping) {
  const auto asset =
      barOf(false, 0.5F, [&](formats::PackageContent& content) { content.mechanics[0].damping = damping; });
  WorldSettings settings;
  settings.gravity = {0, 0, 0};
  settings.damping = settings.deformation_damping_ratio = 0;
  World world(settings);
  const BodyId body = *world.addBody(asset);
  std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end()), v(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) v[i] = {0.2F * x[i][0], 0, 0};
  world.setState(body, x, v);
  const double before = world.energy(body).kinetic;
  for (int step = 0; step < 120; ++step) world.step(1.0F / 240);
  const BodyEnergy energy = world.energy(body);
  return (energy.kinetic + energy.elastic) / before;
}

TEST(Materials, AClustersOwnDampingDecaysItsRinging) {
  EXPECT_GT(ringingAfter(0), 0.9);
  // Half of the energy is kinetic, and that loses exp(-2 d t).
  EXPECT_NEAR(ringingAfter(4), std::exp(-4 * 0.5), 0.04);
}

// Beam theory, by the bending moments of a weight spread evenly: where the free half has a quarter of the modulus the
// end goes (15 + 4) / 16 of its way lower; where the held half has it, 15 / 16 * 4 + 1 / 16.
TEST(Materials, PaintedStiffnessMultipliesTheModulus) {
  const auto sag = [](float held_half, float free_half) {
    const auto asset = barOf(true, 20, [&](formats::PackageContent& content) {
      for (formats::ClusterMechanics& mechanics : content.mechanics) {
        mechanics.stiffness = formats::StiffnessModel::elastic;
        mechanics.young = 2e6F;
        mechanics.poisson = 0;
      }
      for (const formats::PhysicalVertex& vertex : content.physical_vertices) {
        const float x = vertex.rest_position[0];
        content.vertex_stiffness.push_back(x < -0.01F  ? held_half
                                           : x > 0.01F ? free_half
                                                       : 0.5F * (held_half + free_half));
      }
    });
    WorldSettings settings;
    settings.gravity = {0, -0.5F, 0};
    settings.deformation_damping_ratio = 1;
    World world(settings);
    const BodyId body = *world.addBody(asset);
    for (int i = 0; i < 600; ++i) world.step(1.0F / 60);
    double low = 1e9;
    const auto x = world.positions(body);
    for (std::size_t v = 0; v < x.size(); ++v) {
      const Vec3& rest = asset->package().physicalVertices()[v].rest_position;
      if (rest[0] > 0.499F) low = std::min(low, double(x[v][1]) - double(rest[1]));
    }
    return -low;
  };
  const double even = sag(1, 1);
  EXPECT_GT(even, 1e-3);
  EXPECT_LT(even, 0.02);
  EXPECT_NEAR(sag(1, 0.25F) / even, 19.0 / 16, 0.06 * 19 / 16);
  EXPECT_NEAR(sag(0.25F, 1) / even, 61.0 / 16, 0.06 * 61 / 16);
}

}  // namespace
}  // namespace sinew

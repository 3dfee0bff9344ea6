// SPDX-License-Identifier: GPL-3.0-or-later
//
// The yardstick of `study error`, by theory and by the other finite elements here; its peers, by the yardstick.
#include "tools/study/error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/support/box_package.h"
#include "tools/study/explicit_solid.h"
#include "tools/study/packages.h"
#include "tools/study/peers.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kDensity = 1000;
const auto kNothing = [](double) {};

struct Beam {
  MotionBody body;
  MotionScene scene;
  std::array<double, 3> size;
  double young;

  // A beam along x, its rear quarter held; or, where there is a ground, nothing.
  Beam(std::array<int, 3> cells, std::array<double, 3> box_size, double poisson, double modulus,
       std::optional<MotionGround> ground = {})
      : size(box_size), young(modulus) {
    BoxBody box;
    box.cells = cells;
    box.size = size;
    const auto asset = boxPackage(box, {});
    scene.hold = HoldScene::cantilever;
    scene.ground = ground;
    scene.free = ground.has_value();
    const PackageSolid package_solid = packageSolid(asset->package());
    scene.regions = scene.holds(package_solid, asset->package(), extentOf(package_solid)).regions;
    body = motionBody(asset->package(), scene, {{modulus, poisson}}, {});
    // One density, whatever the package's masses are.
    ElasticSolid solid;
    solid.rest = body.rest;
    solid.tetrahedra = body.tetrahedra;
    const std::vector<double> volumes = nodalVolumes(solid);
    for (std::size_t v = 0; v < volumes.size(); ++v) body.masses[v] = kDensity * volumes[v];
    // Seen are the vertices themselves.
    body.surface = body.rest;
    body.areas.assign(body.rest.size(), 1);
    body.probes.assign(body.rest.size(), {});
    for (const auto& t : body.tetrahedra) {
      for (std::size_t k = 0; k < 4; ++k) {
        Probe probe{t, {}};
        probe.weight[k] = 1;
        body.probes[t[k]] = probe;
      }
    }
    // It touches by points midway along the edges of its lower side: the rule of degree 2 of each triangle.
    for (const auto& t : body.tetrahedra) {
      for (std::size_t top = 0; top < 4; ++top) {
        std::array<std::size_t, 3> face{};
        for (std::size_t k = 0; k < 3; ++k) face[k] = (top + 1 + k) % 4;
        if (!std::all_of(face.begin(), face.end(), [&](std::size_t k) { return body.rest[t[k]][1] < low() + 1e-6; })) {
          continue;
        }
        const Vector3d a = body.rest[t[face[0]]], b = body.rest[t[face[1]]], c = body.rest[t[face[2]]];
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t one = face[k], other = face[(k + 1) % 3];
          Probe probe{t, {}};
          probe.weight[one] = probe.weight[other] = 0.5;
          const auto v = std::uint32_t(body.surface.size());
          body.surface.push_back(0.5 * (body.rest[t[one]] + body.rest[t[other]]));
          body.areas.push_back(0);
          body.probes.emplace_back(probe);
          body.points.push_back({{v, v, v}, {1, 0, 0}, (b - a).cross(c - a).norm() / 6});
        }
      }
    }
  }

  double low() const {
    double y = 1e300;
    for (const Vector3d& x : body.rest) y = std::min(y, x[1]);
    return y;
  }
  // Length beyond what is held, from the held vertices that are farthest out.
  double length() const {
    double held = -1e300, end = -1e300;
    for (std::size_t v = 0; v < body.rest.size(); ++v) {
      end = std::max(end, body.rest[v][0]);
      if (body.region[v] >= 0) held = std::max(held, body.rest[v][0]);
    }
    return end - held;
  }
  // Mean height of the surface at the end, from its rest.
  double tip(const std::vector<Vector3f>& frame) const {
    double sum = 0, count = 0;
    double end = -1e300;
    for (const Vector3d& x : body.surface) end = std::max(end, x[0]);
    for (std::size_t v = 0; v < frame.size(); ++v) {
      if (body.surface[v][0] < end - 1e-6 * size[0]) continue;
      sum += double(frame[v][1]) - body.surface[v][1];
      ++count;
    }
    return sum / count;
  }
};

double rmsApart(const Motion& one, const Motion& other) {
  double sum = 0, count = 0;
  for (std::size_t f = 0; f < one.frames.size(); ++f) {
    for (std::size_t v = 0; v < one.frames[f].size(); ++v) {
      sum += double((one.frames[f][v] - other.frames[f][v]).squaredNorm());
      ++count;
    }
  }
  return std::sqrt(sum / count);
}

double rmsMoved(const MotionBody& body, const Motion& motion) {
  double sum = 0, count = 0;
  for (const auto& frame : motion.frames) {
    for (std::size_t v = 0; v < frame.size(); ++v) {
      sum += (frame[v].cast<double>() - body.surface[v]).squaredNorm();
      ++count;
    }
  }
  return std::sqrt(sum / count);
}

// Under a sudden gravity the end of a slender beam swings about the deflection that Euler and Bernoulli give,
// rho A g L^4 / 8 E I, at 1.875² / 2 pi sqrt(E I / rho A L^4) Hz, less what the damping slows it. Quadratic elements
// agree; linear ones are too stiff.
TEST(StudyError, AQuadraticBeamSagsAndSwingsAsTheorySays) {
  Beam beam({24, 2, 2}, {2.4, 0.2, 0.2}, 0, 2e6);
  beam.scene.gravity = {0, -0.05, 0};
  beam.scene.seconds = 10;
  const ExplicitRun quadratic = playSolid(beam.body, beam.scene, {}, kNothing);
  const ExplicitRun linear = playSolid(beam.body, beam.scene, {.quadratic = false}, kNothing);
  ASSERT_TRUE(quadratic.motion.finite);
  const double length = beam.length(), inertia = std::pow(beam.size[1], 4) / 12;
  const double weight = kDensity * beam.size[1] * beam.size[2];  // of a metre, kg
  const double sag = -weight * beam.scene.gravity[1] * std::pow(length, 4) / (8 * beam.young * inertia);
  const double omega = 1.875104 * 1.875104 * std::sqrt(beam.young * inertia / (weight * std::pow(length, 4)));
  const double decay = 0.5 * beam.scene.dampingAt(0);
  const double hertz = std::sqrt(omega * omega - decay * decay) / (2 * std::numbers::pi);
  std::vector<double> tip;
  double mean = 0;
  for (const auto& frame : quadratic.motion.frames) tip.push_back(beam.tip(frame));
  const std::size_t late = tip.size() * 3 / 4;
  for (std::size_t f = late; f < tip.size(); ++f) mean += tip[f] / double(tip.size() - late);
  EXPECT_NEAR(mean, -sag, 0.02 * sag);
  // Crossings of the rest that it swings about, while it swings.
  std::vector<double> crossings;
  for (std::size_t f = 1; f < tip.size() / 2; ++f) {
    if ((tip[f - 1] > mean) == (tip[f] > mean)) continue;
    crossings.push_back((double(f) - (tip[f] - mean) / (tip[f] - tip[f - 1])) * kFrameSeconds);
  }
  ASSERT_GT(crossings.size(), 3U);
  const std::size_t whole = (crossings.size() - 1) / 2 * 2;
  EXPECT_NEAR(0.5 * double(whole) / (crossings[whole] - crossings[0]), hertz, 0.02 * hertz);
  double linear_mean = 0;
  for (std::size_t f = late; f < tip.size(); ++f) {
    linear_mean += beam.tip(linear.motion.frames[f]) / double(tip.size() - late);
  }
  EXPECT_GT(linear_mean, -0.9 * sag);
}

// Linear elements come to the rest that the static solution of the same elements has, far from small strains too.
TEST(StudyError, TheReferenceComesToTheRestOfStatics) {
  Beam beam({8, 2, 2}, {1, 0.2, 0.2}, 0.3, 1e5);
  beam.scene.gravity = {0, -4, 0};
  beam.scene.release = true;  // what damps most; gravity ends too late to matter here
  beam.scene.seconds = 1;
  const ExplicitRun run = playSolid(beam.body, beam.scene, {.quadratic = false}, kNothing);
  ElasticSolid solid;
  solid.rest = beam.body.rest;
  solid.tetrahedra = beam.body.tetrahedra;
  solid.prescribed.resize(solid.rest.size());
  ElasticLoad load{beam.body.materials, {}};
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    if (beam.body.region[v] >= 0) solid.prescribed[v] = solid.rest[v];
    load.forces.push_back(beam.body.masses[v] * beam.scene.gravity);
  }
  const Equilibrium rest = equilibrium(solid, load, {}, 1e-9);
  const double wanted = beam.tip(probed(beam.body, rest.positions));
  EXPECT_LT(wanted, -0.05);
  EXPECT_NEAR(beam.tip(run.motion.frames.back()), wanted, 0.02 * std::abs(wanted));
}

// For small strains both laws are linear elasticity.
TEST(StudyError, TheLawsAgreeForSmallStrains) {
  Beam beam({6, 2, 2}, {1, 0.3, 0.3}, 0.35, 1e6);
  beam.scene.gravity = {0, -0.02, 0};
  beam.scene.seconds = 0.5;
  const ExplicitRun one = playSolid(beam.body, beam.scene, {}, kNothing);
  const ExplicitRun other = playSolid(beam.body, beam.scene, {.law = ElasticLaw::neo_hookean}, kNothing);
  EXPECT_LT(rmsApart(one.motion, other.motion), 2e-3 * rmsMoved(beam.body, one.motion));
}

// A bar that is pulled to 1.5 of its length is as thin in its middle as makes the law's energy least.
TEST(StudyError, ABarThatIsPulledIsAsThinAsItsLawSays) {
  Beam bar({24, 2, 2}, {2, 0.2, 0.2}, 0.4, 1e5);
  for (std::size_t v = 0; v < bar.body.rest.size(); ++v) {
    const double x = bar.body.rest[v][0];
    bar.body.region[v] = x < -1 + 1e-6 ? 0 : x > 1 - 1e-6 ? 1 : -1;
  }
  bar.scene.regions.assign(2, {});
  bar.scene.pose = [](std::size_t region, double time) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    if (region == 1) pose.translation()[0] = std::min(1.0, time);
    return pose;
  };
  bar.scene.damping = 8;
  bar.scene.seconds = 2;
  const double mu = 1e5 / 2.8, lambda = 2 * mu * 0.4 / 0.2, along = 1.5;
  const auto energy = [&](ElasticLaw law, double s) {
    const double j = along * s * s, squares = std::pow(along - 1, 2) + 2 * std::pow(s - 1, 2);
    const double g = j > 1 ? 4 * (std::pow(j, 0.25) - 1) : j - 1;
    if (law == ElasticLaw::corotated) return mu * squares + lambda / 2 * std::pow(along + 2 * s - 3, 2);
    if (law == ElasticLaw::determinant) return mu * squares + lambda / 2 * g * g;
    return mu / 2 * (along * along + 2 * s * s - 3) - mu * (j - 1) + (lambda + mu) / 2 * std::pow(j - 1, 2);
  };
  std::vector<double> found;
  for (const ElasticLaw law : {ElasticLaw::corotated, ElasticLaw::determinant, ElasticLaw::neo_hookean}) {
    double wanted = 0.5;
    for (double s = 0.5; s < 1; s += 1e-5) {
      if (energy(law, s) < energy(law, wanted)) wanted = s;
    }
    const ExplicitRun run = playSolid(bar.body, bar.scene, {.law = law}, kNothing);
    ASSERT_TRUE(run.motion.finite);
    double wide = 0, count = 0;
    for (std::size_t v = 0; v < bar.body.rest.size(); ++v) {
      const Vector3d& x = bar.body.rest[v];
      if (std::abs(x[0]) > 0.05 || std::abs(x[1]) < 0.1 - 1e-6) continue;
      wide += double(run.motion.frames.back()[v][1]) / x[1];
      ++count;
    }
    ASSERT_GT(count, 0);
    EXPECT_NEAR(wide / count, wanted, 0.005) << int(law);
    found.push_back(wanted);
  }
  EXPECT_GT(std::abs(found[0] - found[1]), 0.02);  // by far more than the tolerance
}

// In short steps the peers are the same linear elements: what the study measures of them is theirs.
TEST(StudyError, PeersComeNearTheSameElementsInShortSteps) {
  Beam beam({6, 2, 2}, {1, 0.3, 0.3}, 0.3, 1e6);
  beam.scene.gravity = {0, -20, 0};
  beam.scene.seconds = 0.75;
  const Motion same = playSolid(beam.body, beam.scene, {.quadratic = false}, kNothing).motion;
  const double moved = rmsMoved(beam.body, same);
  const auto off = [&](const Motion& motion) { return rmsApart(motion, same) / moved; };
  EXPECT_LT(off(playXpbd(beam.body, beam.scene, 40)), 0.03);
  EXPECT_GT(off(playXpbd(beam.body, beam.scene, 4)), 0.5);
  EXPECT_LT(off(playStiffnessWarping(beam.body, beam.scene, 40, 40)), 0.03);
  EXPECT_GT(off(playStiffnessWarping(beam.body, beam.scene, 1, 40)), 0.1);
#if SINEW_WITH_BULLET
  EXPECT_LT(off(playBullet(beam.body, beam.scene, BulletKind::finite_elements, 20, 0)), 0.03);
  EXPECT_LT(off(playBullet(beam.body, beam.scene, BulletKind::implicit_finite_elements, 4, 0)), 0.05);
#endif
}

// Ten million times as stiff and as heavy, a body moves alike.
TEST(StudyError, PeersDoNotMindTheUnit) {
  Beam beam({6, 2, 2}, {1, 0.3, 0.3}, 0.3, 1e6);
  beam.scene.gravity = {0, -20, 0};
  beam.scene.seconds = 0.25;
  const Motion warped = playStiffnessWarping(beam.body, beam.scene, 4, 40);
  const Motion xpbd = playXpbd(beam.body, beam.scene, 20);
  const double moved = rmsMoved(beam.body, warped);
  for (double& m : beam.body.masses) m *= 1e7;
  for (ElasticMaterial& m : beam.body.materials) m.young *= 1e7;
  EXPECT_LT(rmsApart(playStiffnessWarping(beam.body, beam.scene, 4, 40), warped), 1e-2 * moved);
  EXPECT_LT(rmsApart(playXpbd(beam.body, beam.scene, 20), xpbd), 1e-2 * moved);
}

// Cut into eight it is the same body: its mass, what is held and by how much, its fibres, where its surface lies.
TEST(StudyError, ARefinedBodyIsTheSame) {
  Beam beam({4, 2, 2}, {1, 0.3, 0.3}, 0.3, 3e4);
  for (std::uint32_t v = 0; v < beam.body.rest.size(); ++v) {
    if (beam.body.rest[v][0] > 0.4) beam.body.tethers.push_back({v, 2, 1 + beam.body.rest[v][1]});
  }
  beam.body.fibres = {{.channel = 1, .tension = 3, .direction = {0, 1, 0}, .weights = {{0, 0.25}, {7, 0.75}}}};
  const MotionBody fine = refined(beam.body);
  const auto total = [](const auto& list, auto of) {
    double result = 0;
    for (const auto& one : list) result += of(one);
    return result;
  };
  const auto stiffness = [](const MotionTether& tether) { return tether.stiffness; };
  EXPECT_NEAR(total(fine.tethers, stiffness), total(beam.body.tethers, stiffness), 1e-9);
  EXPECT_GT(fine.tethers.size(), 3 * beam.body.tethers.size());
  for (const MotionTether& tether : fine.tethers) {
    EXPECT_EQ(tether.region, 2U);
    EXPECT_GT(fine.rest[tether.vertex][0], 0.3);
  }
  ASSERT_EQ(fine.fibres.size(), 1U);
  ASSERT_EQ(fine.fibres[0].weights.size(), 16U);
  EXPECT_EQ(fine.fibres[0].tension, 3);
  EXPECT_NEAR(total(fine.fibres[0].weights, [](const auto& part) { return part.second; }), 1, 1e-12);
  for (const auto& [t, weight] : fine.fibres[0].weights) EXPECT_TRUE(t / 8 == 0 || t / 8 == 7) << t;
  EXPECT_EQ(fine.tetrahedra.size(), 8 * beam.body.tetrahedra.size());
  const auto massOf = [](const MotionBody& body) {
    double sum = 0;
    for (const double m : body.masses) sum += m;
    return sum;
  };
  EXPECT_NEAR(massOf(fine), massOf(beam.body), 1e-9 * massOf(beam.body));
  double farthest = -1e300;
  for (std::size_t v = 0; v < beam.body.rest.size(); ++v) {
    if (beam.body.region[v] >= 0) farthest = std::max(farthest, beam.body.rest[v][0]);
  }
  for (std::size_t v = 0; v < fine.rest.size(); ++v) {
    EXPECT_EQ(fine.region[v] >= 0, fine.rest[v][0] <= farthest + 1e-9) << v;
  }
  const std::vector<Vector3f> seen = probed(fine, fine.rest);
  for (std::size_t v = 0; v < seen.size(); ++v) EXPECT_LT((seen[v].cast<double>() - beam.body.surface[v]).norm(), 1e-6);
}

// A bar that nothing holds, all of it a fibre whose tension would shorten it by a tenth if it were linear, is shorter
// by that: tension over volume is a stress along it, and corotated elasticity of no Poisson's ratio is linear along.
TEST(StudyError, AFibreShortensTheReferenceAsItsTensionSays) {
  Beam bar({6, 2, 2}, {1, 0.3, 0.3}, 0, 1e5, MotionGround{.height = -10});
  bar.scene.damping = 20;
  bar.scene.seconds = 1;
  bar.scene.activation = [](std::uint32_t, double time) { return std::min(1.0, 5 * time); };
  MotionFibre fibre;
  const double volume = bar.size[0] * bar.size[1] * bar.size[2];
  fibre.tension = 0.1 * bar.young * volume;
  fibre.contraction = 0.1;
  for (std::uint32_t t = 0; t < bar.body.tetrahedra.size(); ++t) {
    const auto& c = bar.body.tetrahedra[t];
    const Vector3d a = bar.body.rest[c[0]];
    fibre.weights.emplace_back(
        t, (bar.body.rest[c[1]] - a).cross(bar.body.rest[c[2]] - a).dot(bar.body.rest[c[3]] - a) / 6 / volume);
  }
  bar.body.fibres = {fibre};
  for (const bool quadratic : {false, true}) {
    const Motion motion = playSolid(bar.body, bar.scene, {.quadratic = quadratic}, kNothing).motion;
    ASSERT_TRUE(motion.finite);
    for (std::size_t v = 0; v < bar.body.rest.size(); ++v) {
      const Vector3d& rest = bar.body.rest[v];
      const Vector3d wanted(0.9 * rest[0], rest[1], rest[2]);
      EXPECT_LT((motion.frames.back()[v].cast<double>() - wanted).norm(), 2e-3) << quadratic << ' ' << v;
    }
  }
}

// Stiff tethers in place of holds: the same vertices, and the nodes between them.
TEST(StudyError, StiffTethersHoldAsHoldsDo) {
  Beam beam({8, 2, 2}, {1, 0.2, 0.2}, 0.3, 1e5);
  beam.scene.gravity = {0, -4, 0};
  beam.scene.release = true;
  beam.scene.seconds = 1;
  for (const bool quadratic : {false, true}) {
    Beam tied = beam;
    for (std::uint32_t v = 0; v < tied.body.rest.size(); ++v) {
      if (tied.body.region[v] < 0) continue;
      tied.body.tethers.push_back({v, 0, 1e6 * tied.body.masses[v]});
      tied.body.region[v] = -1;
    }
    const double held =
        beam.tip(playSolid(beam.body, beam.scene, {.quadratic = quadratic}, kNothing).motion.frames.back());
    const double hung =
        tied.tip(playSolid(tied.body, tied.scene, {.quadratic = quadratic}, kNothing).motion.frames.back());
    EXPECT_NEAR(hung / held, 1, 0.02) << quadratic;
  }
}

struct GroundMethod {
  const char* name;
  std::function<Motion(const Beam&)> play;
};

std::vector<GroundMethod> groundMethods() {
  return {
    {"reference", [](const Beam& b) { return playSolid(b.body, b.scene, {}, kNothing).motion; }},
        {"linear", [](const Beam& b) { return playSolid(b.body, b.scene, {.quadratic = false}, kNothing).motion; }},
        {"xpbd", [](const Beam& b) { return playXpbd(b.body, b.scene, 20); }},
        {"warping", [](const Beam& b) { return playStiffnessWarping(b.body, b.scene, 8, 40); }},
#if SINEW_WITH_BULLET
        {"bullet", [](const Beam& b) { return playBullet(b.body, b.scene, BulletKind::finite_elements, 16, 0); }},
#endif
  };
}

// A block that falls on the ground comes to rest on it, shorter at its top by rho g h² / 2E: no strain across, so
// friction does nothing.
TEST(StudyError, ABlockComesToRestOnTheGround) {
  Beam block({2, 4, 2}, {0.3, 0.6, 0.3}, 0, 1e5, MotionGround{});
  block.scene.ground->height = block.low() - 0.02;
  block.scene.gravity = {0, -10, 0};
  block.scene.seconds = 1.5;
  const double sag = kDensity * 10 * 0.6 * 0.6 / (2 * block.young);
  for (const GroundMethod& method : groundMethods()) {
    SCOPED_TRACE(method.name);
    const Motion motion = method.play(block);
    ASSERT_TRUE(motion.finite);
    ASSERT_EQ(motion.frames.size(), 90U);
    double foot = 0, head = 0, feet = 0, heads = 0;
    for (std::size_t v = 0; v < block.body.rest.size(); ++v) {
      const double up = block.body.rest[v][1] - block.low(),
                   way = double(motion.frames.back()[v][1]) - block.body.rest[v][1];
      if (up < 1e-6) foot += way, ++feet;
      if (up > 0.6 - 1e-6) head += way, ++heads;
    }
    EXPECT_NEAR(foot / feet, -0.02, 2e-3);
    EXPECT_NEAR(head / heads - foot / feet, -sag, 0.05 * sag);
  }
}

// On a slope it stays where that is less steep than friction, and beyond slides at g (sin - mu cos), less the damping.
TEST(StudyError, ABlockSlidesByCoulombsLaw) {
  for (const double slope : {0.3, 1.0}) {
    Beam block({3, 1, 3}, {0.6, 0.2, 0.6}, 0, 1e6, MotionGround{});
    block.scene.ground->height = block.low();
    const double g = 10, down = g / std::hypot(1, slope), along = slope * down;
    block.scene.gravity = {along, -down, 0};
    block.scene.seconds = 0.5;
    const double damping = block.scene.dampingAt(0), pull = std::max(0.0, along - block.scene.ground->friction * down);
    const double way = pull / damping * (0.5 - (1 - std::exp(-0.5 * damping)) / damping);
    for (const GroundMethod& method : groundMethods()) {
      SCOPED_TRACE(std::string(method.name) + " " + std::to_string(slope));
      const Motion motion = method.play(block);
      ASSERT_TRUE(motion.finite);
      double mean = 0;
      for (std::size_t v = 0; v < block.body.rest.size(); ++v) {
        mean += (double(motion.frames.back()[v][0]) - block.body.rest[v][0]) / double(block.body.rest.size());
      }
      EXPECT_NEAR(mean, way, std::max(0.1 * way, 5e-3));
    }
  }
}

// What is slower than asked is stopped, and said to be.
TEST(StudyError, WhatIsTooSlowIsStopped) {
  Beam beam({6, 2, 2}, {1, 0.3, 0.3}, 0.3, 3e4);
  beam.scene.slowest_seconds = 1e-9;
  const Motion motion = playXpbd(beam.body, beam.scene, 4);
  EXPECT_TRUE(motion.slow);
  EXPECT_LT(motion.frames.size(), 20U);
  beam.scene.slowest_seconds = 1e9;
  EXPECT_EQ(playXpbd(beam.body, beam.scene, 4).frames.size(), std::size_t(std::lround(beam.scene.seconds * 60)));
}

}  // namespace
}  // namespace sinew::tools

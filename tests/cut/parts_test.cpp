// SPDX-License-Identifier: MIT
//
// Parts of a cut as bodies: energy, touch, what matter remembers.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "sinew/c_api.h"
#include "sinew/runtime/cut.h"
#include "sinew/runtime/world.h"
#include "tests/cut/cut_checks.h"
#include "tests/support/box_package.h"
#include "tests/support/field_content.h"

namespace sinew::test {
namespace {

using Eigen::Vector3d;

constexpr float kStep = 1.0F / 60;

Vector3d asVector(const std::array<float, 3>& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

/// A cube of 1 m with the distance grid of its sides.
formats::PackageContent touchingCube(std::uint32_t cells, float hz) {
  formats::PackageContent content =
      boxContent({.cells = {cells, cells, cells}, .size = {1, 1, 1}, .stretch_hz = hz, .keep = {}});
  formats::DistanceGrid grid = {};
  grid.nodes = {25, 25, 25};
  grid.spacing = 1.0F / 16;
  grid.unit = 1e-4F;
  grid.origin = {-0.75F, -0.75F, -0.75F};
  for (std::uint32_t n = 0; n < 25 * 25 * 25; ++n) {
    const std::uint32_t x = n % 25, y = n / 25 % 25, z = n / 625;
    const Vector3d at = Vector3d(x, y, z) / 16 - Vector3d::Constant(0.75);
    const Vector3d beyond = at.cwiseAbs().array() - 0.5;
    const double distance = beyond.cwiseMax(0.0).norm() + std::min(0.0, beyond.maxCoeff());
    content.distance_values.push_back(std::int16_t(std::lround(distance * 1e4)));
  }
  content.distance_grids.push_back(grid);
  return content;
}

BodyEnergy energyOf(const World& world, std::span<const BodyId> bodies) {
  BodyEnergy sum;
  for (const BodyId body : bodies) {
    const BodyEnergy one = world.energy(body);
    sum.kinetic += one.kinetic;
    sum.elastic += one.elastic;
  }
  return sum;
}

double fastestOf(const World& world, std::span<const BodyId> bodies) {
  double fastest = 0;
  for (const BodyId body : bodies) {
    for (const Vec3& v : world.velocities(body)) fastest = std::max(fastest, asVector(v).norm());
  }
  return fastest;
}

/// Distance of a place to a triangle (Ericson 2005, 5.1.5).
double distanceTo(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return ap.norm();
  const Vector3d bp = p - b, cp = p - c;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d3 >= 0 && d4 <= d3) return bp.norm();
  if (d6 >= 0 && d5 <= d6) return cp.norm();
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return (ap - d1 / (d1 - d3) * ab).norm();
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return (ap - d2 / (d2 - d6) * ac).norm();
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) return (bp - (d4 - d3) / (d4 - d3 + d5 - d6) * (c - b)).norm();
  return (ap - (vb * ab + vc * ac) / (va + vb + vc)).norm();
}

TEST(CutParts, NoKickAtTheCutAndNoEnergyFromIt) {
  const auto asset = boxAsset({.cells = {4, 5, 4}, .size = {1, 1.3, 1}, .stretch_hz = 6, .keep = {}});
  World world({.gravity = {0, 0, 0}, .ground = {}, .damping = 0});
  const BodyId body = *world.addBody(asset);
  std::vector<Vec3> positions, velocities;
  for (const Vec3& x : restOf(*asset)) {
    positions.push_back({x[0] + 0.15F * x[1] * x[1], x[1] + 0.1F * x[0], x[2] - 0.1F * x[0] * x[1]});
    velocities.push_back({1 - 2 * x[1] + 0.3F * x[2] * x[2], 0.5F + 2 * x[0], x[0] * x[1] - 1});
  }
  world.setState(body, positions, velocities);
  world.step(kStep);
  const BodyEnergy before = world.energy(body);
  const auto cut = cutBody(world, body, {{0, 0.1F, 0}, {0.3F, 1, 0.1F}});
  ASSERT_TRUE(cut) << cut.reason();
  const BodyEnergy after = energyOf(world, cut->bodies);
  // Masses and velocities are those of before, vertex by vertex.
  EXPECT_NEAR(after.kinetic, before.kinetic, 1e-5 * before.kinetic);
  // Samples are others beside the section: a share of what is stored may differ, none may come from nothing.
  EXPECT_NEAR(after.elastic, before.elastic, 0.1 * before.elastic);
  double most = after.kinetic + after.elastic;
  for (int i = 0; i < 200; ++i) {
    world.step(kStep);
    const BodyEnergy now = energyOf(world, cut->bodies);
    EXPECT_LE(now.kinetic + now.elastic, most * (1 + 1e-4)) << "step " << i;
    most = std::min(most, now.kinetic + now.elastic);
  }
}

TEST(CutParts, WhatLiesThereStaysAndCarriesItsOtherPart) {
  const auto asset = makeAsset(touchingCube(4, 12));
  World world({.ground = {.enabled = true, .offset = -0.5F}, .collisions = true});
  const BodyId body = *world.addBody(asset);
  for (int i = 0; i < 240; ++i) world.step(kStep);
  const std::array whole = {body};
  ASSERT_LT(fastestOf(world, whole), 1e-3);
  const float high = world.visualBounds(body).high[1];
  const auto cut = cutBody(world, body, {{0, 0.03F, 0}, {0.1F, 1, 0}});
  ASSERT_TRUE(cut) << cut.reason();
  for (const CutPart& part : cut->cut.parts) ASSERT_EQ(part.asset->package().distanceGrids().size(), 1U);
  double fastest = 0;
  for (int i = 0; i < 240; ++i) {
    world.step(kStep);
    fastest = std::max(fastest, fastestOf(world, cut->bodies));
  }
  // Contacts carry nothing before they are pressed in: the upper part falls by so much, 3 mm, and is carried again.
  EXPECT_LT(fastest, std::sqrt(2 * 9.81 * 3e-3));
  EXPECT_LT(fastestOf(world, cut->bodies), 2e-3);
  EXPECT_NEAR(world.visualBounds(cut->bodies[1]).high[1], high, 0.02F);
  // Without the lower part the upper one falls.
  world.removeBody(cut->bodies[0]);
  for (int i = 0; i < 120; ++i) world.step(kStep);
  EXPECT_LT(world.visualBounds(cut->bodies[1]).high[1], high - 0.4F);
}

TEST(CutParts, SteepCutLetsTheUpperPartSlideOff) {
  const auto asset = makeAsset(touchingCube(4, 20));
  World world({.ground = {.enabled = true, .offset = -0.5F}, .collisions = true});
  const BodyId body = *world.addBody(asset);
  for (int i = 0; i < 60; ++i) world.step(kStep);
  const auto cut = cutBody(world, body, {{0, 0, 0}, {0.8F, 1, 0}});
  ASSERT_TRUE(cut) << cut.reason();
  double most = 1e300;
  for (int i = 0; i < 240; ++i) {
    world.step(kStep);
    double energy = 0;
    for (const BodyId part : cut->bodies) {
      const BodyEnergy one = world.energy(part);
      energy += one.kinetic + one.elastic;
      const auto vertices = world.asset(part).package().physicalVertices();
      const auto at = world.positions(part);
      for (std::size_t v = 0; v < at.size(); ++v) energy += double(vertices[v].mass) * 9.81 * (double(at[v][1]) + 0.5);
    }
    EXPECT_LE(energy, most + 1) << "step " << i;  // J, of 4900
    most = std::min(most, energy);
  }
  EXPECT_GT(world.visualBounds(cut->bodies[1]).high[0], 0.56F);
}

TEST(CutParts, GridsTellTheDistanceToTheSectionOfABentBody) {
  const auto asset = makeAsset(touchingCube(6, 6));
  std::vector<Vec3> positions = restOf(*asset);
  for (Vec3& x : positions) x[1] += 0.5F * x[0] * x[0];
  const auto cut = cutAsset(*asset, positions, {{0, 0.1F, 0}, {0.1F, 1, 0.2F}});
  ASSERT_TRUE(cut) << cut.reason();
  for (const CutPart& part : cut->parts) {
    const formats::PackageView& package = part.asset->package();
    ASSERT_EQ(package.distanceGrids().size(), 1U);
    const formats::DistanceGrid& grid = package.distanceGrids()[0];
    const formats::SubMesh& section = package.subMeshes().back();
    std::size_t asked = 0, inside = 0;
    for (std::uint32_t n = 0; n < grid.nodes[0] * grid.nodes[1] * grid.nodes[2]; ++n) {
      const std::uint32_t x = n % grid.nodes[0], row = n / grid.nodes[0], y = row % grid.nodes[1],
                          z = row / grid.nodes[1];
      const Vector3d at = asVector(grid.origin) + double(grid.spacing) * Vector3d(x, y, z);
      if (!(at.cwiseAbs().maxCoeff() < 0.35)) continue;  // nearest to the section
      double nearest = 1e300;
      for (const auto& t : package.visualTriangles().subspan(section.first_triangle, section.triangle_count)) {
        const auto corner = [&](std::size_t k) { return asVector(package.visualPositions()[t[k]]); };
        nearest = std::min(nearest, distanceTo(at, corner(0), corner(1), corner(2)));
      }
      if (nearest > 0.12) continue;
      const double value = double(grid.unit) * double(package.distanceValues()[grid.first_value + n]);
      EXPECT_NEAR(std::abs(value), nearest, 0.25 * double(grid.spacing));
      const double above = at[1] + 0.5 * at[0] * at[0] - 0.1 + 0.1 * at[0] + 0.2 * at[2];
      if (std::abs(above) > 0.02) {
        EXPECT_EQ(value > 0, (above > 0) != part.above);
      }
      ++asked;
      inside += value < 0 ? 1U : 0U;
    }
    EXPECT_GT(asked, 200U);
    EXPECT_GT(inside, 50U);
  }
}

TEST(CutParts, MatterKeepsTheShapeThatItHasFlowedTo) {
  auto content = boxContent({.cells = {4, 4, 4}, .size = {1, 1, 1}, .keep = {}});
  formats::ClusterMechanics plastic = {};
  plastic.stiffness = formats::StiffnessModel::elastic;
  plastic.young = 1e5F;
  plastic.poisson = 0.3F;
  plastic.stretch_min = 0.05F;
  plastic.stretch_max = 20;
  plastic.norm_max = plastic.norm_limit = 1000;
  plastic.plastic_yield = 0.02F;
  plastic.plastic_creep = 20;
  plastic.plastic_limit = 2;
  plastic.channel = formats::kNone;
  content.mechanics.push_back(plastic);
  addFields(content);
  for (formats::FieldPack& pack : content.field_packs) {
    for (std::size_t lane = 0; lane < 8; ++lane) pack.cluster[lane] = pack.volume[lane] > 0 ? 0 : formats::kNone;
  }
  const auto asset = makeAsset(content);
  World world({.gravity = {0, 0, 0}, .ground = {}});
  const BodyId body = *world.addBody(asset);
  std::vector<Vec3> positions = restOf(*asset);
  for (Vec3& x : positions) x = {1.3F * x[0] + 0.3F * x[1], 0.6F * x[1], 1.3F * x[2]};
  world.setState(body, positions, {});
  for (int i = 0; i < 120; ++i) world.step(kStep);
  const Mat3 before = world.clusterRestShape(body, 0);
  ASSERT_LT(before[4], 0.95F);  // it was pressed and has stayed so
  const double speed = fastestOf(world, std::array{body});
  const auto cut = cutBody(world, body, {{0, 0.02F, 0}, {0.2F, 1, 0}});
  ASSERT_TRUE(cut) << cut.reason();
  for (const BodyId part : cut->bodies) {
    const Mat3 after = world.clusterRestShape(part, 0);
    for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(after[i], before[i], 0.03F);
  }
  for (int i = 0; i < 30; ++i) world.step(kStep);
  EXPECT_LT(fastestOf(world, cut->bodies), speed + 0.01);
}

TEST(CutParts, CopiesOfAVertexWeighWhatItDid) {
  const auto asset = boxAsset({.cells = {4, 4, 4}, .size = {1, 1, 1}, .density = 917, .keep = {}});
  const auto cut = cutAsset(*asset, restOf(*asset), {{0.01F, 0.07F, 0}, {0.3F, 1, 0.2F}});
  ASSERT_TRUE(cut) << cut.reason();
  std::vector<double> masses(restOf(*asset).size(), 0);
  for (const CutPart& part : cut->parts) {
    for (std::size_t i = 0; i < part.physical.size(); ++i) {
      masses[part.physical[i]] += double(part.asset->package().physicalVertices()[i].mass);
    }
  }
  for (std::size_t v = 0; v < masses.size(); ++v) {
    EXPECT_EQ(masses[v], double(asset->package().physicalVertices()[v].mass));
  }
}

TEST(CutParts, PartRingsAsOneThatWasMadeLikeIt) {
  // Half of a bar, and a bar of that size with functions of its own: the lowest frequency is that of twice the length.
  const BoxOptions whole = {.cells = {16, 4, 4}, .size = {4, 1, 1}, .stretch_hz = 8, .keep = {}};
  const auto asset = boxAsset(whole);
  const auto cut = cutAsset(*asset, restOf(*asset), {{0.01F, 0, 0}, {1, 0, 0}});
  ASSERT_TRUE(cut) << cut.reason();
  auto half = boxContent({.cells = {8, 4, 4}, .size = {2, 1, 1}, .stretch_hz = 16, .keep = {}});
  addFields(half);  // 2 size hz: the same modulus
  for (const CutPart& part : cut->parts) {
    const float hz = part.asset->package().fields()[0].lowest_hz;
    EXPECT_NEAR(hz, half.fields[0].lowest_hz, 0.15F * half.fields[0].lowest_hz);
  }
}

TEST(CutParts, FromC) {
  const auto bytes = [] {
    auto content = boxContent({.cells = {3, 3, 3}, .size = {1, 1, 1}, .keep = {}});
    addFields(content);
    return formats::writePackage(content);
  }();
  sinew_asset* asset = nullptr;
  ASSERT_EQ(sinew_asset_from_memory(bytes.data(), bytes.size(), &asset), SINEW_OK);
  sinew_world* world = nullptr;
  ASSERT_EQ(sinew_world_create(nullptr, nullptr, &world), SINEW_OK);
  std::uint32_t body = 0;
  ASSERT_EQ(sinew_body_add(world, asset, nullptr, &body), SINEW_OK);
  sinew_cut_settings settings;
  sinew_cut_settings_init(&settings, sizeof settings);
  EXPECT_EQ(settings.least_part, CutSettings().least_part);
  EXPECT_EQ(settings.keep_textures, 1U);
  const std::array<float, 3> point = {0, 0.1F, 0}, normal = {0, 1, 0}, beside = {0, 9, 0};
  sinew_cut* cut = nullptr;
  EXPECT_EQ(sinew_body_cut(world, body, beside.data(), normal.data(), &settings, &cut), SINEW_ERROR_ARGUMENT);
  EXPECT_NE(std::string(sinew_last_error()).find("plane"), std::string::npos);
  EXPECT_EQ(sinew_body_cut(world, body, nullptr, normal.data(), &settings, &cut), SINEW_ERROR_ARGUMENT);
  EXPECT_EQ(sinew_body_exists(world, body), 1U);
  ASSERT_EQ(sinew_body_cut(world, body, point.data(), normal.data(), nullptr, &cut), SINEW_OK);
  EXPECT_EQ(sinew_body_exists(world, body), 0U);
  ASSERT_EQ(sinew_cut_part_count(cut), 2U);
  double volume = 0;
  for (std::uint32_t p = 0; p < 2; ++p) {
    sinew_cut_part part = {};
    part.struct_size = sizeof part;
    ASSERT_EQ(sinew_cut_get_part(cut, p, &part), SINEW_OK);
    EXPECT_EQ(sinew_body_exists(world, part.body), 1U);
    EXPECT_EQ(part.above, p);
    volume += part.volume;
    sinew_asset* piece = nullptr;
    ASSERT_EQ(sinew_cut_part_asset(cut, p, &piece), SINEW_OK);
    sinew_asset_info info = {};
    info.struct_size = sizeof info;
    ASSERT_EQ(sinew_asset_get_info(piece, &info), SINEW_OK);
    EXPECT_EQ(info.visual_vertices, part.visual_count);
    EXPECT_EQ(info.physical_vertices, part.physical_count);
    sinew_asset_release(piece);
    for (std::uint32_t v = 0; v < part.visual_count; ++v) EXPECT_LE(part.visual[v].t, 1);
  }
  EXPECT_NEAR(volume, 1, 1e-5);
  sinew_cut_part none = {};
  EXPECT_EQ(sinew_cut_get_part(cut, 2, &none), SINEW_ERROR_ARGUMENT);
  const sinew_cut_heir* heirs = nullptr;
  std::uint32_t count = 1;
  EXPECT_EQ(sinew_cut_picks(cut, &heirs, &count), SINEW_OK);
  EXPECT_EQ(count, 0U);
  sinew_cut_release(cut);
  EXPECT_EQ(sinew_world_step(world, kStep), SINEW_OK);
  sinew_world_destroy(world);
  sinew_asset_release(asset);
}

}  // namespace
}  // namespace sinew::test

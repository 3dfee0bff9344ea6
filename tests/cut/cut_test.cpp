// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "sinew/runtime/cut.h"
#include "sinew/runtime/world.h"
#include "tests/cut/cut_checks.h"
#include "tests/support/box_package.h"
#include "tests/support/sample_package.h"

namespace sinew::test {
namespace {

using Eigen::Vector3d;

Vector3d asVector(const std::array<float, 3>& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

CutResult cutAtRest(const Asset& asset, const CutPlane& plane, const CutSettings& settings = {}) {
  auto cut = cutAsset(asset, restOf(asset), plane, settings);
  EXPECT_TRUE(cut) << (cut ? "" : cut.reason());
  if (!cut) return {};
  CutErrors errors;
  EXPECT_EQ(faultOfCut(asset, *cut, errors), "");
  return std::move(*cut);
}

std::string refusalOf(const Asset& asset, const CutPlane& plane, const CutSettings& settings = {}) {
  const auto cut = cutAsset(asset, restOf(asset), plane, settings);
  return cut ? "" : cut.reason();
}

/// Area of the sub-mesh that closes a part.
double sectionArea(const formats::PackageView& package) {
  const formats::SubMesh& sub = package.subMeshes().back();
  EXPECT_EQ(package.text(sub.name), "section");
  double area = 0;
  for (const formats::Triangle& t : package.visualTriangles().subspan(sub.first_triangle, sub.triangle_count)) {
    const Vector3d a = asVector(package.visualPositions()[t[0]]);
    area += 0.5 *
            (asVector(package.visualPositions()[t[1]]) - a).cross(asVector(package.visualPositions()[t[2]]) - a).norm();
  }
  return area;
}

struct Motion {
  Vector3d linear = Vector3d::Zero(), angular = Vector3d::Zero();
  double size = 0;
};

void addMotion(const World& world, BodyId body, Motion& motion) {
  const auto vertices = world.asset(body).package().physicalVertices();
  const auto x = world.positions(body), v = world.velocities(body);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Vector3d p = double(vertices[i].mass) * asVector(v[i]);
    motion.linear += p;
    motion.angular += asVector(x[i]).cross(p);
    motion.size += p.norm();
  }
}

double fastestOf(const World& world, BodyId body) {
  double fastest = 0;
  for (const Vec3& v : world.velocities(body)) fastest = std::max(fastest, asVector(v).norm());
  return fastest;
}

TEST(Cut, BoxFallsIntoTwo) {
  const auto asset = boxAsset({.cells = {4, 5, 3}, .size = {1, 1.25, 0.75}, .keep = {}});
  const CutResult cut = cutAtRest(*asset, {{0.03F, 0.11F, 0}, {0.2F, 1, 0.1F}});
  ASSERT_EQ(cut.parts.size(), 2U);
  EXPECT_FALSE(cut.parts[0].above);
  EXPECT_TRUE(cut.parts[1].above);
  const double volume = 1 * 1.25 * 0.75, mass = cut.parts[0].mass + cut.parts[1].mass;
  for (const CutPart& part : cut.parts) {
    EXPECT_NEAR(part.mass / mass, part.volume / volume, 1e-5);
    EXPECT_NEAR(double(part.asset->package().info().source_volume), part.volume, 1e-6);
    EXPECT_NEAR(double(part.asset->package().info().physical_volume), part.volume, 1e-6);
  }
  EXPECT_NEAR(cut.parts[0].volume + cut.parts[1].volume, volume, 1e-6);
  EXPECT_EQ(cut.open_edges, 0U);
  EXPECT_EQ(cut.rough_loops, 0U);
}

TEST(Cut, SectionHasTheAreaOfThePlaneInTheBox) {
  const auto asset = boxAsset({.cells = {5, 5, 5}, .size = {1, 1, 1}, .keep = {}});
  const CutResult cut = cutAtRest(*asset, {{0, 0.07F, 0}, {0, 1, 0}});
  for (const CutPart& part : cut.parts) EXPECT_NEAR(sectionArea(part.asset->package()), 1, 1e-5);
  EXPECT_NEAR(cut.parts[1].volume, 0.43, 1e-5);
  // Points inside, unless they are not wanted.
  const auto inside = [](const CutResult& of) {
    std::size_t count = 0;
    for (const CutOrigin& from : of.parts[0].visual) count += from.a == formats::kNone ? 1U : 0U;
    return count;
  };
  EXPECT_GT(inside(cut), 10U);
  EXPECT_EQ(inside(cutAtRest(*asset, {{0, 0.07F, 0}, {0, 1, 0}}, {.spacing = std::numeric_limits<float>::infinity()})),
            0U);
}

TEST(Cut, DegeneratePlanesAreRightOrRefused) {
  const auto asset = boxAsset({.cells = {4, 4, 4}, .size = {1, 1, 1}, .keep = {}});
  // Through vertices and along edges.
  for (const CutPlane& plane : {CutPlane{{0, 0, 0}, {0, 1, 0}}, CutPlane{{0, 0.25F, 0}, {0, -1, 0}},
                                CutPlane{{0, 0, 0}, {1, 1, 0}}, CutPlane{{0, 0, 0}, {1, 1, 1}},
                                CutPlane{{0.25F, 0, 0}, {1, -1, 0}}, CutPlane{{-0.25F, 0.25F, 0.25F}, {2, 1, 1}}}) {
    const CutResult cut = cutAtRest(*asset, plane);
    ASSERT_EQ(cut.parts.size(), 2U);
    EXPECT_EQ(cut.rough_loops, 0U);
  }
  EXPECT_NEAR(cutAtRest(*asset, {{0, 0.25F, 0}, {0, 1, 0}}).parts[1].volume, 0.25, 1e-6);
  // Along faces, at corners, beside.
  for (const CutPlane& plane :
       {CutPlane{{0, 0.5F, 0}, {0, 1, 0}}, CutPlane{{0, -0.5F, 0}, {0, 1, 0}}, CutPlane{{0.5F, 0.5F, 0.5F}, {1, 1, 1}},
        CutPlane{{0.5F, 0.5F, 0}, {1, 1, 0}}, CutPlane{{0, 3, 0}, {0, 1, 0}}, CutPlane{{0, 0.49999F, 0}, {0, 1, 0}}}) {
    EXPECT_NE(refusalOf(*asset, plane), "");
  }
}

// Pieces that a game has pushed into one another: nothing of one hangs on the other.
TEST(Cut, PiecesThatLieInOneAnotherHaveSectionsOfTheirOwn) {
  formats::PackageContent content = repeated(boxContent({.cells = {5, 5, 5}, .size = {1, 1, 1}, .keep = {}}), 2);
  for (std::size_t i = content.physical_vertices.size() / 2; i < content.physical_vertices.size(); ++i) {
    content.physical_vertices[i].rest_position[0] += 3;
  }
  for (std::size_t i = content.visual_positions.size() / 2; i < content.visual_positions.size(); ++i) {
    content.visual_positions[i][0] += 3;
  }
  for (std::size_t i = content.clusters.size() / 2; i < content.clusters.size(); ++i) {
    content.clusters[i].rest_center[0] += 3;
  }
  content.info.bounds_max[0] += 3;
  content.info.diagonal = std::hypot(4.0F, std::hypot(1.0F, 1.0F));
  content.info.physical_volume *= 2;
  content.info.source_volume *= 2;
  const auto asset = makeAsset(content);
  const formats::PackageView& package = asset->package();
  ASSERT_EQ(package.pieces().size(), 2U);
  const formats::PieceRange &one = package.pieces()[0], &two = package.pieces()[1];
  std::vector<Vec3> positions(package.physicalVertices().size());
  for (std::uint32_t v = 0; v < one.vertex_count; ++v) {
    const Vec3& rest = package.physicalVertices()[one.first_vertex + v].rest_position;
    positions[one.first_vertex + v] = rest;
    positions[two.first_vertex + v] = {rest[0] + 0.33F, rest[1] + 0.07F, rest[2] + 0.21F};
  }
  const auto cut = cutAsset(*asset, positions, {{0, 0.13F, 0}, {0.1F, 1, 0}});
  ASSERT_TRUE(cut) << cut.reason();
  ASSERT_EQ(cut->parts.size(), 4U);
  CutErrors errors;
  EXPECT_EQ(faultOfCut(*asset, *cut, errors, 4), "");
  EXPECT_EQ(cut->rough_loops, 0U);
}

TEST(Cut, WhatIsNoNumberIsRefused) {
  const auto asset = boxAsset({.cells = {2, 2, 2}, .keep = {}});
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(refusalOf(*asset, {{0, 0, 0}, {0, 0, 0}}), "");
  EXPECT_NE(refusalOf(*asset, {{nan, 0, 0}, {0, 1, 0}}), "");
  EXPECT_NE(refusalOf(*asset, {{0, 0, 0}, {0, nan, 0}}), "");
  EXPECT_NE(refusalOf(*asset, {{0, 0, 0}, {0, 1, 0}}, {.spacing = nan}), "");
  EXPECT_NE(refusalOf(*asset, {{0, 0, 0}, {0, 1, 0}}, {.least_part = -1}), "");
  EXPECT_NE(refusalOf(*asset, {{0, 0, 0}, {0, 1, 0}}, {.section_color = {7, 0, 0, 1}}), "");
  std::vector<Vec3> positions = restOf(*asset);
  positions[3][1] = nan;
  EXPECT_FALSE(cutAsset(*asset, positions, {{0, 0, 0}, {0, 1, 0}}));
  positions.pop_back();
  EXPECT_FALSE(cutAsset(*asset, positions, {{0, 0, 0}, {0, 1, 0}}));
}

TEST(Cut, HollowBoxHasARing) {
  const auto solid = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    return i == 0 || i == 4 || j == 0 || j == 4 || k == 0 || k == 4;
  };
  const auto asset = boxAsset({.cells = {5, 5, 5}, .size = {1, 1, 1}, .keep = solid});
  const CutResult cut = cutAtRest(*asset, {{0, 0.03F, 0}, {0, 1, 0}});
  ASSERT_EQ(cut.parts.size(), 2U);
  for (const CutPart& part : cut.parts) EXPECT_NEAR(sectionArea(part.asset->package()), 1 - 0.36, 1e-5);
  EXPECT_NEAR(cut.parts[0].volume + cut.parts[1].volume, 1 - 0.216, 1e-6);
}

TEST(Cut, SectionGoesOnOverAHoleOfTheSurface) {
  auto content = boxContent({.cells = {5, 5, 5}, .size = {1, 1, 1}, .keep = {}});
  const CutPlane plane = {{0, 0.07F, 0}, {0, 1, 0}};
  // A triangle of one side that the plane meets goes: the rim has a gap there.
  const auto at = [&](std::uint32_t v) { return asVector(content.visual_positions[v]); };
  const auto gone =
      std::find_if(content.visual_triangles.begin(), content.visual_triangles.end(), [&](const formats::Triangle& t) {
        const auto [low, high] = std::minmax({at(t[0])[1], at(t[1])[1], at(t[2])[1]});
        return low < 0.07 && high > 0.07 && at(t[0])[0] > 0.49 && at(t[1])[0] > 0.49 && at(t[2])[0] > 0.49;
      });
  ASSERT_NE(gone, content.visual_triangles.end());
  content.visual_triangles.erase(gone);
  content.sub_meshes.clear();
  const CutResult cut = cutAtRest(*makeAsset(content), plane);
  ASSERT_EQ(cut.parts.size(), 2U);
  EXPECT_EQ(cut.open_edges, 1U);
  for (const CutPart& part : cut.parts) EXPECT_NEAR(sectionArea(part.asset->package()), 1, 1e-5);
}

TEST(Cut, IslandsInHolesAreFacesOfTheirOwn) {
  const auto keep = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    const auto ring = [](std::uint32_t a) { return std::min(a, 6 - a); };
    return std::min({ring(i), ring(j), ring(k)}) != 1;
  };
  const auto asset = boxAsset({.cells = {7, 7, 7}, .size = {7, 7, 7}, .keep = keep});
  const CutResult cut = cutAtRest(*asset, {{0, 0.3F, 0}, {0, 1, 0}});
  ASSERT_EQ(cut.parts.size(), 4U);  // shell and core, each cut
  double area = 0;
  for (const CutPart& part : cut.parts) area += sectionArea(part.asset->package());
  EXPECT_NEAR(area, 2 * (49 - 25 + 9), 1e-4);
}

TEST(Cut, RingFallsIntoOneOrTwo) {
  const auto ring = [](std::uint32_t i, std::uint32_t j, std::uint32_t) {
    return i == 0 || i == 4 || j == 0 || j == 4;
  };
  const auto asset = boxAsset({.cells = {5, 5, 1}, .size = {5, 5, 1}, .keep = ring});
  const CutResult halves = cutAtRest(*asset, {{0, 0.2F, 0}, {0, 1, 0}});
  ASSERT_EQ(halves.parts.size(), 2U);
  EXPECT_NEAR(sectionArea(halves.parts[0].asset->package()), 2, 1e-5);
  // A half again: along the other axis it falls into two legs with a bridge, across them into three.
  const Asset& half = *halves.parts[1].asset;
  const CutResult legs = cutAtRest(half, {{0, 1, 0}, {0, 1, 0}});
  ASSERT_EQ(legs.parts.size(), 3U);
  EXPECT_EQ(std::count_if(legs.parts.begin(), legs.parts.end(), [](const CutPart& p) { return p.above; }), 1);
}

TEST(Cut, CutsOfCuts) {
  std::vector<std::shared_ptr<const Asset>> parts = {boxAsset({.cells = {4, 4, 4}, .size = {1, 1, 1}, .keep = {}})};
  const double volume = surfaceOf(parts[0]->package()).volume;
  for (int round = 0; round < 5; ++round) {
    std::vector<std::shared_ptr<const Asset>> next;
    for (const auto& part : parts) {
      const auto cut =
          cutAsset(*part, restOf(*part), randomPlane(restOf(*part), std::uint64_t(round) * 31 + next.size()));
      if (!cut) {
        next.push_back(part);
        continue;
      }
      CutErrors errors;
      EXPECT_EQ(faultOfCut(*part, *cut, errors), "");
      for (const CutPart& made : cut->parts) next.push_back(made.asset);
    }
    parts = next;
  }
  EXPECT_GT(parts.size(), 12U);
  double sum = 0;
  for (const auto& part : parts) {
    sum += surfaceOf(part->package()).volume;
    // One sub-mesh for all sections.
    EXPECT_LE(part->package().subMeshes().size(), 2U);
  }
  EXPECT_NEAR(sum, volume, 1e-4 * volume);
}

TEST(Cut, MotionGoesOn) {
  const auto asset = boxAsset({.cells = {4, 4, 4}, .size = {1, 1, 1}, .keep = {}});
  World world({.gravity = {0, 0, 0}, .ground = {}});
  const BodyId body = *world.addBody(asset);
  std::vector<Vec3> positions, velocities;
  for (const Vec3& x : restOf(*asset)) {
    positions.push_back({x[0] + 0.2F * x[1] * x[1] + 3, x[1] + 0.1F * x[0], x[2] - 0.1F * x[0] * x[1]});
    velocities.push_back({1 - 2 * x[1] + 0.3F * x[2] * x[2], 0.5F + 2 * x[0], x[0] * x[1] - 1});
  }
  world.setState(body, positions, velocities);
  positions.assign(world.positions(body).begin(), world.positions(body).end());
  velocities.assign(world.velocities(body).begin(), world.velocities(body).end());
  Motion before, after;
  addMotion(world, body, before);
  const auto cut = cutBody(world, body, {{3, 0.1F, 0}, {0.3F, 1, 0}});
  ASSERT_TRUE(cut) << cut.reason();
  EXPECT_FALSE(world.contains(body));
  ASSERT_EQ(cut->bodies.size(), 2U);
  for (std::size_t p = 0; p < 2; ++p) {
    const auto x = world.positions(cut->bodies[p]), v = world.velocities(cut->bodies[p]);
    const CutPart& part = cut->cut.parts[p];
    for (std::size_t i = 0; i < x.size(); ++i) {
      EXPECT_LT((asVector(x[i]) - asVector(positions[part.physical[i]])).norm(), 2e-3);
      EXPECT_LT((asVector(v[i]) - asVector(velocities[part.physical[i]])).norm(), 2e-2);
    }
    addMotion(world, cut->bodies[p], after);
  }
  EXPECT_LT((after.linear - before.linear).norm(), 1e-6 * before.size);
  EXPECT_LT((after.angular - before.angular).norm(), 5e-6 * before.size);
}

TEST(Cut, PartsComeToRest) {
  const auto asset = boxAsset({.cells = {4, 4, 4}, .size = {1, 1, 1}, .stretch_hz = 6, .keep = {}});
  World world({.ground = {.enabled = true, .offset = -1}});
  const BodyId body = *world.addBody(asset);
  for (int i = 0; i < 20; ++i) world.step(1.0F / 60);
  const auto cut = cutBody(world, body, {{0, -0.4F, 0}, {0.4F, 1, 0.2F}});
  ASSERT_TRUE(cut) << cut.reason();
  for (int i = 0; i < 300; ++i) world.step(1.0F / 60);
  for (const BodyId part : cut->bodies) {
    EXPECT_EQ(world.repairedVertices(part), 0U);
    EXPECT_LT(fastestOf(world, part), 5e-3);
    EXPECT_GT(world.visualBounds(part).low[1], -1.02F);
  }
}

TEST(Cut, HoldsStayWhereTheyAre) {
  auto content = boxContent({.cells = {3, 4, 3}, .size = {1, 1.5, 1}, .keep = {}});
  content.pin_sets.push_back({content.addText("top"), content.addText("world"), 3, 0, 0, 0});
  for (std::uint32_t v = 0; v < content.physical_vertices.size(); ++v) {
    if (content.physical_vertices[v].rest_position[1] > 0.74F) content.pin_set_vertices.push_back(v);
  }
  content.pin_sets[0].count = std::uint32_t(content.pin_set_vertices.size());
  const auto asset = makeAsset(content);
  World world;
  const BodyId body = *world.addBody(asset);
  const std::vector<Vec3> rest = restOf(*asset);
  std::uint32_t low = 0, visual = 0;
  for (std::uint32_t v = 0; v < rest.size(); ++v) low = rest[v][1] < rest[low][1] ? v : low;
  world.pin(body, low, rest[low]);
  const auto places = asset->package().visualPositions();
  for (std::uint32_t v = 0; v < places.size(); ++v) visual = places[v][1] < places[visual][1] ? v : visual;
  const PickId pick = world.pick(body, visual, {0, -2, 0});
  RigidTransform lifted;
  lifted.position = {0, 0.1F, 0};
  world.movePinSet(world.pinSet(body, "top"), lifted);
  for (int i = 0; i < 60; ++i) world.step(1.0F / 60);
  const PinSetId set = world.pinSet(body, "top");
  const auto cut = cutBody(world, body, {{0, 0.03F, 0}, {0, 1, 0}});
  ASSERT_TRUE(cut) << cut.reason();
  ASSERT_EQ(cut->pin_sets.size(), 1U);
  EXPECT_EQ(cut->pin_sets[0].before, set);
  EXPECT_EQ(cut->pin_sets[0].body, cut->bodies[1]);
  EXPECT_EQ(world.pinSet(cut->bodies[1], "top"), cut->pin_sets[0].now);
  ASSERT_EQ(cut->picks.size(), 1U);
  EXPECT_EQ(cut->picks[0].before, pick);
  EXPECT_EQ(cut->picks[0].body, cut->bodies[0]);
  world.releasePick(cut->picks[0].now);
  for (int i = 0; i < 300; ++i) world.step(1.0F / 60);
  // The upper part hangs where the set was moved to, the lower one by its pin.
  EXPECT_NEAR(world.visualBounds(cut->bodies[1]).high[1], 0.85F, 0.05F);
  const CutPart& lower = cut->cut.parts[0];
  for (std::uint32_t i = 0; i < lower.physical.size(); ++i) {
    if (lower.physical[i] != low) continue;
    EXPECT_LT((asVector(world.positions(cut->bodies[0])[i]) - asVector(rest[low])).norm(), 0.1);
  }
}

TEST(Cut, ReplacedBodyStaysOnRefusal) {
  World world;
  const BodyId body = *world.addBody(boxAsset({.cells = {2, 2, 2}, .keep = {}}));
  EXPECT_FALSE(cutBody(world, body, {{0, 9, 0}, {0, 1, 0}}));
  EXPECT_TRUE(world.contains(body));
  EXPECT_FALSE(cutBody(world, {77}, {{0, 0, 0}, {0, 1, 0}}));
}

TEST(Cut, VerticesAreInterpolatedAndKeepTheirOrigin) {
  auto content = boxContent({.cells = {3, 3, 3}, .size = {1, 1, 1}, .keep = {}});
  const std::size_t count = content.visual_positions.size();
  content.masks.push_back({content.addText("height"), 0, std::uint32_t(count)});
  content.groups.push_back({content.addText("left"), 0, 0});
  for (std::uint32_t v = 0; v < count; ++v) {
    const formats::Float3& x = content.visual_positions[v];
    content.visual_uvs.push_back({x[0], 2 * x[1]});
    content.visual_colors.push_back({std::uint8_t(100 + 100 * x[0]), std::uint8_t(100 + 100 * x[1]), 0, 255});
    content.mask_weights.push_back({v, 0.5F + 0.4F * x[1]});
    if (x[0] < 0) content.group_vertices.push_back(v);
    content.visual_identity.push_back({v, v});
    content.source_identity.push_back({v, v, 1});
    content.source_visual_list.push_back(v);
  }
  content.groups[0].count = std::uint32_t(content.group_vertices.size());
  content.source_meshes.push_back({content.addText("mesh"), 0, std::uint32_t(count)});
  const auto asset = makeAsset(content);
  const CutResult cut = cutAtRest(*asset, {{0, 0.05F, 0}, {0.1F, 1, 0.2F}});
  for (const CutPart& part : cut.parts) {
    const formats::PackageView& package = part.asset->package();
    const formats::SubMesh& section = package.subMeshes().back();
    std::vector<char> on_section(package.visualPositions().size(), 0);
    for (const auto& t : package.visualTriangles().subspan(section.first_triangle, section.triangle_count)) {
      for (const std::uint32_t v : t) on_section[v] = 1;
    }
    std::size_t made = 0;
    for (std::uint32_t v = 0; v < package.visualPositions().size(); ++v) {
      const formats::Float3& x = package.visualPositions()[v];
      const CutOrigin& from = part.visual[v];
      EXPECT_NEAR(asVector(package.visualNormals()[v]).norm(), 1, 1e-5);
      const std::uint32_t source = package.visualIdentity()[v].source_vertex;
      if (from.a == from.b && from.a != formats::kNone) {
        EXPECT_EQ(source, from.a);
      }
      if (from.a != from.b || from.a == formats::kNone) {
        EXPECT_GE(source, count);
        ++made;
      }
      if (on_section[v] != 0) continue;
      EXPECT_NEAR(package.visualUvs()[v][0], x[0], 1e-5F);
      EXPECT_NEAR(package.visualUvs()[v][1], 2 * x[1], 1e-5F);
      EXPECT_NEAR(float(package.visualColors()[v][1]), 100 + 100 * x[1], 1.6F);
    }
    EXPECT_GT(made, 0U);
    EXPECT_EQ(package.sourceMeshes().size(), 2U);
    for (const formats::MaskWeight& m : package.maskWeights()) {
      EXPECT_NEAR(m.weight, 0.5F + 0.4F * package.visualPositions()[m.vertex][1], 1e-5F);
    }
    for (const std::uint32_t v : package.groupVertices()) EXPECT_LT(package.visualPositions()[v][0], 0);
  }
}

TEST(Cut, RandomPlanesOverBentBodies) {
  const auto frame = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) { return (i % 2) + (j % 2) + (k % 2) < 2; };
  const std::vector<std::shared_ptr<const Asset>> assets = {
      boxAsset({.cells = {3, 3, 3}, .size = {1, 1, 1}, .keep = {}}),
      boxAsset({.cells = {3, 6, 2}, .size = {0.5, 1, 0.3}, .center = {50, 0, 0}, .keep = {}}),
      boxAsset({.cells = {5, 5, 5}, .size = {1, 1, 1}, .keep = frame})};
  for (const auto& asset : assets) {
    std::size_t done = 0;
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
      std::vector<Vec3> positions = restOf(*asset);
      const float bend = 0.004F * float(seed);
      for (Vec3& x : positions) x[1] += bend * (x[0] - positions[0][0]) * (x[0] - positions[0][0]);
      const auto cut = cutAsset(*asset, positions, randomPlane(positions, seed));
      if (!cut) {
        EXPECT_FALSE(cut.reason().starts_with("a part")) << cut.reason();
        continue;
      }
      CutErrors errors;
      EXPECT_EQ(faultOfCut(*asset, *cut, errors), "") << "plane " << seed;
      ++done;
    }
    EXPECT_GT(done, 80U);
  }
}

TEST(Cut, SameCutSameBytes) {
  const auto asset = boxAsset({.cells = {3, 3, 3}, .keep = {}});
  const CutPlane plane = {{0, 0.02F, 0}, {0.3F, 1, 0.2F}};
  const CutResult one = cutAtRest(*asset, plane), two = cutAtRest(*asset, plane);
  for (std::size_t p = 0; p < one.parts.size(); ++p) {
    EXPECT_EQ(one.parts[p].asset->checksum(), two.parts[p].asset->checksum());
  }
}

}  // namespace
}  // namespace sinew::test

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Levels of detail: what a bake adds, and bodies that change theirs.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>

#include "sinew/formats/writer.h"
#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"
#include "tools/author/settings.h"
#include "tools/bake/fields.h"

namespace sinew::test {
namespace {

constexpr float kStep = 1.0F / 60;

std::shared_ptr<const Asset> barAsset(std::uint32_t levels) {
  BoxOptions options;
  options.cells = {8, 3, 3};
  options.size = {3, 1, 1};
  options.center = {0, 0.5, 0};
  formats::PackageContent content = boxContent(options);
  tools::Settings settings;
  settings.field.levels = levels;
  tools::addFields(settings, content, nullptr);
  return makePlainAsset(content);
}

WorldSettings inSpace() {
  WorldSettings settings;
  settings.gravity = {0, 0, 0};
  settings.damping = 0;
  return settings;
}

/// Bent and turning.
void stir(World& world, BodyId body) {
  std::vector<Vec3> x, v;
  for (const formats::PhysicalVertex& vertex : world.asset(body).package().physicalVertices()) {
    const Vec3& at = vertex.rest_position;
    x.push_back({at[0], at[1] + 0.08F * at[0] * at[0] * at[0], at[2] * (1 + 0.2F * at[1])});
    v.push_back({-at[1], at[0], 0.4F * at[0] * at[0]});
  }
  world.setState(body, x, v);
}

void setLevel(World& world, BodyId body, std::uint32_t level) {
  BodySettings settings = world.bodySettings(body);
  settings.level = level;
  ASSERT_TRUE(world.setBodySettings(body, settings));
}

std::vector<Vec3> drawn(const World& world, BodyId body) {
  const auto x = world.positions(body);
  return {x.begin(), x.end()};
}

double apart(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, (wide(a[i]) - wide(b[i])).norm());
  return most;
}

TEST(Levels, HaveHalfOfTheFunctionsEach) {
  const auto asset = barAsset(4);
  EXPECT_EQ(asset->levels(), 3U);
  const auto fields = asset->package().allFields();
  ASSERT_EQ(fields.size(), 3U);
  EXPECT_EQ(asset->package().fields().size(), 1U);
  EXPECT_EQ(fields[0].function_count, 32U);
  EXPECT_EQ(fields[1].function_count, 16U);
  EXPECT_EQ(fields[2].function_count, 8U);
  EXPECT_LT(fields[2].pack_count, fields[0].pack_count);
  EXPECT_EQ(barAsset(0)->levels(), 1U);
}

// Mass, centre and momentum stay; energy does not grow; nothing jumps, and what fades is gone in time.
TEST(Levels, ChangeWithoutAPop) {
  const auto asset = barAsset(2);
  World world(inSpace());
  const BodyId body = *world.addBody(asset);
  const BodyId same = *world.addBody(asset);
  stir(world, body);
  stir(world, same);
  for (int i = 0; i < 20; ++i) world.step(kStep);
  for (const std::uint32_t level : {2U, 1U, 0U, 2U, 0U}) {
    const Motion before = motionOf(world, body);
    const BodyEnergy energy = world.energy(body);
    const std::vector<Vec3> shape = drawn(world, body);
    setLevel(world, body, level);
    const float tiny = 1e-4F;
    world.step(tiny);
    const std::vector<Vec3> after = drawn(world, body);
    double fastest = 0;
    for (const Vec3& v : world.velocities(same)) fastest = std::max(fastest, wide(v).norm());
    EXPECT_LT(apart(shape, after), 3 * fastest * double(tiny) + 1e-4) << level;
    const Motion now = motionOf(world, body);
    EXPECT_LT((now.center - before.center).norm(), 1e-3) << level;
    EXPECT_LT((now.momentum - before.momentum).norm(), 1e-4 * before.mass) << level;
    const BodyEnergy left = world.energy(body);
    EXPECT_LE(left.kinetic + left.elastic, (energy.kinetic + energy.elastic) * 1.01) << level;
    for (int i = 0; i < 25; ++i) world.step(kStep);
  }
}

// Of bodies that touch, so that factors are saved too.
TEST(Levels, SnapshotsHoldThem) {
  const auto asset = barAsset(2);
  WorldSettings settings;
  settings.ground.enabled = settings.collisions = true;
  World world(settings);
  BodySettings placed;
  placed.level = 1;
  const BodyId low = *world.addBody(asset, placed);
  placed.level = 0;
  placed.position = {0, 1, 0};
  ASSERT_TRUE(world.addBody(asset, placed));
  for (int i = 0; i < 30; ++i) world.step(kStep);
  for (const std::uint32_t level : {1U, 2U, 0U}) {
    setLevel(world, low, level);
    for (int i = 0; i < 5; ++i) world.step(kStep);
    std::vector<std::byte> bytes(world.snapshotBytes());
    ASSERT_EQ(world.saveSnapshot(bytes), bytes.size());
    const auto go = [&](World& in) {
      for (int i = 0; i < 20; ++i) in.step(kStep);
      return drawn(in, low);
    };
    const std::vector<Vec3> expected = go(world);
    setLevel(world, low, (level + 1) % 3);
    go(world);
    const auto here = world.restoreSnapshot(bytes);
    ASSERT_TRUE(here) << here.reason();
    EXPECT_EQ(go(world), expected) << level;
    World other;
    const auto there = other.restoreSnapshot(bytes, std::array{asset});
    ASSERT_TRUE(there) << there.reason();
    EXPECT_EQ(go(other), expected) << level;
  }
}

TEST(Levels, FadeWhatTheyLose) {
  const auto asset = barAsset(2);
  World world(inSpace());
  const BodyId coarse = *world.addBody(asset);
  stir(world, coarse);
  setLevel(world, coarse, 2);
  world.step(kStep);
  // The same state without what fades.
  World other(inSpace());
  BodySettings settings;
  settings.level = 2;
  const BodyId bare = *other.addBody(asset, settings);
  std::vector<std::byte> bytes(world.stateBytes(coarse));
  ASSERT_TRUE(world.saveState(coarse, bytes));
  ASSERT_TRUE(other.restoreState(bare, bytes));
  std::vector<double> offsets;
  for (int i = 0; i < 30; ++i) {
    world.step(kStep);
    other.step(kStep);
    offsets.push_back(apart(drawn(world, coarse), drawn(other, bare)));
  }
  EXPECT_GT(offsets[0], 1e-3);
  for (std::size_t i = 1; i < offsets.size(); ++i) EXPECT_LE(offsets[i], offsets[i - 1] + 1e-5) << i;
  EXPECT_EQ(offsets.back(), 0);
}

TEST(Levels, RestWhereTheyLay) {
  const auto asset = barAsset(2);
  WorldSettings settings;
  settings.ground.enabled = true;
  settings.ground.normal = {0.2F, 0.98F, 0};
  World world(settings);
  const BodyId body = *world.addBody(asset);
  for (int i = 0; i < 600; ++i) world.step(kStep);
  const Motion before = motionOf(world, body);
  for (const std::uint32_t level : {2U, 0U, 1U}) {
    setLevel(world, body, level);
    for (int i = 0; i < 300; ++i) world.step(kStep);
  }
  const Motion now = motionOf(world, body);
  EXPECT_LT((now.center - before.center).norm(), 0.02);
  EXPECT_LT(now.momentum.norm(), 2e-3 * now.mass);
}

// A body that sleeps keeps sleeping, and changes as it wakes.
TEST(Levels, WaitForWhatSleeps) {
  const auto asset = barAsset(1);
  WorldSettings settings;
  settings.ground.enabled = true;
  settings.sleep_seconds = 0.5F;
  World world(settings);
  const BodyId body = *world.addBody(asset);
  for (int i = 0; i < 1200 && !world.isAsleep(body); ++i) world.step(kStep);
  ASSERT_TRUE(world.isAsleep(body));
  const std::vector<Vec3> shape = drawn(world, body);
  setLevel(world, body, 1);
  for (int i = 0; i < 10; ++i) world.step(kStep);
  EXPECT_TRUE(world.isAsleep(body));
  EXPECT_EQ(apart(shape, drawn(world, body)), 0);
  world.wake(body);
  world.step(kStep);
  EXPECT_LT(apart(shape, drawn(world, body)), 2e-3);
}

TEST(Levels, AreSavedAndRestoredBitForBit) {
  const auto asset = barAsset(2);
  World world(inSpace()), other(inSpace());
  BodySettings settings;
  settings.level = 1;
  const BodyId body = *world.addBody(asset, settings), fresh = *other.addBody(asset);
  stir(world, body);
  for (int i = 0; i < 20; ++i) world.step(kStep);
  std::vector<std::byte> bytes(world.stateBytes(body));
  ASSERT_TRUE(world.saveState(body, bytes));
  ASSERT_TRUE(other.restoreState(fresh, bytes));
  setLevel(other, fresh, 1);
  for (int i = 0; i < 20; ++i) {
    world.step(kStep);
    other.step(kStep);
    ASSERT_EQ(drawn(world, body), drawn(other, fresh)) << i;
  }
}

// More than the package has is its coarsest.
TEST(Levels, EndWhereThePackageDoes) {
  World world(inSpace());
  BodySettings settings;
  settings.level = 100;
  const BodyId body = *world.addBody(barAsset(1), settings);
  stir(world, body);
  for (int i = 0; i < 10; ++i) world.step(kStep);
  EXPECT_EQ(world.repairedVertices(body), 0U);
}

TEST(Levels, OfOtherPointsOrMoreFunctionsAreRefused) {
  const auto refusalOf = [](auto change) {
    BoxOptions options;
    formats::PackageContent content = boxContent(options);
    tools::Settings settings;
    settings.field.levels = 1;
    tools::addFields(settings, content, nullptr);
    change(content);
    const auto asset = Asset::fromMemory(formats::writePackage(content));
    return asset ? std::string() : std::string(asset.reason());
  };
  EXPECT_EQ(refusalOf([](formats::PackageContent&) {}), "");
  EXPECT_NE(refusalOf([](formats::PackageContent& c) { c.fields[1].level = 2; }), "");
  EXPECT_NE(refusalOf([](formats::PackageContent& c) { c.fields[0].level = 1; }), "");
  EXPECT_NE(refusalOf([](formats::PackageContent& c) { c.field_points.back().area *= 2; }), "");
}

}  // namespace
}  // namespace sinew::test

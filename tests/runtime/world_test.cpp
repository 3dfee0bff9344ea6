// SPDX-License-Identifier: MIT
//
// Worlds and bodies: identity, parts, reset, determinism.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <functional>
#include <memory>

#include "sinew/formats/writer.h"
#include "sinew/runtime/thread_pool.h"
#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"
#include "tests/support/field_content.h"

namespace sinew::test {
namespace {

using formats::ClusterMode;

BoxOptions softBox(std::uint32_t clusters = 2) {
  BoxOptions box;
  box.mode = ClusterMode::quadratic;
  box.cells = {8, 8, 8};
  box.clusters = {clusters, clusters, clusters};
  return box;
}

std::vector<std::byte> packageBytes() {
  formats::PackageContent content = boxContent({});
  addFields(content);
  return formats::writePackage(content);
}

// Everything at once: two bodies fall, one is pinned and picked.
std::vector<std::vector<Vec3>> history(JobSystem* jobs) {
  WorldSettings settings;
  settings.ground.enabled = true;
  World world(settings, jobs);
  const auto asset = boxAsset(softBox());
  std::vector<BodyId> bodies;
  for (int i = 0; i < 3; ++i) {
    BodySettings place;
    place.position = {2.0F * float(i), 0.8F, 0};
    bodies.push_back(*world.addBody(asset, place));
  }
  world.pin(bodies[2], 11, world.positions(bodies[2])[11]);
  world.pick(bodies[1], 30, {3, 2, 0});
  std::vector<std::vector<Vec3>> states;
  for (int i = 0; i < 60; ++i) {
    world.step(1.0F / 60);
    for (const BodyId body : bodies) {
      states.emplace_back(world.positions(body).begin(), world.positions(body).end());
      states.emplace_back(world.velocities(body).begin(), world.velocities(body).end());
    }
  }
  return states;
}

// Runs ranges backwards, one element at a time: an order no thread pool would choose.
class BackwardJobs final : public JobSystem {
 public:
  void parallelFor(std::uint32_t count, std::uint32_t,
                   const std::function<void(std::uint32_t, std::uint32_t)>& body) override {
    for (std::uint32_t i = count; i > 0; --i) body(i - 1, i);
  }
};

TEST(World, SameBitsForAnyJobSystem) {
  const auto expected = history(nullptr);
  BackwardJobs backward;
  EXPECT_TRUE(history(&backward) == expected);
  for (const std::uint32_t threads : {1U, 2U, 3U, 8U}) {
    ThreadPool pool(threads);
    EXPECT_EQ(pool.threads(), threads);
    EXPECT_TRUE(history(&pool) == expected) << threads;
  }
}

TEST(ThreadPool, CoversEachIndexOnce) {
  ThreadPool pool(4);
  for (const std::uint32_t count : {0U, 1U, 7U, 1000U}) {
    std::vector<std::atomic<int>> seen(count);
    for (int round = 0; round < 50; ++round) {
      pool.parallelFor(count, 3, [&](std::uint32_t begin, std::uint32_t end) {
        for (std::uint32_t i = begin; i < end; ++i) ++seen[i];
      });
    }
    for (const auto& n : seen) EXPECT_EQ(n, 50);
  }
}

TEST(World, BodiesOfOnePackageAreIndependent) {
  World alone, together;
  const auto asset = boxAsset(softBox());
  const BodyId single = *alone.addBody(asset);
  BodySettings elsewhere;
  elsewhere.position = {5, 1, 2};
  const BodyId other = *together.addBody(asset, elsewhere);
  const BodyId same = *together.addBody(asset);
  run(alone, 0.5);
  run(together, 0.5);
  EXPECT_TRUE(
      std::equal(alone.positions(single).begin(), alone.positions(single).end(), together.positions(same).begin()));
  EXPECT_FALSE(other == same);
}

TEST(World, RemovedBodiesAreGoneAndTheirIdsStayUnused) {
  World world;
  const auto asset = boxAsset(softBox(1));
  const BodyId a = *world.addBody(asset), b = *world.addBody(asset);
  const PickId pick = world.pick(a, 0, {1, 1, 1});
  world.removeBody(a);
  EXPECT_TRUE(world.positions(a).empty());
  world.movePick(pick, {0, 0, 0});
  world.releasePick(pick);
  world.removeBody(a);
  world.step(1.0F / 60);
  const BodyId c = *world.addBody(asset);
  EXPECT_FALSE(c == a);
  EXPECT_FALSE(c == b);
  EXPECT_FALSE(world.positions(b).empty());
}

TEST(World, ResetGoesBackToTheBeginningExactly) {
  WorldSettings settings;
  settings.ground.enabled = true;
  World world(settings);
  BodySettings place;
  place.position = {0, 0.6F, 0};
  const BodyId body = *world.addBody(boxAsset(softBox()), place);
  std::vector<std::vector<Vec3>> runs;
  for (int round = 0; round < 2; ++round) {
    world.pin(body, 0, {1, 1, 1});
    world.pick(body, 2, {2, 2, 2});
    run(world, 0.5);
    runs.emplace_back(world.positions(body).begin(), world.positions(body).end());
    world.resetBody(body);
  }
  EXPECT_TRUE(runs[0] == runs[1]);
  run(world, 1);  // nothing is held any more
  EXPECT_GE(lowestDrawn(world, body), -1e-6);
  EXPECT_LT(lowestPoint(world, body), 0.01);
}

TEST(World, PartsOfAPackageFallIndependently) {
  BoxOptions small = softBox(1), large = softBox();
  small.center = {0, 2, 0};
  large.center = {3, 0, 0};
  formats::PackageContent content = boxContent(small);
  appendBody(content, boxContent(large));
  WorldSettings settings;
  settings.ground.enabled = true;
  World world(settings);
  BodySettings place;
  place.position = {0, 0.5F, 0};
  const BodyId body = *world.addBody(makeAsset(content), place);
  run(world, 0.5);
  // The second stands on the ground from the start; the first is in free fall and does not feel it.
  const double fallen = 2.5 - double(world.positions(body)[0][1]) +
                        double(world.asset(body).package().physicalVertices()[0].rest_position[1]) - 2;
  // With air drag of rate k: g t / k - g (1 - e^-kt) / k².
  EXPECT_NEAR(fallen, 9.81 * 0.5 / 0.2 - 9.81 * (1 - std::exp(-0.1)) / 0.04, 0.015);
  EXPECT_NEAR(lowestDrawn(world, body), 0, 1e-6);
}

TEST(World, RigidMotionAndClusterFramesAreThoseOfThePlacement) {
  World world;
  BodySettings place;
  place.position = {1, 2, 3};
  place.rotation = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  const BodyId body = *world.addBody(boxAsset(softBox()), place);
  Mat3 rotation, linear;
  Vec3 translation, center;
  world.rigidMotion(body, rotation, translation);
  for (std::size_t k = 0; k < 9; ++k) EXPECT_NEAR(rotation[k], place.rotation[k], 1e-6F);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(translation[k], place.position[k], 1e-6F);
  world.clusterFrame(body, 0, center, linear);
  for (std::size_t k = 0; k < 9; ++k) EXPECT_NEAR(linear[k], place.rotation[k], 1e-5F);
}

TEST(World, APackageWithoutFieldsIsRefusedWithACure) {
  World world;
  const auto added = world.addBody(makePlainAsset(boxContent(softBox(1))));
  ASSERT_FALSE(added);
  EXPECT_NE(added.reason().find("bake it again"), std::string::npos) << added.reason();
}

TEST(World, RefusesWhatItCannotUse) {
  World world;
  EXPECT_FALSE(world.addBody(nullptr));
  const auto asset = boxAsset(softBox(1));
  BodySettings mirrored;
  mirrored.rotation = {1, 0, 0, 0, 1, 0, 0, 0, -1};
  EXPECT_FALSE(world.addBody(asset, mirrored));
  BodySettings nowhere;
  nowhere.position = {0, std::numeric_limits<float>::quiet_NaN(), 0};
  EXPECT_FALSE(world.addBody(asset, nowhere));
  const BodyId body = *world.addBody(asset);
  const std::vector<Vec3> before(world.positions(body).begin(), world.positions(body).end());
  for (const float h : {0.0F, -1.0F, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    world.step(h);
  }
  world.setState(body, std::vector<Vec3>(3), {});
  EXPECT_TRUE(std::equal(before.begin(), before.end(), world.positions(body).begin()));
}

TEST(Asset, LoadsFromAFileAndSaysWhyNot) {
  const std::string path = testing::TempDir() + "runtime_world_test.sinew";
  const std::vector<std::byte> bytes = packageBytes();
  {
    std::ofstream file(path, std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  }
  const auto asset = Asset::load(path);
  ASSERT_TRUE(asset) << asset.reason();
  EXPECT_EQ((*asset)->package().physicalVertices().size(), 125U);
  {
    std::ofstream file(path, std::ios::binary | std::ios::trunc);
    file.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size() / 2));
  }
  EXPECT_FALSE(Asset::load(path));
  { const std::ofstream file(path, std::ios::binary | std::ios::trunc); }
  EXPECT_NE(Asset::load(path).reason().find("empty"), std::string::npos);
  std::remove(path.c_str());
  EXPECT_NE(Asset::load(path).reason().find(path), std::string::npos);
  EXPECT_FALSE(Asset::load(testing::TempDir()));
}

// Bytes at any distance from an address that is a multiple of 64.
class BytesAt {
 public:
  BytesAt(std::span<const std::byte> bytes, std::size_t shift)
      : room_(bytes.size() + shift + 64), bytes_(bytes.size()) {
    void* start = room_.data();
    std::size_t left = room_.size();
    begin_ = static_cast<std::byte*>(std::align(64, bytes_ + shift, start, left)) + shift;
    std::copy(bytes.begin(), bytes.end(), begin_);
  }
  std::span<std::byte> span() { return {begin_, bytes_}; }
  bool holds(const void* address) const {
    return std::less_equal<>()(static_cast<const void*>(begin_), address) &&
           std::less<>()(address, static_cast<const void*>(begin_ + bytes_));
  }

 private:
  std::vector<std::byte> room_;
  std::size_t bytes_;
  std::byte* begin_;
};

TEST(Asset, FromMemoryCopiesWhateverTheAddress) {
  const std::vector<std::byte> bytes = packageBytes();
  for (const std::size_t shift : {0U, 1U, 32U, 63U}) {
    BytesAt at(bytes, shift);
    const auto asset = Asset::fromMemory(at.span());
    ASSERT_TRUE(asset) << asset.reason();
    EXPECT_FALSE(at.holds((*asset)->package().physicalVertices().data())) << shift;
    std::ranges::fill(at.span(), std::byte{0xff});
    EXPECT_EQ((*asset)->package().totalBytes(), bytes.size());
    EXPECT_EQ((*asset)->package().physicalVertices().front().rest_position[0], -0.5F) << shift;
  }
  EXPECT_NE(Asset::fromMemory({}).reason().find("cut short"), std::string::npos);
}

TEST(Asset, InPlaceUsesAndKeepsTheBytes) {
  const std::vector<std::byte> bytes = packageBytes();
  BytesAt at(bytes, 0);
  {
    World world, other;
    BodyId body{}, same{};
    {
      const auto asset = Asset::inPlace(at.span());
      ASSERT_TRUE(asset) << asset.reason();
      EXPECT_TRUE(at.holds((*asset)->package().physicalVertices().data()));
      EXPECT_TRUE(at.holds((*asset)->package().info().origin.data()));
      body = *world.addBody(*asset);
      same = *other.addBody(*Asset::fromMemory(bytes));
    }
    for (int i = 0; i < 30; ++i) {
      world.step(1.0F / 60);
      other.step(1.0F / 60);
    }
    EXPECT_TRUE(std::ranges::equal(world.positions(body), other.positions(same)));
  }
  EXPECT_TRUE(std::ranges::equal(at.span(), bytes)) << "they are only read";
  auto owner = std::make_shared<int>(0);
  {
    const auto asset = Asset::inPlace(at.span(), owner);
    EXPECT_EQ(owner.use_count(), 2) << "kept with the asset";
  }
  EXPECT_EQ(owner.use_count(), 1);
  EXPECT_NE(Asset::inPlace({}).reason().find("cut short"), std::string::npos);
  for (const std::size_t shift : {1U, 4U, 32U, 63U}) {
    BytesAt odd(bytes, shift);
    EXPECT_NE(Asset::inPlace(odd.span()).reason().find("not aligned to 64"), std::string::npos) << shift;
  }
}

}  // namespace
}  // namespace sinew::test

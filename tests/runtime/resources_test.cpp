// SPDX-License-Identifier: MIT
//
// What a world is given: memory, jobs, a log. All memory of a world comes from its resource and goes back; steps take
// none; running out of it is told, not thrown.
#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <memory_resource>
#include <string>

#include "sinew/runtime/thread_pool.h"
#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"
#include "tests/support/field_content.h"

namespace sinew::test {
namespace {

// Counts, and runs dry on demand.
class CountingMemory final : public std::pmr::memory_resource {
 public:
  std::atomic<std::size_t> allocations = 0, live_bytes = 0, live_blocks = 0;
  std::size_t dry_after = std::numeric_limits<std::size_t>::max();  ///< allocations, from now on

 private:
  void* do_allocate(std::size_t bytes, std::size_t alignment) override {
    if (dry_after == 0) throw std::bad_alloc();
    --dry_after;
    ++allocations;
    ++live_blocks;
    live_bytes += bytes;
    return std::pmr::new_delete_resource()->allocate(bytes, alignment);
  }
  void do_deallocate(void* memory, std::size_t bytes, std::size_t alignment) override {
    --live_blocks;
    live_bytes -= bytes;
    std::pmr::new_delete_resource()->deallocate(memory, bytes, alignment);
  }
  bool do_is_equal(const std::pmr::memory_resource& other) const noexcept override { return this == &other; }
};

class Lines final : public LogSink {
 public:
  void write(LogSeverity severity, std::string_view line) override {
    lines.emplace_back(severity, std::string(line));
    EXPECT_EQ(line.find('\n'), std::string_view::npos);
  }
  std::size_t count(LogSeverity severity) const {
    std::size_t n = 0;
    for (const auto& line : lines) n += line.first == severity ? 1 : 0;
    return n;
  }
  std::vector<std::pair<LogSeverity, std::string>> lines;
};

class Throwing final : public LogSink {
 public:
  void write(LogSeverity, std::string_view) override { throw 1; }
};

BoxOptions softBox() {
  BoxOptions box;
  box.mode = formats::ClusterMode::quadratic;
  box.clusters = {2, 2, 2};
  return box;
}

class OneByOne final : public JobSystem {
 public:
  void parallelFor(std::uint32_t count, std::uint32_t,
                   const std::function<void(std::uint32_t, std::uint32_t)>& body) override {
    for (std::uint32_t i = count; i > 0; --i) body(i - 1, i);
  }
};

TEST(Resources, StepsTakeNoMemoryAndAllGoesBack) {
  ThreadPool pool(3);
  OneByOne jobs;
  formats::PackageContent content = boxContent(softBox());
  addFields(content);
  addResiduals(content);
  const auto asset = makeAsset(content);
  for (JobSystem* system : std::initializer_list<JobSystem*>{nullptr, &pool, &jobs}) {
    CountingMemory memory;
    {
      WorldSettings settings;
      settings.ground.enabled = true;
      World world(settings, WorldResources{&memory, system, nullptr});
      std::vector<BodyId> bodies;
      for (int i = 0; i < 5; ++i) {
        BodySettings place;
        place.position = {2.0F * float(i), 0.6F, 0};
        place.keep_previous = i % 2 == 0;
        bodies.push_back(*world.addBody(asset, place));
      }
      world.pin(bodies[0], 3, world.positions(bodies[0])[3]);
      const PickId pick = world.pick(bodies[1], 0, {1, 2, 0});
      world.removeBody(bodies[4]);
      world.step(1.0F / 60);
      const std::size_t before = memory.allocations;
      ASSERT_GT(before, 5U);
      for (int i = 0; i < 120; ++i) {
        world.step(i % 2 == 0 ? 1.0F / 60 : 1.0F / 50);
        world.movePick(pick, {1, 2, float(i) * 0.01F});
        if (i == 60) world.unpinAll(bodies[0]);
        if (i == 80) world.resetBody(bodies[2]);
        if (i == 90) world.teleport(bodies[3], {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 1, 0});
      }
      EXPECT_EQ(memory.allocations, before);
    }
    EXPECT_EQ(memory.live_blocks, 0U);
    EXPECT_EQ(memory.live_bytes, 0U);
  }
}

TEST(Resources, OutputsTakeNoMemoryTheSecondTime) {
  CountingMemory memory;
  World world({}, WorldResources{&memory, nullptr, nullptr});
  const BodyId body = *world.addBody(boxAsset(softBox()));
  std::vector<Vec3> normals(world.asset(body).package().visualPositions().size());
  const auto draw = [&] {
    world.step(1.0F / 60);
    world.visualVertices(body, {}, {normals[0].data(), 12, std::uint32_t(normals.size())});
    static_cast<void>(world.visualBounds(body));
  };
  draw();
  const std::size_t before = memory.allocations;
  for (int i = 0; i < 10; ++i) draw();
  EXPECT_EQ(memory.allocations, before);
}

// docs/runtime.md: at most 100 bytes a physical vertex and 40 a membership for one more instance of a package.
TEST(Resources, AnInstanceIsSmall) {
  BoxOptions box;
  box.cells = {16, 16, 16};
  box.clusters = {4, 4, 4};
  box.mode = formats::ClusterMode::quadratic;
  const auto asset = boxAsset(box);
  CountingMemory memory;
  WorldSettings settings;
  settings.ground.enabled = true;
  World world(settings, WorldResources{&memory, nullptr, nullptr});
  const auto add = [&] {
    const BodyId body = *world.addBody(asset);
    world.pick(body, 0, {0, 2, 0});
    world.step(1.0F / 60);
    return body;
  };
  add();
  const std::size_t first = memory.live_bytes;
  for (int i = 0; i < 8; ++i) add();
  const std::size_t vertices = asset->package().physicalVertices().size();
  const std::size_t memberships = asset->package().memberships().size();
  const double each = double(memory.live_bytes - first) / 8;
  RecordProperty("bytes_per_vertex", std::to_string(each / double(vertices)));
  RecordProperty("memberships_per_vertex", std::to_string(double(memberships) / double(vertices)));
  EXPECT_LE(each, 100.0 * double(vertices) + 40.0 * double(memberships));
  EXPECT_GT(each, 24.0 * double(vertices));  // it does count: two vectors a vertex are the least
}

TEST(Resources, RunningOutOfMemoryIsToldAndTheWorldGoesOn) {
  const auto asset = boxAsset(softBox());
  // Wherever it runs out while a body is added.
  for (std::size_t dry_after = 0; dry_after < 40; ++dry_after) {
    CountingMemory memory;
    Lines log;
    World world({}, WorldResources{&memory, nullptr, &log});
    const BodyId first = *world.addBody(asset);
    world.step(1.0F / 60);
    const std::size_t before = memory.live_bytes;
    memory.dry_after = dry_after;
    BodySettings history;
    history.keep_previous = true;
    const auto added = world.addBody(asset, history);
    memory.dry_after = std::numeric_limits<std::size_t>::max();
    if (added) {
      ASSERT_GT(dry_after, 5U);
      break;
    }
    EXPECT_NE(added.reason().find("out of memory"), std::string::npos);
    ASSERT_EQ(log.count(LogSeverity::error), 1U);
    EXPECT_LE(memory.live_bytes, before + 64);
    world.step(1.0F / 60);
    EXPECT_TRUE(allFinite(world, first));
    EXPECT_TRUE(world.addBody(asset));
  }
}

TEST(Resources, AWorldThatFindsNoMemorySaysSo) {
  CountingMemory memory;
  memory.dry_after = 0;
  EXPECT_EQ(World::create({}, WorldResources{&memory, nullptr, nullptr}).reason(), "out of memory");
  EXPECT_EQ(memory.live_blocks, 0U);
  memory.dry_after = std::numeric_limits<std::size_t>::max();
  auto world = World::create({}, WorldResources{&memory, nullptr, nullptr});
  ASSERT_TRUE(world);
  EXPECT_TRUE(world->addBody(boxAsset(softBox())));
}

// Whatever a pin set needs comes from the world's memory, and where it runs out the sets that there are stay.
TEST(Resources, APinSetThatFindsNoMemoryChangesNothing) {
  formats::PackageContent content = boxContent(softBox());
  formats::ClusterMechanics mechanics = formats::kPlainMechanics;
  mechanics.damping = 1;  // so that the body keeps a state of mechanics as well
  content.mechanics.assign(content.clusters.size(), mechanics);
  const auto asset = makeAsset(content);
  CountingMemory memory;
  Lines log;
  World world({}, WorldResources{&memory, nullptr, &log});
  const BodyId body = *world.addBody(asset);
  const std::vector<std::uint32_t> some = {0, 1, 2}, others = {3, 4, 5};
  const PinSetId held = *world.addPinSet(body, some, {}, PinMethod::constrained_fit);
  world.step(1.0F / 60);
  const Vec3 place = world.positions(body)[1];
  bool added = false;
  std::size_t dry_after = 0;
  for (; !added; ++dry_after) {
    ASSERT_LT(dry_after, 100U);
    memory.dry_after = dry_after;
    added = bool(world.addPinSet(body, others, {}, PinMethod::constrained_fit));
    memory.dry_after = std::numeric_limits<std::size_t>::max();
    EXPECT_EQ(log.count(LogSeverity::error), dry_after + (added ? 0 : 1));
    world.step(1.0F / 60);
    ASSERT_TRUE(allFinite(world, body));
    ASSERT_EQ(world.positions(body)[1], place) << dry_after;
  }
  EXPECT_GT(dry_after, 4U);
  memory.dry_after = 0;
  world.removePinSet(held);  // takes none
  memory.dry_after = std::numeric_limits<std::size_t>::max();
  for (int i = 0; i < 10; ++i) world.step(1.0F / 60);
  EXPECT_NE(world.positions(body)[1], place);
}

// A package that needs most: elastic, damped and plastic clusters, and pins of its own.
std::shared_ptr<const Asset> demandingAsset() {
  formats::PackageContent content = boxContent(softBox());
  formats::ClusterMechanics mechanics = formats::kPlainMechanics;
  mechanics.stiffness = formats::StiffnessModel::elastic;
  mechanics.young = 1e5F;
  mechanics.poisson = 0.3F;
  mechanics.damping = 1;
  mechanics.plastic_yield = 0.1F;
  mechanics.plastic_creep = 1;
  mechanics.plastic_limit = 0.2F;
  content.mechanics.assign(content.clusters.size(), mechanics);
  addFields(content);
  addResiduals(content);
  return makeAsset(content);
}

TEST(Resources, AStepThatFindsNoMemoryIsDoneByTheNext) {
  const auto asset = demandingAsset();
  std::size_t dry_after = 0;
  for (bool fell_short = true; fell_short; ++dry_after) {
    ASSERT_LT(dry_after, 100U);
    CountingMemory memory;
    Lines log;
    WorldSettings settings;
    settings.ground.enabled = true;
    World world(settings, WorldResources{&memory, nullptr, &log});
    BodySettings place;
    place.position = {0, 3, 0};
    const BodyId body = *world.addBody(asset, place);
    world.pin(body, 5, {0, 2, 0});
    memory.dry_after = dry_after;
    world.step(1.0F / 60);
    memory.dry_after = std::numeric_limits<std::size_t>::max();
    fell_short = log.count(LogSeverity::error) > 0;
    for (int i = 0; i < 3; ++i) world.step(1.0F / 60);
    EXPECT_EQ(log.count(LogSeverity::error), fell_short ? 1U : 0U);
    EXPECT_TRUE(allFinite(world, body));
    EXPECT_LT(motionOf(world, body).momentum[1], 0) << "it did not step";
  }
  EXPECT_GT(dry_after, 6U);
}

TEST(Resources, WhatFindsNoMemoryHasDoneNothing) {
  const auto asset = demandingAsset();
  const std::vector<std::uint32_t> some = {0, 1, 2}, others = {3, 4, 5};
  std::vector<std::byte> saved;
  for (std::size_t dry_after = 0, failed = 1; failed > 0; ++dry_after) {
    ASSERT_LT(dry_after, 200U);
    CountingMemory memory;
    World world({}, WorldResources{&memory, nullptr, nullptr});
    const BodyId body = *world.addBody(asset);
    if (saved.empty()) {  // of a body that more holds
      const PinSetId set = *world.addPinSet(body, others, {}, PinMethod::constrained_fit);
      world.step(1.0F / 60);
      saved.resize(world.stateBytes(body));
      ASSERT_EQ(world.saveState(body, saved), saved.size());
      world.removePinSet(set);
    }
    ASSERT_TRUE(world.addPinSet(body, some, {}, PinMethod::constrained_fit));
    world.step(1.0F / 60);
    const std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
    failed = 0;
    memory.dry_after = dry_after;
    const bool restored = bool(world.restoreState(body, saved));
    memory.dry_after = std::numeric_limits<std::size_t>::max();
    if (!restored) {
      ++failed;
      EXPECT_TRUE(std::equal(x.begin(), x.end(), world.positions(body).begin())) << dry_after;
      EXPECT_FALSE(world.addPinSet(body, some, {}, PinMethod::constrained_fit)) << "they are held still";
    }
    // What a pick and a pin need for the next step is asked for again then.
    memory.dry_after = dry_after;
    const PickId pick = world.pick(body, 0, {0, 1, 0});
    memory.dry_after = std::numeric_limits<std::size_t>::max();
    std::array<PickId, 4> picks;
    EXPECT_EQ(world.picks(body, picks), pick.value == PickId{}.value ? 0U : 1U) << dry_after;
    world.step(1.0F / 60);
    EXPECT_TRUE(allFinite(world, body));
  }
}

TEST(Resources, BodiesThatAreGoneCostNothing) {
  CountingMemory memory;
  World world({}, WorldResources{&memory, nullptr, nullptr});
  const auto asset = boxAsset(softBox());
  const BodyId stays = *world.addBody(asset);
  const auto come_and_go = [&] {
    const BodyId body = *world.addBody(asset);
    const PickId pick = world.pick(body, 0, {0, 1, 0});
    world.step(1.0F / 60);
    world.releasePick(pick);
    world.removeBody(body);
    EXPECT_FALSE(world.contains(body));
    return body.value;
  };
  std::uint32_t last = come_and_go();
  const std::size_t before = memory.live_bytes;
  for (int i = 0; i < 300; ++i) {
    const std::uint32_t id = come_and_go();
    EXPECT_GT(id, last);  // ids are never used again
    last = id;
  }
  EXPECT_EQ(memory.live_bytes, before);
  EXPECT_TRUE(world.contains(stays));
}

TEST(Resources, TheLogTellsWhatWasRefusedOrPutRight) {
  Lines log;
  World world({}, WorldResources{nullptr, nullptr, &log});
  const BodyId body = *world.addBody(boxAsset(softBox()));
  world.step(1.0F / 60);
  EXPECT_TRUE(log.lines.empty());

  const BodyId unknown{77};
  const std::vector<std::function<void()>> refused = {[&] { world.removeBody(unknown); },
                                                      [&] { world.resetBody(unknown); },
                                                      [&] { world.releasePick({77}); },
                                                      [&] { world.step(2e6F); },
                                                      [&] { world.step(-1); },
                                                      [&] { world.step(std::numeric_limits<float>::quiet_NaN()); },
                                                      [&] { world.setState(body, {}, {}); },
                                                      [&] {
                                                        static_cast<void>(world.pick(body, 1U << 30, {0, 0, 0}));
                                                      },
                                                      [&] {
                                                        world.movePick({123}, {0, 0, 0});
                                                      },
                                                      [&] {
                                                        world.teleport(body, {2, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0});
                                                      },
                                                      [&] { static_cast<void>(world.restoreState(body, {})); },
                                                      [&] { world.visualSubMesh(body, 99, {}); },
                                                      [&] {
                                                        float place[3];
                                                        world.visualVertices(body, {{place, 8, 1}, {}, {}, {}});
                                                      }};
  for (std::size_t i = 0; i < refused.size(); ++i) {
    log.lines.clear();
    refused[i]();
    ASSERT_EQ(log.count(LogSeverity::error), 1U) << i;
    EXPECT_GT(log.lines[0].second.size(), 10U);
  }

  log.lines.clear();
  std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
  x[2] = {std::numeric_limits<float>::infinity(), 0, 0};
  world.setState(body, x, {});
  ASSERT_EQ(log.count(LogSeverity::warning), 1U);
  EXPECT_NE(log.lines[0].second.find("1 vert"), std::string::npos) << log.lines[0].second;

  // A setting out of range is told once, and again when it comes back.
  log.lines.clear();
  world.settings().iterations = 400;
  for (int i = 0; i < 3; ++i) world.step(1.0F / 60);
  ASSERT_EQ(log.lines.size(), 1U);
  EXPECT_NE(log.lines[0].second.find("iterations"), std::string::npos);
  world.settings().iterations = 4;
  world.step(1.0F / 60);
  world.settings().damping = std::numeric_limits<float>::quiet_NaN();
  world.step(1.0F / 60);
  EXPECT_EQ(log.lines.size(), 2U);
  EXPECT_TRUE(allFinite(world, body));
}

TEST(Resources, WhatALogThrowsGoesNoFurther) {
  Throwing log;
  World world({}, WorldResources{nullptr, nullptr, &log});
  EXPECT_NO_THROW(world.step(-1));
  EXPECT_NO_THROW(world.removeBody({5}));
  const BodyId body = *world.addBody(boxAsset(softBox()));
  EXPECT_NO_THROW(EXPECT_FALSE(world.addPinSet(body, {}, {})));
}

TEST(Resources, MovedWorldsKeepTheirBodies) {
  CountingMemory memory;
  {
    World first({}, WorldResources{&memory, nullptr, nullptr});
    const BodyId body = *first.addBody(boxAsset(softBox()));
    World second(std::move(first));
    second.step(1.0F / 60);
    EXPECT_TRUE(second.contains(body));
    World third;
    third = std::move(second);
    third.step(1.0F / 60);
    EXPECT_TRUE(third.contains(body));
  }
  EXPECT_EQ(memory.live_bytes, 0U);
}

}  // namespace
}  // namespace sinew::test

// SPDX-License-Identifier: MIT
//
// Several threads in one world: what may run side by side does, what must not is refused. That nothing is shared that
// should not be is for ThreadSanitizer to show.
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

class Lines final : public LogSink {
 public:
  void write(LogSeverity, std::string_view line) override {
    const std::lock_guard lock(mutex_);
    all_.append(line).append("\n");
  }
  std::string take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(all_, {});
  }

 private:
  std::mutex mutex_;
  std::string all_;
};

/// Runs loops alone, and before the next one what another thread is to do meanwhile.
class Meanwhile final : public JobSystem {
 public:
  void parallelFor(std::uint32_t count, std::uint32_t,
                   const std::function<void(std::uint32_t, std::uint32_t)>& body) override {
    if (const auto work = std::exchange(other, nullptr)) std::thread(work).join();
    body(0, count);
  }
  std::function<void()> other;
};

std::shared_ptr<const Asset> clusteredBox(bool cluster_attachment) {
  BoxOptions box;
  box.cells = {5, 4, 4};
  box.clusters = {2, 2, 2};
  box.mode = formats::ClusterMode::quadratic;
  box.cluster_attachment = cluster_attachment;
  return boxAsset(box);
}

struct Drawn {
  std::vector<Vec3> positions, normals;
  explicit Drawn(const Asset& asset) : positions(asset.package().visualPositions().size()), normals(positions.size()) {}
  VisualOutput output() {
    const auto count = std::uint32_t(positions.size());
    return {{positions[0].data(), 12, count}, {normals[0].data(), 12, count}, {}, {}};
  }
  bool operator==(const Drawn&) const = default;
};

/// Bodies of two kinds, fallen for some steps, each turned another way.
std::vector<BodyId> addBodies(World& world, const std::array<std::shared_ptr<const Asset>, 2>& assets) {
  std::vector<BodyId> bodies;
  for (std::uint32_t i = 0; i < 8; ++i) {
    BodySettings how;
    how.position = {float(3 * i), 0.6F, 0};
    if (i % 3 == 1) how.rotation = {0, -1, 0, 1, 0, 0, 0, 0, 1};
    bodies.push_back(*world.addBody(assets[i % 2], how));
  }
  for (int step = 0; step < 20; ++step) world.step(1.0F / 60);
  return bodies;
}

WorldSettings onGround() {
  WorldSettings settings;
  settings.ground.enabled = true;
  return settings;
}

TEST(WorldThreads, WhatOverlapsAStepIsRefusedAndTold) {
  Meanwhile jobs;
  Lines log;
  World world(onGround(), {nullptr, &jobs, &log});
  const auto asset = clusteredBox(false);
  const BodyId body = *world.addBody(asset), second = *world.addBody(asset);
  const PickId pick = world.pick(second, 0, {3, 1, 0});
  const PinSetId set = *world.addPinSet(second, std::vector<std::uint32_t>{0, 1, 2}, {});
  Drawn drawn(*asset);
  bool found = true, added = true;
  jobs.other = [&] {
    world.step(1.0F / 60);
    EXPECT_EQ(world.advance(1.0F / 60), 0U);
    world.visualVertices(body, drawn.output());
    world.pin(body, 0, {0, 1, 0});
    world.removeBody(second);
    world.movePick(pick, {});
    world.releasePick(pick);
    world.movePinSet(set, {});
    world.removePinSet(set);
    static_cast<void>(world.pinReaction(set));
    found = !world.positions(body).empty();
    added = bool(world.addBody(asset));
  };
  world.step(1.0F / 60);
  ASSERT_FALSE(jobs.other) << "the step has run no loop";
  const std::string told = log.take();
  for (const char* call :
       {"step: another thread steps", "advance: another", "visualVertices: another", "pin: another thread",
        "removeBody: another", "positions: another", "addBody: another", "movePick: another", "releasePick: another",
        "movePinSet: another", "removePinSet: another", "pinReaction: another"}) {
    EXPECT_NE(told.find(call), std::string::npos) << call << " in: " << told;
  }
  EXPECT_FALSE(found);
  EXPECT_FALSE(added);
  EXPECT_TRUE(world.contains(second));
  EXPECT_EQ(drawn, Drawn(*asset));

  // One step was taken, and the world goes on.
  World alone(onGround());
  const BodyId same = *alone.addBody(asset);
  const BodyId alone_second = *alone.addBody(asset);
  static_cast<void>(alone.pick(alone_second, 0, {3, 1, 0}));
  static_cast<void>(alone.addPinSet(alone_second, std::vector<std::uint32_t>{0, 1, 2}, {}));
  for (World* each : {&world, &alone}) each->step(1.0F / 60);
  alone.step(1.0F / 60);
  const auto a = world.positions(body), b = alone.positions(same);
  EXPECT_TRUE(std::equal(a.begin(), a.end(), b.begin(), b.end()));
  EXPECT_EQ(log.take(), "");
}

TEST(WorldThreads, AStepWhileAnotherThreadDrawsIsRefusedAndTold) {
  Meanwhile jobs;
  Lines log;
  World world(onGround(), {nullptr, &jobs, &log});
  const auto asset = clusteredBox(true);  // its clusters are fitted by jobs
  const BodyId body = *world.addBody(asset);
  world.step(1.0F / 60);
  const Vec3 before = world.positions(body)[0];
  Drawn drawn(*asset);
  jobs.other = [&] { world.step(1.0F / 60); };
  world.visualVertices(body, drawn.output());
  ASSERT_FALSE(jobs.other) << "the output has run no loop";
  EXPECT_NE(log.take().find("step: another thread draws"), std::string::npos);
  EXPECT_EQ(world.positions(body)[0], before);
  Drawn again(*asset);
  world.visualVertices(body, again.output());
  EXPECT_EQ(drawn, again);
}

TEST(WorldThreads, BodiesAreDrawnSideBySide) {
  const std::array<std::shared_ptr<const Asset>, 2> assets = {clusteredBox(false), clusteredBox(true)};
  std::vector<Drawn> expected;
  {
    World world(onGround());
    for (const BodyId body : addBodies(world, assets)) {
      expected.emplace_back(world.asset(body));
      world.visualVertices(body, expected.back().output());
    }
  }
  ThreadPool pool(3);
  for (JobSystem* jobs : {static_cast<JobSystem*>(nullptr), static_cast<JobSystem*>(&pool)}) {
    World world(onGround(), jobs);
    const std::vector<BodyId> bodies = addBodies(world, assets);
    std::vector<Drawn> drawn, batch;
    std::vector<BodyOutput> outputs;
    for (const BodyId body : bodies) {
      drawn.emplace_back(world.asset(body));
      batch.emplace_back(world.asset(body));
    }
    for (std::size_t i = 0; i < bodies.size(); ++i) outputs.push_back({bodies[i], batch[i].output()});
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < 4; ++t) {
      threads.emplace_back([&, t] {
        for (int round = 0; round < 20; ++round) {
          for (std::size_t i = t; i < bodies.size(); i += 4) {
            world.visualVertices(bodies[i], drawn[i].output());
            static_cast<void>(world.visualBounds(bodies[i]));
          }
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(drawn, expected);
    world.visualVertices(outputs);
    EXPECT_EQ(batch, expected);
  }
}

TEST(WorldThreads, ABatchDrawsWhatItCanAndTellsTheRest) {
  Lines log;
  ThreadPool pool(2);
  World world(onGround(), {nullptr, &pool, &log});
  const std::array<std::shared_ptr<const Asset>, 2> assets = {clusteredBox(false), clusteredBox(true)};
  const std::vector<BodyId> bodies = addBodies(world, assets);
  Drawn first(*assets[0]), second(*assets[0]), other(*assets[1]), odd(*assets[0]);
  VisualOutput unsound = odd.output();
  unsound.normals.stride = 10;
  const std::vector<BodyOutput> outputs = {{bodies[0], first.output()},
                                           {BodyId{77}, odd.output()},
                                           {bodies[0], second.output()},
                                           {bodies[2], unsound},
                                           {bodies[1], other.output()}};
  world.visualVertices(outputs);
  const std::string told = log.take();
  EXPECT_NE(told.find("there is no body 77"), std::string::npos) << told;
  EXPECT_NE(told.find("body 0 is given twice"), std::string::npos) << told;
  EXPECT_NE(told.find("a stride must be"), std::string::npos) << told;
  Drawn alone(*assets[0]), beside(*assets[1]);
  world.visualVertices(bodies[0], alone.output());
  world.visualVertices(bodies[1], beside.output());
  EXPECT_EQ(first, alone);
  EXPECT_EQ(other, beside);
  EXPECT_EQ(second, Drawn(*assets[0]));
  EXPECT_EQ(odd, Drawn(*assets[0]));
  world.visualVertices(std::span<const BodyOutput>{});  // none
  EXPECT_EQ(log.take(), "");
}

// A loop that is called from inside another, or from two threads at once, is whole all the same.
TEST(WorldThreads, APoolTakesLoopsWithinLoops) {
  ThreadPool pool(3);
  std::atomic<std::uint32_t> sum{0};
  const auto loops = [&] {
    pool.parallelFor(20, 1, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t i = begin; i < end; ++i) {
        pool.parallelFor(10, 1, [&](std::uint32_t b, std::uint32_t e) { sum += e - b; });
      }
    });
  };
  std::thread beside([&] {
    for (int round = 0; round < 50; ++round) loops();
  });
  for (int round = 0; round < 50; ++round) loops();
  beside.join();
  EXPECT_EQ(sum, 2U * 50 * 20 * 10);
}

}  // namespace
}  // namespace sinew::test

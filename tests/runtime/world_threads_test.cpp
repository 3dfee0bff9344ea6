// SPDX-License-Identifier: MIT
//
// Several threads in one world: what may run side by side does, what must not is refused. That nothing is shared that
// should not be is for ThreadSanitizer to show.
#include <gtest/gtest.h>

#include <atomic>
#include <barrier>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

/// Keeps what is told, and at the next line does first what another thread is to do meanwhile.
class Lines final : public LogSink {
 public:
  void write(LogSeverity, std::string_view line) override {
    std::unique_lock lock(mutex_);
    if (const auto work = std::exchange(other, nullptr)) {
      lock.unlock();
      std::thread(work).join();
      lock.lock();
    }
    all_.append(line).append("\n");
  }
  std::string take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(all_, {});
  }
  std::function<void()> other;

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

enum class Does { looks, draws, reads, changes, steps };

/// Whether of two calls that overlap one is refused: who changes meets nobody, who reads where bodies are as the last
/// step left them nobody who draws them as they are shown.
bool refused(Does a, Does b) {
  if (a > b) std::swap(a, b);
  return b >= Does::changes || (a == Does::draws && b == Does::reads);
}

struct Call {
  const char* name;
  Does does;
  std::function<void(World&)> make;
};

/// All of World that may overlap: what is left out returns references (settings(), asset()). What a call adds it takes
/// away again, unless another call is there then.
std::vector<Call> callsOf(const std::shared_ptr<const Asset>& asset) {
  const BodyId body{0};
  const PickId pick{0};
  const ColliderId collider{1};
  const PinSetId set{0};
  const BodyPoint point = BodyPoint::visualVertex(0);
  const Vec3 up = {0, 1, 0};
  const auto drawn = [asset](const World& world, const auto& draw) {
    Drawn to(*asset);
    draw(world, to.output());
  };
  return {
      {"step", Does::steps, [](World& w) { w.step(1.0F / 60); }},
      {"advance", Does::steps, [](World& w) { w.advance(0.02F); }},
      {"addBody", Does::changes,
       [asset](World& w) {
         if (const auto made = w.addBody(asset)) w.removeBody(*made);
       }},
      {"removeBody", Does::changes, [](World& w) { w.removeBody(BodyId{77}); }},
      {"resetBody", Does::changes, [](World& w) { w.resetBody(BodyId{1}); }},
      {"wake", Does::changes, [=](World& w) { w.wake(body); }},
      {"teleport", Does::changes,
       [=](World& w) {
         w.teleport(body, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0.01F, 0, 0});
       }},
      {"restoreState", Does::changes, [=](World& w) { static_cast<void>(w.restoreState(body, {})); }},
      {"restoreSnapshot", Does::changes,
       [](World& w) {
         std::vector<std::byte> bytes(w.snapshotBytes());
         bytes.resize(w.saveSnapshot(bytes));
         static_cast<void>(w.restoreSnapshot(bytes));
       }},
      {"setBodySettings", Does::changes, [=](World& w) { w.setBodySettings(body, {}); }},
      {"setActivity", Does::changes,
       [=](World& w) {
         w.setActivity(body, Activity::paused);
         w.setActivity(body, Activity::active);
       }},
      {"setState", Does::changes,
       [=](World& w) {
         const std::vector<Vec3> x(asset->package().physicalVertices().size(), up);
         w.setState(BodyId{1}, x, {});
       }},
      {"addImpulse", Does::changes, [=](World& w) { w.addImpulse(body, point, up); }},
      {"addForce", Does::changes, [=](World& w) { w.addForce(body, up); }},
      {"setVelocity", Does::changes, [=](World& w) { w.setVelocity(body, up); }},
      {"pin", Does::changes, [=](World& w) { w.pin(body, 20, up); }},
      {"unpin", Does::changes, [=](World& w) { w.unpin(body, 20); }},
      {"unpinAll", Does::changes, [](World& w) { w.unpinAll(BodyId{1}); }},
      {"addPinSet", Does::changes,
       [](World& w) {
         const std::uint32_t vertices[] = {1, 2, 3};
         if (const auto made = w.addPinSet(BodyId{1}, vertices)) w.removePinSet(*made);
       }},
      {"movePinSet", Does::changes,
       [=](World& w) {
         w.movePinSet(set, {{0, 0.01F, 0}});
       }},
      {"removePinSet", Does::changes, [](World& w) { w.removePinSet(PinSetId{77}); }},
      {"movePinTarget", Does::changes, [=](World& w) { w.movePinTarget(body, "world", {}); }},
      {"setActivation", Does::changes, [=](World& w) { w.setActivation(body, 0U, 1); }},
      {"setActivation", Does::changes, [=](World& w) { w.setActivation(body, "smile", 1); }},
      {"addCollider", Does::changes,
       [](World& w) {
         if (const auto made = w.addCollider(SphereShape{0.2F})) w.removeCollider(*made);
       }},
      {"moveCollider", Does::changes,
       [=](World& w) {
         w.moveCollider(collider, {{0, -2, 0}});
       }},
      {"removeCollider", Does::changes, [](World& w) { w.removeCollider(ColliderId{77}); }},
      {"pick", Does::changes,
       [=](World& w) {
         const PickId made = w.pick(BodyId{1}, point, up);
         if (made != PickId{}) w.releasePick(made);
       }},
      {"pickRay", Does::changes,
       [](World& w) {
         w.releasePick(w.pickRay({0.1F, 9, 0.2F}, {0, -1, 0}, 20));
       }},
      {"movePick", Does::changes, [=](World& w) { w.movePick(pick, up); }},
      {"lockPick", Does::changes, [=](World& w) { w.lockPick(pick); }},
      {"letGoPick", Does::changes, [](World& w) { w.letGoPick(PickId{77}); }},
      {"releasePick", Does::changes, [](World& w) { w.releasePick(PickId{77}); }},
      {"releasePicks", Does::changes, [](World& w) { w.releasePicks(BodyId{1}); }},
      {"shiftOrigin", Does::changes,
       [](World& w) {
         w.shiftOrigin({0, 0, 0.01F});
       }},
      {"energy", Does::changes, [=](World& w) { static_cast<void>(w.energy(body)); }},
      {"stateBytes", Does::reads, [=](World& w) { static_cast<void>(w.stateBytes(body)); }},
      {"saveState", Does::reads,
       [=](World& w) {
         std::vector<std::byte> bytes(std::size_t(1) << 16);
         static_cast<void>(w.saveState(body, bytes));
       }},
      {"snapshotBytes", Does::reads, [](World& w) { static_cast<void>(w.snapshotBytes()); }},
      {"saveSnapshot", Does::reads, [](World& w) { static_cast<void>(w.saveSnapshot({})); }},
      {"positions", Does::reads, [=](World& w) { static_cast<void>(w.positions(body)); }},
      {"velocities", Does::reads, [=](World& w) { static_cast<void>(w.velocities(body)); }},
      {"motion", Does::reads, [=](World& w) { static_cast<void>(w.motion(body)); }},
      {"placeOf", Does::reads, [=](World& w) { static_cast<void>(w.placeOf(body, point)); }},
      {"pickAlong", Does::reads,
       [](World& w) {
         static_cast<void>(w.pickAlong({0, 9, 0}, {0, -1, 0}, 20, 0.1F));
       }},
      {"pickState", Does::reads, [=](World& w) { static_cast<void>(w.pickState(pick)); }},
      {"physicalBounds", Does::reads, [=](World& w) { static_cast<void>(w.physicalBounds(body)); }},
      {"rigidMotion", Does::reads,
       [=](World& w) {
         Mat3 turn;
         Vec3 go;
         w.rigidMotion(body, turn, go);
       }},
      {"clusterFrame", Does::reads,
       [=](World& w) {
         Vec3 center;
         Mat3 linear;
         w.clusterFrame(body, 0, center, linear);
       }},
      {"visualVertices", Does::draws,
       [=](World& w) { drawn(w, [=](const World& on, const VisualOutput& to) { on.visualVertices(body, to); }); }},
      {"visualVertices", Does::draws,
       [=](World& w) {
         drawn(w, [=](const World& on, const VisualOutput& to) {
           const BodyOutput list[] = {{body, to}};
           on.visualVertices(list);
         });
       }},
      {"visualSubMesh", Does::draws,
       [=](World& w) { drawn(w, [=](const World& on, const VisualOutput& to) { on.visualSubMesh(body, 0, to); }); }},
      {"visualBounds", Does::draws, [=](World& w) { static_cast<void>(w.visualBounds(body)); }},
      {"nearestPoint", Does::draws, [=](World& w) { static_cast<void>(w.nearestPoint(body, up)); }},
      {"rayCast", Does::draws,
       [](World& w) {
         static_cast<void>(w.rayCast({0.1F, 9, 0.2F}, {0, -1, 0}, 20));
       }},
      {"sphereCast", Does::draws,
       [](World& w) {
         static_cast<void>(w.sphereCast({0, 9, 0}, 0.1F, {0, -1, 0}, 20));
       }},
      {"overlaps", Does::draws, [=](World& w) { static_cast<void>(w.overlaps(up, 1, {})); }},
      {"overlaps", Does::draws, [](World& w) { static_cast<void>(w.overlaps(BoxShape{}, {}, {})); }},
      {"contains", Does::looks, [=](World& w) { static_cast<void>(w.contains(body)); }},
      {"isAsleep", Does::looks, [=](World& w) { static_cast<void>(w.isAsleep(body)); }},
      {"bodies", Does::looks, [](World& w) { static_cast<void>(w.bodies({})); }},
      {"colliders", Does::looks, [](World& w) { static_cast<void>(w.colliders({})); }},
      {"pinSets", Does::looks, [=](World& w) { static_cast<void>(w.pinSets(body, {})); }},
      {"picks", Does::looks, [=](World& w) { static_cast<void>(w.picks(body, {})); }},
      {"bodySettings", Does::looks, [=](World& w) { static_cast<void>(w.bodySettings(body)); }},
      {"activity", Does::looks, [=](World& w) { static_cast<void>(w.activity(body)); }},
      {"repairedVertices", Does::looks, [=](World& w) { static_cast<void>(w.repairedVertices(body)); }},
      {"pinSet", Does::looks, [=](World& w) { static_cast<void>(w.pinSet(body, "held")); }},
      {"pinReaction", Does::looks, [=](World& w) { static_cast<void>(w.pinReaction(set)); }},
      {"colliderPose", Does::looks, [=](World& w) { static_cast<void>(w.colliderPose(collider)); }},
      {"colliderReaction", Does::looks, [](World& w) { static_cast<void>(w.colliderReaction(kGroundCollider)); }},
      {"contactEvents", Does::looks, [](World& w) { static_cast<void>(w.contactEvents()); }},
      {"contacts", Does::looks, [](World& w) { static_cast<void>(w.contacts()); }},
      {"clusterRestShape", Does::looks, [=](World& w) { static_cast<void>(w.clusterRestShape(body, 0)); }},
  };
}

/// A world for callsOf(): two bodies, one of them pulled and held, and a collider.
World worldOfCalls(const std::shared_ptr<const Asset>& asset, LogSink& log, JobSystem* jobs = nullptr) {
  World world(onGround(), {nullptr, jobs, &log});
  for (const float x : {0.0F, 3.0F}) {
    BodySettings how;
    how.position = {x, 0.6F, 0};
    static_cast<void>(world.addBody(asset, how));
  }
  static_cast<void>(world.pick(BodyId{0}, 0, {0, 1, 0}));
  static_cast<void>(world.addPinSet(BodyId{0}, std::vector<std::uint32_t>{0, 1, 2}));
  static_cast<void>(world.addCollider(SphereShape{0.2F}, {{{0, -2, 0}}}));
  world.step(1.0F / 60);
  return world;
}

// A call is met in its midst, where it tells the log of something else.
TEST(WorldThreads, OfCallsThatOverlapOneIsRefusedWhereOneChanges) {
  Lines log;
  const auto asset = clusteredBox(true);
  World world = worldOfCalls(asset, log);
  const std::vector<Call> holders = {
      {"reads", Does::looks, [](World& w) { static_cast<void>(w.clusterRestShape(BodyId{0}, 9999)); }},
      {"draws", Does::draws, [](World& w) { w.visualSubMesh(BodyId{0}, 9999, {}); }},
      {"reads", Does::reads, [](World& w) { static_cast<void>(w.placeOf(BodyId{0}, BodyPoint::visualVertex(9999))); }},
      {"changes", Does::changes, [](World& w) { w.pin(BodyId{0}, 9999, {}); }},
      {"steps", Does::steps,
       [](World& w) {
         w.settings().iterations = 0;
         w.step(1.0F / 60);
         w.settings().iterations = 4;
         w.step(1.0F / 60);
       }},
  };
  const auto calls = callsOf(asset);
  const auto bytes = [&] {
    std::vector<std::byte> all(world.snapshotBytes());
    all.resize(world.saveSnapshot(all));
    return all;
  };
  for (const Call& holder : holders) {
    for (const Call& call : calls) {
      const auto before = bytes();
      static_cast<void>(log.take());
      log.other = [&] { call.make(world); };
      holder.make(world);
      ASSERT_FALSE(log.other) << holder.name << " has told nothing";
      const std::string told = log.take(), line = std::string(": another thread ") + holder.name + " this world";
      EXPECT_EQ(told.find(line) != std::string::npos, refused(holder.does, call.does))
          << call.name << " beside one that " << holder.name << ": " << told;
      if (holder.does != Does::steps && refused(holder.does, call.does)) {
        EXPECT_EQ(bytes(), before) << call.name;
      }
    }
  }
}

TEST(WorldThreads, EachPairOfCallsSurvives) {
  constexpr int kRounds = 12;
  Lines log;
  ThreadPool pool(2);
  const auto asset = clusteredBox(true);
  World world = worldOfCalls(asset, log, &pool);
  const auto calls = callsOf(asset);
  std::barrier together(2);
  const auto play = [&](bool second) {
    for (std::size_t i = 0; i < calls.size(); ++i) {
      for (std::size_t j = i; j < calls.size(); ++j) {
        together.arrive_and_wait();
        for (int round = 0; round < kRounds; ++round) calls[second ? j : i].make(world);
      }
    }
  };
  std::thread other(play, true);
  play(false);
  other.join();
  static_cast<void>(log.take());
  // What a call could not take away again, because the other was there, can be taken away now; nothing was lost.
  std::vector<BodyId> bodies(world.bodies({}));
  world.bodies(bodies);
  ASSERT_GE(bodies.size(), 2U);
  for (const BodyId body : std::span(bodies).subspan(2)) world.removeBody(body);
  std::vector<ColliderId> colliders(world.colliders({}));
  world.colliders(colliders);
  ASSERT_GE(colliders.size(), 1U);
  for (const ColliderId collider : std::span(colliders).subspan(1)) world.removeCollider(collider);
  EXPECT_TRUE(world.contains(BodyId{0}) && world.contains(BodyId{1}));
  EXPECT_EQ(colliders[0], ColliderId{1});
  // Nobody is there any more.
  for (const Call& call : calls) call.make(world);
  EXPECT_EQ(log.take().find("another thread"), std::string::npos);
  EXPECT_EQ(world.bodies({}), 2U);
  EXPECT_EQ(world.colliders({}), 1U);
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

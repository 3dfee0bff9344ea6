// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <new>
#include <vector>

#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"
#include "tests/support/box_package.h"
#include "tests/support/touching_box.h"

namespace {
std::atomic<std::size_t> allocations{0};

void* counted(std::size_t bytes, std::size_t alignment) {
  ++allocations;
  void* memory = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
// Apart, since g++ 12 warns falsely of new and free where it inlines one of them only.
[[gnu::noinline]] void release(void* memory) noexcept { std::free(memory); }
}  // namespace

void* operator new(std::size_t bytes) { return counted(bytes, alignof(std::max_align_t)); }
void* operator new(std::size_t bytes, std::align_val_t alignment) { return counted(bytes, std::size_t(alignment)); }
void operator delete(void* memory) noexcept { release(memory); }
void operator delete(void* memory, std::size_t) noexcept { release(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { release(memory); }

namespace sinew::test {
namespace {

void expectNoAllocation(JobSystem* jobs) {
  BoxOptions box;
  box.mode = formats::ClusterMode::quadratic;
  box.clusters = {2, 2, 2};
  WorldSettings settings;
  settings.ground.enabled = true;
  World world(settings, jobs);
  BodySettings place;
  place.position = {0, 1, 0};
  const BodyId body = *world.addBody(boxAsset(box), place);
  ASSERT_TRUE(world.addBody(world.asset(body).package().info().diagonal > 0 ? boxAsset(box) : nullptr));
  world.step(1.0F / 60);
  world.pin(body, 3, world.positions(body)[3]);
  const PickId pick = world.pick(body, 0, {1, 2, 0});
  const std::size_t before = allocations;
  ASSERT_GT(before, 0U);
  for (int i = 0; i < 120; ++i) {
    world.step(i % 2 == 0 ? 1.0F / 60 : 1.0F / 50);
    world.movePick(pick, {1, 2, float(i) * 0.01F});
    if (i == 60) world.unpinAll(body);
  }
  EXPECT_EQ(allocations, before);
}

TEST(Allocation, NoneInAStepAfterTheFirst) { expectNoAllocation(nullptr); }

TEST(Allocation, NoneWhereBodiesFallAsleep) {
  WorldSettings settings;
  settings.ground.enabled = true;
  settings.ground.offset = -1;
  settings.sleep_seconds = 0.25F;
  World world(settings);
  const BodyId body = *world.addBody(makeAsset(boxContent({})));
  world.step(1.0F / 60);
  const std::size_t before = allocations;
  for (int i = 0; i < 1200 && !world.isAsleep(body); ++i) world.step(1.0F / 60);
  EXPECT_TRUE(world.isAsleep(body));
  world.wake(body);
  for (int i = 0; i < 60; ++i) world.step(1.0F / 60);
  EXPECT_EQ(allocations, before);
}

TEST(Allocation, NoneWithAirAndAHand) {
  WorldSettings settings;
  settings.wind = {3, 0, 0};
  World world(settings);
  BodySettings in_air;
  in_air.drag = 1;
  const BodyId body = *world.addBody(makeAsset(boxContent({})), in_air);
  ColliderSettings hand;
  hand.at.position = {-2, 0, 0};
  hand.most_speed = 1;
  hand.mass = 3;
  const ColliderId ball = *world.addCollider(SphereShape{0.5F}, hand);
  world.addForce(body, {1, 0, 0});
  world.step(1.0F / 60);
  const std::size_t before = allocations;
  for (int i = 0; i < 60; ++i) {
    world.addForce(body, {1, 0, 0});
    world.addImpulse(body, BodyPoint::visualVertex(0), {0, 1, 0});
    world.moveCollider(ball, {{1, 0, 0}});
    world.step(1.0F / 60);
  }
  EXPECT_EQ(allocations, before);
}

TEST(Allocation, NoneWithMechanicsAndPinSets) {
  for (const PinMethod method :
       {PinMethod::hold, PinMethod::infinite_mass, PinMethod::matrix, PinMethod::constrained_fit}) {
    for (const auto stiffness : {formats::StiffnessModel::frequency, formats::StiffnessModel::elastic}) {
      BoxOptions box;
      box.mode = formats::ClusterMode::quadratic;
      box.clusters = {2, 1, 1};
      formats::PackageContent content = boxContent(box);
      formats::ClusterMechanics m = formats::kPlainMechanics;
      m.stiffness = stiffness;
      m.damping = 2;
      m.limit = formats::LimitMethod::frobenius;
      m.volume = formats::VolumeMethod::principal;
      m.plastic_creep = 1;
      content.mechanics.assign(content.clusters.size(), m);
      World world;
      const BodyId body = *world.addBody(makeAsset(content));
      const std::array<std::uint32_t, 4> held = {0, 1, 2, 7};
      const auto set = world.addPinSet(body, held, {}, method);
      ASSERT_TRUE(set) << set.reason();
      world.step(1.0F / 60);
      const std::size_t before = allocations;
      for (int i = 0; i < 60; ++i) {
        RigidTransform at;
        at.position[0] = 0.001F * float(i);
        world.movePinSet(*set, at);
        world.step(i % 2 == 0 ? 1.0F / 60 : 1.0F / 50);
      }
      EXPECT_EQ(allocations, before) << int(method) << ' ' << int(stiffness);
    }
  }
}

TEST(Allocation, NoneWithAThreadPool) {
  ThreadPool pool(3);
  expectNoAllocation(&pool);
}

TEST(Allocation, NoneInAHeapThatFallsAgain) {
  ThreadPool pool(3);
  WorldSettings settings;
  settings.collisions = true;
  settings.ground.enabled = true;
  World world(settings, &pool);
  const auto asset = touchingBox({1, 1, 1});
  std::vector<BodyId> bodies;
  for (int i = 0; i < 27; ++i) {
    BodySettings place;
    const int layer = i / 9;
    place.position = {1.05F * float(i % 3), 0.6F + 1.1F * float(layer), 1.05F * float(i / 3 % 3)};
    bodies.push_back(*world.addBody(asset, place));
  }
  ColliderSettings wire;  // has points of its own
  wire.at = {{1, 0.2F, 0.5F}, {1, 0, 0, 0, 0, -1, 0, 1, 0}};
  ASSERT_TRUE(world.addCollider(CapsuleShape{0.02F, 3}, wire));
  ASSERT_TRUE(world.addCollider(BoxShape{{0.01F, 0.1F, 3}}, wire));
  const auto fall = [&] {
    for (const BodyId body : bodies) world.resetBody(body);
    for (int i = 0; i < 90; ++i) world.step(1.0F / 60);
  };
  fall();
  fall();  // friction of the last heap's contacts is remembered
  const std::size_t before = allocations;
  fall();
  EXPECT_EQ(allocations, before);
}

}  // namespace
}  // namespace sinew::test

// SPDX-License-Identifier: MIT
//
// The C interface from several threads at once. What it computes is compared with one thread; that nothing is shared
// that should not be is for ThreadSanitizer to show.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "sinew/c_api.h"
#include "sinew/formats/writer.h"
#include "tests/support/box_package.h"
#include "tests/support/field_content.h"

namespace sinew::test {
namespace {

constexpr int kSteps = 20;

// A world of two bodies on the ground; every third step something is refused, with this thread's own reason.
std::vector<float> play(const sinew_asset* asset, sinew_thread_pool* pool, std::uint32_t wrong_pin) {
  std::vector<float> states;
  sinew_world_options options;
  sinew_world_options_init(&options, sizeof options);
  options.pool = pool;
  sinew_world_settings settings;
  sinew_world_settings_init(&settings, sizeof settings);
  settings.ground_enabled = 1;
  sinew_world* world = nullptr;
  EXPECT_EQ(sinew_world_create(&settings, &options, &world), SINEW_OK);
  std::array<std::uint32_t, 2> bodies{};
  sinew_body_settings place;
  sinew_body_settings_init(&place, sizeof place);
  for (std::uint32_t& body : bodies) {
    place.position[0] += 3;
    place.position[1] = 1;
    EXPECT_EQ(sinew_body_add(world, asset, &place, &body), SINEW_OK);
  }
  const std::array<float, 3> target = {0, 2, 0};
  for (int i = 0; i < kSteps; ++i) {
    EXPECT_EQ(sinew_world_step(world, 1.0F / 60), SINEW_OK);
    if (i % 3 == 0) {
      EXPECT_EQ(sinew_body_pin(world, bodies[0], wrong_pin, target.data()), SINEW_ERROR_ARGUMENT);
      EXPECT_NE(std::string(sinew_last_error()).find(std::to_string(wrong_pin)), std::string::npos)
          << sinew_last_error();
    }
    for (const std::uint32_t body : bodies) {
      const float* x = nullptr;
      std::uint32_t count = 0;
      EXPECT_EQ(sinew_body_positions(world, body, &x, &count), SINEW_OK);
      states.insert(states.end(), x, x + 3 * std::size_t(count));
    }
  }
  sinew_world_destroy(world);
  return states;
}

TEST(CApi, WorldsAssetsAndErrorsOfSeveralThreads) {
  BoxOptions box;
  box.cells = {8, 8, 8};
  box.clusters = {2, 2, 2};
  formats::PackageContent content = boxContent(box);
  addFields(content);
  const std::vector<std::byte> package = formats::writePackage(content);
  sinew_asset* shared = nullptr;
  ASSERT_EQ(sinew_asset_from_memory(package.data(), package.size(), &shared), SINEW_OK);
  const std::vector<float> expected = play(shared, nullptr, 100000);
  std::array<std::vector<float>, 4> found;
  std::vector<std::thread> threads;
  for (std::uint32_t i = 0; i < found.size(); ++i) {
    threads.emplace_back([&, i] {
      // Two share an asset; two load their own and let go of it while another thread does.
      sinew_asset* own = nullptr;
      if (i % 2 == 1) {
        EXPECT_EQ(sinew_asset_from_memory(package.data(), package.size(), &own), SINEW_OK);
      }
      sinew_thread_pool* pool = nullptr;
      if (i < 2) {
        EXPECT_EQ(sinew_thread_pool_create(2, &pool), SINEW_OK);
      }
      found[i] = play(own != nullptr ? own : shared, pool, 100000 + i);
      sinew_thread_pool_destroy(pool);
      sinew_asset_release(own);
    });
  }
  for (std::thread& thread : threads) thread.join();
  sinew_asset_release(shared);
  for (const auto& states : found) EXPECT_TRUE(states == expected);
}

// Calls in the midst of a step, from its loop.
TEST(CApi, WhatOverlapsAStepFailsAndNothingElseDoes) {
  struct Midst {
    sinew_world* world = nullptr;
    std::uint32_t loops = 0, exists = 1, asleep = 1;
    sinew_status set = SINEW_OK, wake = SINEW_OK;
    std::string reason;
  } midst;
  sinew_world_options options;
  sinew_world_options_init(&options, sizeof options);
  options.jobs_user = &midst;
  options.parallel_for = [](void* user, std::uint32_t count, std::uint32_t, sinew_range_function range, void* context) {
    Midst& m = *static_cast<Midst*>(user);
    if (m.loops++ == 0) {
      sinew_world_settings settings;
      sinew_world_settings_init(&settings, sizeof settings);
      m.set = sinew_world_set_settings(m.world, &settings);
      m.wake = sinew_body_wake(m.world, 0);
      m.reason = sinew_last_error();
      m.exists = sinew_body_exists(m.world, 0);
      m.asleep = sinew_body_is_asleep(m.world, 0);
    }
    range(context, 0, count);
  };
  const std::vector<std::byte> package = [] {
    formats::PackageContent content = boxContent();
    addFields(content);
    return formats::writePackage(content);
  }();
  sinew_asset* asset = nullptr;
  ASSERT_EQ(sinew_asset_from_memory(package.data(), package.size(), &asset), SINEW_OK);
  ASSERT_EQ(sinew_world_create(nullptr, &options, &midst.world), SINEW_OK);
  for (int i = 0; i < 2; ++i) {
    std::uint32_t body = 0;
    ASSERT_EQ(sinew_body_add(midst.world, asset, nullptr, &body), SINEW_OK);
  }
  EXPECT_EQ(sinew_world_step(midst.world, 1.0F / 60), SINEW_OK);
  EXPECT_GT(midst.loops, 0U);
  EXPECT_EQ(midst.set, SINEW_ERROR_ARGUMENT);
  EXPECT_EQ(midst.wake, SINEW_ERROR_ARGUMENT);
  EXPECT_NE(midst.reason.find("another thread steps this world"), std::string::npos) << midst.reason;
  EXPECT_EQ(midst.exists, 0U);
  EXPECT_EQ(midst.asleep, 0U);
  EXPECT_EQ(sinew_body_exists(midst.world, 0), 1U);
  EXPECT_EQ(sinew_world_step(midst.world, 1.0F / 60), SINEW_OK);
  sinew_world_destroy(midst.world);
  sinew_asset_release(asset);
}

}  // namespace
}  // namespace sinew::test

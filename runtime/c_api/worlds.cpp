// SPDX-License-Identifier: MIT
//
// The C interface over world.h. Nothing is decided here.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <functional>
#include <memory_resource>
#include <new>
#include <optional>
#include <string_view>

#include "runtime/c_api/handles.h"
#include "runtime/c_api/structs.h"
#include "runtime/world/world_impl.h"
#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"

namespace {

using sinew::handles::failNull;
using sinew::handles::guarded;
using sinew::handles::isFilled;
using sinew::handles::isNullOrFilled;
using sinew::handles::onWorld;
using sinew::handles::readStruct;
using sinew::handles::tellFailure;
using sinew::handles::vec3;
using sinew::handles::writeStruct;
using sinew::internal::WorldAccess;

class CallerMemory final : public std::pmr::memory_resource {
 public:
  explicit CallerMemory(const sinew_world_options& options) : options_(options) {}

 private:
  void* do_allocate(std::size_t bytes, std::size_t alignment) override {
    void* memory = options_.allocate(options_.allocator_user, bytes, alignment);
    if (memory == nullptr) throw std::bad_alloc();
    return memory;
  }
  void do_deallocate(void* memory, std::size_t bytes, std::size_t alignment) override {
    options_.release(options_.allocator_user, memory, bytes, alignment);
  }
  bool do_is_equal(const std::pmr::memory_resource& other) const noexcept override { return this == &other; }

  sinew_world_options options_;
};

class CallerJobs final : public sinew::JobSystem {
 public:
  explicit CallerJobs(const sinew_world_options& options) : options_(options) {}
  void parallelFor(std::uint32_t count, std::uint32_t grain,
                   const std::function<void(std::uint32_t, std::uint32_t)>& body) override {
    using Body = std::function<void(std::uint32_t, std::uint32_t)>;
    const auto range = [](void* context, std::uint32_t begin, std::uint32_t end) {
      (*static_cast<const Body*>(context))(begin, end);
    };
    options_.parallel_for(options_.jobs_user, count, grain, range, const_cast<Body*>(&body));
  }

 private:
  sinew_world_options options_;
};

// Passes on what the world tells, and remembers the last error for sinew_last_error().
class CallerLog final : public sinew::LogSink {
 public:
  explicit CallerLog(const sinew_world_options& options) : options_(options) {}
  void write(sinew::LogSeverity severity, std::string_view line) override {
    if (severity == sinew::LogSeverity::error) sinew::handles::noteError(line);
    if (options_.log == nullptr) return;
    char text[256];
    const std::size_t length = std::min(line.size(), sizeof text - 1);
    std::memcpy(text, line.data(), length);
    text[length] = '\0';
    options_.log(options_.log_user, std::uint32_t(severity), text);
  }

 private:
  sinew_world_options options_;
};

sinew_world_settings fromCpp(const sinew::WorldSettings& s) {
  sinew_world_settings result = {};
  result.struct_size = sizeof result;
  std::copy(s.gravity.begin(), s.gravity.end(), result.gravity);
  result.ground_enabled = s.ground.enabled ? 1 : 0;
  std::copy(s.ground.normal.begin(), s.ground.normal.end(), result.ground_normal);
  result.ground_offset = s.ground.offset;
  result.ground_friction = s.ground.friction;
  result.iterations = s.iterations;
  result.damping = s.damping;
  result.deformation_damping_ratio = s.deformation_damping_ratio;
  result.support_damping = s.support_damping;
  result.substep_seconds = s.substep_seconds;
  result.most_substeps = s.most_substeps;
  result.sleep_seconds = s.sleep_seconds;
  result.collisions = s.collisions ? 1 : 0;
  std::copy(s.wind.begin(), s.wind.end(), result.wind);
  result.air_density = s.air_density;
  result.ground_restitution = s.ground.restitution;
  result.report_contacts = s.report_contacts ? 1 : 0;
  return result;
}

void toCpp(const sinew_world_settings& s, sinew::WorldSettings& result) {
  std::copy(s.gravity, s.gravity + 3, result.gravity.begin());
  result.ground.enabled = s.ground_enabled != 0;
  std::copy(s.ground_normal, s.ground_normal + 3, result.ground.normal.begin());
  result.ground.offset = s.ground_offset;
  result.ground.friction = s.ground_friction;
  result.iterations = s.iterations;
  result.damping = s.damping;
  result.deformation_damping_ratio = s.deformation_damping_ratio;
  result.support_damping = s.support_damping;
  result.substep_seconds = s.substep_seconds;
  result.most_substeps = s.most_substeps;
  result.sleep_seconds = s.sleep_seconds;
  result.collisions = s.collisions != 0;
  result.wind = vec3(s.wind);
  result.air_density = s.air_density;
  result.ground.restitution = s.ground_restitution;
  result.report_contacts = s.report_contacts != 0;
}

// SINEW_OK where each value is in its range.
sinew_status faultOf(const char* call, const sinew::WorldSettings& settings) {
  const char* const value = sinew::internal::faultyValue(settings);
  if (value == nullptr) return SINEW_OK;
  char text[128];
  std::snprintf(text, sizeof text, "%s: %s is out of range", call, value);
  return tellFailure(SINEW_ERROR_ARGUMENT, text);
}

}  // namespace

struct sinew_thread_pool {
  explicit sinew_thread_pool(std::uint32_t threads) : pool(threads) {}
  sinew::ThreadPool pool;
};

struct sinew_world {
  explicit sinew_world(const sinew_world_options& options) : memory(options), jobs(options), log(options) {}
  CallerMemory memory;
  CallerJobs jobs;
  mutable CallerLog log;
  std::pmr::memory_resource* home = nullptr;  // that this object lies in
  std::optional<sinew::World> world;
};

namespace sinew::handles {

World& worldOf(sinew_world* world) { return *world->world; }
const World& worldOf(const sinew_world* world) { return *world->world; }
std::pmr::memory_resource* memoryOf(const sinew_world* world) { return world->home; }

}  // namespace sinew::handles

extern "C" {

sinew_status sinew_thread_pool_create(uint32_t threads, sinew_thread_pool** pool) {
  if (pool == nullptr) return failNull("sinew_thread_pool_create");
  if (threads > 1024) return tellFailure(SINEW_ERROR_ARGUMENT, "sinew_thread_pool_create: more than 1024 threads");
  return guarded("sinew_thread_pool_create", [&] {
    *pool = new sinew_thread_pool(threads);
    return SINEW_OK;
  });
}

void sinew_thread_pool_destroy(sinew_thread_pool* pool) { delete pool; }

void sinew_world_options_init(sinew_world_options* options, size_t struct_size) {
  writeStruct(sinew_world_options{}, options, struct_size);
}

void sinew_world_settings_init(sinew_world_settings* settings, size_t struct_size) {
  writeStruct(fromCpp(sinew::WorldSettings{}), settings, struct_size);
}

sinew_status sinew_world_create(const sinew_world_settings* settings, const sinew_world_options* options,
                                sinew_world** world) {
  if (world == nullptr || !isNullOrFilled(settings) || !isNullOrFilled(options)) return failNull("sinew_world_create");
  return guarded("sinew_world_create", [&] {
    const sinew_world_options given = readStruct(options, sinew_world_options{});
    if ((given.allocate == nullptr) != (given.release == nullptr)) {
      return tellFailure(SINEW_ERROR_ARGUMENT, "sinew_world_create: allocate and release go together");
    }
    sinew::WorldSettings world_settings;
    toCpp(readStruct(settings, fromCpp(world_settings)), world_settings);
    if (const sinew_status status = faultOf("sinew_world_create", world_settings)) return status;
    CallerMemory first(given);
    std::pmr::memory_resource* heap = std::pmr::new_delete_resource();
    std::pmr::memory_resource* home = given.allocate != nullptr ? &first : heap;
    void* place = home->allocate(sizeof(sinew_world), alignof(sinew_world));
    sinew_world* made = new (place) sinew_world(given);
    made->home = given.allocate != nullptr ? static_cast<std::pmr::memory_resource*>(&made->memory) : heap;
    sinew::WorldResources resources;
    resources.memory = made->home;
    resources.jobs = given.parallel_for != nullptr ? static_cast<sinew::JobSystem*>(&made->jobs)
                     : given.pool != nullptr       ? &given.pool->pool
                                                   : nullptr;
    resources.log = &made->log;
    try {
      made->world.emplace(world_settings, resources);
    } catch (...) {
      made->~sinew_world();
      home->deallocate(place, sizeof(sinew_world), alignof(sinew_world));
      throw;
    }
    *world = made;
    return SINEW_OK;
  });
}

void sinew_world_destroy(sinew_world* world) {
  if (world == nullptr) return;
  world->world.reset();
  // The memory resource is a part of what it has to give back.
  const bool callers = world->home == &world->memory;
  CallerMemory last = world->memory;
  world->~sinew_world();
  std::pmr::memory_resource* home = callers ? &last : std::pmr::new_delete_resource();
  home->deallocate(world, sizeof(sinew_world), alignof(sinew_world));
}

sinew_status sinew_world_set_settings(sinew_world* world, const sinew_world_settings* settings) {
  constexpr const char* kCall = "sinew_world_set_settings";
  return onWorld(kCall, world, isFilled(settings), [&](sinew::World& w) {
    const WorldAccess::Presence presence(WorldAccess::of(w), kCall, WorldAccess::As::changes);
    if (!presence) return SINEW_OK;  // the log, and so onWorld(), knows of it
    sinew::WorldSettings given = w.settings();
    toCpp(readStruct(settings, fromCpp(given)), given);
    const sinew_status status = faultOf(kCall, given);
    if (status == SINEW_OK) w.settings() = given;
    return status;
  });
}

sinew_status sinew_world_get_settings(const sinew_world* world, sinew_world_settings* settings) {
  return onWorld("sinew_world_get_settings", world, isFilled(settings), [&](const sinew::World& w) {
    const WorldAccess::Presence presence(WorldAccess::of(w), "sinew_world_get_settings", WorldAccess::As::looks);
    if (presence) writeStruct(fromCpp(w.settings()), settings, settings->struct_size);
  });
}

sinew_status sinew_world_step(sinew_world* world, float seconds) {
  return onWorld("sinew_world_step", world, true, [&](sinew::World& w) { w.step(seconds); });
}

sinew_status sinew_world_advance(sinew_world* world, float seconds, uint32_t* steps) {
  return onWorld("sinew_world_advance", world, true, [&](sinew::World& w) {
    const std::uint32_t taken = w.advance(seconds);
    if (steps != nullptr) *steps = taken;
  });
}

sinew_status sinew_world_shift_origin(sinew_world* world, const float* by) {
  return onWorld("sinew_world_shift_origin", world, by != nullptr, [&](sinew::World& w) { w.shiftOrigin(vec3(by)); });
}

}  // extern "C"

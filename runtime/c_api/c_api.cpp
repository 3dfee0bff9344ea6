// SPDX-License-Identifier: MIT
//
// The C interface over world.h: handles, structs that may grow, status codes. Nothing is decided here.
#include "sinew/c_api.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>
#include <memory_resource>
#include <new>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "runtime/c_api/handles.h"
#include "runtime/c_api/structs.h"
#include "sinew/formats/version.h"
#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"

namespace {

using sinew::handles::readStruct;
using sinew::handles::transform;
using sinew::handles::vec3;
using sinew::handles::writeStruct;

thread_local char last_error[256] = "";

sinew_status fail(sinew_status status, std::string_view reason) {
  const std::size_t length = std::min(reason.size(), sizeof last_error - 1);
  std::memcpy(last_error, reason.data(), length);
  last_error[length] = '\0';
  return status;
}

sinew_status failNull(const char* call) {
  char line[128];
  std::snprintf(line, sizeof line, "%s: a null pointer", call);
  return fail(SINEW_ERROR_ARGUMENT, line);
}

// Something to call, whatever it is: so that what goes around it is compiled once and not for each function below.
struct Callable {
  // NOLINTNEXTLINE(google-explicit-constructor): lambdas are passed as they are
  template <class Work>
  Callable(const Work& given)
      : work(&given), run([](const void* it) -> sinew_status { return (*static_cast<const Work*>(it))(); }) {}
  sinew_status operator()() const { return run(work); }

  const void* work;
  sinew_status (*run)(const void*);
};

// Runs work(); an exception becomes a status.
sinew_status guarded(const char* call, const Callable& work) noexcept {
  char line[128];
  try {
    return work();
  } catch (const std::bad_alloc&) {
    std::snprintf(line, sizeof line, "%s: out of memory", call);
    return fail(SINEW_ERROR_MEMORY, line);
  } catch (...) {
    std::snprintf(line, sizeof line, "%s: a callback threw an exception", call);
    return fail(SINEW_ERROR_ARGUMENT, line);
  }
}

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
    if (severity == sinew::LogSeverity::error) {
      failed = true;
      out_of_memory = line.ends_with(": out of memory");
      fail(SINEW_ERROR_ARGUMENT, line);
    }
    if (options_.log == nullptr) return;
    char text[256];
    const std::size_t length = std::min(line.size(), sizeof text - 1);
    std::memcpy(text, line.data(), length);
    text[length] = '\0';
    options_.log(options_.log_user, std::uint32_t(severity), text);
  }

  // Of the errors since the last call of this thread.
  static sinew_status takeStatus() {
    if (!std::exchange(failed, false)) return SINEW_OK;
    return out_of_memory ? SINEW_ERROR_MEMORY : SINEW_ERROR_ARGUMENT;
  }

 private:
  sinew_world_options options_;
  inline static thread_local bool failed = false, out_of_memory = false;
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
}

sinew_body_settings fromCpp(const sinew::BodySettings& s) {
  sinew_body_settings result = {};
  result.struct_size = sizeof result;
  std::copy(s.position.begin(), s.position.end(), result.position);
  std::copy(s.rotation.begin(), s.rotation.end(), result.rotation);
  result.stiffness_scale = s.stiffness_scale;
  result.keep_previous = s.keep_previous ? 1 : 0;
  result.package_pins = s.package_pins ? 1 : 0;
  result.solver = reinterpret_cast<const sinew_solver*>(s.solver);
  result.friction = s.friction;
  result.layers = s.layers;
  result.touches = s.touches;
  result.gravity_scale = s.gravity_scale;
  result.drag = s.drag;
  result.self_contact = s.self_contact ? 1 : 0;
  return result;
}

sinew::BodySettings toCpp(const sinew_body_settings& s) {
  sinew::BodySettings result;
  std::copy(s.position, s.position + 3, result.position.begin());
  std::copy(s.rotation, s.rotation + 9, result.rotation.begin());
  result.stiffness_scale = s.stiffness_scale;
  result.keep_previous = s.keep_previous != 0;
  result.package_pins = s.package_pins != 0;
  result.solver = reinterpret_cast<const sinew::SolverFactory*>(s.solver);
  result.friction = s.friction;
  result.layers = s.layers;
  result.touches = s.touches;
  result.gravity_scale = s.gravity_scale;
  result.drag = s.drag;
  result.self_contact = s.self_contact != 0;
  return result;
}

constexpr sinew_visual_output kNoOutput = {
    sizeof(sinew_visual_output), 12, nullptr, nullptr, nullptr, nullptr, 12, 16, 12, 0};

sinew::VisualOutput toCpp(const sinew_visual_output& o) {
  sinew::VisualOutput result;
  result.positions = {o.positions, o.positions_stride, o.count};
  result.normals = {o.normals, o.normals_stride, o.count};
  result.tangents = {o.tangents, o.tangents_stride, o.count};
  result.previous_positions = {o.previous_positions, o.previous_stride, o.count};
  return result;
}

}  // namespace

struct sinew_asset {
  std::shared_ptr<const sinew::Asset> asset;
};

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
sinew_asset* handleOf(std::shared_ptr<const Asset> asset) { return new sinew_asset{std::move(asset)}; }
std::shared_ptr<const Asset> assetOf(const sinew_asset* asset) { return asset->asset; }
sinew_status tellFailure(sinew_status status, std::string_view reason) { return fail(status, reason); }
sinew_status takeToldStatus() { return CallerLog::takeStatus(); }

}  // namespace sinew::handles

namespace {

// What a function below does with a world, and perhaps a body of it, whatever it is.
struct WorldWork {
  const void* work;
  void (*run)(const void* work, const sinew::World& world, sinew::BodyId body);
};

sinew_status runOnWorld(const char* call, const sinew_world* world, sinew::BodyId body, bool arguments_given,
                        const WorldWork& work) noexcept {
  if (world == nullptr || !arguments_given) return failNull(call);
  const sinew_status status = guarded(call, [&] {
    work.run(work.work, *world->world, body);
    return SINEW_OK;
  });
  const sinew_status told = CallerLog::takeStatus();
  return status != SINEW_OK ? status : told;
}

sinew_status runOnBody(const char* call, const sinew_world* world, sinew::BodyId body, bool arguments_given,
                       const WorldWork& work) noexcept {
  if (world == nullptr || !arguments_given) return failNull(call);
  if (!world->world->contains(body)) {
    char line[128];
    std::snprintf(line, sizeof line, "%s: there is no body %u in this world", call, body.value);
    return fail(SINEW_ERROR_ARGUMENT, line);
  }
  return runOnWorld(call, world, body, true, work);
}

// A world that is reached through a handle to read stays one to read.
template <class WorldHandle>
using WorldOf = std::conditional_t<std::is_const_v<WorldHandle>, const sinew::World, sinew::World>;

// Runs work(world) and reports what it told the log.
template <class WorldHandle, class Work>
sinew_status onWorld(const char* call, WorldHandle* world, bool arguments_given, const Work& work) noexcept {
  const auto run = [](const void* it, const sinew::World& on, sinew::BodyId) {
    (*static_cast<const Work*>(it))(const_cast<WorldOf<WorldHandle>&>(on));
  };
  return runOnWorld(call, world, {}, arguments_given, {&work, run});
}

// The same for a body: refused where there is none.
template <class WorldHandle, class Work>
sinew_status onBody(const char* call, WorldHandle* world, std::uint32_t body, bool arguments_given,
                    const Work& work) noexcept {
  const auto run = [](const void* it, const sinew::World& on, sinew::BodyId id) {
    (*static_cast<const Work*>(it))(const_cast<WorldOf<WorldHandle>&>(on), id);
  };
  return runOnBody(call, world, {body}, arguments_given, {&work, run});
}

sinew_status finishLoad(const sinew::Result<std::shared_ptr<const sinew::Asset>>& loaded, sinew_asset** asset) {
  if (!loaded) return fail(SINEW_ERROR_PACKAGE, loaded.reason());
  *asset = new sinew_asset{*loaded};
  return SINEW_OK;
}

template <class Get>
sinew_status vectorsOf(const char* call, const sinew_world* world, std::uint32_t body, const float** xyz,
                       std::uint32_t* count, const Get& get) {
  return onBody(call, world, body, xyz != nullptr && count != nullptr, [&](const sinew::World& w, sinew::BodyId id) {
    const std::span<const sinew::Vec3> vectors = get(w, id);
    *xyz = vectors.empty() ? nullptr : vectors.data()->data();
    *count = std::uint32_t(vectors.size());
  });
}

template <class Get>
sinew_status boundsOf(const char* call, const sinew_world* world, std::uint32_t body, float* low, float* high,
                      const Get& get) {
  return onBody(call, world, body, low != nullptr && high != nullptr, [&](const sinew::World& w, sinew::BodyId id) {
    const sinew::Bounds bounds = get(w, id);
    std::copy(bounds.low.begin(), bounds.low.end(), low);
    std::copy(bounds.high.begin(), bounds.high.end(), high);
  });
}

}  // namespace

extern "C" {

uint32_t sinew_c_api_version(void) { return SINEW_C_API_VERSION; }
const char* sinew_version(void) { return sinew::formats::kSoftwareVersion; }
const char* sinew_last_error(void) { return last_error; }

sinew_status sinew_asset_load(const char* path, sinew_asset** asset) {
  if (path == nullptr || asset == nullptr) return failNull("sinew_asset_load");
  return guarded("sinew_asset_load", [&] { return finishLoad(sinew::Asset::load(path), asset); });
}

sinew_status sinew_asset_from_memory(const void* bytes, size_t size, sinew_asset** asset) {
  if (bytes == nullptr || asset == nullptr) return failNull("sinew_asset_from_memory");
  return guarded("sinew_asset_from_memory", [&] {
    return finishLoad(sinew::Asset::fromMemory({static_cast<const std::byte*>(bytes), size}), asset);
  });
}

sinew_status sinew_asset_in_place(const void* bytes, size_t size, sinew_asset** asset) {
  if (bytes == nullptr || asset == nullptr) return failNull("sinew_asset_in_place");
  if (reinterpret_cast<std::uintptr_t>(bytes) % sinew::formats::kSectionAlignment != 0) {
    return fail(SINEW_ERROR_ARGUMENT, "sinew_asset_in_place: the address of the bytes is not a multiple of 64");
  }
  return guarded("sinew_asset_in_place", [&] {
    return finishLoad(sinew::Asset::inPlace({static_cast<const std::byte*>(bytes), size}), asset);
  });
}

void sinew_asset_release(sinew_asset* asset) { delete asset; }

sinew_status sinew_asset_get_info(const sinew_asset* asset, sinew_asset_info* info) {
  if (asset == nullptr || info == nullptr) return failNull("sinew_asset_get_info");
  const sinew::formats::PackageView& package = asset->asset->package();
  const sinew::formats::PackageInfo& from = package.info();
  sinew_asset_info result = {};
  result.pieces = std::uint32_t(package.pieces().size());
  result.physical_vertices = std::uint32_t(package.physicalVertices().size());
  result.tetrahedra = std::uint32_t(package.tetrahedra().size());
  result.clusters = std::uint32_t(package.clusters().size());
  result.memberships = std::uint32_t(package.memberships().size());
  result.visual_vertices = std::uint32_t(package.visualPositions().size());
  result.visual_triangles = std::uint32_t(package.visualTriangles().size());
  result.sub_meshes = std::uint32_t(package.subMeshes().size());
  result.diagonal = from.diagonal;
  std::copy(from.bounds_min.begin(), from.bounds_min.end(), result.bounds_min);
  std::copy(from.bounds_max.begin(), from.bounds_max.end(), result.bounds_max);
  result.total_mass = from.total_mass;
  std::copy(from.origin.begin(), from.origin.end(), result.origin);
  writeStruct(result, info, info->struct_size);
  return SINEW_OK;
}

sinew_status sinew_asset_section(const sinew_asset* asset, uint32_t id, const void** data, uint32_t* count,
                                 uint32_t* bytes_each) {
  if (asset == nullptr || data == nullptr || count == nullptr || bytes_each == nullptr) {
    return failNull("sinew_asset_section");
  }
  const sinew::formats::SectionData section = asset->asset->package().sectionData(id);
  *data = section.data;
  *count = std::uint32_t(section.count);
  *bytes_each = section.bytes_each;
  return SINEW_OK;
}

sinew_status sinew_asset_sub_mesh_runs(const sinew_asset* asset, uint32_t sub_mesh, const uint32_t** runs,
                                       uint32_t* count) {
  if (asset == nullptr || runs == nullptr || count == nullptr) return failNull("sinew_asset_sub_mesh_runs");
  if (sub_mesh >= asset->asset->package().subMeshes().size()) {
    return fail(SINEW_ERROR_ARGUMENT, "sinew_asset_sub_mesh_runs: no such sub-mesh");
  }
  return guarded("sinew_asset_sub_mesh_runs", [&] {
    static_assert(sizeof(sinew::VertexRun) == 2 * sizeof(uint32_t));
    const std::span<const sinew::VertexRun> found = asset->asset->subMeshVertices(sub_mesh);
    *runs = found.empty() ? nullptr : &found.data()->first;
    *count = std::uint32_t(found.size());
    return SINEW_OK;
  });
}

sinew_status sinew_thread_pool_create(uint32_t threads, sinew_thread_pool** pool) {
  if (pool == nullptr) return failNull("sinew_thread_pool_create");
  if (threads > 1024) return fail(SINEW_ERROR_ARGUMENT, "sinew_thread_pool_create: more than 1024 threads");
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
  if (world == nullptr) return failNull("sinew_world_create");
  return guarded("sinew_world_create", [&] {
    const sinew_world_options given = readStruct(options, sinew_world_options{});
    if ((given.allocate == nullptr) != (given.release == nullptr)) {
      return fail(SINEW_ERROR_ARGUMENT, "sinew_world_create: allocate and release go together");
    }
    sinew::WorldSettings world_settings;
    toCpp(readStruct(settings, fromCpp(world_settings)), world_settings);
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
  return onWorld("sinew_world_set_settings", world, settings != nullptr,
                 [&](sinew::World& w) { toCpp(readStruct(settings, fromCpp(w.settings())), w.settings()); });
}

sinew_status sinew_world_get_settings(const sinew_world* world, sinew_world_settings* settings) {
  return onWorld("sinew_world_get_settings", world, settings != nullptr,
                 [&](const sinew::World& w) { writeStruct(fromCpp(w.settings()), settings, settings->struct_size); });
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

void sinew_body_settings_init(sinew_body_settings* settings, size_t struct_size) {
  writeStruct(fromCpp(sinew::BodySettings{}), settings, struct_size);
}

sinew_status sinew_body_add(sinew_world* world, const sinew_asset* asset, const sinew_body_settings* settings,
                            uint32_t* body) {
  if (world == nullptr || asset == nullptr || body == nullptr) return failNull("sinew_body_add");
  return guarded("sinew_body_add", [&] {
    const sinew_body_settings given = readStruct(settings, fromCpp(sinew::BodySettings{}));
    const sinew::Result<sinew::BodyId> added = world->world->addBody(asset->asset, toCpp(given));
    const sinew_status told = CallerLog::takeStatus();
    if (!added) return fail(told != SINEW_OK ? told : SINEW_ERROR_ARGUMENT, added.reason());
    *body = (*added).value;
    return SINEW_OK;
  });
}

sinew_status sinew_body_remove(sinew_world* world, uint32_t body) {
  return onBody("sinew_body_remove", world, body, true, [](sinew::World& w, sinew::BodyId id) { w.removeBody(id); });
}

sinew_status sinew_body_reset(sinew_world* world, uint32_t body) {
  return onBody("sinew_body_reset", world, body, true, [](sinew::World& w, sinew::BodyId id) { w.resetBody(id); });
}

uint32_t sinew_body_is_asleep(const sinew_world* world, uint32_t body) {
  return world != nullptr && world->world->contains({body}) && world->world->isAsleep({body}) ? 1 : 0;
}

sinew_status sinew_body_wake(sinew_world* world, uint32_t body) {
  return onBody("sinew_body_wake", world, body, true, [](sinew::World& w, sinew::BodyId id) { w.wake(id); });
}

uint32_t sinew_body_exists(const sinew_world* world, uint32_t body) {
  return world != nullptr && world->world->contains({body}) ? 1 : 0;
}

sinew_status sinew_body_teleport(sinew_world* world, uint32_t body, const float rotation[9],
                                 const float translation[3]) {
  return onBody("sinew_body_teleport", world, body, rotation != nullptr && translation != nullptr,
                [&](sinew::World& w, sinew::BodyId id) {
                  sinew::Mat3 matrix;
                  std::copy(rotation, rotation + 9, matrix.begin());
                  w.teleport(id, matrix, vec3(translation));
                });
}

sinew_status sinew_body_positions(const sinew_world* world, uint32_t body, const float** xyz, uint32_t* count) {
  return vectorsOf("sinew_body_positions", world, body, xyz, count,
                   [](const sinew::World& w, sinew::BodyId id) { return w.positions(id); });
}

sinew_status sinew_body_velocities(const sinew_world* world, uint32_t body, const float** xyz, uint32_t* count) {
  return vectorsOf("sinew_body_velocities", world, body, xyz, count,
                   [](const sinew::World& w, sinew::BodyId id) { return w.velocities(id); });
}

sinew_status sinew_body_set_state(sinew_world* world, uint32_t body, const float* positions, const float* velocities,
                                  uint32_t count) {
  return onBody("sinew_body_set_state", world, body, positions != nullptr, [&](sinew::World& w, sinew::BodyId id) {
    static_assert(sizeof(sinew::Vec3) == 3 * sizeof(float));
    const auto vectors = [count](const float* from) {
      return from == nullptr ? std::span<const sinew::Vec3>()
                             : std::span<const sinew::Vec3>(reinterpret_cast<const sinew::Vec3*>(from), count);
    };
    w.setState(id, vectors(positions), vectors(velocities));
  });
}

sinew_status sinew_body_repaired(const sinew_world* world, uint32_t body, uint32_t* count) {
  return onBody("sinew_body_repaired", world, body, count != nullptr,
                [&](const sinew::World& w, sinew::BodyId id) { *count = w.repairedVertices(id); });
}

sinew_status sinew_body_state_size(const sinew_world* world, uint32_t body, size_t* size) {
  return onBody("sinew_body_state_size", world, body, size != nullptr,
                [&](const sinew::World& w, sinew::BodyId id) { *size = w.stateBytes(id); });
}

sinew_status sinew_body_save(const sinew_world* world, uint32_t body, void* bytes, size_t size, size_t* written) {
  std::size_t used = 0;
  const sinew_status status = onBody("sinew_body_save", world, body, bytes != nullptr && written != nullptr,
                                     [&](const sinew::World& w, sinew::BodyId id) {
                                       used = w.saveState(id, {static_cast<std::byte*>(bytes), size});
                                     });
  if (status != SINEW_OK) return status;
  *written = used;
  return used > 0 ? SINEW_OK : fail(SINEW_ERROR_CAPACITY, "sinew_body_save: the buffer is too small");
}

sinew_status sinew_body_restore(sinew_world* world, uint32_t body, const void* bytes, size_t size) {
  sinew_status result = SINEW_OK;
  const sinew_status status =
      onBody("sinew_body_restore", world, body, bytes != nullptr, [&](sinew::World& w, sinew::BodyId id) {
        const sinew::Result<std::size_t> restored = w.restoreState(id, {static_cast<const std::byte*>(bytes), size});
        if (!restored) result = fail(SINEW_ERROR_STATE, restored.reason());
      });
  return status == SINEW_ERROR_MEMORY || result == SINEW_OK ? status : result;
}

sinew_status sinew_body_pin(sinew_world* world, uint32_t body, uint32_t vertex, const float target[3]) {
  return onBody("sinew_body_pin", world, body, target != nullptr,
                [&](sinew::World& w, sinew::BodyId id) { w.pin(id, vertex, vec3(target)); });
}

sinew_status sinew_body_unpin(sinew_world* world, uint32_t body, uint32_t vertex) {
  return onBody("sinew_body_unpin", world, body, true, [&](sinew::World& w, sinew::BodyId id) { w.unpin(id, vertex); });
}

sinew_status sinew_body_unpin_all(sinew_world* world, uint32_t body) {
  return onBody("sinew_body_unpin_all", world, body, true, [](sinew::World& w, sinew::BodyId id) { w.unpinAll(id); });
}

sinew_status sinew_body_pin_set(sinew_world* world, uint32_t body, const uint32_t* vertices, uint32_t count,
                                const float position[3], const float rotation[9], uint32_t method, uint32_t* pin_set) {
  const bool given = vertices != nullptr && position != nullptr && rotation != nullptr && pin_set != nullptr;
  sinew_status result = SINEW_OK;
  const sinew_status status = onBody("sinew_body_pin_set", world, body, given, [&](sinew::World& w, sinew::BodyId id) {
    const auto made = w.addPinSet(id, {vertices, count}, transform(position, rotation), sinew::PinMethod(method));
    if (made) {
      *pin_set = (*made).value;
    } else {
      result = fail(SINEW_ERROR_ARGUMENT, made.reason());
    }
  });
  return status != SINEW_OK ? status : result;
}

sinew_status sinew_pin_set_move(sinew_world* world, uint32_t pin_set, const float position[3],
                                const float rotation[9]) {
  return onWorld("sinew_pin_set_move", world, position != nullptr && rotation != nullptr,
                 [&](sinew::World& w) { w.movePinSet({pin_set}, transform(position, rotation)); });
}

sinew_status sinew_pin_set_remove(sinew_world* world, uint32_t pin_set) {
  return onWorld("sinew_pin_set_remove", world, true, [&](sinew::World& w) { w.removePinSet({pin_set}); });
}

sinew_status sinew_body_find_pin_set(const sinew_world* world, uint32_t body, const char* name, uint32_t* pin_set) {
  sinew::PinSetId found;
  const sinew_status status = onBody("sinew_body_find_pin_set", world, body, name != nullptr && pin_set != nullptr,
                                     [&](const sinew::World& w, sinew::BodyId id) { found = w.pinSet(id, name); });
  if (status != SINEW_OK) return status;
  if (found == sinew::PinSetId{}) {
    return fail(SINEW_ERROR_ARGUMENT, "sinew_body_find_pin_set: no pin set of the package has this name");
  }
  *pin_set = found.value;
  return SINEW_OK;
}

sinew_status sinew_body_move_pin_target(sinew_world* world, uint32_t body, const char* target, const float position[3],
                                        const float rotation[9]) {
  std::uint32_t moved = 0;
  const bool given = target != nullptr && position != nullptr && rotation != nullptr;
  const sinew_status status = onBody(
      "sinew_body_move_pin_target", world, body, given,
      [&](sinew::World& w, sinew::BodyId id) { moved = w.movePinTarget(id, target, transform(position, rotation)); });
  if (status != SINEW_OK || moved > 0) return status;
  return fail(SINEW_ERROR_ARGUMENT, "sinew_body_move_pin_target: no pin set of the package follows this target");
}

sinew_status sinew_pin_set_reaction(const sinew_world* world, uint32_t pin_set, float force[3], float torque[3]) {
  return onWorld("sinew_pin_set_reaction", world, force != nullptr && torque != nullptr, [&](const sinew::World& w) {
    const sinew::PinReaction reaction = w.pinReaction({pin_set});
    std::copy(reaction.force.begin(), reaction.force.end(), force);
    std::copy(reaction.torque.begin(), reaction.torque.end(), torque);
  });
}

sinew_status sinew_body_set_activation(sinew_world* world, uint32_t body, uint32_t channel, float value) {
  bool found = true;
  const sinew_status status =
      onBody("sinew_body_set_activation", world, body, true,
             [&](sinew::World& w, sinew::BodyId id) { found = w.setActivation(id, channel, value); });
  if (status != SINEW_OK || found) return status;
  return fail(SINEW_ERROR_ARGUMENT, "sinew_body_set_activation: the package has no such channel");
}

sinew_status sinew_body_set_activation_by_name(sinew_world* world, uint32_t body, const char* channel, float value) {
  bool found = true;
  const sinew_status status =
      onBody("sinew_body_set_activation_by_name", world, body, channel != nullptr,
             [&](sinew::World& w, sinew::BodyId id) { found = w.setActivation(id, std::string_view(channel), value); });
  if (status != SINEW_OK || found) return status;
  return fail(SINEW_ERROR_ARGUMENT, "sinew_body_set_activation_by_name: the package has no such channel");
}

sinew_status sinew_body_pick(sinew_world* world, uint32_t body, uint32_t visual_vertex, const float target[3],
                             float frequency_hz, float most_force, uint32_t* pick) {
  return onBody("sinew_body_pick", world, body, target != nullptr && pick != nullptr,
                [&](sinew::World& w, sinew::BodyId id) {
                  const sinew::PickId made = w.pick(id, visual_vertex, vec3(target), frequency_hz, most_force);
                  if (made != sinew::PickId{}) *pick = made.value;
                });
}

sinew_status sinew_pick_move(sinew_world* world, uint32_t pick, const float target[3]) {
  return onWorld("sinew_pick_move", world, target != nullptr,
                 [&](sinew::World& w) { w.movePick({pick}, vec3(target)); });
}

sinew_status sinew_pick_release(sinew_world* world, uint32_t pick) {
  return onWorld("sinew_pick_release", world, true, [&](sinew::World& w) { w.releasePick({pick}); });
}

sinew_status sinew_body_picks(const sinew_world* world, uint32_t body, uint32_t* picks, uint32_t capacity,
                              uint32_t* count) {
  return onBody("sinew_body_picks", world, body, count != nullptr && (picks != nullptr || capacity == 0),
                [&](const sinew::World& w, sinew::BodyId id) {
                  static_assert(sizeof(sinew::PickId) == sizeof(uint32_t));
                  *count = std::uint32_t(w.picks(id, {reinterpret_cast<sinew::PickId*>(picks), capacity}));
                });
}

sinew_status sinew_body_set_settings(sinew_world* world, uint32_t body, const sinew_body_settings* settings) {
  return onBody("sinew_body_set_settings", world, body, settings != nullptr, [&](sinew::World& w, sinew::BodyId id) {
    w.setBodySettings(id, toCpp(readStruct(settings, fromCpp(sinew::BodySettings()))));
  });
}

sinew_status sinew_body_get_settings(const sinew_world* world, uint32_t body, sinew_body_settings* settings) {
  return onBody("sinew_body_get_settings", world, body, settings != nullptr,
                [&](const sinew::World& w, sinew::BodyId id) {
                  writeStruct(fromCpp(w.bodySettings(id)), settings, settings->struct_size);
                });
}

void sinew_visual_output_init(sinew_visual_output* output, size_t struct_size) {
  writeStruct(kNoOutput, output, struct_size);
}

sinew_status sinew_body_visual_vertices(const sinew_world* world, uint32_t body, const sinew_visual_output* output) {
  return onBody(
      "sinew_body_visual_vertices", world, body, output != nullptr,
      [&](const sinew::World& w, sinew::BodyId id) { w.visualVertices(id, toCpp(readStruct(output, kNoOutput))); });
}

sinew_status sinew_world_visual_vertices(const sinew_world* world, const uint32_t* bodies,
                                         const sinew_visual_output* outputs, uint32_t count) {
  if (count == 0 && world != nullptr) return SINEW_OK;
  const bool given = bodies != nullptr && outputs != nullptr;
  return onWorld("sinew_world_visual_vertices", world, given, [&](const sinew::World& w) {
    std::pmr::vector<sinew::BodyOutput> all(world->home);
    all.reserve(count);
    const std::byte* at = reinterpret_cast<const std::byte*>(outputs);
    for (uint32_t i = 0; i < count; ++i, at += outputs->struct_size) {
      all.push_back({{bodies[i]}, toCpp(readStruct(reinterpret_cast<const sinew_visual_output*>(at), kNoOutput))});
    }
    w.visualVertices(all);
  });
}

sinew_status sinew_body_visual_sub_mesh(const sinew_world* world, uint32_t body, uint32_t sub_mesh,
                                        const sinew_visual_output* output) {
  return onBody("sinew_body_visual_sub_mesh", world, body, output != nullptr,
                [&](const sinew::World& w, sinew::BodyId id) {
                  w.visualSubMesh(id, sub_mesh, toCpp(readStruct(output, kNoOutput)));
                });
}

sinew_status sinew_body_physical_bounds(const sinew_world* world, uint32_t body, float low[3], float high[3]) {
  return boundsOf("sinew_body_physical_bounds", world, body, low, high,
                  [](const sinew::World& w, sinew::BodyId id) { return w.physicalBounds(id); });
}

sinew_status sinew_body_visual_bounds(const sinew_world* world, uint32_t body, float low[3], float high[3]) {
  return boundsOf("sinew_body_visual_bounds", world, body, low, high,
                  [](const sinew::World& w, sinew::BodyId id) { return w.visualBounds(id); });
}

sinew_status sinew_body_rigid_motion(const sinew_world* world, uint32_t body, float rotation[9], float translation[3]) {
  return onBody("sinew_body_rigid_motion", world, body, rotation != nullptr && translation != nullptr,
                [&](const sinew::World& w, sinew::BodyId id) {
                  sinew::Mat3 matrix;
                  sinew::Vec3 vector;
                  w.rigidMotion(id, matrix, vector);
                  std::copy(matrix.begin(), matrix.end(), rotation);
                  std::copy(vector.begin(), vector.end(), translation);
                });
}

sinew_status sinew_body_energy(const sinew_world* world, uint32_t body, double* kinetic, double* elastic) {
  return onBody("sinew_body_energy", world, body, true, [&](const sinew::World& w, sinew::BodyId id) {
    const sinew::BodyEnergy energy = w.energy(id);
    if (kinetic != nullptr) *kinetic = energy.kinetic;
    if (elastic != nullptr) *elastic = energy.elastic;
  });
}

sinew_status sinew_world_shift_origin(sinew_world* world, const float* by) {
  return onWorld("sinew_world_shift_origin", world, by != nullptr, [&](sinew::World& w) { w.shiftOrigin(vec3(by)); });
}

sinew_status sinew_body_cluster_frame(const sinew_world* world, uint32_t body, uint32_t cluster, float center[3],
                                      float linear[9]) {
  return onBody("sinew_body_cluster_frame", world, body, center != nullptr && linear != nullptr,
                [&](const sinew::World& w, sinew::BodyId id) {
                  sinew::Vec3 vector;
                  sinew::Mat3 matrix;
                  w.clusterFrame(id, cluster, vector, matrix);
                  std::copy(vector.begin(), vector.end(), center);
                  std::copy(matrix.begin(), matrix.end(), linear);
                });
}

sinew_status sinew_body_cluster_rest_shape(const sinew_world* world, uint32_t body, uint32_t cluster, float shape[9]) {
  return onBody("sinew_body_cluster_rest_shape", world, body, shape != nullptr,
                [&](const sinew::World& w, sinew::BodyId id) {
                  const sinew::Mat3 matrix = w.clusterRestShape(id, cluster);
                  std::copy(matrix.begin(), matrix.end(), shape);
                });
}

}  // extern "C"

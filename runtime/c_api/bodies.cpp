// SPDX-License-Identifier: MIT
//
// The C interface over the bodies of world.h and what they show. Nothing is decided here.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <span>
#include <vector>

#include "runtime/c_api/handles.h"
#include "runtime/c_api/structs.h"

namespace {

using sinew::handles::assetOf;
using sinew::handles::failNull;
using sinew::handles::guarded;
using sinew::handles::isFilled;
using sinew::handles::isNullOrFilled;
using sinew::handles::memoryOf;
using sinew::handles::onBody;
using sinew::handles::onWorld;
using sinew::handles::readStruct;
using sinew::handles::takeToldStatus;
using sinew::handles::tellFailure;
using sinew::handles::vec3;
using sinew::handles::worldOf;
using sinew::handles::writeStruct;

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
  result.level = s.level;
  result.support_damping = s.support_damping;
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
  result.level = s.level;
  result.support_damping = s.support_damping;
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

/// For calls that answer and do not fail: what the world tells meanwhile is no later call's failure.
template <class Ask>
std::uint32_t answerOf(const sinew_world* world, const Ask& ask) {
  const bool answer = world != nullptr && ask(worldOf(world));
  takeToldStatus();
  return answer ? 1 : 0;
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

void sinew_body_settings_init(sinew_body_settings* settings, size_t struct_size) {
  writeStruct(fromCpp(sinew::BodySettings{}), settings, struct_size);
}

sinew_status sinew_body_add(sinew_world* world, const sinew_asset* asset, const sinew_body_settings* settings,
                            uint32_t* body) {
  if (world == nullptr || asset == nullptr || body == nullptr || !isNullOrFilled(settings)) {
    return failNull("sinew_body_add");
  }
  return guarded("sinew_body_add", [&] {
    const sinew_body_settings given = readStruct(settings, fromCpp(sinew::BodySettings{}));
    const sinew::Result<sinew::BodyId> added = worldOf(world).addBody(assetOf(asset), toCpp(given));
    const sinew_status told = takeToldStatus();
    if (!added) return tellFailure(told != SINEW_OK ? told : SINEW_ERROR_ARGUMENT, added.reason());
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
  return answerOf(world, [&](const sinew::World& w) { return w.contains({body}) && w.isAsleep({body}); });
}

sinew_status sinew_body_wake(sinew_world* world, uint32_t body) {
  return onBody("sinew_body_wake", world, body, true, [](sinew::World& w, sinew::BodyId id) { w.wake(id); });
}

uint32_t sinew_body_exists(const sinew_world* world, uint32_t body) {
  return answerOf(world, [&](const sinew::World& w) { return w.contains({body}); });
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

sinew_status sinew_body_snap_to_pins(sinew_world* world, uint32_t body) {
  return onBody("sinew_body_snap_to_pins", world, body, true,
                [](sinew::World& w, sinew::BodyId id) { w.snapToPins(id); });
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
  return used > 0 ? SINEW_OK : tellFailure(SINEW_ERROR_CAPACITY, "sinew_body_save: the buffer is too small");
}

sinew_status sinew_body_restore(sinew_world* world, uint32_t body, const void* bytes, size_t size) {
  sinew_status result = SINEW_OK;
  const sinew_status status =
      onBody("sinew_body_restore", world, body, bytes != nullptr, [&](sinew::World& w, sinew::BodyId id) {
        const sinew::Result<std::size_t> restored = w.restoreState(id, {static_cast<const std::byte*>(bytes), size});
        if (!restored) result = tellFailure(SINEW_ERROR_STATE, restored.reason());
      });
  return status == SINEW_ERROR_MEMORY || result == SINEW_OK ? status : result;
}

sinew_status sinew_body_set_settings(sinew_world* world, uint32_t body, const sinew_body_settings* settings) {
  return onBody("sinew_body_set_settings", world, body, isFilled(settings), [&](sinew::World& w, sinew::BodyId id) {
    w.setBodySettings(id, toCpp(readStruct(settings, fromCpp(sinew::BodySettings()))));
  });
}

sinew_status sinew_body_get_settings(const sinew_world* world, uint32_t body, sinew_body_settings* settings) {
  return onBody("sinew_body_get_settings", world, body, isFilled(settings),
                [&](const sinew::World& w, sinew::BodyId id) {
                  writeStruct(fromCpp(w.bodySettings(id)), settings, settings->struct_size);
                });
}

void sinew_visual_output_init(sinew_visual_output* output, size_t struct_size) {
  writeStruct(kNoOutput, output, struct_size);
}

sinew_status sinew_body_visual_vertices(const sinew_world* world, uint32_t body, const sinew_visual_output* output) {
  return onBody(
      "sinew_body_visual_vertices", world, body, isFilled(output),
      [&](const sinew::World& w, sinew::BodyId id) { w.visualVertices(id, toCpp(readStruct(output, kNoOutput))); });
}

sinew_status sinew_world_visual_vertices(const sinew_world* world, const uint32_t* bodies,
                                         const sinew_visual_output* outputs, uint32_t count) {
  if (count == 0 && world != nullptr) return SINEW_OK;
  const bool given = bodies != nullptr && isFilled(outputs);
  return onWorld("sinew_world_visual_vertices", world, given, [&](const sinew::World& w) {
    std::pmr::vector<sinew::BodyOutput> all(memoryOf(world));
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
  return onBody("sinew_body_visual_sub_mesh", world, body, isFilled(output),
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

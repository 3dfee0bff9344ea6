// SPDX-License-Identifier: MIT
//
// The C interface over what world.h lets a game do to bodies: pins, picks, pushes, snapshots. Nothing is decided here.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "runtime/c_api/handles.h"
#include "runtime/c_api/structs.h"

namespace {

using sinew::handles::onBody;
using sinew::handles::onWorld;
using sinew::handles::takeToldStatus;
using sinew::handles::tellFailure;
using sinew::handles::transform;
using sinew::handles::vec3;
using sinew::handles::writeStruct;

sinew::BodyPoint toCpp(const sinew_body_point* point) {
  return {{point->vertex[0], point->vertex[1], point->vertex[2]}, vec3(point->weight), point->physical};
}

void copy(const sinew::Vec3& from, float* to) { std::copy(from.begin(), from.end(), to); }

/// \param list of the world, into a span of ids.
template <class Id, class List>
sinew_status listOf(const char* call, const sinew_world* world, uint32_t* ids, uint32_t capacity, uint32_t* count,
                    const List& list) {
  static_assert(sizeof(Id) == sizeof(uint32_t));
  return onWorld(call, world, count != nullptr && (ids != nullptr || capacity == 0), [&](const sinew::World& w) {
    *count = uint32_t(list(w, std::span(reinterpret_cast<Id*>(ids), capacity)));
  });
}

}  // namespace

extern "C" {

sinew_status sinew_body_set_activity(sinew_world* world, uint32_t body, uint32_t activity) {
  return onWorld("sinew_body_set_activity", world, true,
                 [&](sinew::World& w) { w.setActivity({body}, sinew::Activity(activity)); });
}

sinew_status sinew_body_get_activity(const sinew_world* world, uint32_t body, uint32_t* activity) {
  return onWorld("sinew_body_get_activity", world, activity != nullptr,
                 [&](const sinew::World& w) { *activity = uint32_t(w.activity({body})); });
}

sinew_status sinew_body_nearest_point(const sinew_world* world, uint32_t body, const float place[3],
                                      sinew_body_point* point) {
  return onWorld("sinew_body_nearest_point", world, place != nullptr && point != nullptr, [&](const sinew::World& w) {
    const sinew::BodyPoint found = w.nearestPoint({body}, vec3(place));
    std::copy(found.vertex.begin(), found.vertex.end(), point->vertex);
    copy(found.weight, point->weight);
    point->physical = found.physical;
  });
}

sinew_status sinew_body_place_of(const sinew_world* world, uint32_t body, const sinew_body_point* point,
                                 float place[3]) {
  return onWorld("sinew_body_place_of", world, point != nullptr && place != nullptr,
                 [&](const sinew::World& w) { copy(w.placeOf({body}, toCpp(point)), place); });
}

sinew_status sinew_body_add_impulse(sinew_world* world, uint32_t body, const sinew_body_point* at,
                                    const float impulse[3]) {
  return onWorld("sinew_body_add_impulse", world, impulse != nullptr, [&](sinew::World& w) {
    at != nullptr ? w.addImpulse({body}, toCpp(at), vec3(impulse)) : w.addImpulse({body}, vec3(impulse));
  });
}

sinew_status sinew_body_add_force(sinew_world* world, uint32_t body, const sinew_body_point* at, const float force[3]) {
  return onWorld("sinew_body_add_force", world, force != nullptr, [&](sinew::World& w) {
    at != nullptr ? w.addForce({body}, toCpp(at), vec3(force)) : w.addForce({body}, vec3(force));
  });
}

sinew_status sinew_body_get_motion(const sinew_world* world, uint32_t body, sinew_body_motion* motion) {
  return onWorld("sinew_body_get_motion", world, motion != nullptr, [&](const sinew::World& w) {
    const sinew::BodyMotion found = w.motion({body});
    sinew_body_motion result = {};
    copy(found.center, result.center);
    copy(found.velocity, result.velocity);
    copy(found.angular_velocity, result.angular_velocity);
    result.mass = found.mass;
    writeStruct(result, motion, motion->struct_size);
  });
}

sinew_status sinew_body_set_velocity(sinew_world* world, uint32_t body, const float velocity[3],
                                     const float angular_velocity[3]) {
  return onWorld("sinew_body_set_velocity", world, velocity != nullptr, [&](sinew::World& w) {
    w.setVelocity({body}, vec3(velocity), angular_velocity != nullptr ? vec3(angular_velocity) : sinew::Vec3{});
  });
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
      result = tellFailure(SINEW_ERROR_ARGUMENT, made.reason());
    }
  });
  return status != SINEW_OK ? status : result;
}

sinew_status sinew_pin_set_move(sinew_world* world, uint32_t pin_set, const float position[3],
                                const float rotation[9]) {
  return onWorld("sinew_pin_set_move", world, position != nullptr && rotation != nullptr,
                 [&](sinew::World& w) { w.movePinSet({pin_set}, transform(position, rotation)); });
}

sinew_status sinew_pin_set_drawn(const sinew_world* world, uint32_t pin_set, float position[3], float rotation[9]) {
  return onWorld("sinew_pin_set_drawn", world, position != nullptr && rotation != nullptr, [&](const sinew::World& w) {
    const sinew::RigidTransform at = w.drawnPose(sinew::PinSetId{pin_set});
    std::copy(at.position.begin(), at.position.end(), position);
    std::copy(at.rotation.begin(), at.rotation.end(), rotation);
  });
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
    return tellFailure(SINEW_ERROR_ARGUMENT, "sinew_body_find_pin_set: no pin set of the package has this name");
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
  return tellFailure(SINEW_ERROR_ARGUMENT, "sinew_body_move_pin_target: no pin set of the package follows this target");
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
  return tellFailure(SINEW_ERROR_ARGUMENT, "sinew_body_set_activation: the package has no such channel");
}

sinew_status sinew_body_set_activation_by_name(sinew_world* world, uint32_t body, const char* channel, float value) {
  bool found = true;
  const sinew_status status =
      onBody("sinew_body_set_activation_by_name", world, body, channel != nullptr,
             [&](sinew::World& w, sinew::BodyId id) { found = w.setActivation(id, std::string_view(channel), value); });
  if (status != SINEW_OK || found) return status;
  return tellFailure(SINEW_ERROR_ARGUMENT, "sinew_body_set_activation_by_name: the package has no such channel");
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

sinew_status sinew_body_pick_point(sinew_world* world, uint32_t body, const sinew_body_point* at, const float target[3],
                                   float frequency_hz, float most_force, uint32_t* pick) {
  return onWorld("sinew_body_pick_point", world, at != nullptr && target != nullptr && pick != nullptr,
                 [&](sinew::World& w) {
                   *pick = w.pick({body}, toCpp(at), vec3(target), {frequency_hz, most_force}).value;
                 });
}

sinew_status sinew_world_pick_ray(sinew_world* world, const float origin[3], const float direction[3], float distance,
                                  float frequency_hz, float most_force, uint32_t* pick) {
  return onWorld("sinew_world_pick_ray", world, origin != nullptr && direction != nullptr && pick != nullptr,
                 [&](sinew::World& w) {
                   *pick = w.pickRay(vec3(origin), vec3(direction), distance, {frequency_hz, most_force}).value;
                 });
}

sinew_status sinew_world_pick_along(const sinew_world* world, const float origin[3], const float direction[3],
                                    float distance, float radius, uint32_t* pick) {
  return onWorld(
      "sinew_world_pick_along", world, origin != nullptr && direction != nullptr && pick != nullptr,
      [&](const sinew::World& w) { *pick = w.pickAlong(vec3(origin), vec3(direction), distance, radius).value; });
}

sinew_status sinew_pick_lock(sinew_world* world, uint32_t pick, uint32_t locked) {
  return onWorld("sinew_pick_lock", world, true, [&](sinew::World& w) { w.lockPick({pick}, locked != 0); });
}

sinew_status sinew_pick_let_go(sinew_world* world, uint32_t pick) {
  return onWorld("sinew_pick_let_go", world, true, [&](sinew::World& w) { w.letGoPick({pick}); });
}

sinew_status sinew_picks_release(sinew_world* world, uint32_t body) {
  return onWorld("sinew_picks_release", world, true,
                 [&](sinew::World& w) { body == SINEW_NONE ? w.releasePicks() : w.releasePicks({body}); });
}

sinew_status sinew_world_bodies(const sinew_world* world, uint32_t* bodies, uint32_t capacity, uint32_t* count) {
  return listOf<sinew::BodyId>("sinew_world_bodies", world, bodies, capacity, count,
                               [](const sinew::World& w, const auto& ids) { return w.bodies(ids); });
}

sinew_status sinew_world_colliders(const sinew_world* world, uint32_t* colliders, uint32_t capacity, uint32_t* count) {
  return listOf<sinew::ColliderId>("sinew_world_colliders", world, colliders, capacity, count,
                                   [](const sinew::World& w, const auto& ids) { return w.colliders(ids); });
}

sinew_status sinew_body_pin_sets(const sinew_world* world, uint32_t body, uint32_t* pin_sets, uint32_t capacity,
                                 uint32_t* count) {
  return listOf<sinew::PinSetId>("sinew_body_pin_sets", world, pin_sets, capacity, count,
                                 [&](const sinew::World& w, const auto& ids) { return w.pinSets({body}, ids); });
}

sinew_status sinew_world_snapshot_size(const sinew_world* world, size_t* size) {
  return onWorld("sinew_world_snapshot_size", world, size != nullptr,
                 [&](const sinew::World& w) { *size = w.snapshotBytes(); });
}

sinew_status sinew_world_save(const sinew_world* world, void* bytes, size_t size, size_t* written) {
  return onWorld("sinew_world_save", world, bytes != nullptr && written != nullptr, [&](const sinew::World& w) {
    *written = w.saveSnapshot({static_cast<std::byte*>(bytes), size});
    if (const sinew_status told = takeToldStatus(); told != SINEW_OK) return told;
    return *written > 0 ? SINEW_OK : tellFailure(SINEW_ERROR_CAPACITY, "sinew_world_save: the buffer is too small");
  });
}

sinew_status sinew_world_restore(sinew_world* world, const void* bytes, size_t size, const sinew_asset* const* assets,
                                 uint32_t asset_count) {
  return onWorld("sinew_world_restore", world, bytes != nullptr && (assets != nullptr || asset_count == 0),
                 [&](sinew::World& w) {
                   std::vector<std::shared_ptr<const sinew::Asset>> given;
                   for (uint32_t i = 0; i < asset_count; ++i) {
                     if (assets[i] != nullptr) given.push_back(sinew::handles::assetOf(assets[i]));
                   }
                   const auto restored = w.restoreSnapshot({static_cast<const std::byte*>(bytes), size}, given);
                   return restored ? SINEW_OK : tellFailure(SINEW_ERROR_STATE, restored.reason());
                 });
}

}  // extern "C"

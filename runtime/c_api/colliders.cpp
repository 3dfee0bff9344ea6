// SPDX-License-Identifier: MIT
//
// The C interface over collider.h and query.h. Nothing is decided here.
#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "runtime/c_api/handles.h"
#include "runtime/c_api/structs.h"

static_assert(sizeof(sinew_query_object) == sizeof(sinew::QueryObject));
static_assert(offsetof(sinew_query_object, collider) == offsetof(sinew::QueryObject, collider));
static_assert(sizeof(sinew::Vec3) == 3 * sizeof(float));
static_assert(sizeof(sinew::formats::Triangle) == 3 * sizeof(uint32_t));

namespace {

using sinew::handles::isFilled;
using sinew::handles::isNullOrFilled;
using sinew::handles::onWorld;
using sinew::handles::readStruct;
using sinew::handles::tellFailure;
using sinew::handles::transform;
using sinew::handles::vec3;
using sinew::handles::writeStruct;

sinew_shape defaultShape() {
  sinew_shape s = {};
  s.struct_size = sizeof s;
  s.kind = SINEW_SHAPE_SPHERE;
  s.normal[1] = 1;
  s.radius = s.half_length = 0.5F;
  std::fill_n(s.half_size, 3, 0.5F);
  s.cell = 1;
  return s;
}

/// Null where the kind is none.
std::optional<sinew::ColliderShape> toCpp(const sinew_shape& s) {
  const std::span points(reinterpret_cast<const sinew::Vec3*>(s.points), s.points != nullptr ? s.point_count : 0);
  switch (s.kind) {
    case SINEW_SHAPE_PLANE:
      return sinew::PlaneShape{vec3(s.normal), s.offset};
    case SINEW_SHAPE_SPHERE:
      return sinew::SphereShape{s.radius};
    case SINEW_SHAPE_CAPSULE:
      return sinew::CapsuleShape{s.radius, s.half_length};
    case SINEW_SHAPE_BOX:
      return sinew::BoxShape{vec3(s.half_size)};
    case SINEW_SHAPE_HULL:
      return sinew::HullShape{points};
    case SINEW_SHAPE_MESH:
      return sinew::MeshShape{points,
                              {reinterpret_cast<const sinew::formats::Triangle*>(s.triangles),
                               s.triangles != nullptr ? std::size_t(s.triangle_count) : 0}};
    case SINEW_SHAPE_HEIGHT_FIELD:
      return sinew::HeightFieldShape{
          {s.heights, s.heights != nullptr ? std::size_t(s.columns) * s.rows : 0}, s.columns, s.cell};
    default:
      return std::nullopt;
  }
}

sinew_collider_settings fromCpp(const sinew::ColliderSettings& s) {
  sinew_collider_settings result = {};
  result.struct_size = sizeof result;
  std::copy(s.at.position.begin(), s.at.position.end(), result.position);
  std::copy(s.at.rotation.begin(), s.at.rotation.end(), result.rotation);
  result.friction = s.friction;
  result.restitution = s.restitution;
  result.layers = s.layers;
  result.touches = s.touches;
  result.mass = s.mass;
  std::copy(s.inertia.begin(), s.inertia.end(), result.inertia);
  result.most_speed = s.most_speed;
  std::copy(s.surface_velocity.begin(), s.surface_velocity.end(), result.surface_velocity);
  return result;
}

sinew::ColliderSettings toCpp(const sinew_collider_settings& s) {
  sinew::ColliderSettings result;
  result.at = transform(s.position, s.rotation);
  result.friction = s.friction;
  result.restitution = s.restitution;
  result.layers = s.layers;
  result.touches = s.touches;
  result.mass = s.mass;
  result.inertia = vec3(s.inertia);
  result.most_speed = s.most_speed;
  result.surface_velocity = vec3(s.surface_velocity);
  return result;
}

constexpr sinew_query_filter kAll = {sizeof(sinew_query_filter), 0xFFFFFFFFU, 1, 1};

sinew::QueryFilter toCpp(const sinew_query_filter* given) {
  const sinew_query_filter f = readStruct(given, kAll);
  return {f.layers, f.bodies != 0, f.colliders != 0};
}

std::span<sinew::QueryObject> room(sinew_query_object* objects, uint32_t capacity) {
  return {reinterpret_cast<sinew::QueryObject*>(objects), objects != nullptr ? std::size_t(capacity) : 0};
}

}  // namespace

extern "C" {

void sinew_shape_init(sinew_shape* shape, size_t struct_size) { writeStruct(defaultShape(), shape, struct_size); }

void sinew_collider_settings_init(sinew_collider_settings* settings, size_t struct_size) {
  writeStruct(fromCpp(sinew::ColliderSettings{}), settings, struct_size);
}

void sinew_query_filter_init(sinew_query_filter* filter, size_t struct_size) { writeStruct(kAll, filter, struct_size); }

sinew_status sinew_collider_add(sinew_world* world, const sinew_shape* shape, const sinew_collider_settings* settings,
                                uint32_t* collider) {
  return onWorld("sinew_collider_add", world, isFilled(shape) && isNullOrFilled(settings) && collider != nullptr,
                 [&](sinew::World& w) {
                   const std::optional<sinew::ColliderShape> made = toCpp(readStruct(shape, defaultShape()));
                   if (!made) return tellFailure(SINEW_ERROR_ARGUMENT, "sinew_collider_add: no such kind of shape");
                   const sinew::Result<sinew::ColliderId> added =
                       w.addCollider(*made, toCpp(readStruct(settings, fromCpp(sinew::ColliderSettings{}))));
                   if (!added) return tellFailure(SINEW_ERROR_ARGUMENT, added.reason());
                   *collider = (*added).value;
                   return SINEW_OK;
                 });
}

sinew_status sinew_collider_move(sinew_world* world, uint32_t collider, const float position[3],
                                 const float rotation[9]) {
  return onWorld("sinew_collider_move", world, position != nullptr && rotation != nullptr, [&](sinew::World& w) {
    w.moveCollider({collider}, transform(position, rotation));
    return SINEW_OK;
  });
}

sinew_status sinew_collider_set_settings(sinew_world* world, uint32_t collider,
                                         const sinew_collider_settings* settings) {
  return onWorld("sinew_collider_set_settings", world, isFilled(settings), [&](sinew::World& w) {
    w.setColliderSettings({collider}, toCpp(readStruct(settings, fromCpp(sinew::ColliderSettings{}))));
  });
}

sinew_status sinew_collider_get_settings(const sinew_world* world, uint32_t collider,
                                         sinew_collider_settings* settings) {
  return onWorld("sinew_collider_get_settings", world, isFilled(settings), [&](const sinew::World& w) {
    writeStruct(fromCpp(w.colliderSettings({collider})), settings, settings->struct_size);
  });
}

sinew_status sinew_collider_remove(sinew_world* world, uint32_t collider) {
  return onWorld("sinew_collider_remove", world, true, [&](sinew::World& w) {
    w.removeCollider({collider});
    return SINEW_OK;
  });
}

sinew_status sinew_collider_pose(const sinew_world* world, uint32_t collider, float position[3], float rotation[9]) {
  return onWorld("sinew_collider_pose", world, position != nullptr && rotation != nullptr, [&](const sinew::World& w) {
    const sinew::RigidTransform at = w.colliderPose({collider});
    std::copy(at.position.begin(), at.position.end(), position);
    std::copy(at.rotation.begin(), at.rotation.end(), rotation);
    return SINEW_OK;
  });
}

sinew_status sinew_collider_drawn(const sinew_world* world, uint32_t collider, float position[3], float rotation[9]) {
  return onWorld("sinew_collider_drawn", world, position != nullptr && rotation != nullptr, [&](const sinew::World& w) {
    const sinew::RigidTransform at = w.drawnPose(sinew::ColliderId{collider});
    std::copy(at.position.begin(), at.position.end(), position);
    std::copy(at.rotation.begin(), at.rotation.end(), rotation);
  });
}

sinew_status sinew_collider_reaction(const sinew_world* world, uint32_t collider, float impulse[3],
                                     float torque_impulse[3]) {
  return onWorld("sinew_collider_reaction", world, impulse != nullptr && torque_impulse != nullptr,
                 [&](const sinew::World& w) {
                   const sinew::ColliderReaction reaction = w.colliderReaction({collider});
                   std::copy(reaction.impulse.begin(), reaction.impulse.end(), impulse);
                   std::copy(reaction.torque_impulse.begin(), reaction.torque_impulse.end(), torque_impulse);
                   return SINEW_OK;
                 });
}

sinew_status sinew_world_contact_events(const sinew_world* world, sinew_contact_event* events, uint32_t capacity,
                                        uint32_t* count) {
  return onWorld("sinew_world_contact_events", world, count != nullptr && (events != nullptr || capacity == 0),
                 [&](const sinew::World& w) {
                   const std::span<const sinew::ContactEvent> found = w.contactEvents();
                   *count = uint32_t(found.size());
                   for (std::size_t i = 0; i < std::min<std::size_t>(capacity, found.size()); ++i) {
                     events[i] = {found[i].body, found[i].collider.value, found[i].began ? 1U : 0U, found[i].other};
                   }
                   return SINEW_OK;
                 });
}

sinew_status sinew_world_contacts(const sinew_world* world, sinew_contact* contacts, uint32_t capacity,
                                  uint32_t* count) {
  return onWorld("sinew_world_contacts", world, count != nullptr && (contacts != nullptr || capacity == 0),
                 [&](const sinew::World& w) {
                   const std::span<const sinew::BodyContact> found = w.contacts();
                   *count = uint32_t(found.size());
                   for (std::size_t i = 0; i < std::min<std::size_t>(capacity, found.size()); ++i) {
                     const sinew::BodyContact& from = found[i];
                     sinew_contact& to = contacts[i];
                     to = {from.body, from.collider.value, from.other, {}, {}, {}, from.speed};
                     std::copy(from.point.begin(), from.point.end(), to.point);
                     std::copy(from.normal.begin(), from.normal.end(), to.normal);
                     std::copy(from.impulse.begin(), from.impulse.end(), to.impulse);
                   }
                   return SINEW_OK;
                 });
}

sinew_status sinew_world_cast(const sinew_world* world, const float origin[3], float radius, const float direction[3],
                              float distance, const sinew_query_filter* filter, sinew_cast_hit* hit, uint32_t* found) {
  const bool all_given = origin != nullptr && direction != nullptr && hit != nullptr && found != nullptr;
  return onWorld("sinew_world_cast", world, all_given, [&](const sinew::World& w) {
    const sinew::QueryFilter counts = toCpp(filter);
    const std::optional<sinew::CastHit> met =
        radius == 0 ? w.rayCast(vec3(origin), vec3(direction), distance, counts)
                    : w.sphereCast(vec3(origin), radius, vec3(direction), distance, counts);
    *found = met ? 1 : 0;
    if (!met) return SINEW_OK;
    hit->object = {met->object.body, met->object.collider.value};
    hit->distance = met->distance;
    std::copy(met->point.begin(), met->point.end(), hit->point);
    std::copy(met->normal.begin(), met->normal.end(), hit->normal);
    hit->triangle = met->triangle;
    return SINEW_OK;
  });
}

sinew_status sinew_world_overlaps_sphere(const sinew_world* world, const float center[3], float radius,
                                         const sinew_query_filter* filter, sinew_query_object* objects,
                                         uint32_t capacity, uint32_t* count) {
  return onWorld("sinew_world_overlaps_sphere", world, center != nullptr && count != nullptr,
                 [&](const sinew::World& w) {
                   *count = uint32_t(w.overlaps(vec3(center), radius, room(objects, capacity), toCpp(filter)));
                   return SINEW_OK;
                 });
}

sinew_status sinew_world_overlaps_box(const sinew_world* world, const float half_size[3], const float position[3],
                                      const float rotation[9], const sinew_query_filter* filter,
                                      sinew_query_object* objects, uint32_t capacity, uint32_t* count) {
  const bool all_given = half_size != nullptr && position != nullptr && rotation != nullptr && count != nullptr;
  return onWorld("sinew_world_overlaps_box", world, all_given, [&](const sinew::World& w) {
    *count = uint32_t(w.overlaps(sinew::BoxShape{vec3(half_size)}, transform(position, rotation),
                                 room(objects, capacity), toCpp(filter)));
    return SINEW_OK;
  });
}

}  // extern "C"

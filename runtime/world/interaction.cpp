// SPDX-License-Identifier: MIT
//
// A game's calls on bodies: pushes, picks, stops.
#include <algorithm>
#include <cmath>

#include "runtime/interact/picked_point.h"
#include "runtime/world/world_impl.h"

namespace sinew {

using internal::asArray;
using internal::asVector;
using internal::Body;
using internal::Vector3d;

std::pair<Body*, std::size_t> World::Impl::findPick(PickId id) const {
  for (const internal::BodyPointer& body : bodies) {
    for (std::size_t i = 0; i < body->picks.size(); ++i) {
      if (body->picks[i].id == id.value) return {body.get(), i};
    }
  }
  return {nullptr, 0};
}

bool World::Impl::isOf(const Body& body, const BodyPoint& at, const char* call) const {
  const std::size_t count = at.physical != 0 ? body.vertexCount() : body.package().visualPositions().size();
  bool sound = std::abs(at.weight[0] + at.weight[1] + at.weight[2] - 1) < 1e-3F;
  for (std::size_t c = 0; c < 3; ++c) sound = sound && (at.weight[c] == 0 || at.vertex[c] < count);
  if (!sound) {
    tell(LogSeverity::error, "%s: the point is none of body %u: vertices must exist, and weights sum to 1", call,
         body.id);
  }
  return sound;
}

bool World::Impl::isPush(const Vec3& push, const char* call) const {
  const bool finite = internal::stateIsUsable(push, {});
  if (!finite) tell(LogSeverity::error, "%s: not finite, or beyond 1e15", call);
  return finite;
}

namespace {

Vec3 asFloats(const Vector3d& v) { return {float(v[0]), float(v[1]), float(v[2])}; }

Vector3d whereIs(const Body& body, const internal::PickedPoint& point) {
  Vector3d place = Vector3d::Zero();
  for (std::size_t c = 0; c < point.weight.size() && point.weight[c] != 0; ++c) {
    place += point.weight[c] * wide(body.x[point.vertex[c]]);
  }
  return place;
}

/// Ids of a list into a span, as many as fit.
template <class Id, class List, class Number>
std::size_t list(const List& from, std::span<Id> ids, const Number& number) {
  for (std::size_t i = 0; i < std::min(ids.size(), from.size()); ++i) ids[i] = Id{number(from[i])};
  return from.size();
}

}  // namespace

std::size_t World::bodies(std::span<BodyId> ids) const {
  const Impl::Presence presence(*impl_, "bodies", Impl::As::looks);
  if (!presence) return 0;
  return list(impl_->bodies, ids, [](const internal::BodyPointer& body) { return body->id; });
}

std::size_t World::colliders(std::span<ColliderId> ids) const {
  const Impl::Presence presence(*impl_, "colliders", Impl::As::looks);
  if (!presence) return 0;
  return list(impl_->colliders, ids, [](const internal::Collider& collider) { return collider.id; });
}

std::size_t World::pinSets(BodyId id, std::span<PinSetId> ids) const {
  const Impl::Presence presence(*impl_, "pinSets", Impl::As::looks);
  const Body* body = presence.find(id);
  return body == nullptr ? 0 : list(body->pin_sets, ids, [](const internal::PinSet& set) { return set.id; });
}

std::size_t World::picks(BodyId id, std::span<PickId> ids) const {
  const Impl::Presence presence(*impl_, "picks", Impl::As::looks);
  const Body* body = presence.find(id);
  return body == nullptr ? 0 : list(body->picks, ids, [](const internal::Pick& pick) { return pick.id; });
}

void World::setActivity(BodyId id, Activity activity) {
  const Impl::Presence presence(*impl_, "setActivity", Impl::As::changes);
  Body* body = presence.find(id);
  if (body == nullptr || body->activity == activity) return;
  if (activity > Activity::disabled) {
    impl_->tell(LogSeverity::error, "setActivity: no such activity");
    return;
  }
  impl_->changed(*body);
  internal::wakeAll(impl_->bodies);  // what lay on it may fall, or be thrown
  if (body->activity == Activity::active) {
    body->sleeps_with = body->id;
    body->touches.clear();
    for (internal::Piece& piece : body->pieces) {
      std::copy(piece.state.z.begin(), piece.state.z.end(), piece.state.z_before.begin());
      std::copy(piece.state.v.begin(), piece.state.v.end(), piece.state.v_before.begin());
      piece.state.turn.setZero();
      piece.state.h_before = 0;
    }
    body->outdated = true;
  }
  body->activity = activity;
  if (activity != Activity::active) return;
  body->sleeps_with = formats::kNone;
  impl_->snapToPins(*body);
}

Activity World::activity(BodyId id) const {
  const Impl::Presence presence(*impl_, "activity", Impl::As::looks);
  const Body* body = presence.find(id);
  return body != nullptr ? body->activity : Activity::disabled;
}

void World::Impl::addImpulse(BodyId id, const BodyPoint* at, const Vec3& impulse) {
  const Presence presence(*this, "addImpulse", As::changes);
  Body* body = presence.seen(id);
  if (body == nullptr || !isPush(impulse, "addImpulse") || (at != nullptr && !isOf(*body, *at, "addImpulse"))) return;
  changed(*body);
  body->solver->push(at != nullptr ? pickedPoint(*body, *at) : internal::PickedPoint{}, wide(impulse));
}

void World::addImpulse(BodyId id, const BodyPoint& at, Vec3 impulse) { impl_->addImpulse(id, &at, impulse); }
void World::addImpulse(BodyId id, Vec3 impulse) { impl_->addImpulse(id, nullptr, impulse); }

void World::Impl::addForce(BodyId id, const BodyPoint* at, const Vec3& force) {
  const Presence presence(*this, "addForce", As::changes);
  Body* body = presence.find(id);
  if (body == nullptr || !isPush(force, "addForce") || (at != nullptr && !isOf(*body, *at, "addForce"))) return;
  guarded("addForce", false, [&] {
    body->forces.push_back({at != nullptr ? pickedPoint(*body, *at) : internal::PickedPoint{}, force});
    internal::wake(bodies, *body);
    return true;
  });
}

void World::addForce(BodyId id, const BodyPoint& at, Vec3 force) { impl_->addForce(id, &at, force); }
void World::addForce(BodyId id, Vec3 force) { impl_->addForce(id, nullptr, force); }

void World::Impl::forgetForces() {
  for (const internal::BodyPointer& body : bodies) body->forces.clear();
}

BodyMotion World::motion(BodyId id) const {
  const Impl::Presence presence(*impl_, "motion", Impl::As::reads);
  const Body* body = presence.seen(id);
  if (body == nullptr) return {};
  const internal::WholeMotion motion = body->solver->motion();
  return {asFloats(motion.center), asFloats(motion.velocity), asFloats(motion.angular_velocity), float(motion.mass)};
}

void World::setVelocity(BodyId id, Vec3 velocity, Vec3 angular_velocity) {
  const Impl::Presence presence(*impl_, "setVelocity", Impl::As::changes);
  Body* body = presence.seen(id);
  if (body == nullptr || !impl_->isPush(velocity, "setVelocity") || !impl_->isPush(angular_velocity, "setVelocity")) {
    return;
  }
  impl_->changed(*body);
  const internal::WholeMotion now = body->solver->motion();
  body->solver->addMotion(wide(velocity) - now.velocity, wide(angular_velocity) - now.angular_velocity, now.center);
}

Vec3 World::placeOf(BodyId id, const BodyPoint& at) const {
  const Impl::Presence presence(*impl_, "placeOf", Impl::As::reads);
  const Body* body = presence.seen(id);
  if (body == nullptr || !impl_->isOf(*body, at, "placeOf")) return {};
  return asFloats(whereIs(*body, pickedPoint(*body, at)));
}

PickId World::pick(BodyId id, const BodyPoint& at, Vec3 target, const PickSettings& settings) {
  const Impl::Presence presence(*impl_, "pick", Impl::As::changes);
  Body* body = presence.seen(id);
  if (body == nullptr || !impl_->isOf(*body, at, "pick")) return {};
  if (!internal::stateIsUsable(target, {}) || !(settings.frequency_hz > 0)) {
    impl_->tell(LogSeverity::error,
                "pick: the frequency is not above 0, the target is not finite, or the target beyond 1e15 m");
    return {};
  }
  if (!(settings.most_force >= 0)) {
    impl_->tell(LogSeverity::error, "pick: the largest force is negative or not a number");
    return {};
  }
  return impl_->guarded("pick", PickId{}, [&] {
    const PickId pick{impl_->next_pick};
    body->picks.push_back({pick.value, 0, at, pickedPoint(*body, at), target,
                           std::clamp(settings.frequency_hz, 0.1F, 100.0F), settings.most_force});
    ++impl_->next_pick;
    impl_->holdsChanged(*body);
    return pick;
  });
}

PickId World::pick(BodyId id, std::uint32_t visual_vertex, Vec3 target, float frequency_hz, float most_force) {
  return pick(id, BodyPoint::visualVertex(visual_vertex), target, {frequency_hz, most_force});
}

PickId World::pickRay(Vec3 origin, Vec3 direction, float distance, const PickSettings& settings,
                      const QueryFilter& filter) {
  const std::optional<CastHit> hit = impl_->cast("pickRay", origin, 0, direction, distance, filter);
  if (!hit || hit->object.body == formats::kNone) return {};
  return pick({hit->object.body}, hit->at, hit->point, settings);
}

PickId World::pickAlong(Vec3 origin, Vec3 direction, float distance, float radius) const {
  PickId nearest;
  const Impl::Presence presence(*impl_, "pickAlong", Impl::As::reads);
  if (!presence || !impl_->isRay("pickAlong", origin, direction, distance)) return nearest;
  double least = double(radius);
  for (const internal::BodyPointer& body : impl_->bodies) {
    if (body->picks.empty()) continue;
    impl_->showLast(*body);
    for (const internal::Pick& pick : body->picks) {
      for (const Vector3d& place : {wide(pick.target), whereIs(*body, pick.point)}) {
        const Vector3d arm = place - wide(origin);
        const double along = std::clamp(arm.dot(wide(direction)), 0.0, double(distance));
        const double off = (arm - along * wide(direction)).norm();
        if (!(off <= least)) continue;
        least = off;
        nearest = {pick.id};
      }
    }
  }
  return nearest;
}

void World::movePick(PickId id, Vec3 target) {
  const Impl::Presence presence(*impl_, "movePick", Impl::As::changes);
  const auto [body, index] = presence.find(id);
  if (body == nullptr) return;
  if (!internal::stateIsUsable(target, {})) {
    impl_->tell(LogSeverity::error, "movePick: target is not finite, or beyond 1e15 m");
    return;
  }
  body->picks[index].target = target;
  internal::wake(impl_->bodies, *body);
}

void World::lockPick(PickId id, bool locked) {
  const Impl::Presence presence(*impl_, "lockPick", Impl::As::changes);
  const auto [body, index] = presence.find(id);
  if (body != nullptr) body->picks[index].locked = locked ? 1 : 0;
}

void World::letGoPick(PickId id) {
  Impl::Presence presence(*impl_, "letGoPick", Impl::As::changes);
  const auto [body, index] = presence.find(id);
  if (body == nullptr || body->picks[index].locked != 0) return;
  presence.lend();
  releasePick(id);
}

void World::releasePick(PickId id) {
  const Impl::Presence presence(*impl_, "releasePick", Impl::As::changes);
  const auto [body, index] = presence.find(id);
  if (body == nullptr) return;
  impl_->showLast(*body);
  body->picks.erase(index);
  impl_->holdsChanged(*body);
}

void World::releasePicks(BodyId id) {
  const Impl::Presence presence(*impl_, "releasePicks", Impl::As::changes);
  Body* body = presence.find(id);
  if (body == nullptr || body->picks.empty()) return;
  impl_->showLast(*body);
  body->picks.clear();
  impl_->holdsChanged(*body);
}

void World::releasePicks() {
  Impl::Presence presence(*impl_, "releasePicks", Impl::As::changes);
  if (!presence) return;
  presence.lend();
  for (const internal::BodyPointer& body : impl_->bodies) releasePicks({body->id});
}

PickState World::pickState(PickId id) const {
  const Impl::Presence presence(*impl_, "pickState", Impl::As::reads);
  const auto [body, index] = presence.find(id);
  if (body == nullptr) return {};
  impl_->showLast(*body);
  const internal::Pick& pick = body->picks[index];
  return {{body->id}, pick.at, asFloats(whereIs(*body, pick.point)), pick.target, pick.locked != 0};
}

}  // namespace sinew

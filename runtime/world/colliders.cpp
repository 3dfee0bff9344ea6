// SPDX-License-Identifier: MIT
//
// Colliders, and what touched what.
#include <algorithm>
#include <cmath>

#include "runtime/world/world_impl.h"

namespace sinew {

std::pair<internal::Collider*, std::size_t> World::Impl::locate(ColliderId id) {
  const auto comes_before = [](const internal::Collider& collider, std::uint32_t value) { return collider.id < value; };
  internal::Collider* const place = std::lower_bound(colliders.begin(), colliders.end(), id.value, comes_before);
  const bool there = place != colliders.end() && place->id == id.value;
  return {there ? place : nullptr, std::size_t(place - colliders.begin())};
}

const internal::Collider* World::Impl::colliderOf(std::uint32_t id) const {
  if (id == kGroundCollider.value) return &ground;
  return const_cast<Impl*>(this)->locate(ColliderId{id}).first;
}

void World::Impl::forgetTouches() {
  events.clear();
  for (internal::Collider* collider = colliders.begin(); collider != colliders.end(); ++collider) {
    collider->impulse.setZero();
    collider->torque.setZero();
  }
  ground.impulse.setZero();
  ground.torque.setZero();
}

void World::Impl::gatherTouches(double seconds) {
  for (const internal::BodyPointer& body : bodies) {
    // A sleeper's forces go on.
    const double part = body->touches_in > 0 ? seconds / body->touches_in : 1;
    for (const internal::ColliderTouch& touch : body->touches) {
      auto& collider = const_cast<internal::Collider&>(*colliderOf(touch.collider));
      collider.impulse += part * touch.impulse;
      collider.torque += part * touch.torque;
    }
    findTouched(*body, touched);
    const auto missing = [&](const internal::Array<std::uint32_t>& from, const internal::Array<std::uint32_t>& in,
                             bool began) {
      for (const std::uint32_t id : from) {
        if (!std::binary_search(in.begin(), in.end(), id))
          events.push_back({body->id, ColliderId{id}, began, formats::kNone});
      }
    };
    missing(body->touched, touched, false);
    missing(touched, body->touched, true);
    body->touched.assign({touched.data(), touched.size()});
  }
}

void World::Impl::findTouching() {
  touching.clear();
  for (const internal::TouchMemory& touch : together.touching) {
    if (!(touch.depth > 0)) continue;
    const std::uint64_t a = touch.body_a, b = touch.body_b, pair = std::min(a, b) << 32 | std::max(a, b);
    if (touching.empty() || touching.back() != pair) touching.push_back(pair);
  }
  internal::sortAscending({touching.data(), touching.size()});
  touching.truncate(std::size_t(std::unique(touching.begin(), touching.end()) - touching.begin()));
}

void World::Impl::tellTouching() {
  touching_before.swap(touching);
  findTouching();
  const auto missing = [&](const internal::Array<std::uint64_t>& from, const internal::Array<std::uint64_t>& in,
                           bool began) {
    for (const std::uint64_t pair : from) {
      const auto a = std::uint32_t(pair >> 32), b = std::uint32_t(pair);
      if (std::binary_search(in.begin(), in.end(), pair)) continue;
      if (locate(BodyId{a}).first != nullptr && locate(BodyId{b}).first != nullptr) events.push_back({a, {}, began, b});
    }
  };
  missing(touching_before, touching, false);
  missing(touching, touching_before, true);
}

const char* internal::faultOf(const ColliderSettings& settings) {
  const auto isWeight = [](float value) { return value >= 0 && std::isfinite(value); };
  if (!isProper(settings.at)) return "the transform is not finite, or its rotation not proper";
  if (!(settings.friction >= 0 && settings.friction <= 1e4F)) return "ColliderSettings::friction must be 0 to 1e4";
  if (!(settings.restitution >= 0 && settings.restitution <= 1)) return "ColliderSettings::restitution must be 0 to 1";
  if (!(isWeight(settings.mass) && std::all_of(settings.inertia.begin(), settings.inertia.end(), isWeight))) {
    return "mass and inertia must be 0 or more, and finite";
  }
  if (!(settings.most_speed > 0)) return "ColliderSettings::most_speed must be above 0";
  if (!internal::asVector(settings.surface_velocity).allFinite())
    return "ColliderSettings::surface_velocity is not finite";
  return nullptr;
}

Result<ColliderId> World::addCollider(const ColliderShape& shape, const ColliderSettings& settings) {
  const Impl::Presence presence(*impl_, "addCollider", Impl::As::changes);
  if (!presence) return presence.refusal();
  return impl_->guarded(
      "addCollider", Result<ColliderId>(Error{"addCollider: out of memory"}), [&]() -> Result<ColliderId> {
        if (const char* fault = internal::Shape::faultOf(shape)) return impl_->refuse("addCollider: %s", fault);
        if (const char* fault = internal::faultOf(settings)) return impl_->refuse("addCollider: %s", fault);
        const auto& added = impl_->colliders.emplace_back(impl_->next_collider, shape, settings, impl_->memory);
        internal::wakeIn(impl_->bodies, added.bounds());
        return ColliderId{impl_->next_collider++};
      });
}

void World::moveCollider(ColliderId id, const RigidTransform& to) {
  const Impl::Presence presence(*impl_, "moveCollider", Impl::As::changes);
  internal::Collider* const collider = presence.find(id);
  if (collider == nullptr) return;
  if (!internal::isProper(to)) {
    impl_->tell(LogSeverity::error, "moveCollider: the transform is not finite and proper");
    return;
  }
  collider->target = to;
}

RigidTransform World::colliderPose(ColliderId id) const {
  RigidTransform at;
  const Impl::Presence presence(*impl_, "colliderPose", Impl::As::looks);
  const internal::Collider* const collider = presence.find(id);
  if (collider == nullptr) return at;
  for (int r = 0; r < 3; ++r) {
    at.position[std::size_t(r)] = float(collider->pose.position[r]);
    for (int c = 0; c < 3; ++c) at.rotation[3 * std::size_t(r) + std::size_t(c)] = float(collider->pose.rotation(r, c));
  }
  return at;
}

RigidTransform World::drawnPose(ColliderId id) const {
  const Impl::Presence presence(*impl_, "drawnPose", Impl::As::looks);
  const internal::Collider* const collider = presence.find(id);
  return collider != nullptr ? internal::between(collider->before, collider->at, impl_->shown) : RigidTransform{};
}

ColliderSettings World::colliderSettings(ColliderId id) const {
  const Impl::Presence presence(*impl_, "colliderSettings", Impl::As::looks);
  const internal::Collider* const collider = presence.find(id);
  return collider != nullptr ? collider->settings : ColliderSettings{};
}

bool World::setColliderSettings(ColliderId id, const ColliderSettings& settings) {
  const Impl::Presence presence(*impl_, "setColliderSettings", Impl::As::changes);
  internal::Collider* const collider = presence.find(id);
  if (collider == nullptr) return false;
  ColliderSettings wanted = settings;
  wanted.at = collider->settings.at;
  if (const char* fault = internal::faultOf(wanted)) {
    impl_->tell(LogSeverity::error, "setColliderSettings: %s", fault);
    return false;
  }
  collider->settings = wanted;
  internal::wakeIn(impl_->bodies, collider->bounds());
  return true;
}

void World::removeCollider(ColliderId id) {
  const Impl::Presence presence(*impl_, "removeCollider", Impl::As::changes);
  const internal::Collider* const collider = presence.find(id);
  if (collider == nullptr) return;
  internal::wakeIn(impl_->bodies, collider->bounds());
  impl_->colliders.erase(impl_->locate(id).second);
}

ColliderReaction World::colliderReaction(ColliderId id) const {
  ColliderReaction reaction;
  const Impl::Presence presence(*impl_, "colliderReaction", Impl::As::looks);
  if (!presence) return reaction;
  const internal::Collider* const collider = id == kGroundCollider ? &impl_->ground : presence.find(id);
  if (collider == nullptr) return reaction;
  for (int k = 0; k < 3; ++k) {
    reaction.impulse[std::size_t(k)] = float(collider->impulse[k]);
    reaction.torque_impulse[std::size_t(k)] = float(collider->torque[k]);
  }
  return reaction;
}

std::span<const ContactEvent> World::contactEvents() const {
  const Impl::Presence presence(*impl_, "contactEvents", Impl::As::looks);
  if (!presence) return {};
  return {impl_->events.data(), impl_->events.size()};
}

}  // namespace sinew

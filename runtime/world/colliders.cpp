// SPDX-License-Identifier: MIT
//
// Colliders, and what touched what.
#include <algorithm>
#include <cmath>

#include "runtime/contact/contacts.h"
#include "runtime/step/rigid.h"
#include "runtime/world/world_impl.h"

namespace sinew {

void internal::ContactSum::add(const ContactSum& other) {
  impulse += other.impulse;
  push += other.push;
  place += other.place;
  load += other.load;
  speed = std::max(speed, other.speed);
}

BodyContact internal::ContactSum::told() const {
  const auto narrow = [](const Vector3d& v) { return Vec3{float(v[0]), float(v[1]), float(v[2])}; };
  return {key[0], ColliderId{key[1]}, key[2], narrow(place / load), narrow(push.normalized()), narrow(impulse), speed};
}

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
  contact_sums.clear();
  contacts.clear();
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

void World::Impl::gatherContacts(double seconds) {
  const auto add = [this](const internal::ContactSum& sum) {
    if (sum.load > 0) contact_sums.push_back(sum);
  };
  for (const internal::BodyPointer& body : bodies) {
    const double part = body->touches_in > 0 ? seconds / body->touches_in : 1;
    for (const internal::ColliderTouch& touch : body->touches) {
      const internal::Collider& collider = *colliderOf(touch.collider);
      const Eigen::Vector3d at = collider.pose.position + touch.place / touch.load;
      add({{body->id, touch.collider, formats::kNone},
           -part * touch.impulse,
           part * touch.push,
           part * touch.push.norm() * at,
           part * touch.push.norm(),
           body->asleep() ? 0 : touch.speed});
    }
  }
  internal::forEachPair(
      {together.touching.data(), together.touching.size()}, [&](std::span<const internal::TouchMemory> touches) {
        const internal::TouchMemory& first = touches[0];
        const auto place = [this](std::uint32_t id) { return locate(BodyId{id}).first; };
        const internal::Body *const a = place(first.body_a), *const b = place(first.body_b);
        if (a == nullptr || b == nullptr) return;
        const internal::Piece& piece = a->pieces[first.piece_a];
        const Eigen::Vector3d center = internal::meanOf(piece.field(), piece.z());
        const double sign = first.body_a < first.body_b ? 1 : first.body_a > first.body_b ? -1 : 0;
        internal::ContactSum sum = {
            {std::min(first.body_a, first.body_b), formats::kNone, std::max(first.body_a, first.body_b)}};
        for (const internal::TouchMemory& touch : touches) {
          const Eigen::Vector3d force = internal::asVector(touch.force).cast<double>(),
                                normal = internal::asVector(touch.normal).cast<double>();
          const double load = seconds * normal.dot(force);
          if (!(load > 0)) continue;
          sum.impulse += sign * seconds * force;
          sum.push += sign * load * normal;
          sum.place += load * internal::positionOf(piece.field(), touch.point, piece.z(), center);
          sum.load += load;
          if (!a->asleep()) sum.speed = std::max(sum.speed, touch.speed);
        }
        add(sum);
      });
  std::sort(contact_sums.begin(), contact_sums.end(), [](const auto& x, const auto& y) { return x.key < y.key; });
  std::size_t kept = 0;
  for (const internal::ContactSum& sum : contact_sums) {
    if (kept == 0 || contact_sums[kept - 1].key != sum.key) {
      contact_sums[kept++] = sum;
    } else {
      contact_sums[kept - 1].add(sum);
    }
  }
  contact_sums.truncate(kept);
  contacts.clear();
  for (const internal::ContactSum& sum : contact_sums) contacts.push_back(sum.told());
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

std::span<const BodyContact> World::contacts() const {
  const Impl::Presence presence(*impl_, "contacts", Impl::As::looks);
  if (!presence) return {};
  return {impl_->contacts.data(), impl_->contacts.size()};
}

}  // namespace sinew

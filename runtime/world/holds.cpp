// SPDX-License-Identifier: MIT
//
// Pins, pin sets and activation.
#include <algorithm>
#include <cmath>

#include "runtime/interact/pin_sets.h"
#include "runtime/world/world_impl.h"

namespace sinew {

using internal::Body;

std::pair<Body*, std::size_t> World::Impl::findPinSet(PinSetId id) const {
  for (const internal::BodyPointer& body : bodies) {
    for (std::size_t i = 0; i < body->pin_sets.size(); ++i) {
      if (body->pin_sets[i].id == id.value) return {body.get(), i};
    }
  }
  return {nullptr, 0};
}

void World::pin(BodyId id, std::uint32_t vertex, Vec3 target) {
  const Impl::Presence presence(*impl_, "pin", Impl::As::changes);
  Body* body = presence.find(id);
  if (body == nullptr) return;
  if (vertex >= body->vertexCount() || !internal::stateIsUsable(target, {})) {
    impl_->tell(LogSeverity::error, "pin: body %u has no vertex %u, or the target is not finite or beyond 1e15 m",
                id.value, vertex);
    return;
  }
  for (const internal::PinSet& set : body->pin_sets) {
    for (const internal::PinnedVertex& held : set.vertices) {
      if (held.vertex == vertex) return;
    }
  }
  const auto place = std::lower_bound(body->pins.begin(), body->pins.end(), vertex,
                                      [](const internal::Pin& pin, std::uint32_t v) { return pin.vertex < v; });
  if (place != body->pins.end() && place->vertex == vertex) {
    place->target = target;
    internal::wake(impl_->bodies, *body);
    return;
  }
  impl_->guarded("pin", false, [&] {
    impl_->showLast(*body);
    body->pins.insert(std::size_t(place - body->pins.begin()), {vertex, target, target, target});
    body->pinned[vertex] = 1;
    impl_->holdsChanged(*body);
    return true;
  });
}

void World::unpin(BodyId id, std::uint32_t vertex) {
  const Impl::Presence presence(*impl_, "unpin", Impl::As::changes);
  Body* body = presence.find(id);
  if (body == nullptr || vertex >= body->vertexCount() || body->pinned[vertex] == 0) return;
  const auto held = std::find_if(body->pins.begin(), body->pins.end(),
                                 [vertex](const internal::Pin& pin) { return pin.vertex == vertex; });
  if (held == body->pins.end()) return;
  impl_->showLast(*body);
  body->pins.erase(std::size_t(held - body->pins.begin()));
  body->pinned[vertex] = 0;
  impl_->holdsChanged(*body);
}

void World::unpinAll(BodyId id) {
  const Impl::Presence presence(*impl_, "unpinAll", Impl::As::changes);
  Body* body = presence.seen(id);
  if (body == nullptr) return;
  for (const internal::Pin& pin : body->pins) body->pinned[pin.vertex] = 0;
  body->pins.clear();
  internal::removePinSets(*body);
  impl_->holdsChanged(*body);
}

Result<PinSetId> World::addPinSet(BodyId id, std::span<const std::uint32_t> vertices, const RigidTransform& at,
                                  PinMethod method) {
  const Impl::Presence presence(*impl_, "addPinSet", Impl::As::changes);
  if (!presence) return presence.refusal();
  Body* body = presence.seen(id);
  if (body == nullptr) return Error{"addPinSet: no such body"};
  return impl_->guarded("addPinSet", Result<PinSetId>(Error{"addPinSet: out of memory"}), [&]() -> Result<PinSetId> {
    if (!internal::isProper(at))
      return impl_->refuse("addPinSet: the transform is not finite, or its rotation not proper");
    if (method > PinMethod::constrained_fit) return impl_->refuse("addPinSet: no such method");
    internal::PinSet set(impl_->memory);
    set.id = impl_->next_pin_set;
    set.method = method;
    set.before = set.at = set.target = at;
    const auto weights = body->package().pinWeights();
    const auto weightOf = [&](std::uint32_t vertex) { return weights.empty() ? 1.0F : weights[vertex]; };
    internal::Array<std::uint64_t> held(impl_->memory);
    for (const std::uint32_t vertex : vertices) {
      if (vertex >= body->vertexCount()) return impl_->refuse("addPinSet: vertex %u does not exist", vertex);
      if (body->pinned[vertex] != 0) return impl_->refuse("addPinSet: vertex %u is pinned already", vertex);
      if (weightOf(vertex) > 0) held.push_back(vertex);
    }
    internal::sortAscending(held);
    for (const std::uint64_t key : held) {
      const std::uint32_t vertex = std::uint32_t(key);
      if (!set.vertices.empty() && set.vertices.back().vertex == vertex) {
        return impl_->refuse("addPinSet: vertex %u is given twice", vertex);
      }
      set.vertices.push_back({vertex, weightOf(vertex)});
    }
    if (set.vertices.empty()) return impl_->refuse("addPinSet: no vertex with a pin weight above 0");
    internal::addPinSet(*body, std::move(set));
    impl_->holdsChanged(*body);
    return PinSetId{impl_->next_pin_set++};
  });
}

void World::movePinSet(PinSetId id, const RigidTransform& to) {
  const Impl::Presence presence(*impl_, "movePinSet", Impl::As::changes);
  const auto [body, index] = presence.find(id);
  if (body == nullptr) return;
  if (!internal::isProper(to)) {
    impl_->tell(LogSeverity::error, "movePinSet: the transform is not finite and proper");
    return;
  }
  body->pin_sets[index].target = to;
  internal::wake(impl_->bodies, *body);
}

void World::removePinSet(PinSetId id) {
  const Impl::Presence presence(*impl_, "removePinSet", Impl::As::changes);
  const auto [body, index] = presence.find(id);
  if (body == nullptr) return;
  impl_->showLast(*body);
  internal::removePinSet(*body, index);
  impl_->holdsChanged(*body);
}

PinSetId World::pinSet(BodyId id, std::string_view name) const {
  const Impl::Presence presence(*impl_, "pinSet", Impl::As::looks);
  const Body* body = presence.find(id);
  if (body == nullptr) return {};
  for (const internal::PinSet& set : body->pin_sets) {
    if (set.source == formats::kNone) continue;
    if (body->package().text(body->package().pinSets()[set.source].name) == name) return PinSetId{set.id};
  }
  return {};
}

std::uint32_t World::movePinTarget(BodyId id, std::string_view target, const RigidTransform& to) {
  const Impl::Presence presence(*impl_, "movePinTarget", Impl::As::changes);
  Body* body = presence.find(id);
  if (body == nullptr) return 0;
  if (!internal::isProper(to)) {
    impl_->tell(LogSeverity::error, "movePinTarget: the transform is not finite and proper");
    return 0;
  }
  std::uint32_t moved = 0;
  for (internal::PinSet& set : body->pin_sets) {
    if (set.source == formats::kNone) continue;
    if (body->package().text(body->package().pinSets()[set.source].target) != target) continue;
    set.target = to;
    ++moved;
  }
  if (moved > 0) internal::wake(impl_->bodies, *body);
  return moved;
}

RigidTransform World::drawnPose(PinSetId id) const {
  const Impl::Presence presence(*impl_, "drawnPose", Impl::As::looks);
  const auto [body, index] = presence.find(id);
  if (body == nullptr) return {};
  const internal::PinSet& set = body->pin_sets[index];
  return internal::between(set.before, set.at, impl_->shown);
}

PinReaction World::pinReaction(PinSetId id) const {
  const Impl::Presence presence(*impl_, "pinReaction", Impl::As::looks);
  const auto [body, index] = presence.find(id);
  PinReaction reaction;
  if (body == nullptr) return reaction;
  const internal::PinSet& set = body->pin_sets[index];
  for (int k = 0; k < 3; ++k) {
    reaction.force[std::size_t(k)] = float(set.force_sum[k]);
    reaction.torque[std::size_t(k)] = float(set.torque_sum[k]);
  }
  return reaction;
}

bool World::setActivation(BodyId id, std::uint32_t channel, float value) {
  const Impl::Presence presence(*impl_, "setActivation", Impl::As::changes);
  Body* body = presence ? impl_->find(id) : nullptr;
  if (body == nullptr || channel >= body->activation.size() || std::isnan(value)) return false;
  const float wanted = value > 0 ? std::min(value, 1.0F) : 0.0F;
  if (body->activation[channel] == wanted) return true;
  return impl_->guarded("setActivation", false, [&] {
    body->activation[channel] = wanted;
    body->solver->activationChanged();
    internal::wake(impl_->bodies, *body);
    return true;
  });
}

bool World::setActivation(BodyId id, std::string_view channel, float value) {
  Impl::Presence presence(*impl_, "setActivation", Impl::As::changes);
  const Body* body = presence ? impl_->find(id) : nullptr;
  if (body == nullptr) return false;
  presence.lend();
  const auto channels = body->package().channels();
  for (std::uint32_t c = 0; c < channels.size(); ++c) {
    if (body->package().text(channels[c].name) == channel) return setActivation(id, c, value);
  }
  return false;
}

}  // namespace sinew

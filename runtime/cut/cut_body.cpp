// SPDX-License-Identifier: MIT
#include <algorithm>
#include <chrono>
#include <new>
#include <vector>

#include "runtime/world/world_impl.h"
#include "sinew/runtime/cut.h"

namespace sinew {

namespace internal {
struct WorldAccess {
  static World::Impl& of(World& world) { return *world.impl_; }
};
}  // namespace internal

namespace {

using internal::Body;
using internal::PinSet;

Body* find(World& world, BodyId id) {
  for (const internal::BodyPointer& body : internal::WorldAccess::of(world).bodies) {
    if (body->id == id.value) return body.get();
  }
  return nullptr;
}

/// What holds and pulls a body, copied: it is gone when its parts are given theirs.
struct Holds {
  struct Set {
    PinSetId id;
    std::uint32_t source;
    PinMethod method;
    RigidTransform before, at, target;
    std::vector<std::uint32_t> vertices;
  };
  std::vector<Set> sets;
  std::vector<internal::Pin> pins;
  std::vector<internal::Pick> picks;
  std::vector<float> activation;
};

Holds holdsOf(const Body& body) {
  Holds holds;
  for (const PinSet& set : body.pin_sets) {
    Holds::Set& made = holds.sets.emplace_back();
    made.id = {set.id};
    made.source = set.source;
    made.method = set.method;
    made.before = set.before;
    made.at = set.at;
    made.target = set.target;
    for (const internal::PinnedVertex& v : set.vertices) made.vertices.push_back(v.vertex);
  }
  holds.pins.assign(body.pins.begin(), body.pins.end());
  holds.picks.assign(body.picks.begin(), body.picks.end());
  holds.activation.assign(body.activation.begin(), body.activation.end());
  return holds;
}

class Heirs {
 public:
  Heirs(World& world, const Asset& parent, const Holds& holds, CutBodies& result)
      : world_(world), parent_(parent), holds_(holds), result_(result) {}

  /// What the state of a part depends on: before setState().
  void prepare(std::size_t p) {
    const CutPart& part = result_.cut.parts[p];
    const BodyId id = result_.bodies[p];
    local_.assign(parent_.package().physicalVertices().size(), formats::kNone);
    for (std::uint32_t i = 0; i < part.physical.size(); ++i) {
      if (part.own[i] != 0) local_[part.physical[i]] = i;
    }
    takePackageSets(id);
    for (std::uint32_t c = 0; c < holds_.activation.size(); ++c) {
      if (holds_.activation[c] > 0) world_.setActivation(id, c, holds_.activation[c]);
    }
  }

  /// What acts on the state: after setState().
  void hold(std::size_t p) {
    const CutPart& part = result_.cut.parts[p];
    const BodyId id = result_.bodies[p];
    for (const internal::Pin& pin : holds_.pins) {
      if (local_[pin.vertex] != formats::kNone) world_.pin(id, local_[pin.vertex], pin.target);
    }
    for (const Holds::Set& set : holds_.sets) {
      if (set.source != formats::kNone) continue;
      std::vector<std::uint32_t> vertices;
      for (const std::uint32_t v : set.vertices) {
        if (local_[v] != formats::kNone) vertices.push_back(local_[v]);
      }
      if (vertices.empty()) continue;
      const Result<PinSetId> made = world_.addPinSet(id, vertices, set.at, set.method);
      if (!made) continue;
      world_.movePinSet(*made, set.target);
      result_.pin_sets.push_back({set.id, *made, id});
    }
    for (const internal::Pick& pick : holds_.picks) {
      for (std::uint32_t v = 0; v < part.visual.size(); ++v) {
        if (part.visual[v].a != pick.visual_vertex || part.visual[v].b != pick.visual_vertex) continue;
        const PickId made = world_.pick(id, v, pick.target, pick.frequency_hz, pick.most_force);
        result_.picks.push_back({{pick.id}, made, id});
        break;
      }
    }
  }

 private:
  /// The package's sets are there from the start: they go to where the body's were, or go where it had let go of them.
  void takePackageSets(BodyId id) {
    const formats::PackageView& package = parent_.package();
    std::vector<std::uint32_t> source;  // of the part's sets: the parent's
    for (std::uint32_t s = 0; s < package.pinSets().size(); ++s) {
      const formats::PinSet& set = package.pinSets()[s];
      const auto vertices = package.pinSetVertices().subspan(set.first, set.count);
      if (std::any_of(vertices.begin(), vertices.end(),
                      [this](std::uint32_t v) { return local_[v] != formats::kNone; })) {
        source.push_back(s);
      }
    }
    std::vector<PinSetId> gone;
    for (PinSet& set : find(world_, id)->pin_sets) {
      if (set.source == formats::kNone) continue;
      const auto held = std::find_if(holds_.sets.begin(), holds_.sets.end(),
                                     [&](const Holds::Set& one) { return one.source == source[set.source]; });
      if (held == holds_.sets.end()) {
        gone.push_back({set.id});
        continue;
      }
      set.before = held->before;
      set.at = held->at;
      set.target = held->target;
      result_.pin_sets.push_back({held->id, {set.id}, id});
    }
    for (const PinSetId set : gone) world_.removePinSet(set);
  }

  World& world_;
  const Asset& parent_;
  const Holds& holds_;
  CutBodies& result_;
  std::vector<std::uint32_t> local_;  // of the parent's vertices: the part's, where they lie on its side
};

Result<CutBodies> cutSound(World& world, BodyId id, const CutPlane& plane, const CutSettings& settings) {
  const std::span<const Vec3> positions = world.positions(id), velocities = world.velocities(id);
  const Body* const body = find(world, id);
  const std::shared_ptr<const Asset> asset = body->asset;
  Result<CutResult> cut = cutAsset(*asset, positions, plane, settings);
  if (!cut) return Error{cut.reason()};
  const auto start = std::chrono::steady_clock::now();
  CutBodies result;
  result.cut = std::move(*cut);
  const BodySettings body_settings = body->settings;
  const Holds holds = holdsOf(*body);
  Heirs heirs(world, *asset, holds, result);
  for (std::size_t p = 0; p < result.cut.parts.size(); ++p) {
    const CutPart& part = result.cut.parts[p];
    const Result<BodyId> made = world.addBody(part.asset, body_settings);
    if (!made) {
      for (const BodyId other : result.bodies) world.removeBody(other);
      return Error{made.reason()};
    }
    result.bodies.push_back(*made);
    heirs.prepare(p);
    std::vector<Vec3> x, v;
    x.reserve(part.physical.size());
    v.reserve(part.physical.size());
    for (const std::uint32_t vertex : part.physical) {
      x.push_back(positions[vertex]);
      v.push_back(velocities[vertex]);
    }
    world.setState(*made, x, v);
    heirs.hold(p);
  }
  world.removeBody(id);
  result.cut.times.bodies = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace

Result<CutBodies> cutBody(World& world, BodyId body, const CutPlane& plane, const CutSettings& settings) {
  if (!world.contains(body)) return Error{"cutBody: no such body"};
  if (internal::WorldAccess::of(world).present.load() != 0) return Error{"cutBody: another thread uses this world"};
  try {
    return cutSound(world, body, plane, settings);
  } catch (const std::bad_alloc&) {
    return Error{"out of memory"};
  }
}

}  // namespace sinew

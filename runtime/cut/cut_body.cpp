// SPDX-License-Identifier: MIT
#include <algorithm>
#include <chrono>
#include <new>
#include <vector>

#include "runtime/solver/plasticity.h"
#include "runtime/world/world_impl.h"
#include "sinew/runtime/cut.h"

namespace sinew {

namespace {

using internal::Body;
using internal::Piece;
using internal::PinSet;
using internal::WorldAccess;

Body* find(World& world, BodyId id) {
  for (const internal::BodyPointer& body : WorldAccess::of(world).bodies) {
    if (body->id == id.value) return body.get();
  }
  return nullptr;
}

/// Holds of a body, copied: the body is gone when its parts are given theirs.
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

  /// Gives a part pin sets and activation for setState().
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

  /// The memory of the parent's matter: after setState().
  void remember(std::size_t p, const Body& parent) {
    const CutPart& part = result_.cut.parts[p];
    Body& body = *find(world_, result_.bodies[p]);
    for (std::size_t i = 0; i < body.pieces.size(); ++i) {
      const std::uint32_t vertex = part.physical[body.package().pieces()[i].first_vertex];
      const auto from = std::find_if(
          parent_.package().pieces().begin(), parent_.package().pieces().end(),
          [vertex](const formats::PieceRange& range) { return vertex - range.first_vertex < range.vertex_count; });
      const Piece& source = parent.pieces[std::size_t(from - parent_.package().pieces().begin())];
      takePlasticity(source, body.pieces[i]);
      takeTouching(source, body.pieces[i]);
    }
  }

  /// Holds act on the state: after setState().
  void hold(std::size_t p, Activity activity) {
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
    for (const internal::Pick& pick : holds_.picks) takePick(pick, part, id);
    world_.setActivity(id, activity);
  }

 private:
  /// The part that has all corners of its point takes it; of a triangle that is cut the nearest one counts.
  void takePick(const internal::Pick& pick, const CutPart& part, BodyId id) {
    const auto here = [&](std::uint32_t vertex) {
      if (pick.at.physical != 0) return local_[vertex];
      const auto same = [vertex](const CutOrigin& from) { return from.a == vertex && from.b == vertex; };
      const auto place = std::find_if(part.visual.begin(), part.visual.end(), same);
      return place != part.visual.end() ? std::uint32_t(place - part.visual.begin()) : formats::kNone;
    };
    BodyPoint at = pick.at;
    const auto nearest = std::size_t(std::max_element(at.weight.begin(), at.weight.end()) - at.weight.begin());
    if (here(at.vertex[nearest]) == formats::kNone) return;
    bool whole = true;
    for (std::size_t c = 0; c < 3; ++c) {
      at.vertex[c] = pick.at.weight[c] != 0 ? here(pick.at.vertex[c]) : 0;
      whole = whole && at.vertex[c] != formats::kNone;
    }
    if (!whole) at = {{at.vertex[nearest], 0, 0}, {1, 0, 0}, at.physical};
    const PickId made = world_.pick(id, at, pick.target, {pick.frequency_hz, pick.most_force});
    if (pick.locked != 0) world_.lockPick(made);
    result_.picks.push_back({{pick.id}, made, id});
  }

  /// Samples keep the rest shape that they have flowed to; new ones have the nearest one's.
  static void takePlasticity(const Piece& from, Piece& to) {
    if (from.state.plastic.empty() || to.state.plastic.empty()) return;
    internal::Array<float> shapes(to.state.plastic.memory());
    shapes.assign({from.state.plastic.data(), from.state.plastic.size()});
    internal::movePlasticity(from.field(), to.field(), shapes);
    to.state.plastic.swap(shapes);
    internal::invertPlasticity(to.state.plastic, to.rest_change);
  }

  /// Touching points keep touching colliders: a part's points are some of its parent's in their order, then the
  /// section's.
  static void takeTouching(const Piece& from, Piece& to) {
    const auto before = from.field().points, now = to.field().points;
    std::vector<std::uint32_t> number(before.size(), formats::kNone);
    for (std::uint32_t i = 0, next = 0; i < before.size() && next < now.size(); ++i) {
      if (before[i].at == now[next].at) number[i] = next++;
    }
    for (internal::TouchingPoint touching : from.state.touching) {
      if (touching.point >= number.size()) continue;  // a collider's own
      touching.point = number[touching.point];
      if (touching.point != formats::kNone) to.state.touching.push_back(touching);
    }
  }

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

/// On refusal the parts that are there already go.
struct Undo {
  World& world;
  const std::vector<BodyId>& bodies;
  bool done = false;

  Undo(World& of, const std::vector<BodyId>& parts) : world(of), bodies(parts) {}
  Undo(const Undo&) = delete;
  Undo& operator=(const Undo&) = delete;
  ~Undo() {
    if (done) return;
    for (const BodyId body : bodies) world.removeBody(body);
  }
};

/// Where the functions have the vertices: what is held is shown where it is held, which is no state.
std::vector<Vec3> placesOf(const Body& body, std::span<const Vec3> shown) {
  std::vector<Vec3> places(shown.begin(), shown.end());
  for (const Piece& piece : body.pieces) {
    const internal::Field& field = piece.field();
    for (std::uint32_t i = 0; i < field.vertex_count; ++i) {
      Eigen::Vector3d x = Eigen::Vector3d::Zero();
      for (std::uint32_t j = 0; j < field.k; ++j) x += double(field.valueAt(i, j)) * piece.state.z[j];
      for (std::size_t a = 0; a < 3; ++a) places[field.first_vertex + i][a] = float(x[int(a)]);
    }
  }
  return places;
}

Result<CutBodies> cutSound(World& world, BodyId id, const CutPlane& plane, const CutSettings& settings) {
  WorldAccess::Presence presence(WorldAccess::of(world), "cutBody", WorldAccess::As::changes);
  if (!presence) return presence.refusal();
  const Body* const body = presence.seen(id);
  if (body == nullptr) return Error{"cutBody: no such body"};
  const std::span<const Vec3> positions = body->positions(), velocities(body->v.data(), body->vertexCount());
  const std::shared_ptr<const Asset> asset = body->asset;
  CutSettings with_jobs = settings;
  if (with_jobs.jobs == nullptr) with_jobs.jobs = WorldAccess::of(world).jobs;
  Result<CutResult> cut = cutAsset(*asset, positions, plane, with_jobs);
  if (!cut) return Error{cut.reason()};
  presence.lend();  // not before: jobs of others may run in this thread meanwhile, or this call go on in another
  const auto start = std::chrono::steady_clock::now();
  CutBodies result;
  result.cut = std::move(*cut);
  const BodySettings body_settings = body->settings;
  const Holds holds = holdsOf(*body);
  Heirs heirs(world, *asset, holds, result);
  Undo undo(world, result.bodies);
  const std::vector<Vec3> places = placesOf(*body, positions);
  for (std::size_t p = 0; p < result.cut.parts.size(); ++p) {
    const CutPart& part = result.cut.parts[p];
    const Result<BodyId> made = world.addBody(part.asset, body_settings);
    if (!made) return Error{made.reason()};
    result.bodies.push_back(*made);
    heirs.prepare(p);
    std::vector<Vec3> x, v;
    x.reserve(part.physical.size());
    v.reserve(part.physical.size());
    for (const std::uint32_t vertex : part.physical) {
      x.push_back(places[vertex]);
      v.push_back(velocities[vertex]);
    }
    world.setState(*made, x, v);
    heirs.remember(p, *body);
    heirs.hold(p, body->activity);
  }
  undo.done = true;
  world.removeBody(id);
  result.cut.times.bodies = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace

Result<CutBodies> cutBody(World& world, BodyId body, const CutPlane& plane, const CutSettings& settings) {
  try {
    return cutSound(world, body, plane, settings);
  } catch (const std::bad_alloc&) {
    return Error{"out of memory"};
  }
}

}  // namespace sinew

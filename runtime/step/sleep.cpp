// SPDX-License-Identifier: MIT
#include "runtime/step/sleep.h"

#include <algorithm>
#include <cmath>

#include "runtime/solver/springs.h"
#include "runtime/step/piece_step.h"

namespace sinew::internal {
namespace {

/// Mean speed below which a body rests, rms, diagonals per second: over the time after which it sleeps, for what hums
/// goes nowhere at any speed.
constexpr double kResting = 1e-3;
/// What flows has to rest so many times as long: sleep ends creep only where that goes a percent in a minute at most.
constexpr double kFlowing = 10;
/// Of that time a step counts so much at most: long ones stop all that moves.
constexpr double kPart = 0.1;

/// Whether something holds or carries every piece: what floats may drift as slowly as it likes.
bool isSupported(const Body& body) {
  return std::all_of(body.pieces.begin(), body.pieces.end(), [&body](const Piece& piece) {
    const PieceState& state = piece.state;
    return state.leaning || !state.touching.empty() || piece.field().driven > 0 || hasSprings(body, piece);
  });
}

/// Whether all pieces are where they came to rest.
bool isStill(const Body& body, double seconds) {
  const double most = kResting * seconds * double(body.package().info().diagonal);
  return std::all_of(body.pieces.begin(), body.pieces.end(), [most](const Piece& piece) {
    const PieceState& state = piece.state;
    double squared = 0;
    for (std::uint32_t j = 0; j < state.z.size(); ++j) squared += (state.z[j] - state.z_rest[j]).squaredNorm();
    return squared < most * most * piece.field().mass;
  });
}

/// Whether it has rested for long enough to sleep. Plastic flow leaves no known energy.
bool hasRested(const Body& body, double seconds) {
  const bool flows = std::any_of(body.pieces.begin(), body.pieces.end(),
                                 [](const Piece& piece) { return piece.field().plastic && piece.state.elastic < 0; });
  return !body.pieces.empty() && body.still >= (flows ? kFlowing : 1) * seconds;
}

}  // namespace

void fallAsleep(Body& body, std::uint32_t group) {
  body.sleeps_with = group;
  body.outdated = true;
  for (Piece& piece : body.pieces) {
    PieceState& state = piece.state;
    std::copy(state.z.begin(), state.z.end(), state.z_before.begin());
    for (Array<Vector3d>* array : {&state.v, &state.v_before})
      std::fill(array->begin(), array->end(), Vector3d::Zero());
    state.turn.setZero();
    state.omega.setZero();
    state.h_before = 0;
    piece.box = boxOf(body, piece, Vector3d::Zero(), 0);
  }
}

void letSleep(BodyList& bodies, const WorldSettings& settings, double seconds, TogetherScratch& scratch) {
  if (!(settings.sleep_seconds > 0)) return;
  bool ready = false;
  for (const BodyPointer& body : bodies) {
    if (body->asleep() || body->pieces.empty()) continue;
    if (isStill(*body, double(settings.sleep_seconds)) && isSupported(*body)) {
      body->still += std::min(seconds, kPart * double(settings.sleep_seconds));
      ready = ready || hasRested(*body, double(settings.sleep_seconds));
      continue;
    }
    body->still = 0;
    for (Piece& piece : body->pieces) std::copy(piece.state.z.begin(), piece.state.z.end(), piece.state.z_rest.begin());
  }
  if (!ready) return;
  // Bodies that touch share a root, the first of them.
  Array<std::uint32_t>& parent = scratch.parent;
  parent.resize(bodies.size());
  for (std::uint32_t i = 0; i < bodies.size(); ++i) parent[i] = i;
  forEachPair({scratch.touching.data(), scratch.touching.size()}, [&](std::span<const TouchMemory> touches) {
    const std::uint32_t a = rootOf(parent, placeOf(bodies, touches[0].body_a)),
                        b = rootOf(parent, placeOf(bodies, touches[0].body_b));
    parent[std::max(a, b)] = std::min(a, b);
  });
  // A root is marked where one of its bodies has not rested long enough.
  const auto rested = [&](const Body& body) {
    return body.asleep() || hasRested(body, double(settings.sleep_seconds));
  };
  constexpr std::uint32_t kAwake = 0x80000000U;
  for (std::uint32_t i = 0; i < bodies.size(); ++i) parent[i] = rootOf(parent, i);
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    const std::uint32_t root = parent[i] & ~kAwake;
    if (!rested(*bodies[i])) parent[root] |= kAwake;
  }
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    const std::uint32_t root = parent[i] & ~kAwake;
    if ((parent[root] & kAwake) == 0 && !bodies[i]->asleep()) fallAsleep(*bodies[i], bodies[root]->id);
  }
}

void wake(BodyList& bodies, Body& body) {
  body.still = 0;
  if (!body.asleep() || body.activity != Activity::active) return;
  const std::uint32_t group = body.sleeps_with;
  for (const BodyPointer& other : bodies) {
    if (other->sleeps_with != group || other->activity != Activity::active) continue;
    other->sleeps_with = formats::kNone;
    other->still = 0;
  }
}

void wakeAll(BodyList& bodies) {
  for (const BodyPointer& body : bodies) {
    if (body->activity == Activity::active) body->sleeps_with = formats::kNone;
    body->still = 0;
  }
}

void wakeIn(BodyList& bodies, const Eigen::AlignedBox3d& box) {
  for (const BodyPointer& body : bodies) {
    if (!body->asleep()) continue;
    const bool meets = std::any_of(body->pieces.begin(), body->pieces.end(),
                                   [&box](const Piece& piece) { return piece.box.intersects(box); });
    if (meets) wake(bodies, *body);
  }
}

}  // namespace sinew::internal

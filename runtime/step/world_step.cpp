// SPDX-License-Identifier: MIT
//
// One step of the world: every body by its solver, a thread on each.
#include "runtime/step/world_step.h"

#include <algorithm>
#include <atomic>

#include "runtime/interact/pin_sets.h"
#include "runtime/solver/cluster_solver.h"
#include "runtime/step/body_state.h"
#include "runtime/step/sleep.h"

namespace sinew::internal {

void growScratch(const BodyList& bodies, std::span<const Collider* const> colliders, StepScratch& scratch,
                 const JobSystem* jobs) {
  const std::size_t at_once = jobs != nullptr ? std::clamp<std::size_t>(jobs->concurrency(), 1, 64) : 1;
  while (scratch.size() < std::min(at_once, std::max<std::size_t>(bodies.size(), 1))) {
    scratch.emplace_back(scratch.memory());
  }
  for (SolverScratch& lane : scratch) {
    for (const BodyPointer& body : bodies) {
      body->solver->reserve(lane);
      for (Piece& piece : body->pieces) {
        for (const Field* field : {piece.free, piece.fixed}) {
          if (field == nullptr) continue;
          lane.pieces.contacts.reserveNear(*field, colliders);
          if (!areAllPlanes(colliders)) piece.state.touching.reserve(mostTouching(*field));
        }
      }
    }
  }
  const std::size_t most = std::min<std::size_t>(colliders.size(), kMostContacts);
  for (const BodyPointer& body : bodies) {
    body->touches.reserve(body->pieces.size() * most);
    body->touched.reserve(most);
  }
}

void stepWorld(BodyList& bodies, StepScratch& scratch, TogetherScratch& together, const StepWorld& world,
               JobSystem* jobs, double seconds, double share) {
  for (const BodyPointer& body : bodies) {
    if (!body->asleep()) {
      body->solver->beginStep(seconds);
    } else if (body->fade_before > 0) {
      passFade(*body, seconds);
    }
  }
  if (std::all_of(bodies.begin(), bodies.end(), [](const BodyPointer& body) { return body->asleep(); })) return;
  growScratch(bodies, world.colliders, scratch, jobs);
  if (world.settings.sleep_seconds > 0) together.parent.reserve(bodies.size());
  findPairs(bodies, world.settings, seconds, together, jobs);
  // Each lane takes the next body that nobody has taken. Bodies that touch no other share nothing, so it does not
  // matter which.
  std::atomic<std::size_t> next = 0;
  const auto run = [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t lane = begin; lane < end; ++lane) {
      for (std::size_t i = next++; i < bodies.size(); i = next++) {
        if (bodies[i]->asleep()) continue;
        moveHolds(*bodies[i], share);
        bodies[i]->touches.clear();
        bodies[i]->touches_in = seconds;
        if (together.busy[i] != 0) continue;
        bodies[i]->solver->step(world, seconds, scratch[lane]);
      }
    }
  };
  if (jobs == nullptr || scratch.size() == 1 || bodies.size() == 1) {
    run(0, 1);
  } else {
    // One reference is all that is captured, which std::function stores in place: no allocation.
    jobs->parallelFor(std::uint32_t(scratch.size()), 1,
                      [&run](std::uint32_t begin, std::uint32_t end) { run(begin, end); });
  }
  if (together.pairs.empty()) {
    together.next_touching.clear();
    keepSleeping(bodies, together);
    together.touching.swap(together.next_touching);
  } else {
    stepTogether(bodies, world, seconds, together, jobs);
  }
  letSleep(bodies, world.settings, seconds, together);
}

}  // namespace sinew::internal

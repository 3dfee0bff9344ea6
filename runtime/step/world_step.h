// SPDX-License-Identifier: MIT
#pragma once

#include <memory_resource>

#include "runtime/memory/array.h"
#include "runtime/step/piece_step.h"
#include "runtime/step/together.h"
#include "runtime/world/body.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// Memory that stepping one body takes beside its state: much for a short time, so bodies share it.
struct SolverScratch {
  explicit SolverScratch(std::pmr::memory_resource* memory) : pieces(memory), vertices(memory) {}

  PieceScratch pieces;
  Array<Vec3> vertices;
};

/// Scratch of a world: one for each body that may be stepped at the same time, each large enough for every body.
using StepScratch = OwningArray<SolverScratch>;

/// Grows the scratch to what all bodies and colliders take, so that steps do not allocate, nor jobs at any time.
void growScratch(const BodyList& bodies, std::span<const Collider* const> colliders, StepScratch& scratch,
                 const JobSystem* jobs);

/// Advances all bodies by one step, side by side. \param share of the way to their targets that holds go. \param
/// scratch grown where bodies have come. \param jobs may be null.
void stepWorld(BodyList& bodies, StepScratch& scratch, TogetherScratch& together, const StepWorld& world,
               JobSystem* jobs, double seconds, double share);

}  // namespace sinew::internal

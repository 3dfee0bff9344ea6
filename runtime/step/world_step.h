// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <memory_resource>
#include <vector>

#include "runtime/memory/array.h"
#include "runtime/step/piece_step.h"
#include "runtime/world/body.h"
#include "sinew/runtime/world.h"

namespace sinew::internal {

enum StepPhase : std::uint32_t { kPredict, kMoments, kRows, kMatch, kSolve, kGoals, kSettle, kStepPhaseCount };

/// Milliseconds by phase.
using StepTimes = std::array<double, kStepPhaseCount>;

/// What stepping one body takes beside its state: much memory for a short time, so bodies share it.
struct BodyScratch {
  BodyScratch(std::pmr::memory_resource* memory, LineMemory* lines)
      : pass(lines),
        piece(memory),
        rows(memory),
        frames(memory),
        responses(memory),
        solver_rows(memory),
        terms(memory),
        answers(memory) {}

  PassScratch pass;
  PieceScratch piece;
  // Of the solver of rows.
  Array<Row> rows;
  Array<ClusterFrame> frames;
  Array<ClusterResponse> responses;
  Array<SolverRow> solver_rows;
  Array<RowTerm> terms;
  Array<ClusterAnswer> answers;
};

/// Scratch of a world: one BodyScratch for each body that may be stepped at the same time. The first is large enough
/// for every body, the others for those that are stepped side by side.
struct StepScratch {
  explicit StepScratch(std::pmr::memory_resource* memory) : lines(memory), lanes(memory) {}

  /// The first lane's scratch of a pass, grown for `body`: for what is done between steps.
  PassScratch& passOf(const Body& body);

  LineMemory lines;
  OwningArray<BodyScratch> lanes;

 private:
  friend void growScratch(const BodyList&, StepScratch&, const WorldSettings&, const JobSystem*);
  void addLane() { lanes.emplace_back(lanes.memory(), &lines); }
};

/// Sizes the scratch for the worst case of all bodies, so that steps do not allocate, nor jobs at any time.
void growScratch(const BodyList& bodies, StepScratch& scratch, const WorldSettings& settings, const JobSystem* jobs);

/// Advances all bodies by one step. \param scratch grown where bodies, pins or picks have come. \param jobs may be
/// null. \param times null, or where phases are added up (bodies that share jobs count into the first phase).
void stepWorld(BodyList& bodies, StepScratch& scratch, const WorldSettings& settings, JobSystem* jobs, float seconds,
               StepTimes* times);

}  // namespace sinew::internal

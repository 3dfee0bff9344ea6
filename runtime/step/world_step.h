// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <memory_resource>
#include <vector>

#include "runtime/world/body.h"
#include "sinew/runtime/world.h"

namespace sinew::internal {

enum StepPhase : std::uint32_t { kPredict, kMoments, kRows, kMatch, kSolve, kGoals, kSettle, kStepPhaseCount };

/// Milliseconds by phase.
using StepTimes = std::array<double, kStepPhaseCount>;

/// What solving the rows of one body takes: much memory for a short time, so bodies share it.
struct RowScratch {
  explicit RowScratch(std::pmr::memory_resource* memory)
      : rows(memory), frames(memory), responses(memory), solver_rows(memory), terms(memory), answers(memory) {}

  std::pmr::vector<Row> rows;
  std::pmr::vector<ClusterFrame> frames;
  std::pmr::vector<ClusterResponse> responses;
  std::pmr::vector<SolverRow> solver_rows;
  std::pmr::vector<RowTerm> terms;
  std::pmr::vector<ClusterAnswer> answers;
};

/// Scratch of a world: one RowScratch for each body that may be stepped at the same time, each large enough for any.
struct StepScratch {
  explicit StepScratch(std::pmr::memory_resource* memory) : lanes(memory) {}

  std::pmr::vector<RowScratch> lanes;
};

/// Sizes the scratch for the worst case of all bodies, so that steps do not allocate, nor jobs at any time.
void growScratch(const BodyList& bodies, StepScratch& scratch, const WorldSettings& settings, const JobSystem* jobs);

/// Advances all bodies by one step. \param scratch grown where bodies, pins or picks have come. \param jobs may be
/// null. \param times null, or where phases are added up (bodies that share jobs count into the first phase).
void stepWorld(BodyList& bodies, StepScratch& scratch, const WorldSettings& settings, JobSystem* jobs, float seconds,
               StepTimes* times);

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "runtime/world/body.h"
#include "sinew/runtime/world.h"

namespace sinew::internal {

enum StepPhase : std::uint32_t { kPredict, kMoments, kRows, kMatch, kSolve, kGoals, kSettle, kStepPhaseCount };

/// Milliseconds by phase.
using StepTimes = std::array<double, kStepPhaseCount>;

/// Advances all bodies by one step. \param jobs may be null. \param bodies entries may be null. \param times null, or
/// where phases are added up (bodies that share jobs count into the first phase).
void stepWorld(std::vector<std::unique_ptr<Body>>& bodies, const WorldSettings& settings, JobSystem* jobs,
               float seconds, StepTimes* times);

}  // namespace sinew::internal

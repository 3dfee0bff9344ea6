// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// Pieces that a job takes at least.
inline constexpr std::uint32_t kPiecesAJob = 8;

/// Calls visit(i) for all i below count, shared by the jobs' threads where there are two jobs of `grain`. Allocates
/// nothing. \param jobs null: none.
template <class Visit>
void forEach(JobSystem* jobs, std::uint32_t count, std::uint32_t grain, const Visit& visit) {
  if (jobs == nullptr || count < 2 * grain) {
    for (std::uint32_t i = 0; i < count; ++i) visit(i);
    return;
  }
  // One reference is all that is captured: std::function stores it in place.
  jobs->parallelFor(count, grain, [&visit](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i) visit(i);
  });
}

/// The same, but one thread visits all of a run of i that are alike: bodyOf(i) tells.
template <class BodyOf, class Visit>
void forEachByBody(JobSystem* jobs, std::uint32_t count, std::uint32_t grain, const BodyOf& bodyOf,
                   const Visit& visit) {
  forEach(jobs, count, grain, [&](std::uint32_t i) {
    if (i > 0 && bodyOf(i) == bodyOf(i - 1)) return;
    for (std::uint32_t m = i; m < count && bodyOf(m) == bodyOf(i); ++m) visit(m);
  });
}

}  // namespace sinew::internal

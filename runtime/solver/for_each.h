// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include "sinew/runtime/settings.h"

namespace sinew::internal {

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

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#pragma once

#include "runtime/world/body.h"

namespace sinew::internal {

/// Where a pinned vertex is at the end of this pass, metres: on the straight way to its target, there after the last
/// pass of the step. \param passes_left including this one, >= 1.
inline Vector3 pinPosition(const Vector3& start, const Vector3& target, std::uint32_t passes_left) {
  return passes_left <= 1 ? target : Vector3(start + (target - start) / float(passes_left));
}

/// Appends a row for each pinned vertex (method `hold`: positions held, forces passed on through the match).
void addPinRows(Body& body, float pass_seconds, std::uint32_t passes_left);

/// Puts the pinned vertices exactly where they are held.
void holdPins(Body& body, float pass_seconds, std::uint32_t passes_left);

}  // namespace sinew::internal

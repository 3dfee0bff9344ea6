// SPDX-License-Identifier: MIT
#pragma once

#include "runtime/world/body.h"

namespace sinew::internal {

/// Appends a row for each pick of the body. Its target is where the point starts the pass; the solver blends in the
/// spring's target (eq. 12), because only there the mass that the spring feels is known.
void addPickRows(Body& body, float pass_seconds);

}  // namespace sinew::internal

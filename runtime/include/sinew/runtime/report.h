// SPDX-License-Identifier: MIT
//
// The library sinew_report: bodies moved as in Henriques, "Meshless deformation for real-time soft tissue simulation",
// 2006. For comparison; a game that does not want it does not link it.
#pragma once

#include "sinew/runtime/export.h"
#include "sinew/runtime/settings.h"

namespace sinew {

/// For BodySettings::solver. Clusters are matched one by one and averaged, once a step, as the sources have it: so how
/// stiff a body is depends on the length of the step. It moves any package, also one without fields, keeps no momentum
/// exactly, knows no elastic energy, and leaves plasticity and activation out. What is not finite is put back at rest.
SINEW_API const SolverFactory& reportSolver();

}  // namespace sinew

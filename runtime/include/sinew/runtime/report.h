// SPDX-License-Identifier: MIT
//
// The library sinew_report: bodies moved as in Henriques, "Meshless deformation for real-time soft tissue simulation",
// 2006. For comparison; a game that does not want it does not link it.
#pragma once

#include "sinew/runtime/export.h"
#include "sinew/runtime/settings.h"

namespace sinew {

/// For BodySettings::solver. Clusters are matched one by one and averaged, once a step (docs/report.md), so stiffness
/// depends on the length of the step. Moves any package, also one without fields. Keeps no momentum exactly and has
/// neither elastic energy, plasticity nor activation. Vertices that are not finite are put back at rest.
SINEW_API const SolverFactory& reportSolver();

}  // namespace sinew

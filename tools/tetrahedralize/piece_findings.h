// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "tools/core/finding.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"
#include "tools/tetrahedralize/pieces.h"

namespace sinew::tools {

/// Findings on these pieces: some nearly touch, large sheets ride along, covers are inside out.
std::vector<Finding> pieceFindings(const VisualMesh& mesh, const Topology& topology, const PieceSet& set,
                                   double join_distance);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "tools/core/finding.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Loose parts that probably ride on another (eyes and teeth in a head, lashes on a lid, a button on a coat): small
/// beside it, within its box, and close to its surface all over. At most one finding (info), with the lines to write
/// into the recipe. Nothing for sources of more than 256 loose parts: those are soups. Cost: a distance to the surface
/// for each vertex of a small part.
std::vector<Finding> suggestParts(const VisualMesh& mesh, const Topology& topology);

}  // namespace sinew::tools

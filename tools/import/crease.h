// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Which corners of triangles share a normal: those of one point that are joined by edges less sharp than a crease, so
/// a lone sharp edge that ends in a surface splits nothing. Faces are to be oriented and welded. \param crease_degrees
/// angle between neighbouring faces from which on an edge is sharp, 0..180; 180 = none is. \return for corner k of
/// triangle t, at [3 t + k]: the lowest corner of its fan.
std::vector<std::uint32_t> smoothFans(const VisualMesh& mesh, double crease_degrees);

}  // namespace sinew::tools

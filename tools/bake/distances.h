// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "sinew/formats/writer.h"
#include "tools/bake/stage_cache.h"

namespace sinew::tools {

/// Adds the distance grid (sections DIST, DVAL) of each piece that has contact points and a drawn surface: distances to
/// its visual triangles, negative where their winding number is above 1/2. A sheet has no inside. To be called when all
/// else of the content stands. \param cells along the longest side of a piece; 0 adds none.
void addDistances(std::uint32_t cells, formats::PackageContent& content, StageCache& cache);

}  // namespace sinew::tools

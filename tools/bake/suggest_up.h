// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "tools/core/finding.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Says so (`lies-on-its-side`, an info) where a model was read with y up and stands only with z up: its centre (of
/// the surface's area) is over the hull of its lowest points with z up, firmly, and not with y up, nor so with -z up;
/// and it is not thin along z. Nothing for what stands both ways: a door or a curtain, a terrain on its edge, a person
/// on its back; nor for what stands neither way. An arm that is cut off and reaches forward is taken for one that lies.
std::optional<Finding> suggestUp(const VisualMesh& mesh);

}  // namespace sinew::tools

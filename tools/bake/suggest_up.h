// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "tools/core/finding.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Says so (`lies-on-its-side`, an info) where a model was read with y up and stands far better with z up: it is longer
/// along the source's z than along its y, and has a flat base below in z and none below in y. Nothing else tells a
/// figure that lies from a fish that swims.
std::optional<Finding> suggestUp(const VisualMesh& mesh);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Axes and a scale in metres over the view, as pictures have them.
#pragma once

#include "tools/render/camera.h"
#include "tools/studio/view_layout.h"

namespace sinew::tools {

/// \param metres_per_unit of the drawing, whose diagonal is 1. \param height of the window, its own coordinates
void drawViewMarks(const ViewLayout& layout, const Camera& camera, double metres_per_unit, int height);

}  // namespace sinew::tools

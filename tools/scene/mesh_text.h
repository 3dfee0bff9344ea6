// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "tools/scene/scene.h"

namespace sinew::tools {

/// Where an exported mesh stands: where the artist's source does, in its unit and axes (at rest it is the source); or
/// in the scene (of a file in its coordinates), metres, y up.
enum class ExportFrame { source, scene };

/// The deformed visual meshes of the scene's bodies as OBJ text, objects where they are several; vertices of each in
/// its package's order.
std::string meshText(const Scene& scene, ExportFrame frame);

}  // namespace sinew::tools

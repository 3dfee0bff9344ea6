// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "tools/import/import.h"
#include "tools/import/raw_scene.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Metres in a unit's name or number: "cm", "0.0254". 0 where it is none.
double metresPerUnit(const std::string& unit);

/// Turns a validated scene into the visual mesh: unit, axes and node transforms applied, polygons cut, positions
/// welded, faces oriented, normals completed, weights normalized, textures brought. Throws ToolError(bad_input) for a
/// scene without faces or extent.
VisualMesh assembleVisualMesh(RawScene scene, const std::filesystem::path& file, const std::string& format,
                              const ImportOptions& options);

}  // namespace sinew::tools

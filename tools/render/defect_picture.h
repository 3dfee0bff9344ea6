// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "tools/core/finding.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Draws a source with what the doctor found: whole views with the places of every finding in its colour, a close-up of
/// the first place of the gravest ones, and a legend. Faces are filled, vertices dotted, edges between two marked
/// vertices drawn where they are open or shared by more than two faces. Makes its own OpenGL context; writes the PNG
/// whole or not at all. Throws ToolError(system) where there is no OpenGL or the file cannot be written.
void renderDefects(const VisualMesh& mesh, const std::vector<Finding>& findings, const std::filesystem::path& png);

}  // namespace sinew::tools

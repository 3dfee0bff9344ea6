// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A named weight 0..1 for each visual vertex.
struct NamedWeights {
  std::string name;
  std::vector<double> weights;
};

/// Draws weights on a mesh: all of them together from four sides, each in a colour of its own, then each alone from the
/// side from which most of it is seen (at most 40 of them), with axes and a scale in metres. Grey is weight 0. Makes
/// its own OpenGL context; writes the PNG whole or not at all. Throws ToolError(system) where there is no OpenGL or the
/// file cannot be written. \param title over the pictures, as the recipe's name. \param front_yaw rad, of the front
void renderWeights(const VisualMesh& mesh, const std::vector<NamedWeights>& named, const std::string& title,
                   const std::filesystem::path& png, float front_yaw = 0);

}  // namespace sinew::tools

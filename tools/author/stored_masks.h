// SPDX-License-Identifier: GPL-3.0-or-later
//
// Masks kept as weights at points, for regions that no selection of a source says: the file of a selection `stored`.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tools/author/json_text.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Weights 0..1 of a name, one per welded point of the mesh they were made on.
struct StoredMask {
  std::string name;
  std::vector<double> weights;
};

/// The text of a mask file: the mesh's welded points in metres, y up, and each mask's weights above 0
/// (docs/recipe-format.md). Equal arguments give equal bytes.
std::string storedMasksText(const VisualMesh& mesh, const std::vector<StoredMask>& masks);

struct StoredWeights {
  std::vector<double> weights;  ///< per visual vertex
  std::size_t moved = 0;        ///< points of the mesh that none of the file lies on, but one is near
  std::size_t unknown = 0;      ///< points of the mesh with none near: weight 0
};

/// Reads one mask of a file and lays it onto a mesh: each welded point takes the weight of the point nearest to it,
/// within 2 % of the diagonal. Throws ToolError(bad_input) for a wrong file, naming file, line and cure; \return
/// nothing where it has no mask of this name, and its names in `names`.
std::pair<bool, StoredWeights> readStoredMask(const std::filesystem::path& file, const std::string& name,
                                              const VisualMesh& mesh, std::vector<std::string>& names);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/author/recipe.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A region that the source itself has a name for.
struct SourceRegion {
  std::string name;
  nlohmann::ordered_json selection;  ///< of a recipe on this source
  std::size_t visual_vertices = 0;   ///< that the selection takes
};

/// Kinds of sourceRegions(), as one writes them: bone, group, material, object, part, morph.
const std::vector<std::string>& sourceRegionKinds();

/// The regions of one kind, in the file's order, each name once; loose parts are named part.0, part.1, ...
/// \param kind one of sourceRegionKinds(). \param patterns names, in which * stands for any letters; empty: all.
/// \param options further keys of the selections: a JSON object, or null. Throws ToolError(usage) where the source has
/// nothing of this kind, or a pattern matches none of it.
std::vector<SourceRegion> sourceRegions(const std::string& kind, const std::vector<std::string>& patterns,
                                        const nlohmann::ordered_json& options, const VisualMesh& mesh,
                                        const Topology& topology);

/// Finds how many visual vertices each region takes. \param recipe what messages name; its masks may be used. The
/// regions' selections must be right (RecipeEditor::addClusters() finds that out).
void countVertices(const Recipe& recipe, const VisualMesh& mesh, const Topology& topology,
                   std::vector<SourceRegion>& regions);

}  // namespace sinew::tools

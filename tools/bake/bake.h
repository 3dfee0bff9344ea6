// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "tools/author/recipe.h"
#include "tools/bake/authored.h"
#include "tools/bake/parts.h"
#include "tools/bake/stage_cache.h"
#include "tools/core/finding.h"
#include "tools/core/progress.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A recipe and its source as read, before anything is filled.
struct ImportedSource {
  VisualMesh mesh;
  Topology topology;
  AuthoredWeights authored;
  std::vector<RidingPart> parts;
  std::vector<Finding> findings;  ///< about the recipe, and parts it might have; what import found is the mesh's
};

/// The stages import and topology. Throws ToolError.
ImportedSource importSource(const Recipe& recipe, Progress& progress);

struct BakeResult {
  std::vector<std::byte> package;  ///< the whole file, already opened and checked once
  std::vector<Finding> findings;   ///< the same as in the report
  nlohmann::ordered_json report;   ///< what was done, measured, found; without times (those are Progress's)
};

/// Bakes a recipe: import -> topology -> tetrahedra -> clusters -> attachment -> package -> check.
/// Writes nothing. Equal recipes and sources give equal bytes for any folder and number of threads.
/// Throws ToolError where the source, a setting or the machine makes it impossible.
/// \param cache where stages are kept from one bake to the next; null: nowhere. It never changes the package, but
/// for a draft's.
/// \param draft where the cache has what earlier materials of the same tetrahedra and pins move by, that serves: the
/// body plays sooner, less exactly (reweighed()); `draft` in the report's fields says whether it was so.
BakeResult bake(const Recipe& recipe, Progress& progress, StageCache* cache = nullptr, bool draft = false);

/// Whether bake() makes a package: all of its stages but the fields, without which a package still stands. The cache
/// keeps for the bake what it takes from there. \return the refusal as a finding of severity error, or all that bake()
/// warns of. Throws ToolError where the machine fails.
std::vector<Finding> rehearseBake(const Recipe& recipe, ImportedSource source, Progress& progress, StageCache* cache);

/// The report on the stages' cache.
nlohmann::ordered_json cacheJson(const StageCache& cache);

/// The stages' costs as the report shows them.
nlohmann::ordered_json costsJson(const Progress& progress);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "tools/author/recipe.h"
#include "tools/bake/stage_cache.h"
#include "tools/core/finding.h"
#include "tools/core/progress.h"

namespace sinew::tools {

struct BakeResult {
  std::vector<std::byte> package;  ///< the whole file, already opened and checked once
  std::vector<Finding> findings;   ///< the same as in the report
  nlohmann::ordered_json report;   ///< what was done, measured, found; without times (those are Progress's)
};

/// Bakes a recipe: import -> topology -> tetrahedra -> clusters -> attachment -> package -> check.
/// Writes nothing. Equal recipes and sources give equal bytes for any folder and number of threads.
/// Throws ToolError where the source, a setting or the machine makes it impossible.
/// \param cache where stages are kept from one bake to the next; null: nowhere. It never changes the package.
BakeResult bake(const Recipe& recipe, Progress& progress, StageCache* cache = nullptr);

/// What the report says of the stages' cache.
nlohmann::ordered_json cacheJson(const StageCache& cache);

/// The stages' costs as the report shows them.
nlohmann::ordered_json costsJson(const Progress& progress);

}  // namespace sinew::tools

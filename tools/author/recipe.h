// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "tools/author/settings.h"

namespace sinew::tools {

/// What was authored: the source and every setting that differs from its default. JSON:
/// {"sinew_recipe": 1, "source": "spot.obj", "settings": {"tetrahedra.vertices": 2000}}
struct Recipe {
  static constexpr int kVersion = 1;
  std::filesystem::path source;  ///< absolute or relative to the working folder (in the file: relative to the recipe)
  Settings settings;
};

/// Whether a file is a recipe, by its extension .json.
bool isRecipe(const std::filesystem::path& file);

/// Reads and validates a recipe. Throws ToolError(bad_input) naming the file, the key or line, and the cure.
Recipe readRecipe(const std::filesystem::path& file);

/// The recipe of a bare source: its path and the defaults; of a recipe: its content.
Recipe recipeFor(const std::filesystem::path& source_or_recipe);

}  // namespace sinew::tools

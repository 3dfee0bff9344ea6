// SPDX-License-Identifier: GPL-3.0-or-later
//
// A recipe's masks, clusters and pins, carried over to a new version of its source.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/author/recipe_commands.h"
#include "tools/author/source_match.h"
#include "tools/core/progress.h"

namespace sinew::tools {

struct TransferOptions {
  std::filesystem::path recipe;
  std::filesystem::path new_source;
  std::filesystem::path old_source;  ///< where the recipe's source is no longer what it was; empty: the recipe's
  std::filesystem::path output;      ///< a new recipe; empty: `recipe` itself changes
};

/// Outcome of one selection.
struct TransferredSelection {
  std::string kind;     ///< "mask", "cluster", "origin", "insertion", "pins", "stiffness", "thickness", "part",
                        ///< "carrier"
  std::string name;     ///< of the mask, cluster or pins; the number of a stiffness or thickness entry, from 0
  bool stored = false;  ///< it became a stored mask; else it says what it said
  std::array<std::size_t, kMatchRules> matched = {};  ///< visual vertices that it selects, by rule
  double largest = 0, rms = 0;        ///< m: how far those vertices lie from their old places; 0 where none has one
  double old_area = 0, new_area = 0;  ///< m^2, weighted; the old one at the new scale
};

struct TransferResult {
  RecipeEditor editor;              ///< the recipe as it will be; not saved
  std::filesystem::path mask_file;  ///< to be written before the recipe is saved; empty: none
  std::string mask_text;
  std::vector<std::string> notes;  ///< what was found of unit, axes and place, one sentence each
  double matched = 0;              ///< part of the new surface that the old one has, 0..1
  double error = 0;                ///< mean distance of the two surfaces, in diagonals
  bool uvs_kept = false;
  std::vector<TransferredSelection> selections;
};

/// Finds where the new source stands against the old one, which place of the old surface each of its vertices was, and
/// what every selection of the recipe selects there. A selection whose words still select the same on the new source
/// keeps them; what is left is stored as weights at points beside the recipe (in a file of a new name, so that undo
/// finds the old one). Lengths and points of the recipe follow where the model itself was scaled, turned or moved; a
/// change of unit or axes goes into import.unit and import.up.
/// Nothing is written. Throws ToolError(bad_input) where less than half of the surface, or of a selection's area, is
/// found again, naming what is missing; (usage) for wrong names.
TransferResult transferRecipe(const TransferOptions& options, Progress& progress);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Commands of a recipe that paint: single strokes, and muscles.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "tools/author/recipe_commands.h"
#include "tools/author/strokes.h"

namespace sinew::tools {

/// Adds strokes to a mask, as one command "stroke NAME". The strokes so far and these are written to a new file in the
/// folder RECIPE.strokes beside the recipe (at once: save() only writes the recipe that names it), so undo finds the
/// file before. A mask that is no mask of strokes is kept under them as `over`; where there is none it is made. Files
/// of this mask that no step of the history names are removed. Throws ToolError(system) where the file cannot be
/// written.
void addStrokes(RecipeEditor& editor, const std::string& mask, std::span<const Stroke> strokes);

/// The strokes that a mask has, and which of them are its own: the same as addStrokes() would write before the new
/// ones.
std::vector<Stroke> strokesOf(const RecipeEditor& editor, const std::string& mask);

struct MuscleOptions {
  std::string name;
  std::vector<Eigen::Vector3d> path;  ///< from its origin to its insertion, metres: Surface::path()
  double width = 0;                   ///< m, > 0, where its weight is above one half
  bool mirror = false;                ///< its image too, under the name with left and right exchanged
  std::string plane = "auto";         ///< of mirror: auto, x, y or z
};

/// Adds all of a muscle as one command "muscle NAME": the mask NAME.region (a stroke along its path), the cluster NAME
/// of it, its fibre (from end to end) and its channel NAME; and its image. Throws ToolError(usage) where the name is
/// taken or, with mirror, has no side. \param found_normal as in RecipeEditor::mirror().
void addMuscle(RecipeEditor& editor, const MuscleOptions& options,
               const std::function<Eigen::Vector3d()>& found_normal);

}  // namespace sinew::tools

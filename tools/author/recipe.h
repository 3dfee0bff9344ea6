// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tools/author/json_text.h"
#include "tools/author/settings.h"
#include "tools/core/finding.h"

namespace sinew::tools {

/// A selection as the recipe has it, with its place in the recipe's text.
struct SelectionText {
  nlohmann::ordered_json json;  ///< null: none
  std::string pointer;          ///< JSON pointer
};

/// A named region with a material of its own.
struct RecipeCluster {
  std::string name;
  std::string pointer;
  SelectionText from;                                                    ///< null: the cluster mesh of this name
  std::vector<std::pair<std::string, nlohmann::ordered_json>> settings;  ///< full keys ("clusters.mode") and values
  std::optional<double> split;                                           ///< m
  std::string channel;                                                   ///< empty: none
  double contraction = 0.3;                                              ///< 0..0.9
  std::optional<Eigen::Vector3d> fibre;                                  ///< as given, not unit; none: found
  SelectionText origin, insertion;                                       ///< null: none
};

struct RecipePins {
  std::string name;
  SelectionText from;
  std::uint32_t method = 3;  ///< number of a sinew::PinMethod (runtime settings.h)
  std::string target = "world";
};

/// A factor where the selection's weight is 1, 1 where it is 0, in between in proportion.
struct RecipeFactor {
  SelectionText from;
  double value = 1;
};

/// Colour of the visual vertices, for sources that have none of their own.
struct RecipeColor {
  SelectionText from;
  std::array<double, 3> color = {1, 1, 1};  ///< linear RGB, 0..1
};

/// Loose parts of the source that ride along without tetrahedra of their own.
struct RecipePart {
  std::string name;
  std::string pointer;
  SelectionText from;
  bool rigid = true;  ///< false: each vertex follows the nearest surface
  SelectionText to;   ///< its carrier; null: the nearest physical vertices, or surface
};

/// Authored data: the source, every setting that differs from its default, and the artist's masks, clusters, pins.
/// The format: docs/recipe-format.md.
struct Recipe {
  static constexpr int kVersion = 3;
  std::filesystem::path source;  ///< absolute or relative to the working folder (in the file: relative to the recipe)
  Settings settings;
  std::vector<std::pair<std::string, SelectionText>> masks;
  std::vector<RecipeCluster> clusters;
  std::vector<RecipePins> pins;
  std::vector<RecipeFactor> stiffness;  ///< of the report's solver, 0..1
  std::vector<RecipeFactor> thickness;  ///< of shells, 0.01..100
  std::vector<RecipeColor> colors;      ///< later ones over earlier ones
  std::vector<RecipePart> parts;
  std::filesystem::path folder;          ///< the recipe's; empty for a bare source
  std::filesystem::path project;         ///< no file lies outside of it
  std::shared_ptr<const JsonText> text;  ///< for messages; never null
  std::vector<Finding> migrated;         ///< what an older version's keys became

  /// A file that the recipe names. Throws ToolError(bad_input) where it lies outside the project folder.
  std::filesystem::path file(const std::string& name, const std::string& pointer) const;
  /// The mask of a name; null where there is none.
  const SelectionText* mask(const std::string& name) const;
};

/// Whether a file is a recipe, by its extension .json.
bool isRecipe(const std::filesystem::path& file);

/// Reads and validates a recipe: everything but what needs the source. Throws ToolError(bad_input) naming file, line,
/// place and cure.
Recipe readRecipe(const std::filesystem::path& file);
/// The same of a text that is, or will be, in `file`.
Recipe parseRecipe(std::string_view text, const std::filesystem::path& file);

/// The recipe of a bare source: its path and the defaults; of a recipe: its content.
Recipe recipeFor(const std::filesystem::path& source_or_recipe);

/// Selections of `after` that are not in the same list of `before`: of masks, clusters, pins, accessories and factors.
std::vector<SelectionText> newSelections(const Recipe& before, const Recipe& after);

/// A recipe's JSON in the present version. Throws ToolError(bad_input) where it is of a version that is not known.
/// \param file where it stands, for paths that version 1 allowed to leave its folder. \param findings out: what
/// became of keys that are no more.
nlohmann::ordered_json migratedRecipe(const JsonText& text, const std::filesystem::path& file,
                                      std::vector<Finding>& findings);

}  // namespace sinew::tools

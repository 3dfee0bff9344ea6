// SPDX-License-Identifier: GPL-3.0-or-later
//
// Every key of a recipe, declared once: validation, docs/recipe.schema.json, `sinew help recipe` and
// docs/recipe-format.md all come from recipeObjects() and selectionKinds().
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace sinew::tools {

/// Metres; beyond any scene. No coordinate of a recipe is larger.
inline constexpr double kRecipeFar = 1e9;

/// A key's type of value; the sum where it has several.
enum RecipeType : std::uint32_t {
  kRecipeNumber = 1U << 0,           ///< within minimum..maximum
  kRecipeInteger = 1U << 1,          ///< within minimum..maximum
  kRecipeFlag = 1U << 2,             ///< true or false
  kRecipeText = 1U << 3,             ///< not empty
  kRecipeTexts = 1U << 4,            ///< a list of texts, at least one
  kRecipeChoice = 1U << 5,           ///< one of `choices`
  kRecipePath = 1U << 6,             ///< a file, relative to the recipe, inside the project folder
  kRecipePoint = 1U << 7,            ///< [x, y, z]
  kRecipePoints = 1U << 8,           ///< two points
  kRecipeColor = 1U << 9,            ///< [r, g, b] or [r, g, b, a], each 0..1
  kRecipeSelection = 1U << 10,       ///< the name of a mask, or an object of one kind
  kRecipeSelections = 1U << 11,      ///< a list of selections, at least one
  kRecipeMasks = 1U << 12,           ///< an object name -> selection
  kRecipeSettings = 1U << 13,        ///< an object of settings
  kRecipeClusterSettings = 1U << 14  ///< an object of the settings that a cluster can have of its own
};

struct RecipeKey {
  std::string_view name;
  std::uint32_t type;          ///< sum of RecipeType; 0 = a list of objects of `object`
  std::string_view sentence;   ///< what it means
  std::string_view fallback;   ///< what its absence means, as JSON; "" = it must be there; "none" = nothing
  std::string_view unit = "";  ///< "" where it has none
  double minimum = 0, maximum = 1;
  std::vector<std::string_view> choices = {};
  std::string_view object = "";
  std::string_view needs = "";     ///< another key, without which this one says nothing
  std::string_view excludes = "";  ///< another key that cannot stand beside it
};

/// An object of a recipe. A kind of selection is named by its first key.
struct RecipeObject {
  std::string_view name;
  std::string_view sentence;
  std::vector<RecipeKey> keys;
  std::string_view example;  ///< JSON
};

/// The recipe itself, then the objects in its lists.
const std::vector<RecipeObject>& recipeObjects();
/// One of them by its name.
const RecipeObject& recipeObject(std::string_view name);
/// One of its keys.
const RecipeKey& recipeKey(std::string_view object, std::string_view key);
/// A key's legal values in words.
std::string legalText(const RecipeKey& key);
/// Kinds of selections, besides the name of a mask.
const std::vector<RecipeObject>& selectionKinds();
/// The kind that a selection's object is of, by the key that it has; null where it has none or several.
const RecipeObject* selectionKind(const nlohmann::ordered_json& selection);

/// A key's value, or its fallback where the object lacks it.
nlohmann::ordered_json recipeValue(const RecipeObject& object, const nlohmann::ordered_json& json,
                                   std::string_view key);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe.h"

#include <algorithm>
#include <fstream>
#include <iterator>

#include "tools/core/error.h"

namespace sinew::tools {
namespace {

[[noreturn]] void bad(const std::filesystem::path& file, const std::string& what, const std::string& cure) {
  throw ToolError(ExitCode::bad_input, file.string(), what, cure);
}

}  // namespace

bool isRecipe(const std::filesystem::path& file) { return file.extension() == ".json"; }

Recipe readRecipe(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) bad(file, "cannot be read", "Check the name and its permissions.");
  const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  nlohmann::json json;
  try {
    json = nlohmann::json::parse(text, nullptr, true, true);
  } catch (const nlohmann::json::parse_error& error) {
    const auto line =
        1 + std::count(text.begin(), text.begin() + std::ptrdiff_t(std::min(error.byte, text.size())), '\n');
    bad(file, "is not valid JSON (line " + std::to_string(line) + ")",
        "Mend the syntax there; a missing comma or quote is usual.");
  }
  if (!json.is_object() || !json.contains("sinew_recipe")) {
    bad(file, "is JSON but no recipe (the key sinew_recipe is missing)",
        R"(A recipe looks like {"sinew_recipe": 1, "source": "mesh.obj", "settings": {}}.)");
  }
  if (json["sinew_recipe"] != Recipe::kVersion) {
    bad(file,
        "is a recipe of version " + json["sinew_recipe"].dump() + ", this program reads version " +
            std::to_string(Recipe::kVersion),
        "Use the version of sinew that wrote it, or set sinew_recipe to 1 if it was written by hand.");
  }
  Recipe recipe;
  for (const auto& [key, value] : json.items()) {
    if (key == "sinew_recipe") continue;
    if (key == "source" && value.is_string() && !value.get<std::string>().empty()) {
      recipe.source = file.parent_path() / value.get<std::string>();
    } else if (key == "settings" && value.is_object()) {
      recipe.settings.apply(value, file.string());
    } else if (key == "source" || key == "settings") {
      bad(file, "the key " + key + " has the wrong type",
          key == "source" ? "Give a file name." : "Give an object of settings.");
    } else {
      bad(file, "has the unknown key '" + key + "'", "Known keys: sinew_recipe, source, settings.");
    }
  }
  if (recipe.source.empty()) bad(file, "names no source", R"(Add "source": "mesh.obj", relative to the recipe.)");
  return recipe;
}

Recipe recipeFor(const std::filesystem::path& source_or_recipe) {
  if (isRecipe(source_or_recipe)) return readRecipe(source_or_recipe);
  Recipe recipe;
  recipe.source = source_or_recipe;
  return recipe;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe_values.h"

#include <array>
#include <utility>

#include "tools/author/recipe.h"
#include "tools/core/error.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

// Powers of the factor: a frequency goes with the root of the modulus.
constexpr std::array<std::pair<const char*, int>, 4> kStiff = {
    {{"stretch_hz", 1}, {"bend_hz", 1}, {"twist_hz", 1}, {"young", 2}}};

}  // namespace

std::vector<RecipeEditor::Change> stiffen(RecipeEditor& editor, double factor) {
  if (!(factor >= 1e-3 && factor <= 1e3))
    throw ToolError(ExitCode::usage, "", "a recipe is made 0.001 to 1000 times as stiff", "Give a factor, as 1.5.");
  const Recipe recipe = parseRecipe(editor.text(), editor.file());
  RecipeEditor trial = editor;
  std::vector<RecipeEditor::Change> changes;
  const auto scale = [&](const std::string& key, double value, int power) {
    const auto made = trial.set(key, exactText(sevenDigits(value * (power == 1 ? factor : factor * factor))));
    changes.insert(changes.end(), made.begin(), made.end());
  };
  Settings settings = recipe.settings;
  for (const auto& [name, power] : kStiff) {
    const std::string key = std::string("clusters.") + name;
    for (const Settings::Declaration& d : Settings::declarations(settings)) {
      if (d.key == key) scale(key, std::stod(valueText(settings, d)), power);
    }
  }
  const auto document = editor.document();
  for (const auto& cluster : document.value("clusters", nlohmann::ordered_json::array())) {
    if (!cluster.contains("settings")) continue;
    for (const auto& [name, power] : kStiff) {
      if (cluster["settings"].contains(name))
        scale("clusters." + cluster["name"].get<std::string>() + "." + name, cluster["settings"][name].get<double>(),
              power);
    }
  }
  editor.replace("stiffen " + rounded(factor), trial.document());
  return changes;
}

}  // namespace sinew::tools

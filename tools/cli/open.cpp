// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/cli/open.h"

#include <filesystem>
#include <iostream>
#include <map>

#include "tools/author/recipe_commands.h"
#include "tools/cli/files.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

std::string recipeOf(const std::string& file, const std::string& named) {
  if (isRecipe(file)) return file;
  std::string recipe = named.empty() ? std::filesystem::path(file).replace_extension(".json").string() : named;
  std::error_code error;
  if (!std::filesystem::exists(recipe, error)) {
    RecipeEditor::create(recipe, file).save();
    std::cerr << "sinew: " << recipe << ": a new recipe for " << file << "\n";
    return recipe;
  }
  const Recipe there = readRecipe(recipe);
  if (std::filesystem::equivalent(there.source, file, error)) return recipe;
  throw ToolError(ExitCode::usage, recipe, "is a recipe of " + there.source.string() + ", not of " + file,
                  "Name another place for the new one: sinew studio " + file + " -o NAME.json.");
}

}  // namespace

Opened openForWindow(const std::string& file, const std::string& recipe) {
  if (!file.ends_with(".sinew")) return {recipeOf(file, recipe), nullptr, SceneKind::drop};
  Opened opened = {file, loadPackage(file), SceneKind::drop};
  const formats::PackageView& package = opened.asset->package();
  if (package.visualTriangles().empty()) {
    throw ToolError(ExitCode::bad_input, file, "the package has no visual mesh to draw",
                    "Bake it from a source with faces.");
  }
  if (!package.pinSets().empty()) opened.scene = SceneKind::rest;
  return opened;
}

void addWindowOptions(CLI::App& verb, StudioOptions& options) {
  ViewOptions& view = options.view;
  verb.add_option("--screenshot", view.screenshot,
                  "Write a picture of the window (.png) after --frames frames, or the replay, and end");
  verb.add_option("--frames", view.frames, "End after so many frames; 0 = when the window is closed")
      ->check(CLI::Range(0U, 1000000U));
  verb.add_option("--log-state", view.state_log, "Write what happens in each frame as lines of JSON (for tests)");
  verb.add_option("--replay", options.replay, "Input from a file instead of mouse and keyboard (for tests)");
  const std::map<std::string, Navigation> navigations = {
      {"sinew", Navigation::usual}, {"blender", Navigation::blender}, {"maya", Navigation::maya}};
  verb.add_option("--navigation", options.navigation,
                  "The mouse moves the camera as in sinew, blender or maya; without it as last time")
      ->transform(CLI::CheckedTransformer(navigations, CLI::ignore_case));
  options.open = [](const std::string& file) { return openForWindow(file); };
}

}  // namespace sinew::tools

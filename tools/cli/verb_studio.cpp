// SPDX-License-Identifier: GPL-3.0-or-later
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>

#include "tools/author/recipe_commands.h"
#include "tools/cli/files.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/studio/view_window.h"

namespace sinew::tools {
namespace {

struct StudioCommand {
  std::string file, recipe;
  StudioOptions options;
};

// The recipe to edit: the file itself, or one of a source, which is made where there is none.
std::string recipeOf(const StudioCommand& command) {
  if (isRecipe(command.file)) return command.file;
  std::string recipe =
      command.recipe.empty() ? std::filesystem::path(command.file).replace_extension(".json").string() : command.recipe;
  std::error_code error;
  if (!std::filesystem::exists(recipe, error)) {
    RecipeEditor::create(recipe, command.file).save();
    std::cerr << "sinew: " << recipe << ": a new recipe for " << command.file << "\n";
    return recipe;
  }
  const Recipe there = readRecipe(recipe);
  if (std::filesystem::equivalent(there.source, command.file, error)) return recipe;
  throw ToolError(ExitCode::usage, recipe, "is a recipe of " + there.source.string() + ", not of " + command.file,
                  "Name another place for the new one: -o NAME.json.");
}

}  // namespace

void addStudioVerb(CLI::App& app, int& exit_code) {
  auto command = std::make_shared<StudioCommand>();
  CLI::App* verb = app.add_subcommand(
      "studio", "Open a window on a mesh or recipe: say which regions move, and feel them move (docs/studio.md)");
  verb->add_option("file", command->file, "The artist's mesh, a recipe (.json), or a package (.sinew: to look at)")
      ->required();
  verb->add_option("-o,--output", command->recipe, "The recipe of a mesh; without it, the one beside the mesh");
  verb->add_option("--replay", command->options.replay, "Input from a file instead of mouse and keyboard (for tests)");
  verb->add_option("--screenshot", command->options.view.screenshot,
                   "Write a picture of the window (.png) after --frames frames, or the replay, and end");
  verb->add_option("--frames", command->options.view.frames, "End after so many frames; 0 = when the window is closed")
      ->check(CLI::Range(0U, 1000000U));
  verb->add_option("--log-state", command->options.view.state_log,
                   "Write what happens in each frame as lines of JSON (for tests)");
  verb->callback([command, &exit_code] {
    ViewOptions& view = command->options.view;
    view.file = command->file;
    if (!view.screenshot.empty()) requireOutput(Output::picture, view.screenshot, {command->file});
    if (command->file.ends_with(".sinew")) {
      requireDisplay(command->file);
      const std::shared_ptr<const Asset> asset = loadPackage(command->file);
      view.scene = asset->package().pinSets().empty() ? SceneKind::drop : SceneKind::rest;
      runViewWindow(asset, view);
    } else {
      const std::string recipe = recipeOf(*command);
      view.file = recipe;
      runStudioWindow(recipe, command->options);
    }
    exit_code = static_cast<int>(ExitCode::done);
  });
}

}  // namespace sinew::tools

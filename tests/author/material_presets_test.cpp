// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/material_presets.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "tools/author/recipe.h"
#include "tools/author/recipe_commands.h"
#include "tools/author/weights.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

TEST(MaterialPresets, SetOneClusterAllOfThemAndTheDefaultAsOneCommand) {
  const fs::path folder = fs::temp_directory_path() / ("sinew_presets_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  std::ofstream(folder / "a.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  RecipeEditor editor = RecipeEditor::create(folder / "a.json", folder / "a.obj");
  editor.addCluster("tail", R"({"all": true})");
  editor.addCluster("body", R"({"all": true})");
  const auto presetOf = [&](std::size_t cluster) {
    const Recipe recipe = parseRecipe(editor.text(), editor.file());
    return materialPresetOf(optionsOf(recipe.clusters[cluster], recipe.settings));
  };
  EXPECT_EQ(presetOf(0), "flesh");  // the defaults
  editor.set("clusters.material", "stiff");
  EXPECT_EQ(presetOf(0), "stiff");
  const auto changes = editor.set("tail.material", "jelly");
  EXPECT_EQ(changes.size(), 5U);
  EXPECT_EQ(presetOf(0), "jelly");
  EXPECT_EQ(presetOf(1), "stiff");
  EXPECT_EQ(editor.undo(), "set tail.material=jelly");
  EXPECT_EQ(presetOf(0), "stiff");
  editor.set("*.material", "cloth");
  EXPECT_EQ(presetOf(0), "cloth");
  EXPECT_EQ(presetOf(1), "cloth");
  editor.set("*.material", "default");
  EXPECT_EQ(presetOf(1), "stiff");
  editor.set("tail.stretch_hz", "7");
  EXPECT_EQ(presetOf(0), "");
  const std::string before = editor.text();
  try {
    editor.set("tail.material", "jello");
    ADD_FAILURE();
  } catch (const ToolError& error) {
    EXPECT_NE(std::string(error.what()).find("jelly"), std::string::npos) << error.what();
  }
  EXPECT_THROW(editor.set("nose.material", "jelly"), ToolError);
  EXPECT_EQ(editor.text(), before);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace sinew::tools

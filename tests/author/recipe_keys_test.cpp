// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe_keys.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "tools/author/recipe_commands.h"
#include "tools/author/recipe_markdown.h"
#include "tools/author/recipe_schema.h"
#include "tools/author/recipe_shape.h"
#include "tools/author/selection.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

std::string fileText(const std::string& name) {
  std::ifstream in(std::string(SINEW_DOCS) + "/" + name, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(RecipeKeys, DocsAreWhatTheDeclarationsSay) {
  EXPECT_TRUE(fileText("recipe-format.md") == recipeMarkdown())
      << "run: sinew help recipe --markdown > docs/recipe-format.md";
  EXPECT_TRUE(fileText("recipe.schema.json") == recipeSchema().dump(1) + "\n")
      << "run: sinew help schema > docs/recipe.schema.json";
}

TEST(RecipeKeys, EveryExampleIsLegalAndOfItsKind) {
  for (const RecipeObject& kind : selectionKinds()) {
    const JsonText text(kind.example, std::string(kind.name));
    EXPECT_EQ(selectionKind(text.json()), &kind);
    EXPECT_NO_THROW(checkSelectionShape(text, "", text.json())) << kind.name;
  }
  const JsonText recipe(recipeObjects().front().example, "recipe");
  EXPECT_NO_THROW(checkRecipeShape(recipe));
  for (const RecipeObject& object : recipeObjects()) {
    if (object.name == "recipe") continue;
    nlohmann::ordered_json whole = {{"sinew_recipe", 2}, {"source", "a.obj"}};
    for (const RecipeKey& key : recipeObjects().front().keys) {
      if (key.object == object.name) whole[std::string(key.name)] = {nlohmann::ordered_json::parse(object.example)};
    }
    EXPECT_EQ(whole.size(), 3U) << object.name;
    EXPECT_NO_THROW(checkRecipeShape(JsonText(whole.dump(), "x"))) << object.name;
  }
}

TEST(JsonText, KnowsTheLineOfEveryValue) {
  const JsonText text("{\"a\": 1,\n \"b\": [2,\n 3\n, {\"c/d\": true}],\n\"e\":\n-4.5}", "x.json");
  EXPECT_EQ(text.line(""), 1U);
  EXPECT_EQ(text.line("/a"), 1U);
  EXPECT_EQ(text.line("/b"), 2U);
  EXPECT_EQ(text.line("/b/0"), 2U);
  EXPECT_EQ(text.line("/b/1"), 3U);
  EXPECT_EQ(text.line("/b/2/c~1d"), 4U);
  EXPECT_EQ(text.line("/b/2/none"), 4U);
  EXPECT_EQ(text.line("/e"), 6U);
  EXPECT_FALSE(text.hasComments());
  EXPECT_TRUE(JsonText("{} // note", "x.json").hasComments());
  EXPECT_THROW(JsonText(std::string(100, '['), "x.json"), ToolError);
}

TEST(Names, NearestPatternAndSide) {
  const std::vector<std::string> names = {"lip_upper", "lip_lower", "jaw"};
  EXPECT_EQ(nearestName("lip_uper", names), "lip_upper");
  EXPECT_EQ(nearestName("x", {}), "");
  EXPECT_EQ(nearestName("out", std::vector<std::string>{"set", "output"}), "output");
  EXPECT_TRUE(matchesPattern("lip_upper", "lip_*"));
  EXPECT_TRUE(matchesPattern("lip_upper", "*p*p*r"));
  EXPECT_TRUE(matchesPattern("", "*"));
  EXPECT_FALSE(matchesPattern("lip_upper", "lip"));
  EXPECT_FALSE(matchesPattern("jaw", "*_*"));
  EXPECT_EQ(otherSide("smile.L"), "smile.R");
  EXPECT_EQ(otherSide("brow_r"), "brow_l");
  EXPECT_EQ(otherSide("LeftHand"), "RightHand");
  EXPECT_EQ(otherSide("arm_l_upper"), "arm_r_upper");
  EXPECT_EQ(otherSide("nose"), "nose");
}

}  // namespace
}  // namespace sinew::tools

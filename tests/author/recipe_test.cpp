// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/author/sheet.h"
#include "tools/author/needs.h"
#include "tools/author/selection.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

class RecipeFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              (std::string("sinew_recipe_") + testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::string& text) {
    auto file = folder_ / "recipe.json";
    std::ofstream(file) << text;
    return file;
  }
  std::string errorOf(const std::string& text) {
    try {
      readRecipe(write(text));
    } catch (const ToolError& error) {
      EXPECT_EQ(error.code(), ExitCode::bad_input);
      EXPECT_NE(std::string(error.what()).find("recipe.json"), std::string::npos);
      return error.what();
    }
    return "";
  }
  std::filesystem::path folder_;
};

TEST_F(RecipeFile, ReadsSourceBesideItselfAndSettings) {
  const Recipe recipe = readRecipe(write(R"({
    // comments are welcome
    "sinew_recipe": 1, "source": "meshes/cow.obj",
    "settings": {"tetrahedra.vertices": 700, "clusters.grid": [2, 3, 4], "package.groups": false, "import.unit": "cm"}})"));
  EXPECT_EQ(recipe.source, folder_ / "meshes/cow.obj");
  EXPECT_EQ(recipe.settings.tetrahedra.target_vertices, 700U);
  EXPECT_EQ(recipe.settings.clusters.grid, (std::array<std::uint32_t, 3>{2, 3, 4}));
  EXPECT_EQ(Needs::parse(recipe.settings.package.needs), Needs::all().without(Need::groups));
  EXPECT_EQ(recipe.settings.import.unit, "cm");
}

TEST_F(RecipeFile, VersionOneMayNameASourceAnywhereAboveIt) {
  std::filesystem::create_directories(folder_ / "a/b");
  const auto file = folder_ / "a/b/old.json";
  std::ofstream(file) << R"({"sinew_recipe": 1, "source": "../../cow.obj"})";
  EXPECT_EQ(std::filesystem::weakly_canonical(readRecipe(file).source),
            std::filesystem::weakly_canonical(folder_ / "cow.obj"));
  std::ofstream(file) << R"({"sinew_recipe": 2, "project": "../..", "source": "../../cow.obj"})";
  EXPECT_NO_THROW(readRecipe(file));
  std::ofstream(file) << R"({"sinew_recipe": 2, "project": "..", "source": "../../cow.obj"})";
  EXPECT_THROW(readRecipe(file), ToolError);
}

TEST_F(RecipeFile, UntilVersionTwoSettingsCouldBeTexts) {
  const std::string rest = R"("source": "x.obj",
    "settings": {"package.groups": "off", "clusters.grid": "2,3,4", "tetrahedra.vertices": "700"},
    "clusters": [{"name": "a", "from": {"all": true}, "settings": {"stretch_hz": "20"}}]})";
  const Recipe recipe = readRecipe(write(R"({"sinew_recipe": 2, )" + rest));
  EXPECT_EQ(Needs::parse(recipe.settings.package.needs), Needs::all().without(Need::groups));
  EXPECT_EQ(recipe.settings.clusters.grid, (std::array<std::uint32_t, 3>{2, 3, 4}));
  EXPECT_EQ(recipe.settings.tetrahedra.target_vertices, 700U);
  EXPECT_EQ(recipe.clusters[0].settings[0].second, 20);
  EXPECT_FALSE(
      readRecipe(write(R"({"sinew_recipe": 2, "source": "x.obj", "settings": {"clusters.overlap_metres": "0"}})"))
          .settings.clusters.overlap);
  EXPECT_NE(
      errorOf(R"({"sinew_recipe": 2, "source": "x.obj", "settings": {"package.groups": "maybe"}})").find("groups"),
      std::string::npos);
  EXPECT_NE(errorOf(R"({"sinew_recipe": 3, )" + rest).find("clusters.grid"), std::string::npos);
}

TEST_F(RecipeFile, FaultsNameThePlace) {
  EXPECT_NE(errorOf("{\n\"sinew_recipe\": 1,\n\"source\" \"x\"}").find("line 3"), std::string::npos);
  EXPECT_NE(errorOf(R"({"sinew_recipe": 9, "source": "x.obj"})").find("version 9"), std::string::npos);
  EXPECT_NE(errorOf(R"({"source": "x.obj"})").find("sinew_recipe"), std::string::npos);
  EXPECT_NE(errorOf(R"({"sinew_recipe": 1})").find("source"), std::string::npos);
  EXPECT_NE(errorOf(R"({"sinew_recipe": 1, "source": "x.obj", "colour": 3})").find("colour"), std::string::npos);
  EXPECT_NE(errorOf(R"({"sinew_recipe": 1, "source": 5})").find("source"), std::string::npos);
  EXPECT_NE(
      errorOf(R"({"sinew_recipe": 1, "source": "x.obj", "settings": {"clusters.alpha": 7}})").find("clusters.alpha"),
      std::string::npos);
  EXPECT_NE(errorOf(""), "");
  EXPECT_NE(errorOf("[]"), "");
}

// Bones of two skeletons have one name; a third has a name of its own.
TEST_F(RecipeFile, BonesOfOneNameAreSaidToBeOne) {
  VisualMesh mesh = flat(2);
  mesh.joints = {"hand", "tip", "hand"};
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) mesh.skin.push_back({{v % 3, 1.0F}});
  const Topology topology = analyzeTopology(mesh);
  const Recipe recipe = readRecipe(write(R"({"sinew_recipe": 2, "source": "cow.obj"})"));
  std::vector<Finding> findings;
  Selections selections(recipe, mesh, topology, {}, findings);
  selections.evaluate({nlohmann::ordered_json::parse(R"({"bone": "tip"})"), "/pins/0/from"});
  EXPECT_TRUE(findings.empty());
  selections.evaluate({nlohmann::ordered_json::parse(R"({"bone": "hand"})"), "/pins/0/from"});
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].id, "bones-of-one-name");
  EXPECT_EQ(findings[0].count, 2U);
  EXPECT_NE(findings[0].cure.find(R"({"and":[{"bone":"hand"},{"object":"NAME"}]})"), std::string::npos);
}

}  // namespace
}  // namespace sinew::tools

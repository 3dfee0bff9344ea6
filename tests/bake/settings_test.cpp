// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/settings.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <set>

#include "sinew/runtime/settings.h"
#include "tools/author/recipe.h"
#include "tools/author/recipe_keys.h"
#include "tools/core/error.h"
#include "tools/core/progress.h"
#include "tools/import/import.h"

namespace sinew::tools {
namespace {

std::string errorOf(const std::string& assignment) {
  Settings settings;
  try {
    settings.assign(assignment);
  } catch (const ToolError& error) {
    EXPECT_EQ(error.code(), ExitCode::usage);
    return error.what();
  }
  return "";
}

TEST(Settings, EveryDefaultIsLegalAndKeysAreUnique) {
  Settings settings;
  std::set<std::string> keys;
  const nlohmann::ordered_json before = settings.toJson();
  for (const auto& d : Settings::declarations(settings)) {
    EXPECT_TRUE(keys.insert(std::string(d.key)).second) << d.key;
    EXPECT_TRUE(d.sentence.ends_with('.')) << d.key;
    settings.set(d.key, valueText(settings, d));
  }
  EXPECT_EQ(settings.toJson(), before);
  EXPECT_EQ(before.size(), keys.size());
}

TEST(Settings, TheImportChecksItsOptionsByTheirDeclaration) {
  Settings settings;
  const auto codeOf = [&] {
    Progress progress(false);
    try {
      importVisualMesh("there is no such file.obj", settings.import, progress);
    } catch (const ToolError& error) {
      return error.code();
    }
    return ExitCode::done;
  };
  std::size_t checked = 0;
  const auto check = [&](auto& value, auto least, auto most, auto step, std::string_view key) {
    const auto usual = value;
    for (const auto legal : {least, most}) {
      value = legal;
      EXPECT_EQ(codeOf(), ExitCode::bad_input) << key;
    }
    for (const auto beyond : {least - step, most + step}) {
      value = beyond;
      EXPECT_EQ(codeOf(), ExitCode::usage) << key;
    }
    value = usual;
    ++checked;
  };
  for (const auto& d : Settings::declarations(settings)) {
    if (!d.key.starts_with("import.")) continue;
    if (const auto* number = std::get_if<Settings::Number>(&d.type))
      check(*number->value, number->minimum, number->maximum, 1e-3, d.key);
    if (const auto* count = std::get_if<Settings::Count>(&d.type))
      check(*count->value, count->minimum, count->maximum, 1U, d.key);
  }
  EXPECT_EQ(checked, 4U);
}

TEST(Settings, ChoicesStandInTheOrderOfTheirEnumerations) {
  EXPECT_EQ(choicesOf("clusters.mode").at(std::size_t(formats::ClusterMode::quadratic)), "quadratic");
  EXPECT_EQ(choicesOf("clusters.limit").at(std::size_t(formats::LimitMethod::curve)), "curve");
  EXPECT_EQ(choicesOf("clusters.stiffness").at(std::size_t(formats::StiffnessModel::elastic)), "elastic");
  EXPECT_EQ(choicesOf("clusters.volume").at(std::size_t(formats::VolumeMethod::principal) + 1), "principal");
  const auto& pins = recipeKey("pin", "method").choices;
  ASSERT_EQ(pins.size(), 4U);
  EXPECT_EQ(pins[std::size_t(PinMethod::hold)], "hold");
  EXPECT_EQ(pins[std::size_t(PinMethod::infinite_mass)], "infinite_mass");
  EXPECT_EQ(pins[std::size_t(PinMethod::matrix)], "matrix");
  EXPECT_EQ(pins[RecipePins{}.method], recipeValue(recipeObject("pin"), nlohmann::ordered_json::object(), "method"));
}

TEST(Settings, ARecipesValuesHaveTheirTypes) {
  Settings settings;
  EXPECT_THROW(settings.setJson("clusters.stretch_hz", "20"), ToolError);
  EXPECT_THROW(settings.setJson("package.needs", true), ToolError);
  EXPECT_THROW(settings.setJson("clusters.grid", "2,2,2"), ToolError);
  EXPECT_THROW(settings.setJson("import.up", 1), ToolError);
  settings.setJson("clusters.grid", {2, 3, 4});
  EXPECT_EQ(settings.clusters.grid, (std::array<std::uint32_t, 3>{2, 3, 4}));
  EXPECT_EQ(settings.recipeValue("clusters.grid"), nlohmann::ordered_json({2, 3, 4}));
  settings.setJson("import.unit", 0.5);
  EXPECT_EQ(settings.import.unit, "0.5");
  EXPECT_THROW(settings.setJson("clusters.overlap", "0.02"), ToolError);
  settings.setJson("clusters.overlap", 0.02);
  EXPECT_EQ(settings.clusters.overlap, 0.02);
  EXPECT_EQ(settings.recipeValue("clusters.overlap"), 0.02);
  settings.setJson("clusters.overlap", "auto");
  EXPECT_EQ(settings.clusters.overlap, std::nullopt);
  EXPECT_EQ(settings.recipeValue("clusters.overlap"), "auto");
}

TEST(Settings, ValuesArriveWhereTheToolsReadThem) {
  Settings settings;
  settings.assign("tetrahedra.method=delaunay");
  settings.assign("clusters.grid=[4, 2,3]");
  settings.assign("clusters.overlap=0.25");
  settings.assign("import.unit=0.0254");
  settings.assign("package.needs=contact,cut");
  EXPECT_EQ(settings.tetrahedra.method, TetrahedraMethod::delaunay);
  EXPECT_EQ(settings.clusters.grid, (std::array<std::uint32_t, 3>{4, 2, 3}));
  EXPECT_EQ(settings.clusters.overlap, 0.25);
  EXPECT_EQ(settings.import.unit, "0.0254");
  EXPECT_EQ(settings.package.needs, "contact,cut");
}

TEST(Settings, WrongValuesAreRefusedWithTheLegalOnes) {
  EXPECT_NE(errorOf("vertices=900").find("tetrahedra.vertices"), std::string::npos);
  EXPECT_NE(errorOf("tetrahedra.method=voxels").find("auto | grid | stuffing | delaunay"), std::string::npos);
  EXPECT_NE(errorOf("clusters.overlap=-1").find("auto | 0 .. "), std::string::npos);
  EXPECT_NE(errorOf("clusters.overlap=nan"), "");
  EXPECT_NE(errorOf("clusters.overlap=0.5x"), "");
  EXPECT_NE(errorOf("tetrahedra.vertices=12.5"), "");
  EXPECT_NE(errorOf("tetrahedra.vertices=-1"), "");
  EXPECT_NE(errorOf("clusters.grid=[1,2]"), "");
  EXPECT_NE(errorOf("clusters.grid=[1,2,3,4]"), "");
  EXPECT_NE(errorOf("clusters.grid=[0,2,3]"), "");
  EXPECT_NE(errorOf("import.unit=furlong"), "");
  EXPECT_NE(errorOf("import.unit=-1"), "");
  EXPECT_NE(errorOf("package.needs=maybe"), "");
  EXPECT_NE(errorOf("tetrahedra.vertices"), "");
}

TEST(Settings, AMistypedKeyNamesTheNearest) {
  EXPECT_NE(errorOf("tetrahedra.vertexes=100").find("tetrahedra.vertices"), std::string::npos);
  EXPECT_NE(errorOf("cluster.grid=auto").find("clusters.grid"), std::string::npos);
}

TEST(Settings, TheDocumentedTableIsTheDeclarations) {
  std::ifstream in(std::string(SINEW_DOCS) + "/settings.md", std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  EXPECT_EQ(text, settingsMarkdown()) << "run: sinew help settings --markdown > docs/settings.md";
}

}  // namespace
}  // namespace sinew::tools

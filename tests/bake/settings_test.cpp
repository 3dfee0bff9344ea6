// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/settings.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <set>

#include "tools/core/error.h"

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

TEST(Settings, ValuesArriveWhereTheToolsReadThem) {
  Settings settings;
  settings.assign("tetrahedra.method=delaunay");
  settings.assign("clusters.grid=[4, 2,3]");
  settings.assign("clusters.overlap=0.25");
  settings.assign("import.unit=0.0254");
  settings.assign("package.textures=off");
  EXPECT_EQ(settings.tetrahedra.method, TetrahedraMethod::delaunay);
  EXPECT_EQ(settings.clusters.grid, (std::array<std::uint32_t, 3>{4, 2, 3}));
  EXPECT_EQ(settings.clusters.overlap, 0.25);
  EXPECT_EQ(settings.import.unit, "0.0254");
  EXPECT_FALSE(settings.package.textures);
}

TEST(Settings, WrongValuesAreRefusedWithTheLegalOnes) {
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
  EXPECT_NE(errorOf("package.groups=maybe"), "");
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

// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "sinew/runtime/world.h"
#include "tools/bake/bake.h"
#include "tools/bake/check_package.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

// Two cubes so far apart that a float there is a twentieth of their size: what the package says of its clusters is true
// of the vertices it holds.
TEST(Rounding, ClustersBelongToTheVerticesAsTheyAreStored) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("sinew_rounding" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  constexpr double kSize = 0.02, kApart = 20000;
  for (const int axis : {0, 1, 2}) {
    SCOPED_TRACE(axis);
    std::ofstream obj(folder / "two.obj");
    obj.precision(9);
    for (int cube = 0; cube < 2; ++cube) {
      for (int corner = 0; corner < 8; ++corner) {
        obj << 'v';
        for (int k = 0; k < 3; ++k) {
          obj << ' ' << (k == axis && cube == 1 ? kApart : 0) + ((corner >> k & 1) != 0 ? kSize : 0);
        }
        obj << '\n';
      }
      for (const char* face :
           {"-8 -6 -5 -7", "-4 -3 -1 -2", "-8 -7 -3 -4", "-6 -2 -1 -5", "-8 -4 -2 -6", "-7 -5 -1 -3"})
        obj << "f " << face << '\n';
    }
    obj.close();
    Recipe recipe = parseRecipe(R"({"sinew_recipe": 2, "source": "two.obj"})", folder / "two.json");
    recipe.settings.import.worker = SINEW_TEST_IMPORT_WORKER;
    Progress progress(false);
    const BakeResult result = bake(recipe, progress);
    const std::shared_ptr<const Asset> asset = *Asset::fromMemory(result.package);
    for (const Finding& finding : checkPackage(asset->package())) {
      EXPECT_NE(finding.severity, Severity::error) << finding.message;
    }
  }
  std::filesystem::remove_all(folder);
}

// A package holds no place more than a diagonal outside its bounds: a shell that would is refused with its setting, and
// the check of the recipe says so before.
TEST(Rounding, AShellThickerThanItsModelIsRefusedWithACure) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("sinew_thick" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream obj(folder / "sheet.obj");
  for (const char* y : {"0", "0.1", "0.2", "0.3", "0.4"}) {
    for (const char* x : {"0", "0.1", "0.2", "0.3", "0.4"}) obj << "v " << x << ' ' << y << " 0\n";
  }
  for (int i = 1; i <= 19; ++i) {
    if (i % 5 != 0) obj << "f " << i << ' ' << i + 1 << ' ' << i + 6 << ' ' << i + 5 << '\n';
  }
  obj.close();
  const auto refusal = [&](const char* thickness) -> std::string {
    const std::string text = R"({"sinew_recipe": 2, "source": "sheet.obj", "settings": {"tetrahedra.method": "shell", )"
                             R"("tetrahedra.thickness": )" +
                             std::string(thickness) + "}}";
    Recipe recipe = parseRecipe(text, folder / "sheet.json");
    recipe.settings.import.worker = SINEW_TEST_IMPORT_WORKER;
    Progress progress(false);
    const std::vector<Finding> before = rehearseBake(recipe, importSource(recipe, progress), progress, nullptr);
    try {
      bake(recipe, progress);
    } catch (const ToolError& error) {
      EXPECT_EQ(before.size(), 1U);
      for (const Finding& finding : before) {
        EXPECT_EQ(finding.severity, Severity::error);
        EXPECT_EQ("sheet.obj: " + finding.message + ". " + finding.cure,
                  std::string(error.what()).substr(std::string(error.what()).rfind("sheet.obj: ")));
      }
      return error.what();
    }
    EXPECT_TRUE(before.empty());
    return "";
  };
  EXPECT_EQ(refusal("0.5"), "");
  EXPECT_NE(refusal("3").find("Lower tetrahedra.thickness"), std::string::npos);
  std::filesystem::remove_all(folder);
}

// A skin of a ten thousandth of the sheet: vertices that coarsening left beside it hang by large weights, whose
// rounding is no displacement.
TEST(Rounding, ThinSkinsBake) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("sinew_thin" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  constexpr int kSide = 60;
  std::ofstream obj(folder / "sheet.obj");
  for (int i = 0; i <= kSide; ++i) {
    for (int j = 0; j <= kSide; ++j) {
      const double x = double(i) / kSide, z = double(j) / kSide;
      obj << "v " << x << ' ' << 0.15 * std::sin(11 * x + 5 * z) * std::cos(13 * z - 3 * x) << ' ' << z << '\n';
    }
  }
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      const int a = 1 + i * (kSide + 1) + j;
      obj << "f " << a << ' ' << a + 1 << ' ' << a + kSide + 2 << ' ' << a + kSide + 1 << '\n';
    }
  }
  obj.close();
  Recipe recipe = parseRecipe(R"({"sinew_recipe": 2, "source": "sheet.obj"})", folder / "sheet.json");
  recipe.settings.import.worker = SINEW_TEST_IMPORT_WORKER;
  recipe.settings.tetrahedra.method = TetrahedraMethod::shell;
  recipe.settings.tetrahedra.shell_thickness = 1e-4;
  recipe.settings.tetrahedra.target_vertices = 400;
  Progress progress(false);
  const BakeResult result = bake(recipe, progress);
  const std::shared_ptr<const Asset> asset = *Asset::fromMemory(result.package);
  EXPECT_GT(asset->package().info().max_rest_error, 1e-6F);
  for (const Finding& finding : checkPackage(asset->package())) {
    EXPECT_NE(finding.id, "attachment-error") << finding.message;
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace sinew::tools

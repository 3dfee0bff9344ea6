// SPDX-License-Identifier: GPL-3.0-or-later
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "tools/bake/bake.h"

namespace sinew::tools {
namespace {

// A hill with noise of more than a triangle's size: its motions have their energy in few tetrahedra each, so that
// samples of some motions are hardly any of others.
TEST(Rough, SamplesAreAsFirmAsTheSheet) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("sinew_rough" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  constexpr int kSide = 20;
  for (const unsigned seed : {1U, 7U, 8U, 9U}) {
    std::mt19937 random(seed);
    const auto noise = [&] {
      double sum = 0;
      for (int i = 0; i < 12; ++i) sum += double(random()) * 0x1p-32 - 0.5;
      return 1.5 * sum / kSide;
    };
    std::ofstream obj(folder / "sheet.obj");
    for (int i = 0; i <= kSide; ++i) {
      for (int j = 0; j <= kSide; ++j) {
        const double x = double(i) / kSide, y = double(j) / kSide;
        obj << "v " << x + noise() << ' ' << y + noise() << ' ' << 0.2 * std::sin(5 * x + 3 * y) + noise() << '\n';
      }
    }
    for (int i = 0; i < kSide; ++i) {
      for (int j = 0; j < kSide; ++j) {
        const int a = 1 + i * (kSide + 1) + j;
        obj << "f " << a << ' ' << a + 1 << ' ' << a + kSide + 2 << "\nf " << a << ' ' << a + kSide + 2 << ' '
            << a + kSide + 1 << '\n';
      }
    }
    obj.close();
    Recipe recipe = parseRecipe(R"({"sinew_recipe": 2, "source": "sheet.obj"})", folder / "sheet.json");
    recipe.settings.import.worker = SINEW_TEST_IMPORT_WORKER;
    Progress progress(false);
    const BakeResult result = bake(recipe, progress);
    for (const auto& piece : result.report.at("fields")) {
      const auto& space = piece.at("free");
      EXPECT_LE(space.at("samples").get<double>(),
                1 + recipe.settings.field.samples * space.at("functions").get<double>());
      EXPECT_GE(space.at("least_eigenvalue").get<double>(), 0.9);
    }
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace sinew::tools

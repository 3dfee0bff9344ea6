// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "sinew/runtime/asset.h"
#include "tools/bake/bake.h"

namespace sinew::tools {

/// A bake of a mesh that a test writes. \param change of the default settings
inline std::shared_ptr<const Asset> bakedObj(
    const std::string& name, const std::function<void(std::ofstream&)>& write,
    const std::function<void(Settings&)>& change = [](Settings&) {}) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("sinew_" + name + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  {
    std::ofstream obj(folder / (name + ".obj"));
    write(obj);
  }
  Recipe recipe = parseRecipe(R"({"sinew_recipe": 2, "source": ")" + name + ".obj\"}", folder / (name + ".json"));
  recipe.settings.import.worker = SINEW_TEST_IMPORT_WORKER;
  change(recipe.settings);
  Progress progress(false);
  auto asset = *Asset::fromMemory(bake(recipe, progress).package);
  std::filesystem::remove_all(folder);
  return asset;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/cli/files.h"

#include <algorithm>

#include "tools/core/command_line.h"
#include "tools/core/error.h"
#include "tools/import/import.h"

namespace sinew::tools {

std::shared_ptr<const Asset> loadPackage(const std::string& file) {
  auto asset = Asset::load(file);
  if (asset) return *asset;
  std::string reason = asset.reason();
  const std::string prefix = file + ": ";
  if (reason.starts_with(prefix)) reason.erase(0, prefix.size());
  // Never the advice to write over what the artist made.
  const std::string cure = isMeshName(file)
                               ? "Bake it first: " + commandLine({"sinew", "bake", file, "-o", packageName(file)}) + "."
                           : isForeign(Output::package, file)
                               ? "Name a package; sinew bake SOURCE -o OUT.sinew makes one."
                               : "Bake it again: " + commandLine({"sinew", "bake", "SOURCE", "-o", file}) + ".";
  throw ToolError(ExitCode::bad_input, file, reason, cure);
}

std::vector<std::shared_ptr<const Asset>> loadOthers(const std::vector<std::string>& files,
                                                     std::span<const SceneChoice> scenes) {
  const auto takes = [](const SceneChoice& scene) { return scene.takesSeveral(); };
  if (!files.empty() && std::none_of(scenes.begin(), scenes.end(), takes)) {
    throw ToolError(ExitCode::usage, files.front(), "the scene has one body, but more packages are given",
                    "Choose --scene stack, pyramid, pile, stairs or a file with bodies.");
  }
  std::vector<std::shared_ptr<const Asset>> others;
  for (const std::string& file : files) others.push_back(loadPackage(file));
  return others;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/cli/files.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <iterator>
#include <string_view>

#include "sinew/formats/sections.h"
#include "tools/core/atomic_file.h"
#include "tools/core/command_line.h"
#include "tools/core/error.h"
#include "tools/core/text.h"
#include "tools/import/import.h"

namespace sinew::tools {
namespace {

std::string endingOf(const std::filesystem::path& file) { return lowerCase(file.extension().string()); }

bool isPictureName(const std::filesystem::path& file) {
  constexpr std::string_view kEndings[] = {".png", ".jpg",  ".jpeg", ".tga", ".bmp", ".gif", ".tif", ".tiff",
                                           ".dds", ".webp", ".exr",  ".hdr", ".psd", ".svg", ".ktx", ".ktx2"};
  return std::find(std::begin(kEndings), std::end(kEndings), endingOf(file)) != std::end(kEndings);
}

// Whether a file lies there that holds something and does not begin as a package does.
bool isForeign(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error) || std::filesystem::file_size(file, error) == 0) return false;
  std::array<char, formats::kMagic.size()> head{};
  std::ifstream(file, std::ios::binary).read(head.data(), head.size());
  return head != formats::kMagic;
}

// SOURCE.obj -> SOURCE.sinew
std::string packageName(std::filesystem::path file) { return file.replace_extension(".sinew").string(); }

void requirePackage(const std::filesystem::path& file) {
  const std::string name = file.string();
  if (isMeshName(file) || isPictureName(file)) {
    throw ToolError(ExitCode::usage, name,
                    std::string("a package is not named like a ") + (isMeshName(file) ? "mesh" : "picture"),
                    "End its name with .sinew: -o " + packageName(file) + ".");
  }
  // A package that was damaged may be baked again; what a link leads to decides.
  std::error_code error;
  if (endingOf(std::filesystem::weakly_canonical(file, error)) != ".sinew" && isForeign(file)) {
    throw ToolError(ExitCode::usage, name, "is no Sinew package; writing would destroy it",
                    "Name another file to write, one that ends in .sinew.");
  }
}

}  // namespace

void requireOutput(Output what, const std::filesystem::path& file,
                   std::initializer_list<std::filesystem::path> inputs) {
  requireWritable(file, inputs);
  const std::string ending = endingOf(file);
  const auto refuse = [&](const char* why, const char* cure) {
    throw ToolError(ExitCode::usage, file.string(), why, cure);
  };
  switch (what) {
    case Output::package:
      requirePackage(file);
      break;
    case Output::picture:
      if (ending != ".png") refuse("pictures are written as .png", "Name a file that ends in .png.");
      break;
    case Output::picture_or_video:
      if (ending != ".png" && ending != ".mp4")
        refuse("pictures are written as .png, videos as .mp4", "Name a file that ends in one of them.");
      break;
    case Output::mesh:
      if (ending != ".obj") refuse("only .obj can be exported", "Name a file that ends in .obj.");
      break;
    case Output::report:
      if (isMeshName(file) || isPictureName(file) || ending == ".sinew")
        refuse("a report is JSON", "Name a file that ends in .json.");
      break;
  }
}

std::shared_ptr<const Asset> loadPackage(const std::string& file) {
  auto asset = Asset::load(file);
  if (asset) return *asset;
  std::string reason = asset.reason();
  const std::string prefix = file + ": ";
  if (reason.starts_with(prefix)) reason.erase(0, prefix.size());
  // Never the advice to write over what the artist made.
  const std::string cure =
      isMeshName(file)  ? "Bake it first: " + commandLine({"sinew", "bake", file, "-o", packageName(file)}) + "."
      : isForeign(file) ? "Name a package; sinew bake SOURCE -o OUT.sinew makes one."
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

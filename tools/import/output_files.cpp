// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/output_files.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>

#include "sinew/formats/sections.h"
#include "tools/core/atomic_file.h"
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

// What the beginning of each file of a kind holds that sinew wrote.
std::string_view markOf(Output what, std::string_view ending) {
  switch (what) {
    case Output::package:
      return {formats::kMagic.data(), formats::kMagic.size()};
    case Output::picture:
    case Output::picture_or_video:
      return ending == ".mp4" ? "ftyp" : kPictureMark;
    case Output::mesh:
      return "written by sinew";
    case Output::report:
      return "\"tool_version\"";
    case Output::scene:
      return "\"sinew_scene\"";
    case Output::page:
      return "<title>Error against run time";
    case Output::times:
      break;  // read before it is added to
  }
  return {};
}

void requirePackageName(const std::filesystem::path& file) {
  if (!isMeshName(file) && !isPictureName(file)) return;
  throw ToolError(ExitCode::usage, file.string(),
                  std::string("a package is not named like a ") + (isMeshName(file) ? "mesh" : "picture"),
                  "End its name with .sinew: -o " + packageName(file) + ".");
}

}  // namespace

std::string packageName(std::filesystem::path file) { return file.replace_extension(".sinew").string(); }

bool isForeign(Output what, const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error) || std::filesystem::file_size(file, error) == 0) return false;
  std::array<char, 8192> bytes{};
  std::ifstream in(file, std::ios::binary);
  in.read(bytes.data(), bytes.size());
  const std::string_view head(bytes.data(), std::size_t(in.gcount()));
  const std::string_view mark = markOf(what, endingOf(file));
  return what == Output::package ? !head.starts_with(mark) : head.find(mark) == std::string_view::npos;
}

void requireOutput(Output what, const std::filesystem::path& file,
                   std::initializer_list<std::filesystem::path> inputs) {
  requireWritable(file, inputs);
  const std::string ending = endingOf(file);
  const auto refuse = [&](const char* why, const char* cure) {
    throw ToolError(ExitCode::usage, file.string(), why, cure);
  };
  switch (what) {
    case Output::package: {
      requirePackageName(file);
      // A package that was damaged may be baked again; what a link leads to decides.
      std::error_code error;
      if (endingOf(std::filesystem::weakly_canonical(file, error)) != ".sinew" && isForeign(what, file))
        refuse("is no Sinew package; writing would destroy it", "Name another file to write, one that ends in .sinew.");
      return;
    }
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
    case Output::scene:
    case Output::report:
    case Output::times:
      if (isMeshName(file) || isPictureName(file) || ending == ".sinew")
        refuse("what is written is JSON", "Name a file that ends in .json.");
      break;
    case Output::page:
      break;
  }
  if (isForeign(what, file)) {
    refuse("was not written by sinew; writing would destroy it",
           "Name another file to write, or remove this one first.");
  }
}

}  // namespace sinew::tools

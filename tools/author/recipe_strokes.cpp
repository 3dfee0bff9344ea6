// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe_strokes.h"

#include <algorithm>
#include <cctype>
#include <charconv>

#include "tools/author/recipe.h"
#include "tools/core/atomic_file.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

// A mask's name as part of a file's.
std::string fileName(const std::string& mask) {
  std::string name;
  for (const char c : mask) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '_' || c == '-';
    name += plain ? c : '_';
  }
  return name;
}

fs::path strokeFolder(const fs::path& recipe) { return fs::path(recipe).replace_extension(".strokes"); }

// The number in NAME.NUMBER.json; 0 where the file is another's.
unsigned numberOf(const fs::path& file, const std::string& name) {
  const std::string text = file.filename().string();
  if (!text.starts_with(name + ".") || !text.ends_with(".json") || text.size() < name.size() + 7) return 0;
  const char* first = text.data() + name.size() + 1;
  const char* last = text.data() + text.size() - 5;
  unsigned number = 0;
  const auto [end, error] = std::from_chars(first, last, number);
  return error == std::errc() && end == last ? number : 0;
}

std::vector<fs::path> strokeFiles(const fs::path& folder, const std::string& name, unsigned& largest) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const unsigned number = numberOf(entry.path(), name);
    if (number == 0) continue;
    largest = std::max(largest, number);
    files.push_back(entry.path());
  }
  return files;
}

const Json* maskOf(const Json& document, const std::string& name) {
  if (!document.contains("masks") || !document["masks"].contains(name)) return nullptr;
  return &document["masks"][name];
}

}  // namespace

std::vector<Stroke> strokesOf(const RecipeEditor& editor, const std::string& mask) {
  const Json document = editor.document();
  const Json* selection = maskOf(document, mask);
  if (selection == nullptr || !selection->is_object() || !selection->contains("strokes")) return {};
  const Recipe recipe = parseRecipe(editor.text(), editor.file());
  return readStrokes(recipe.file((*selection)["strokes"].get<std::string>(), "/masks/" + mask));
}

void addStrokes(RecipeEditor& editor, const std::string& mask, std::span<const Stroke> strokes) {
  std::vector<Stroke> all = strokesOf(editor, mask);
  all.insert(all.end(), strokes.begin(), strokes.end());
  const fs::path folder = strokeFolder(editor.file());
  const std::string name = fileName(mask);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw ToolError(ExitCode::system, folder.string(), "cannot be made (" + error.message() + ")",
                    "Strokes lie beside the recipe: put it where you may write.");
  }
  unsigned largest = 0;
  const std::vector<fs::path> files = strokeFiles(folder, name, largest);
  const fs::path file = folder / (name + "." + std::to_string(largest + 1) + ".json");
  writeFileAtomically(file, strokesText(all));
  Json document = editor.document();
  const Json* before = maskOf(document, mask);
  const bool painted = before != nullptr && before->is_object() && before->contains("strokes");
  Json selection = painted ? *before : Json::object();
  selection["strokes"] = pathFromRecipe(editor.file(), file);
  if (before != nullptr && !painted) selection["over"] = *before;
  document["masks"][mask] = selection;
  editor.replace("stroke " + mask, document);
  for (const fs::path& old : files) {
    if (!editor.everMentions(old.filename().string())) fs::remove(old, error);
  }
}

void addMuscle(RecipeEditor& editor, const MuscleOptions& options,
               const std::function<Eigen::Vector3d()>& found_normal) {
  const auto usage = [](const std::string& what, const std::string& cure) {
    throw ToolError(ExitCode::usage, "", what, cure);
  };
  if (options.path.size() < 2) usage("a muscle needs two places that differ, on one part of the surface", "Move one.");
  if (!(options.width > 0)) usage("a muscle needs a width above 0", "Give it in metres.");
  const std::string region = options.name + ".region";
  const Json before = editor.document();
  if (maskOf(before, region) != nullptr)
    usage("there is a mask named '" + region + "'", "Choose another name for the muscle, or remove it.");
  RecipeEditor trial = editor;
  Stroke stroke;
  // The weight is one half in the middle of the falloff.
  stroke.radius = options.width / 4;
  stroke.falloff = options.width / 2;
  // The brush joins points along straight lines: so many that these lie near the surface.
  double since = options.width;
  for (std::size_t i = 0; i < options.path.size(); ++i) {
    if (i > 0) since += (options.path[i] - options.path[i - 1]).norm();
    if (since < options.width / 4 && i + 1 < options.path.size()) continue;
    stroke.points.push_back(options.path[i]);
    since = 0;
  }
  addStrokes(trial, region, {&stroke, 1});
  trial.addCluster(options.name, Json(region).dump());
  Json document = trial.document();
  Json& cluster = document["clusters"].back();
  const Eigen::Vector3d along = options.path.back() - options.path.front();
  cluster["channel"] = options.name;
  cluster["fibre"] = {sevenDigits(along[0]), sevenDigits(along[1]), sevenDigits(along[2])};
  cluster["settings"] = {{"overlap", 0}};  // as wide as it is said to be
  trial.replace("cluster", document);
  if (options.mirror) {
    trial.mirror(region, "", options.plane, found_normal);
    trial.mirror(options.name, "", options.plane, found_normal);
    // Its own mask in place of the mirror image of this one, so that it can be painted on.
    document = trial.document();
    document["clusters"].back()["from"] = otherSide(region);
    trial.replace("mirror", document);
  }
  editor.replace("muscle " + options.name, trial.document());
}

}  // namespace sinew::tools

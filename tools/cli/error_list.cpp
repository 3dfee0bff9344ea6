// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/cli/error_list.h"

#include <algorithm>
#include <filesystem>

#include "tools/author/json_text.h"
#include "tools/cli/files.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

class Reader {
 public:
  Reader(const std::string& file, const ErrorOptions& options)
      : text_(JsonText::read(file)), folder_(std::filesystem::path(file).parent_path()), options_(options) {}

  std::vector<ErrorEntry> run() const {
    const Json& json = text_.json();
    object(json, "", {"sinew_error_list", "entries", "note"});
    if (json.value("sinew_error_list", Json()) != 1) {
      text_.fail("/sinew_error_list", "is no list of version 1", R"(Begin it with "sinew_error_list": 1.)");
    }
    std::vector<ErrorEntry> entries;
    each(json, "", "entries", [&](const Json& one, const std::string& at) { entries.push_back(entry(one, at)); });
    if (entries.empty()) text_.fail("/entries", "has nothing to play", R"(Write [{"input": "my_mesh.obj"}].)");
    return entries;
  }

 private:
  ErrorEntry entry(const Json& json, const std::string& at) const {
    object(json, at, {"name", "input", "scenes", "settings", "functions", "vertices", "note"});
    ErrorEntry entry{.input = {}, .options = options_};
    const std::string name = string(json.value("input", Json()), childPointer(at, "input"));
    if (!std::filesystem::is_regular_file(folder_ / name)) {
      text_.fail(childPointer(at, "input"), "there is no file " + name, "Its path is relative to the list.");
    }
    entry.input = errorInput((folder_ / name).string());
    entry.input.name = json.contains("name") ? string(json["name"], childPointer(at, "name")) : name;
    each(json, at, "scenes", [&](const Json& scene, const std::string& place) {
      std::string known = string(scene, place);
      if (known.ends_with(".json")) {
        known = (folder_ / known).string();
        requireErrorScene(known);
      } else {
        checked(place, [&] { requireErrorScene(known); });
      }
      entry.options.scenes.push_back(known);
    });
    if (json.contains("settings")) {
      const std::string place = childPointer(at, "settings");
      if (!json["settings"].is_object()) text_.fail(place, "is no object", R"(Write {"tetrahedra.vertices": 500}.)");
      if (!entry.input.recipe) text_.fail(place, "changes nothing in a package", "Give its recipe or source.");
      for (const auto& [key, value] : json["settings"].items()) {
        checked(childPointer(place, key),
                [&, &setting = key, &to = value] { entry.input.recipe->settings.setJson(setting, to); });
      }
    }
    numbers(json, at, "functions", 1, ErrorOptions::kMostFunctions, entry.options.functions);
    numbers(json, at, "vertices", ErrorOptions::kLeastVertices, ErrorOptions::kMostVertices, entry.options.vertices);
    return entry;
  }

  void object(const Json& json, const std::string& pointer, const std::vector<std::string>& known) const {
    if (!json.is_object()) text_.fail(pointer, "is no object", "Write { \"key\": value, ... }.");
    for (const auto& [key, value] : json.items()) {
      if (std::find(known.begin(), known.end(), key) != known.end()) continue;
      text_.fail(childPointer(pointer, key), "there is no key '" + key + "' here",
                 "Did you mean " + nearestName(key, known) + "?");
    }
  }

  std::string string(const Json& json, const std::string& pointer) const {
    if (!json.is_string()) text_.fail(pointer, "needs a text", "Put it between quotes.");
    return json.get<std::string>();
  }

  template <class Take>
  void each(const Json& json, const std::string& at, const char* key, Take take) const {
    if (!json.contains(key)) return;
    const std::string place = childPointer(at, key);
    if (!json[key].is_array()) text_.fail(place, "is no list", "Write [ ... ].");
    for (std::size_t i = 0; i < json[key].size(); ++i) take(json[key][i], childPointer(place, i));
  }

  void numbers(const Json& json, const std::string& at, const char* key, std::uint32_t least, std::uint32_t most,
               std::vector<std::uint32_t>& result) const {
    if (json.contains(key)) result.clear();
    each(json, at, key, [&](const Json& number, const std::string& place) {
      if (!number.is_number_unsigned() || number < least || number > most) {
        text_.fail(place, "needs a whole number",
                   "Legal: " + std::to_string(least) + " to " + std::to_string(most) + ".");
      }
      result.push_back(number.get<std::uint32_t>());
    });
  }

  // Complaints without a place get one.
  template <class Set>
  void checked(const std::string& pointer, Set set) const {
    try {
      set();
    } catch (const ToolError& error) {
      text_.fail(pointer, error.problem(), error.cure());
    }
  }

  JsonText text_;
  std::filesystem::path folder_;
  ErrorOptions options_;
};

}  // namespace

ErrorInput errorInput(const std::string& file) {
  ErrorInput input;
  input.name = std::filesystem::path(file).filename().string();
  if (file.ends_with(".sinew")) {
    input.package = loadPackage(file);
  } else {
    input.recipe = recipeFor(file);
  }
  return input;
}

std::vector<ErrorEntry> readErrorList(const std::string& file, const ErrorOptions& options) {
  return Reader(file, options).run();
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe_commands.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <sstream>

#include "tools/author/mask_image.h"
#include "tools/author/material_presets.h"
#include "tools/author/recipe.h"
#include "tools/author/recipe_keys.h"
#include "tools/author/selection.h"
#include "tools/core/atomic_file.h"
#include "tools/core/command_line.h"
#include "tools/core/error.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr std::size_t kMostStates = 200;

[[noreturn]] void usage(const std::string& what, const std::string& cure) {
  throw ToolError(ExitCode::usage, "", what, cure);
}

fs::path historyFile(const fs::path& file) { return fs::path(file).concat(".history"); }

// One line for what fits, as people write recipes: lists of numbers and short objects stay on theirs.
void write(std::ostream& out, const Json& json, std::size_t indent) {
  const std::string flat = json.dump();
  const bool document = indent == 0;
  if (!document && (!json.is_structured() || json.empty() || flat.size() + indent <= 100)) {
    std::string spaced;
    bool text = false;
    for (std::size_t i = 0; i < flat.size(); ++i) {
      spaced += flat[i];
      if (flat[i] == '\\' && text) {
        spaced += flat[++i];
      } else if (flat[i] == '"') {
        text = !text;
      } else if (!text && (flat[i] == ',' || flat[i] == ':')) {
        spaced += ' ';
      }
    }
    out << spaced;
    return;
  }
  out << (json.is_object() ? "{\n" : "[\n");
  const std::string margin(indent + 2, ' ');
  std::size_t i = 0;
  for (const auto& [key, value] : json.items()) {
    out << margin;
    if (json.is_object()) out << Json(key).dump() << ": ";
    write(out, value, indent + 2);
    out << (++i < json.size() ? ",\n" : "\n");
  }
  out << std::string(indent, ' ') << (json.is_object() ? "}" : "]");
}

std::string written(const Json& document) {
  std::ostringstream out;
  try {
    write(out, document, 0);
  } catch (const Json::type_error&) {
    usage("a name or file name is not UTF-8, which a recipe cannot hold", "Give it another name.");
  }
  return out.str() + "\n";
}

// A value from the command line: JSON where it is, else the text itself.
Json valueOf(const std::string& text) {
  Json json = Json::parse(text, nullptr, false);
  return json.is_discarded() ? Json(text) : json;
}

Json selectionOf(const std::string& text) {
  Json json = valueOf(text);
  if (json.is_string() && !text.empty() && (text.front() == '{' || text.front() == '[')) {
    usage("the selection is not valid JSON: " + text, R"(Write it as in '{"group": "lip_upper"}', in single quotes.)");
  }
  if (!json.is_string() && !json.is_object()) {
    usage("'" + text + "' is no selection", "Give a mask's name, or JSON as in '{\"group\": \"lip_upper\"}'.");
  }
  return json;
}

Json* namedEntry(Json& document, const std::string& list, const std::string& name) {
  if (!document.contains(list)) return nullptr;
  if (list == "masks") return document[list].contains(name) ? &document[list][name] : nullptr;
  for (Json& entry : document[list]) {
    if (entry.contains("name") && entry["name"] == name) return &entry;
  }
  return nullptr;
}

// Masks last: entries are found first.
constexpr std::array<const char*, 4> kNamedLists = {"clusters", "pins", "parts", "masks"};

/// \param list its alone; empty: of all.
[[noreturn]] void noSuchName(const Json& document, const std::string& name, const std::string& list = "") {
  std::vector<std::string> names;
  for (const std::string kind : kNamedLists) {
    if (!document.contains(kind) || (!list.empty() && kind != list)) continue;
    for (const auto& [key, entry] : document[kind].items())
      names.push_back(kind == "masks" ? key : entry["name"].get<std::string>());
  }
  const std::string what = list.empty()     ? "mask, cluster, part or set of pins"
                           : list == "pins" ? "set of pins"
                                            : list.substr(0, list.size() - 1);
  usage("there is no " + what + " named '" + name + "'",
        names.empty() ? "The recipe has none yet." : "Did you mean " + nearestName(name, names) + "?");
}

// Every place where a selection names a mask; `visit` may change it.
template <class Visit>
void visitMaskNames(Json& selection, const Visit& visit) {
  if (selection.is_string()) {
    visit(selection);
    return;
  }
  if (!selection.is_object()) return;
  const RecipeObject* kind = selectionKind(selection);
  if (kind == nullptr) return;
  for (const RecipeKey& key : kind->keys) {
    if (!selection.contains(key.name)) continue;
    Json& value = selection[std::string(key.name)];
    if (key.name == "rest" && value.is_array()) {
      for (Json& name : value) visit(name);
    } else if ((key.type & kRecipeSelections) != 0) {
      for (Json& each : value) visitMaskNames(each, visit);
    } else if ((key.type & kRecipeSelection) != 0) {
      visitMaskNames(value, visit);
    }
  }
}

template <class Visit>
void visitSelections(Json& document, const Visit& visit) {
  if (document.contains("masks")) {
    for (auto& [name, mask] : document["masks"].items()) visitMaskNames(mask, visit);
  }
  for (const char* list : {"clusters", "pins", "stiffness", "thickness", "colors", "parts"}) {
    if (!document.contains(list)) continue;
    for (Json& entry : document[list]) {
      for (const char* key : {"from", "origin", "insertion", "to"}) {
        if (entry.contains(key)) visitMaskNames(entry[key], visit);
      }
    }
  }
}

bool isSetting(std::string_view key) {
  Settings settings;
  const auto all = Settings::declarations(settings);
  return std::any_of(all.begin(), all.end(), [&](const auto& d) { return d.key == key; });
}

// Findings of old keys are told where the recipe is read for use.
Json migrated(const JsonText& text, const fs::path& file) {
  std::vector<Finding> findings;
  return migratedRecipe(text, file, findings);
}

bool isKeyOf(std::string_view object, std::string_view key) {
  const std::vector<RecipeKey>& keys = recipeObject(object).keys;
  return std::any_of(keys.begin(), keys.end(), [&](const RecipeKey& k) { return k.name == key; });
}

void requireNewRecipe(const fs::path& file) {
  if (!isRecipe(file)) usage("a recipe's name ends in .json, not '" + file.string() + "'", "Name it NAME.json.");
  std::error_code error;
  if (fs::exists(file, error)) usage(file.string() + " is there already", "Choose another name, or edit that one.");
}

}  // namespace

std::string pathFromRecipe(const fs::path& recipe, const fs::path& file) {
  const fs::path folder = recipe.has_parent_path() ? recipe.parent_path() : fs::path(".");
  return fs::weakly_canonical(file).lexically_relative(fs::weakly_canonical(folder)).generic_string();
}

std::string otherSide(const std::string& name) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 3> kWords = {
      {{"left", "right"}, {"Left", "Right"}, {"LEFT", "RIGHT"}}};
  for (const auto& [left, right] : kWords) {
    for (const auto& [from, to] : {std::pair{left, right}, std::pair{right, left}}) {
      const std::size_t at = name.find(from);
      if (at != std::string::npos) return std::string(name).replace(at, from.size(), to);
    }
  }
  // A single letter at the end, or between two separators.
  for (std::size_t i = 1; i < name.size(); ++i) {
    if (std::string_view("._-").find(name[i - 1]) == std::string_view::npos) continue;
    if (i + 1 < name.size() && std::string_view("._-").find(name[i + 1]) == std::string_view::npos) continue;
    const std::size_t side = std::string_view("lrLR").find(name[i]);
    if (side == std::string_view::npos) continue;
    std::string other = name;
    other[i] = "rlRL"[side];
    return other;
  }
  return name;
}

RecipeEditor RecipeEditor::create(const fs::path& file, const fs::path& source) {
  requireNewRecipe(file);
  std::error_code error;
  if (!fs::is_regular_file(source, error)) {
    throw ToolError(ExitCode::bad_input, source.string(), "cannot be read", "Check the name and its permissions.");
  }
  Json document = {{"sinew_recipe", Recipe::kVersion}};
  const std::string relative = pathFromRecipe(file, source);
  if (relative.empty()) usage(source.string() + " has no path from the recipe", "Put both on one drive.");
  // As many folders up as the path begins with.
  std::string project;
  for (const fs::path& step : fs::path(relative)) {
    if (step != "..") break;
    project += project.empty() ? ".." : "/..";
  }
  if (!project.empty()) document["project"] = project;
  document["source"] = relative;
  RecipeEditor editor;
  editor.file_ = file;
  editor.states_.push_back({"new", ""});
  editor.commitText("new " + relative, written(document));
  editor.states_.erase(editor.states_.begin());
  editor.at_ = 0;
  return editor;
}

RecipeEditor RecipeEditor::open(const fs::path& file) {
  RecipeEditor editor;
  editor.file_ = file;
  const std::string text = JsonText::readFile(file.string());
  parseRecipe(text, file);
  std::error_code error;
  if (fs::exists(historyFile(file), error)) {
    try {
      const JsonText history = JsonText::read(historyFile(file).string());
      for (const Json& state : history.json().at("states")) {
        editor.states_.push_back({state.at("command").get<std::string>(), state.at("text").get<std::string>()});
      }
      editor.at_ = history.json().at("at").get<std::size_t>();
      if (editor.at_ >= editor.states_.size()) editor.states_.clear();
    } catch (const nlohmann::json::exception&) {
      editor.states_.clear();
    } catch (const ToolError&) {
      editor.states_.clear();  // a history that cannot be read is as good as none
    }
  }
  if (editor.states_.empty()) {
    editor.states_.push_back({"opened", text});
    editor.at_ = 0;
  } else if (editor.states_[editor.at_].text != text) {
    editor.states_.resize(editor.at_ + 1);
    editor.states_.push_back({"edited by hand", text});
    editor.at_ = editor.states_.size() - 1;
  }
  return editor;
}

RecipeEditor RecipeEditor::copy(const fs::path& from, const fs::path& file) {
  requireNewRecipe(file);
  RecipeEditor editor;
  const std::string text = JsonText::readFile(from.string());
  parseRecipe(text, from);
  editor.file_ = file;
  editor.states_.push_back(
      {"copied from " + from.filename().string(), written(migrated(JsonText(text, from.string()), from))});
  return editor;
}

void RecipeEditor::replace(const std::string& command, const Json& document) { commit(command, document); }

Json RecipeEditor::document() const { return migrated(JsonText(text(), file_.string()), file_); }

void RecipeEditor::commit(const std::string& command, const Json& document) { commitText(command, written(document)); }

void RecipeEditor::commitText(const std::string& command, std::string text) {
  parseRecipe(text, file_);
  states_.resize(at_ + 1);
  states_.push_back({command, std::move(text)});
  if (states_.size() > kMostStates) states_.erase(states_.begin());
  at_ = states_.size() - 1;
}

void RecipeEditor::addCluster(const std::string& name, const std::string& selection) {
  Json document = this->document();
  Json cluster = {{"name", name}};
  if (!selection.empty()) cluster["from"] = selectionOf(selection);
  document["clusters"].push_back(cluster);
  commit("add-cluster " + name, document);
}

void RecipeEditor::addClusters(const std::string& kind, const std::vector<SourceRegion>& regions) {
  Json document = this->document();
  for (const SourceRegion& region : regions) {
    document["clusters"].push_back({{"name", region.name}, {"from", region.selection}});
  }
  commit("add-clusters " + kind, document);
}

void RecipeEditor::setMask(const std::string& name, const std::string& selection) {
  Json document = this->document();
  document["masks"][name] = selectionOf(selection);
  commit("add-mask " + name, document);
}

void RecipeEditor::addPins(const std::string& name, const std::string& selection, const std::string& method,
                           const std::string& target) {
  Json document = this->document();
  Json pins = {{"name", name}, {"from", selectionOf(selection)}};
  if (!method.empty()) pins["method"] = method;
  if (!target.empty()) pins["target"] = target;
  document["pins"].push_back(pins);
  commit("add-pins " + name, document);
}

void RecipeEditor::addFactor(const std::string& list, const std::string& selection, double value) {
  Json document = this->document();
  document[list].push_back({{"from", selectionOf(selection)}, {"value", value}});
  commit("add-" + list, document);
}

void RecipeEditor::addPart(const std::string& name, const std::string& selection, const std::string& attach,
                           const std::string& to) {
  Json document = this->document();
  Json part = {{"name", name}, {"from", selectionOf(selection)}};
  if (!attach.empty()) part["attach"] = attach;
  if (!to.empty()) part["to"] = selectionOf(to);
  document["parts"].push_back(part);
  commit("add-part " + name, document);
}

std::vector<RecipeEditor::Change> RecipeEditor::setMaterial(const std::string& owner, const std::string& value) {
  const std::span<const MaterialPreset> presets = materialPresets();
  std::vector<std::string> names;
  const MaterialPreset* chosen = value == "default" ? &presets.front() : nullptr;
  for (const MaterialPreset& preset : presets) {
    names.emplace_back(preset.name);
    if (preset.name == value) chosen = &preset;
  }
  if (chosen == nullptr) {
    usage("there is no material '" + value + "'", "Did you mean " + nearestName(value, names) + "? There are " +
                                                      listed(names, names.size()) + ", and default.");
  }
  std::vector<std::pair<std::string, std::string>> values;
  for (const MaterialPreset::Value& one : chosen->values) {
    values.emplace_back(owner + "." + std::string(one.key), value == "default" ? value : exactText(one.value));
  }
  return setTogether(values, "set " + owner + ".material=" + value);
}

std::vector<RecipeEditor::Change> RecipeEditor::setTogether(std::span<const std::pair<std::string, std::string>> values,
                                                            const std::string& command) {
  RecipeEditor trial = *this;
  std::vector<Change> changes;
  for (const auto& [key, value] : values) {
    const auto made = trial.set(key, value);
    changes.insert(changes.end(), made.begin(), made.end());
  }
  commit(command, trial.document());
  return changes;
}

std::vector<RecipeEditor::Change> RecipeEditor::set(const std::string& key, const std::string& value) {
  constexpr std::string_view kMaterial = ".material";
  if (key.size() > kMaterial.size() && key.front() != '/' && key.ends_with(kMaterial))
    return setMaterial(key.substr(0, key.size() - kMaterial.size()), value);
  Json document = this->document();
  const bool removes = value == "default";
  std::vector<Change> changes;
  const auto put = [&](Json& object, const std::string& name, const Json& json, const std::string& place) {
    const std::string before = object.contains(name) ? object[name].dump() : "default";
    if (removes)
      object.erase(name);
    else
      object[name] = json;
    const std::string after = removes ? "default" : object[name].dump();
    if (before != after) changes.push_back({place, before, after});
  };
  const auto putSetting = [&](Json& owner, const std::string& name, const std::string& setting,
                              const std::string& place) {
    Json& settings = owner["settings"];
    if (settings.is_null()) settings = Json::object();
    put(settings, name, typedSetting(setting, valueOf(value)), place);
    if (settings.empty()) owner.erase("settings");
  };
  const auto isPattern = [](const std::string& text) { return text.find('*') != std::string::npos; };
  if (!key.empty() && key.front() == '/') {
    const char* const no_place = "Write it as in /clusters/0/from, without patterns (*).";
    try {
      const Json::json_pointer pointer(key);
      if (isPattern(key) && !document.contains(pointer)) usage("'" + key + "' is no place of the recipe", no_place);
      const std::string before = document.contains(pointer) ? document[pointer].dump() : "default";
      if (removes) {
        if (document.contains(pointer)) {
          Json& parent = document[pointer.parent_pointer()];
          if (parent.is_object())
            parent.erase(pointer.back());
          else
            parent.erase(std::stoul(pointer.back()));
        }
      } else {
        document[pointer] = valueOf(value);
      }
      const std::string after = removes ? "default" : document[pointer].dump();
      if (before != after) changes.push_back({key, before, after});
    } catch (const nlohmann::json::exception&) {
      usage("'" + key + "' is no place of the recipe", no_place);
    }
    commit("set " + key + "=" + value, document);
    return changes;
  }
  bool found = false;
  Settings settings;
  const auto all = Settings::declarations(settings);
  const auto putMatching = [&] {
    for (const auto& d : all) {
      if (!matchesPattern(d.key, key)) continue;
      found = true;
      const std::string setting(d.key);
      putSetting(document, setting, setting, setting);
    }
  };
  const std::size_t dot = key.rfind('.');
  // "*.mode" is the mode of whatever has a name; "tetra*.vertices" is a setting where nothing has such a name.
  const bool of_names = dot != std::string::npos && isPattern(key.substr(0, key.find('.')));
  if (!of_names) putMatching();
  if (!found && dot != std::string::npos) {
    const std::string names = key.substr(0, dot);
    const std::string name = key.substr(dot + 1);
    const bool pattern = isPattern(names) || isPattern(name);
    std::vector<std::string> own_settings = {name};
    if (isPattern(name)) {
      own_settings.clear();
      for (const auto& d : all) {
        const std::string setting(d.of_cluster ? d.key.substr(kClusterPrefix.size()) : "");
        if (d.of_cluster && matchesPattern(setting, name)) own_settings.push_back(setting);
      }
    }
    for (const auto& [list, object] : {std::pair{"clusters", "cluster"}, {"pins", "pin"}, {"parts", "part"}}) {
      if (!document.contains(list)) continue;
      const bool is_setting = std::string_view(list) == "clusters" && !own_settings.empty() &&
                              isSetting(std::string(kClusterPrefix) + own_settings[0]);
      // A plain name is one entry, whose key is checked with the recipe; a pattern matches the entries that have the
      // key.
      if (pattern ? !is_setting && !isKeyOf(object, name) : found) continue;
      for (Json& entry : document[list]) {
        const auto own = entry["name"].get<std::string>();
        const std::string in_list = std::string(list).append(".").append(own);
        if (!matchesPattern(own, names) && !matchesPattern(in_list, names)) continue;
        const auto homonyms = std::count_if(kNamedLists.begin(), kNamedLists.end() - 1, [&](const char* other) {
          return namedEntry(document, other, own) != nullptr;
        });
        const std::string owner = (homonyms > 1 ? in_list : own) + ".";
        found = true;
        if (!is_setting) put(entry, name, valueOf(value), owner + name);
        for (const std::string& setting : own_settings) {
          if (is_setting) putSetting(entry, setting, std::string(kClusterPrefix) + setting, owner + setting);
        }
      }
    }
  }
  if (!found && of_names && key.front() != '*') putMatching();
  if (!found && key.find_first_of("*?") != std::string::npos) {
    usage(
        "'" + key + "' matches nothing",
        "* stands for any letters, ? only for itself: in a setting's key (tetra*.vert*), in NAME, and in NAME.KEY for "
        "settings of clusters (l*.*_hz). All settings: sinew help settings.");
  }
  if (!found) {
    // NAME.KEY of a setting of clusters, or of a key that entries have: the name is what is wrong.
    const std::string name = dot == std::string::npos ? "" : key.substr(0, dot);
    const std::string last = dot == std::string::npos ? "" : key.substr(dot + 1);
    const bool is_key = isSetting(std::string(kClusterPrefix) + last) || isKeyOf("cluster", last) ||
                        isKeyOf("pin", last) || isKeyOf("part", last);
    if (is_key && name + "." != kClusterPrefix) noSuchName(document, name);
    settings.set(key, value);  // says what is wrong with it
    usage("'" + key + "' is neither a setting nor NAME.KEY of a cluster, part or set of pins",
          "All settings: sinew help settings.");
  }
  commit("set " + key + "=" + value, document);
  return changes;
}

void RecipeEditor::rename(const std::string& from, const std::string& to) {
  Json document = this->document();
  if (to.empty()) usage("a name cannot be empty", "Give the new name.");
  bool found = false;
  if (document.contains("masks") && document["masks"].contains(from)) {
    found = true;
    if (document["masks"].contains(to)) usage("there is a mask named '" + to + "'", "Choose another name.");
    Json masks = Json::object();
    for (const auto& [name, mask] : document["masks"].items()) masks[name == from ? to : name] = mask;
    document["masks"] = masks;
    visitSelections(document, [&](Json& name) {
      if (name == from) name = to;
    });
  }
  for (const char* list : {"clusters", "pins", "parts"}) {
    Json* entry = namedEntry(document, list, from);
    if (entry == nullptr) continue;
    found = true;
    // A cluster that its cluster mesh defines keeps it.
    if (std::string_view(list) == "clusters" && !entry->contains("from")) (*entry)["from"] = {{"cluster_mesh", from}};
    (*entry)["name"] = to;
  }
  if (found && document.contains("parts")) {
    for (Json& part : document["parts"]) {
      if (part.contains("to") && part["to"] == from) part["to"] = to;
    }
  }
  if (!found) noSuchName(document, from);
  commit("rename " + from + " " + to, document);
}

void RecipeEditor::move(const std::string& name, int by, const std::string& list) {
  Json document = this->document();
  for (const std::string kind : kNamedLists) {
    if (!document.contains(kind) || (!list.empty() && kind != list)) continue;
    // Masks are an object, in the order of its keys.
    std::vector<std::pair<std::string, Json>> entries;
    for (const auto& [key, value] : document[kind].items())
      entries.emplace_back(kind == "masks" ? key : value["name"].get<std::string>(), value);
    const auto at = std::find_if(entries.begin(), entries.end(), [&](const auto& e) { return e.first == name; });
    if (at == entries.end()) continue;
    const std::ptrdiff_t from = at - entries.begin(), to = from + by;
    if (to < 0 || to >= std::ptrdiff_t(entries.size())) {
      std::string problem = "'" + name + "' is number " + std::to_string(from + 1) + " of ";
      problem += counted(entries.size(), "entry", "entries") + " in " + kind + " and cannot go ";
      problem += std::to_string(std::abs(by)) + (by < 0 ? " up" : " down");
      usage(problem, "Move it less far.");
    }
    const auto first = entries.begin();
    if (to < from)
      std::rotate(first + to, first + from, first + from + 1);
    else
      std::rotate(first + from, first + from + 1, first + to + 1);
    Json sorted = kind == "masks" ? Json::object() : Json::array();
    for (const auto& [key, value] : entries) kind == "masks" ? void(sorted[key] = value) : sorted.push_back(value);
    document[kind] = sorted;
    commit("move " + name + (by < 0 ? " up " : " down ") + std::to_string(std::abs(by)), document);
    return;
  }
  noSuchName(document, name, list);
}

void RecipeEditor::remove(const std::string& name) {
  Json document = this->document();
  bool found = false;
  for (const char* list : {"clusters", "pins", "parts"}) {
    if (namedEntry(document, list, name) == nullptr) continue;
    found = true;
    Json kept = Json::array();
    for (const Json& entry : document[list]) {
      if (entry["name"] != name) kept.push_back(entry);
    }
    document[list] = kept;
    if (kept.empty()) document.erase(list);
  }
  if (!found && document.contains("masks") && document["masks"].contains(name)) {
    found = true;
    document["masks"].erase(name);
    if (document["masks"].empty()) document.erase("masks");
    std::size_t uses = 0;
    visitSelections(document, [&](Json& used) { uses += used == name ? 1U : 0U; });
    if (uses > 0) {
      usage("mask '" + name + "' is used by " + std::to_string(uses) + (uses == 1 ? " selection" : " selections"),
            "Remove or change what uses it first: " +
                commandLine({"sinew", "author", file_.string(), "show", "--json"}) + ".");
    }
  }
  if (!found) noSuchName(document, name);
  commit("remove " + name, document);
}

void RecipeEditor::mirror(const std::string& name, const std::string& to, const std::string& plane,
                          const std::function<Eigen::Vector3d()>& found_normal, const std::string& list) {
  Json document = this->document();
  const std::string target = to.empty() ? otherSide(name) : to;
  const std::string command = "mirror " + name + " " + target;
  const auto isMask = [&](const std::string& wanted) { return namedEntry(document, "masks", wanted) != nullptr; };
  const auto image = [&](const Json& selection) {
    Json mirrored = {{"mirror", selection}};
    if (plane != "auto" && !plane.empty()) mirrored["plane"] = plane;
    return mirrored;
  };
  for (const std::string kind : kNamedLists) {
    if (!list.empty() && kind != list) continue;
    Json* entry = namedEntry(document, kind, name);
    if (entry == nullptr) continue;
    if (target == name)
      usage("'" + name + "' has no side in its name that could be exchanged", "Give the new name with --to.");
    if (kind == "masks") {
      if (isMask(target)) usage("there is a mask named '" + target + "'", "Give another with --to.");
      document[kind][target] = image(Json(name));
      commit(command, document);
      return;
    }
    Json copy = *entry;
    copy["name"] = target;
    if (!copy.contains("from")) copy["from"] = {{"cluster_mesh", name}};
    for (const char* key : {"from", "origin", "insertion"}) {
      if (copy.contains(key)) copy[key] = image(copy[key]);
    }
    for (const char* key : {"channel", "target"}) {
      if (copy.contains(key)) copy[key] = otherSide(copy[key].get<std::string>());
    }
    if (copy.contains("to")) {
      // The carrier goes by its name, but for a mask that has no other side.
      Json& carrier = copy["to"];
      const std::string host = carrier.is_string() ? carrier.get<std::string>() : "";
      const std::string other = otherSide(host);
      const bool selects = !namedEntry(document, "clusters", host) && !namedEntry(document, "pins", host) &&
                           (host.empty() || isMask(host)) && (other == host || !isMask(other));
      carrier = selects ? image(carrier) : Json(other);
    }
    // Found directions mirror by themselves.
    if (copy.contains("fibre") && copy["fibre"].is_array()) {
      Json& fibre = copy["fibre"];
      const Eigen::Vector3d normal = plane.empty() || plane == "auto" ? found_normal()
                                                                      : Eigen::Vector3d::Unit(plane == "x"   ? 0
                                                                                              : plane == "y" ? 1
                                                                                                             : 2);
      const Eigen::Vector3d along(fibre[0].get<double>(), fibre[1].get<double>(), fibre[2].get<double>());
      const Eigen::Vector3d image_along = along - 2 * along.dot(normal) * normal;
      // Without what the reflection rounds beside a zero.
      for (int k = 0; k < 3; ++k) {
        fibre[std::size_t(k)] = std::abs(image_along[k]) > 1e-9 * along.norm() ? sevenDigits(image_along[k]) : 0.0;
      }
    }
    document[kind].push_back(copy);
    commit(command, document);
    return;
  }
  noSuchName(document, name, list);
}

void RecipeEditor::paint(const std::string& name, const fs::path& file, const std::string& options) {
  if (file.extension() != ".json") readMaskImage(file, {});
  Json document = this->document();
  Json mask = {{file.extension() == ".json" ? "strokes" : "image", pathFromRecipe(file_, file)}};
  if (!options.empty()) mask.update(furtherKeys(options, R"({"threshold": 0.5})"));
  document["masks"][name] = mask;
  commit("paint " + name + " " + file.filename().string(), document);
}

Json furtherKeys(const std::string& text, const std::string& example) {
  Json keys = Json::parse(text, nullptr, false);
  if (!keys.is_object()) usage("'" + text + "' is no JSON object", "Write it as in '" + example + "'.");
  return keys;
}

std::string RecipeEditor::undo() { return at_ == 0 ? std::string() : states_[at_--].command; }

std::string RecipeEditor::redo() { return at_ + 1 >= states_.size() ? std::string() : states_[++at_].command; }

std::vector<std::string> RecipeEditor::history() const {
  std::vector<std::string> commands;
  for (const State& state : states_) commands.push_back(state.command);
  return commands;
}

bool RecipeEditor::everMentions(std::string_view letters) const {
  return std::any_of(states_.begin(), states_.end(),
                     [&](const State& state) { return state.text.find(letters) != std::string::npos; });
}

void RecipeEditor::save() const {
  Json states = Json::array();
  for (const State& state : states_) states.push_back({{"command", state.command}, {"text", state.text}});
  const Json history = {{"at", at_}, {"states", states}};
  // The history first: if the second write fails, the recipe counts as edited by hand, and nothing is lost.
  writeFileAtomically(historyFile(file_), history.dump(1) + "\n");
  writeFileAtomically(file_, text());
}

}  // namespace sinew::tools

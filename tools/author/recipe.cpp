// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe.h"

#include <algorithm>
#include <functional>
#include <set>

#include "tools/author/needs.h"
#include "tools/author/recipe_keys.h"
#include "tools/author/recipe_shape.h"
#include "tools/core/error.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

// Runs a setting's own check, and adds line and place to its complaint.
void checked(const JsonText& text, const std::string& pointer, const std::function<void()>& set) {
  try {
    set();
  } catch (const ToolError& error) {
    const std::string what = error.what();
    const std::size_t stop = what.find(". ");
    text.fail(pointer, what.substr(0, stop), what.substr(stop + 2));
  }
}

SelectionText selectionAt(const Json& object, const std::string& pointer, std::string_view key) {
  const auto at = object.find(key);
  if (at == object.end()) return {};
  return {*at, childPointer(pointer, key)};
}

void readClusterSettings(const JsonText& text, const Json& json, const std::string& pointer, RecipeCluster& cluster) {
  Settings trial;
  std::vector<std::string> known;
  for (const auto& d : Settings::declarations(trial)) {
    if (d.of_cluster) known.emplace_back(d.key.substr(kClusterPrefix.size()));
  }
  for (const auto& [name, value] : json.items()) {
    const std::string place = childPointer(pointer, name);
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      text.fail(place, "a cluster has no setting '" + name + "'",
                "Did you mean " + nearestName(name, known) +
                    "? They are those of `sinew help settings` under clusters., "
                    "without that prefix and without method, grid, size and soften_metres.");
    }
    const std::string key = std::string(kClusterPrefix) + name;
    checked(text, place, [&, &setting = value] { trial.setJson(key, setting); });
    cluster.settings.emplace_back(key, value);
  }
}

RecipeCluster readCluster(const JsonText& text, const Json& json, const std::string& pointer) {
  RecipeCluster cluster;
  const RecipeObject& shape = recipeObject("cluster");
  cluster.name = json["name"].get<std::string>();
  cluster.pointer = pointer;
  cluster.from = selectionAt(json, pointer, "from");
  if (json.contains("settings")) {
    readClusterSettings(text, json["settings"], childPointer(pointer, "settings"), cluster);
  }
  if (json.contains("split")) cluster.split = json["split"].get<double>();
  if (json.contains("channel")) cluster.channel = json["channel"].get<std::string>();
  cluster.contraction = recipeValue(shape, json, "contraction").get<double>();
  const Json fibre = recipeValue(shape, json, "fibre");
  if (fibre.is_array()) {
    cluster.fibre = Eigen::Vector3d(fibre[0].get<double>(), fibre[1].get<double>(), fibre[2].get<double>());
    if (!(cluster.fibre->norm() > 0)) {
      text.fail(childPointer(pointer, "fibre"), "a fibre needs a direction that is not zero",
                "Give [1, 0, 0], or auto.");
    }
  }
  cluster.origin = selectionAt(json, pointer, "origin");
  cluster.insertion = selectionAt(json, pointer, "insertion");
  return cluster;
}

void readContent(const Json& json, Recipe& recipe) {
  const JsonText& text = *recipe.text;
  if (json.contains("settings")) {
    for (const auto& [key, value] : json["settings"].items()) {
      checked(text, childPointer("/settings", key),
              [&, &name = key, &setting = value] { recipe.settings.setJson(name, setting); });
    }
  }
  if (json.contains("masks")) {
    for (const auto& [name, mask] : json["masks"].items()) {
      recipe.masks.emplace_back(name, SelectionText{mask, childPointer("/masks", name)});
    }
  }
  std::set<std::string> names;
  const auto list = [&](const char* key, auto take) {
    if (!json.contains(key)) return;
    names.clear();
    for (std::size_t i = 0; i < json[key].size(); ++i) take(json[key][i], childPointer(childPointer("", key), i));
  };
  const auto unique = [&](const std::string& name, const std::string& pointer, const char* what) {
    if (!names.insert(name).second) {
      text.fail(childPointer(pointer, "name"), "there are two " + std::string(what) + " named '" + name + "'",
                "Rename or remove one of them.");
    }
  };
  list("clusters", [&](const Json& entry, const std::string& pointer) {
    recipe.clusters.push_back(readCluster(text, entry, pointer));
    unique(recipe.clusters.back().name, pointer, "clusters");
  });
  list("pins", [&](const Json& entry, const std::string& pointer) {
    RecipePins pins;
    pins.name = entry["name"].get<std::string>();
    pins.from = selectionAt(entry, pointer, "from");
    const std::string method = recipeValue(recipeObject("pin"), entry, "method").get<std::string>();
    const std::vector<std::string_view>& choices = recipeKey("pin", "method").choices;
    pins.method = std::uint32_t(std::find(choices.begin(), choices.end(), method) - choices.begin());
    pins.target = recipeValue(recipeObject("pin"), entry, "target").get<std::string>();
    unique(pins.name, pointer, "pins");
    recipe.pins.push_back(std::move(pins));
  });
  list("stiffness", [&](const Json& entry, const std::string& pointer) {
    recipe.stiffness.push_back({selectionAt(entry, pointer, "from"), entry["value"].get<double>()});
  });
  list("colors", [&](const Json& entry, const std::string& pointer) {
    RecipeColor color{selectionAt(entry, pointer, "from")};
    for (std::size_t k = 0; k < 3; ++k) color.color[k] = entry["color"][k].get<double>();
    recipe.colors.push_back(std::move(color));
  });
  list("thickness", [&](const Json& entry, const std::string& pointer) {
    recipe.thickness.push_back({selectionAt(entry, pointer, "from"), entry["value"].get<double>()});
  });
  list("parts", [&](const Json& entry, const std::string& pointer) {
    RecipePart part;
    part.name = entry["name"].get<std::string>();
    part.pointer = pointer;
    part.from = selectionAt(entry, pointer, "from");
    part.rigid = recipeValue(recipeObject("part"), entry, "attach") == "rigid";
    part.to = selectionAt(entry, pointer, "to");
    unique(part.name, pointer, "parts");
    recipe.parts.push_back(std::move(part));
  });
}

// Names with the places where they stand.
using Places = std::vector<std::pair<std::string, std::string>>;

// Masks and files that a selection names.
void namedThings(const Json& selection, const std::string& pointer, Places& names, Places& files) {
  if (selection.is_string()) {
    names.emplace_back(selection.get<std::string>(), pointer);
    return;
  }
  const RecipeObject* kind = selectionKind(selection);
  if (kind == nullptr) return;
  for (const RecipeKey& key : kind->keys) {
    if (!selection.contains(key.name)) continue;
    const Json& value = selection[std::string(key.name)];
    const std::string place = childPointer(pointer, key.name);
    if (key.name == "rest" && value.is_array()) {
      for (std::size_t i = 0; i < value.size(); ++i) {
        names.emplace_back(value[i].get<std::string>(), childPointer(place, i));
      }
    }
    if ((key.type & kRecipePath) != 0) files.emplace_back(value.get<std::string>(), place);
    if ((key.type & kRecipeSelection) != 0) namedThings(value, place, names, files);
    if ((key.type & kRecipeSelections) != 0) {
      for (std::size_t i = 0; i < value.size(); ++i) namedThings(value[i], childPointer(place, i), names, files);
    }
  }
}

// Every mask that is named exists, none needs itself, and every file lies inside the project.
class MaskCheck {
 public:
  explicit MaskCheck(const Recipe& recipe) : recipe_(recipe) {
    for (const auto& [name, mask] : recipe.masks) known_.push_back(name);
  }

  void selection(const SelectionText& selection) {
    if (selection.json.is_null()) return;
    Places names;
    Places files;
    namedThings(selection.json, selection.pointer, names, files);
    for (const auto& [name, pointer] : files) recipe_.file(name, pointer);
    for (const auto& [name, pointer] : names) {
      const SelectionText* mask = recipe_.mask(name);
      if (mask == nullptr) {
        recipe_.text->fail(pointer, "there is no mask '" + name + "'",
                           known_.empty() ? "The recipe has no masks; add it under \"masks\"."
                                          : "Did you mean " + nearestName(name, known_) + "? Add it under \"masks\".");
      }
      const auto at = std::find(stack_.begin(), stack_.end(), name);
      if (at != stack_.end()) {
        std::string cycle;
        for (auto it = at; it != stack_.end(); ++it) cycle.append(*it).append(" -> ");
        cycle += name;
        recipe_.text->fail(pointer, "the selection needs itself: " + cycle,
                           "Break the cycle: one of these masks must do without the next.");
      }
      if (done_.contains(name)) continue;
      stack_.push_back(name);
      this->selection(*mask);
      stack_.pop_back();
      done_.insert(name);
    }
  }

 private:
  const Recipe& recipe_;
  std::vector<std::string> known_;
  std::vector<std::string> stack_;
  std::set<std::string> done_;
};

// Selections of a recipe's list entries; not the carriers of parts, which may be the name of more than a mask.
std::vector<SelectionText> entrySelections(const Recipe& recipe) {
  std::vector<SelectionText> all;
  for (const RecipeCluster& cluster : recipe.clusters) {
    for (const SelectionText* s : {&cluster.from, &cluster.origin, &cluster.insertion}) all.push_back(*s);
    if (cluster.from.json.is_null()) all.push_back({{{"cluster_mesh", cluster.name}}, cluster.pointer});
  }
  for (const RecipePins& pins : recipe.pins) all.push_back(pins.from);
  for (const RecipeFactor& stiffness : recipe.stiffness) all.push_back(stiffness.from);
  for (const RecipeFactor& thickness : recipe.thickness) all.push_back(thickness.from);
  for (const RecipeColor& color : recipe.colors) all.push_back(color.from);
  for (const RecipePart& part : recipe.parts) all.push_back(part.from);
  std::erase_if(all, [](const SelectionText& selection) { return selection.json.is_null(); });
  return all;
}

fs::path folderOf(const fs::path& file) { return file.has_parent_path() ? file.parent_path() : fs::path("."); }

bool isInside(const fs::path& file, const fs::path& folder) {
  const fs::path inner = fs::weakly_canonical(file);
  const fs::path outer = fs::weakly_canonical(folder);
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

void takeProject(const Json& json, Recipe& recipe) {
  recipe.project = recipe.folder;
  if (!json.contains("project")) return;
  const fs::path steps = json["project"].get<std::string>();
  if (!std::all_of(steps.begin(), steps.end(), [](const fs::path& p) { return p == ".." || p == "." || p.empty(); })) {
    recipe.text->fail("/project", "the project folder must be the recipe's folder or one above it",
                      "Write \".\", \"..\", \"../..\" and so on.");
  }
  recipe.project = recipe.folder / steps;
}

void typeSettings(Json& owner, std::string_view prefix) {
  if (!owner.contains("settings") || !owner["settings"].is_object()) return;
  for (auto& [key, value] : owner["settings"].items()) value = typedSetting(std::string(prefix) + key, value);
}

Finding migration(const std::string& message, Severity severity, const std::string& cure) {
  Finding finding;
  finding.id = "recipe-migrated";
  finding.severity = severity;
  finding.count = 1;
  finding.message = message;
  finding.cure = cure;
  return finding;
}

// Before package.needs three flags said what a package keeps.
Json withNeeds(Json json, std::vector<Finding>& findings) {
  if (!json.contains("settings") || !json["settings"].is_object()) return json;
  Json& settings = json["settings"];
  if (settings.contains("package.needs")) return json;
  Needs needs = Needs::all();
  for (const auto& [key, need] :
       {std::pair("package.textures", Need::textures), std::pair("package.identity", Need::identity),
        std::pair("package.groups", Need::groups)}) {
    if (!settings.contains(key)) continue;
    const bool no =
        settings[key] == false || settings[key] == "off" || settings[key] == "false" || settings[key] == "no";
    const bool yes =
        settings[key] == true || settings[key] == "on" || settings[key] == "true" || settings[key] == "yes";
    if (!no && !yes) continue;  // told where it is read
    if (no) needs = needs.without(need);
    settings.erase(key);
  }
  if (needs == Needs::all()) return json;
  settings["package.needs"] = needs.text();
  findings.push_back(migration("flags of package are now package.needs = " + needs.text(), Severity::info,
                               "The next command of sinew author that changes the recipe writes it so."));
  return json;
}

// Until version 2 a setting's value could be a text of any type ("off"), and the overlap had three names: in boxes for
// grids, in metres (0: automatic) for authored clusters, and a cluster's own key.
Json asVersion3(Json json, std::vector<Finding>& findings) {
  json["sinew_recipe"] = Recipe::kVersion;
  const auto say = [&](const std::string& message, Severity severity) {
    findings.push_back(migration(message, severity,
                                 severity == Severity::info
                                     ? "The next command of sinew author that changes the recipe writes it so."
                                     : "Give clusters.overlap in metres where it is to differ."));
  };
  if (json.contains("settings") && json["settings"].is_object()) {
    Json& settings = json["settings"];
    const auto overlapAt = [&](const char* key) {
      return typedSetting("clusters.overlap", settings.value(key, Json()));
    };
    const Json boxes = overlapAt("clusters.overlap");
    const Json metres = overlapAt("clusters.overlap_metres");
    settings.erase("clusters.overlap");
    settings.erase("clusters.overlap_metres");
    if (!boxes.is_null() && boxes != 0.5) {
      say("clusters.overlap = " + boxes.dump() + " counted boxes of a grid and is left out: it is in metres now",
          Severity::warning);
    }
    if (!metres.is_null()) {
      if (metres != 0) settings["clusters.overlap"] = metres;
      say("clusters.overlap_metres = " + metres.dump() +
              " is now clusters.overlap = " + (metres == 0 ? "auto" : metres.dump()),
          Severity::info);
    }
  }
  typeSettings(json, "");
  std::size_t moved = 0;
  if (json.contains("clusters") && json["clusters"].is_array()) {
    for (Json& cluster : json["clusters"]) {
      if (!cluster.is_object()) continue;
      typeSettings(cluster, kClusterPrefix);
      if (!cluster.contains("overlap")) continue;
      if (cluster.contains("settings") && !cluster["settings"].is_object()) continue;  // told when it is read
      cluster["settings"]["overlap"] = cluster["overlap"];
      cluster.erase("overlap");
      ++moved;
    }
  }
  if (moved > 0) {
    say("the overlap of " + counted(moved, "cluster", "clusters") + " is now in the cluster's settings",
        Severity::info);
  }
  return json;
}

}  // namespace

bool isRecipe(const fs::path& file) { return file.extension() == ".json"; }

Json migratedRecipe(const JsonText& text, const fs::path& file, std::vector<Finding>& findings) {
  const Json& json = text.json();
  if (!json.is_object() || !json.contains("sinew_recipe")) {
    throw ToolError(ExitCode::bad_input, text.file(), "is JSON but no recipe (the key sinew_recipe is missing)",
                    R"(A recipe looks like {"sinew_recipe": 3, "source": "mesh.obj", "settings": {}}.)");
  }
  if (json["sinew_recipe"] == Recipe::kVersion) return withNeeds(json, findings);
  if (json["sinew_recipe"] == 2) return asVersion3(withNeeds(json, findings), findings);
  if (json["sinew_recipe"] != 1) {
    text.fail("/sinew_recipe",
              "is a recipe of version " + json["sinew_recipe"].dump() + ", this program reads versions 1 to " +
                  std::to_string(Recipe::kVersion),
              "Use the version of sinew that wrote it, or set sinew_recipe to 3 if it was written by hand.");
  }
  for (const auto& [key, value] : json.items()) {
    if (key != "sinew_recipe" && key != "source" && key != "settings") {
      text.fail(childPointer("", key), "a recipe of version 1 has no key '" + key + "'",
                "Set sinew_recipe to 3, or remove the key.");
    }
  }
  // Version 1 had no project folder: take the nearest one that holds the source.
  Json migrated = asVersion3(withNeeds(json, findings), findings);
  if (json.contains("source") && json["source"].is_string()) {
    const fs::path folder = folderOf(file);
    const fs::path source = folder / json["source"].get<std::string>();
    std::string project;
    const fs::path whole = fs::weakly_canonical(folder);
    const auto depth = std::distance(whole.begin(), whole.end());
    while (!isInside(source, folder / project) && std::count(project.begin(), project.end(), '.') < 2 * depth) {
      project += project.empty() ? ".." : "/..";
    }
    if (!project.empty()) {
      migrated["project"] = project;
      migrated["source"] =
          source.is_absolute() ? fs::relative(source, folder).string() : json["source"].get<std::string>();
    }
  }
  return migrated;
}

Recipe parseRecipe(std::string_view content, const fs::path& file) {
  Recipe recipe;
  auto text = std::make_shared<JsonText>(content, file.string());
  recipe.text = text;
  recipe.folder = folderOf(file);
  Json json = migratedRecipe(*text, file, recipe.migrated);
  checkRecipeShape(text->with(json));
  takeProject(json, recipe);
  recipe.source = recipe.file(json["source"].get<std::string>(), "/source");
  readContent(json, recipe);
  MaskCheck masks(recipe);
  for (const auto& [name, mask] : recipe.masks) masks.selection(SelectionText{name, mask.pointer});
  for (const SelectionText& selection : entrySelections(recipe)) masks.selection(selection);
  for (const RecipePart& part : recipe.parts) {
    // A name may also be that of a cluster, which the source alone may know: looked up when it is evaluated.
    if (!part.to.json.is_string()) masks.selection(part.to);
  }
  return recipe;
}

std::vector<SelectionText> newSelections(const Recipe& before, const Recipe& after) {
  const auto all = [](const Recipe& recipe) {
    std::vector<SelectionText> selections = entrySelections(recipe);
    for (const auto& [name, mask] : recipe.masks) selections.push_back(mask);
    return selections;
  };
  // "/pins", and what it selects: what may carry an accessory cannot be pinned.
  const auto inList = [](const SelectionText& selection) {
    return selection.pointer.substr(0, selection.pointer.find('/', 1)) + selection.json.dump();
  };
  std::set<std::string> known;
  for (const SelectionText& selection : all(before)) known.insert(inList(selection));
  std::vector<SelectionText> fresh = all(after);
  std::erase_if(fresh, [&](const SelectionText& selection) { return known.contains(inList(selection)); });
  return fresh;
}

Recipe readRecipe(const fs::path& file) { return parseRecipe(JsonText::readFile(file.string()), file); }

Recipe recipeFor(const fs::path& source_or_recipe) {
  if (isRecipe(source_or_recipe)) return readRecipe(source_or_recipe);
  Recipe recipe;
  recipe.source = source_or_recipe;
  recipe.text = std::make_shared<JsonText>("{}", source_or_recipe.string());
  return recipe;
}

const SelectionText* Recipe::mask(const std::string& name) const {
  const auto at = std::find_if(masks.begin(), masks.end(), [&](const auto& entry) { return entry.first == name; });
  return at == masks.end() ? nullptr : &at->second;
}

fs::path Recipe::file(const std::string& name, const std::string& pointer) const {
  fs::path path = folder / name;
  if (fs::path(name).is_absolute()) {
    text->fail(pointer, "'" + name + "' is an absolute path",
               "Give it relative to the recipe, so that others can use it.");
  }
  if (!isInside(path, project)) {
    text->fail(pointer, "'" + name + "' lies outside the project folder",
               "Move the file beside the recipe, or add \"project\": \"..\" where the folders above belong to it.");
  }
  return path;
}

}  // namespace sinew::tools

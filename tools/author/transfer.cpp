// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/transfer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "tools/author/json_text.h"
#include "tools/author/recipe.h"
#include "tools/author/recipe_keys.h"
#include "tools/author/selection.h"
#include "tools/author/stored_masks.h"
#include "tools/core/command_line.h"
#include "tools/core/error.h"
#include "tools/core/units.h"
#include "tools/import/import.h"

namespace sinew::tools {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

// Of its area a selection may say something else by this before it is stored, where weights differ by more than the
// second; borders may differ by one triangle.
constexpr double kSameWords = 0.01;
constexpr double kSameWeight = 0.02;
// The root mean square difference where vertices of the old source are; what counts as one; so few say nothing.
constexpr double kSameAtVertices = 0.02;
constexpr double kAtVertex = 0.999;
constexpr double kFewVertices = 0.1;
// Of the surface, and of each selection's area, that must be found again.
constexpr double kLeastFound = 0.5;
// Names that no recipe can have, for weights that will be stored.
constexpr const char* kPending = "\n";

// ---- Lengths and points of a recipe ----

bool isPoint(const Json& json) {
  return json.is_array() && json.size() == 3 &&
         std::all_of(json.begin(), json.end(), [](const Json& x) { return x.is_number(); });
}

// Moves what a recipe says in metres along with the model, by the declarations of its keys.
class Mover {
 public:
  explicit Mover(const Similarity& to_new) : to_new_(to_new) {}

  void object(const RecipeObject& shape, Json& json) const {
    if (shape.name == "mirror") plane(json);
    for (const RecipeKey& key : shape.keys) {
      const auto at = json.find(key.name);
      if (at == json.end()) continue;
      const auto has = [&](std::uint32_t type) { return (key.type & type) != 0; };
      if (key.type == 0) {
        for (Json& entry : *at) object(recipeObject(key.object), entry);
      } else if (has(kRecipeSelection)) {
        selection(*at);
      } else if (has(kRecipeSelections)) {
        for (Json& entry : *at) selection(entry);
      } else if (has(kRecipeMasks)) {
        for (auto& [name, mask] : at->items()) selection(mask);
      } else if (has(kRecipeSettings)) {
        settings(*at, "");
      } else if (has(kRecipeClusterSettings)) {
        settings(*at, std::string(kClusterPrefix));
      } else if (has(kRecipePoints)) {
        for (Json& entry : *at) entry = jsonOf(to_new_(pointOf(entry)));
      } else if (has(kRecipePoint) && isPoint(*at)) {
        *at = jsonOf(key.unit == "m" ? to_new_(pointOf(*at)) : Vector3d(to_new_.rotation * pointOf(*at)));
      } else if (key.unit == "m" && has(kRecipeNumber) && at->is_number()) {
        *at = sevenDigits(to_new_.scale * at->get<double>());
      }
    }
  }

 private:
  void selection(Json& json) const {
    if (!json.is_object()) return;
    if (const RecipeObject* kind = selectionKind(json)) object(*kind, json);
  }

  // A plane named by its axis needs its place, and after a turn its normal.
  void plane(Json& json) const {
    const std::string axis = json.value("plane", "auto");
    if (axis == "auto" && !json.contains("normal")) return;
    if (!json.contains("point")) json["point"] = {0, 0, 0};
    if (axis == "auto" || to_new_.rotation.isIdentity(1e-6)) return;
    json.erase("plane");
    json["normal"] = jsonOf(Vector3d::Unit(axis == "x" ? 0 : axis == "y" ? 1 : 2));
  }

  void settings(Json& json, const std::string& prefix) const {
    Settings defaults;
    for (const Settings::Declaration& d : Settings::declarations(defaults)) {
      if (d.unit != "m" || !d.key.starts_with(prefix)) continue;
      const auto at = json.find(d.key.substr(prefix.size()));
      if (at != json.end() && at->is_number()) *at = sevenDigits(to_new_.scale * at->get<double>());
    }
  }

  const Similarity& to_new_;
};

// ---- Files of a recipe ----

template <class Visit>
void visitFiles(Json& selection, const Visit& visit) {
  if (!selection.is_object()) return;
  const RecipeObject* kind = selectionKind(selection);
  if (kind == nullptr) return;
  for (const RecipeKey& key : kind->keys) {
    if (!selection.contains(key.name)) continue;
    Json& value = selection[std::string(key.name)];
    if ((key.type & kRecipePath) != 0) visit(value);
    if ((key.type & kRecipeSelection) != 0) visitFiles(value, visit);
    if ((key.type & kRecipeSelections) != 0) {
      for (Json& entry : value) visitFiles(entry, visit);
    }
  }
}

template <class Visit>
void visitSelections(Json& document, const Visit& visit) {
  if (document.contains("masks")) {
    for (auto& [name, mask] : document["masks"].items()) visit(mask);
  }
  for (const char* list : {"clusters", "pins", "stiffness", "thickness", "colors", "parts"}) {
    if (!document.contains(list)) continue;
    for (Json& entry : document[list]) {
      for (const char* key : {"from", "origin", "insertion", "to"}) {
        if (entry.contains(key)) visit(entry[key]);
      }
    }
  }
}

std::size_t stepsUp(const fs::path& path) { return std::size_t(std::count(path.begin(), path.end(), fs::path(".."))); }

// Gives every file its path from the new recipe, and the project folder the steps up that these need.
void moveFiles(Json& document, const fs::path& old_folder, const fs::path& new_recipe, const fs::path& source) {
  std::size_t most = 0;
  const auto take = [&](Json& file, const fs::path& from) {
    const std::string path = pathFromRecipe(new_recipe, from);
    if (path.empty()) {
      throw ToolError(ExitCode::usage, from.string(), "has no path from the recipe", "Put both on one drive.");
    }
    file = path;
    most = std::max(most, stepsUp(path));
  };
  visitSelections(document, [&](Json& selection) {
    visitFiles(selection, [&](Json& file) { take(file, old_folder / file.get<std::string>()); });
  });
  take(document["source"], source);
  const std::size_t present = document.contains("project") ? stepsUp(document["project"].get<std::string>()) : 0;
  if (most <= present) return;
  std::string project;
  for (std::size_t i = 0; i < most; ++i) project += i == 0 ? ".." : "/..";
  document["project"] = project;
}

// ---- The two sources ----

struct Source {
  VisualMesh mesh;
  std::vector<ClusterMesh> cluster_meshes;
  Topology topology;
};

Source readSource(const fs::path& file, const ImportOptions& options, Progress& progress) {
  Source source;
  source.mesh = importVisualMesh(file, options, progress);
  source.cluster_meshes = takeClusterMeshes(source.mesh);
  source.topology = analyzeTopology(source.mesh);
  return source;
}

// "cm" where the number is a unit's, else the number; empty where it is no usual one.
std::string unitNamed(double metres) {
  for (const LengthUnit& unit : kLengthUnits)
    if (std::abs(metres / unit.metres - 1) < 0.01) return std::string(unit.name);
  return "";
}

bool isUsualRatio(double ratio) {
  for (const double unit : {1.0, 0.0254, 0.3048, 0.0254 / 0.3048}) {
    for (const double r : {ratio / unit, ratio * unit}) {
      const double power = std::log10(r);
      if (std::abs(power - std::round(power)) < 0.005) return true;
    }
  }
  return false;
}

void setImport(Json& document, const char* key, const std::string& value) {
  if (value == "auto") {
    if (!document.contains("settings")) return;
    document["settings"].erase(key);
    if (document["settings"].empty()) document.erase("settings");
  } else {
    document["settings"][key] = value;
  }
}

std::string sentence(const char* format, double a, double b = 0, double c = 0) {
  char text[200];
  std::snprintf(text, sizeof text, format, a, b, c);
  return text;
}

// Reads the new source such that it lies on the old one, with what had to be changed in `document` said in `notes`.
Source readAligned(const fs::path& file, const Settings& settings, const Source& old, Json& document,
                   Alignment& alignment, std::vector<std::string>& notes, Progress& progress) {
  const Surface old_surface(old.mesh);
  const auto read = [&](const ImportOptions& options) {
    Source source = readSource(file, options, progress);
    alignment =
        findAlignment(old.mesh, old_surface, source.mesh, Surface(source.mesh), pairsByUv(old.mesh, source.mesh));
    return source;
  };
  ImportOptions options = settings.import;
  Source source = read(options);
  const bool given = options.unit != "auto" || options.up != "auto";
  if (alignment.to_old.isIdentity(old.mesh.diagonal)) return source;
  const double given_scale = alignment.to_old.scale;
  if (given) {
    options.unit = options.up = "auto";
    source = read(options);
    // Another size in any unit: then it stays in the one that was given.
    const double scale = alignment.to_old.scale;
    if (!isUsualRatio(scale) && std::abs(std::log(given_scale)) < std::abs(std::log(scale))) {
      options = settings.import;
      source = read(options);
    }
  }
  Matrix3d z_up;
  z_up << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const Similarity& s = alignment.to_old;
  if (std::abs(s.scale - 1) > 0.005 && isUsualRatio(s.scale)) {
    const double metres = source.mesh.metres_per_unit * s.scale;
    options.unit = unitNamed(metres);
    if (options.unit.empty()) options.unit = Json(sevenDigits(metres)).dump();
  }
  if (source.mesh.up_axis == "y" && s.rotation.isApprox(z_up, 0.02)) options.up = "z";
  if (source.mesh.up_axis == "z" && s.rotation.isApprox(z_up.transpose(), 0.02)) options.up = "y";
  if (options.unit != "auto" || options.up != "auto") source = read(options);
  if (options.unit != settings.import.unit) {
    setImport(document, "import.unit", options.unit);
    notes.push_back("import.unit is now " + options.unit + " (it was " + settings.import.unit + ")");
  }
  if (options.up != settings.import.up) {
    setImport(document, "import.up", options.up);
    notes.push_back("import.up is now " + options.up + " (it was " + settings.import.up + ")");
  }
  return source;
}

void describe(const Similarity& to_new, double diagonal, std::vector<std::string>& notes) {
  if (std::abs(to_new.scale - 1) >= 1e-4) {
    notes.push_back(sentence("the model is %.4g times as large: so are the recipe's lengths", to_new.scale));
  }
  const Eigen::AngleAxisd turn(to_new.rotation);
  if (turn.angle() > 1e-4) {
    notes.push_back(sentence("the model is turned by %.4g degrees", turn.angle() * 180 / 3.14159265358979323846) +
                    sentence(" about [%.3g, %.3g, %.3g]: so are the recipe's points", turn.axis()[0], turn.axis()[1],
                             turn.axis()[2]));
  }
  if (to_new.translation.norm() > 1e-4 * diagonal) {
    notes.push_back(sentence("the model is moved by [%.4g, %.4g, %.4g] m: so are the recipe's points",
                             to_new.translation[0], to_new.translation[1], to_new.translation[2]));
  }
}

// ---- Selections ----

std::vector<double> vertexAreas(const VisualMesh& mesh) {
  std::vector<double> area(mesh.positions.size(), 0);
  for (const Triangle& t : mesh.triangles) {
    const auto& x = mesh.positions;
    const double third = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).norm() / 6;
    for (const std::uint32_t v : t) area[v] += third;
  }
  return area;
}

double weightedArea(const std::vector<double>& area, const VisualWeights& weights) {
  double sum = 0;
  for (std::size_t v = 0; v < area.size(); ++v) sum += area[v] * weights[v];
  return sum;
}

class Carrier {
 public:
  Carrier(const Recipe& old_recipe, const Recipe& new_recipe, const Source& old, const Source& fresh,
          const SourceMatch& match)
      : old_recipe_(old_recipe),
        old_(old),
        new_(fresh),
        match_(match),
        old_selections_(old_recipe, old.mesh, old.topology, old.cluster_meshes, findings_),
        new_selections_(new_recipe, fresh.mesh, fresh.topology, fresh.cluster_meshes, findings_),
        old_area_(vertexAreas(old.mesh)),
        new_area_(vertexAreas(fresh.mesh)) {}

  void run(Json& document) {
    for (const auto& [name, mask] : old_recipe_.masks) this->mask(document, name);
    clusters(document);
    const auto list = [&](const char* key, const char* kind) {
      for (std::size_t i = 0; document.contains(key) && i < document[key].size(); ++i) {
        Json& entry = document[key][i];
        const std::string name = entry.contains("name") ? entry["name"].get<std::string>() : std::to_string(i);
        const std::string pointer = childPointer(childPointer("", key), i);
        selection(kind, name, childPointer(pointer, "from"), entry["from"]);
        // A part's carrier may be the name of a cluster or of pins as well, which are carried over themselves.
        if (entry.contains("to") && entry["to"].is_object()) {
          selection("carrier", name, childPointer(pointer, "to"), entry["to"]);
        }
      }
    };
    list("pins", "pins");
    list("stiffness", "stiffness");
    list("thickness", "thickness");
    list("colors", "color");
    list("parts", "part");
  }

  std::vector<TransferredSelection> selections;
  std::vector<StoredMask> stored;

 private:
  // A selection on its way: for the new recipe, for evaluation now (with names of weights that are not yet in a file),
  // and its weights.
  struct Carried {
    Json written, trial;
    VisualWeights weights;
    bool stored = false;
  };

  VisualWeights joined(VisualWeights weights) const {
    std::vector<double> points(new_.mesh.welded_positions.size(), 0);
    for (std::size_t v = 0; v < weights.size(); ++v) {
      points[new_.mesh.welded[v]] = std::max(points[new_.mesh.welded[v]], weights[v]);
    }
    for (std::size_t v = 0; v < weights.size(); ++v) weights[v] = points[new_.mesh.welded[v]];
    return weights;
  }

  VisualWeights carry(const VisualWeights& old_weights) const { return joined(match_.carry(old_weights, old_.mesh)); }

  VisualWeights oldWeights(const Json& json, const std::string& pointer) {
    return old_selections_.weights({json, pointer});
  }

  // Whether words select what was carried over. Where vertices of the old source are still there they must agree; in
  // between, a border may lie one triangle off, as subdividing and thinning do.
  bool same(const VisualWeights& words, const VisualWeights& carried) const {
    std::vector<double> low(new_.mesh.welded_positions.size(), 1);
    std::vector<double> high(low.size(), 0);
    for (const Triangle& t : new_.mesh.triangles) {
      for (const std::uint32_t v : t) {
        for (const std::uint32_t other : t) {
          low[new_.mesh.welded[v]] = std::min(low[new_.mesh.welded[v]], carried[other]);
          high[new_.mesh.welded[v]] = std::max(high[new_.mesh.welded[v]], carried[other]);
        }
      }
    }
    double selected = 0;
    double wrong = 0;
    double still_there = 0;
    double squared_there = 0;
    double squared = 0;
    for (std::size_t v = 0; v < carried.size(); ++v) {
      const double area = new_area_[v] * std::max(words[v], carried[v]);
      const double square = new_area_[v] * (words[v] - carried[v]) * (words[v] - carried[v]);
      selected += area;
      squared += square;
      const auto& corner = match_.vertices[v].corner;
      if (*std::max_element(corner.begin(), corner.end()) > kAtVertex) {
        still_there += area;
        squared_there += square;
      }
      const std::uint32_t point = new_.mesh.welded[v];
      const double off = std::max(low[point] - words[v], words[v] - high[point]);
      if (off > kSameWeight) wrong += new_area_[v] * off;
    }
    if (wrong > kSameWords * selected) return false;
    const double limit = kSameAtVertices * kSameAtVertices;
    return still_there > kFewVertices * selected ? squared_there <= limit * still_there : squared <= limit * selected;
  }

  // Words on the new source; false where they mean nothing there.
  bool evaluated(const Json& trial, VisualWeights& weights) {
    try {
      weights = new_selections_.weights({trial, "/trial"});
      return true;
    } catch (const ToolError& error) {
      if (error.code() != ExitCode::bad_input) throw;
      return false;
    }
  }

  Carried store(const std::string& name, VisualWeights weights) {
    std::string unique = name;
    for (int n = 2; std::any_of(stored.begin(), stored.end(), [&](const StoredMask& m) { return m.name == unique; });
         ++n) {
      unique = name + "." + std::to_string(n);
    }
    StoredMask mask{unique, std::vector<double>(new_.mesh.welded_positions.size(), 0)};
    for (std::size_t v = 0; v < weights.size(); ++v) mask.weights[new_.mesh.welded[v]] = std::min(weights[v], 1.0);
    Carried carried;
    carried.written = {{"stored", kPending}, {"mask", unique}};
    carried.trial = kPending + unique;
    new_selections_.define(kPending + unique, weights);
    stored.push_back(std::move(mask));
    carried.weights = std::move(weights);
    carried.stored = true;
    return carried;
  }

  // \param old the selection in the old recipe; \param fresh the same, moved along with the model.
  Carried transferred(const Json& old, const Json& fresh, const std::string& pointer, const std::string& name) {
    const VisualWeights carried = carry(oldWeights(old, pointer));
    Carried result;
    result.written = fresh;
    result.trial = fresh;
    const std::size_t stored_before = stored.size();
    if (fresh.is_object()) {
      const RecipeObject& kind = *selectionKind(fresh);
      for (const RecipeKey& declared : kind.keys) {
        const std::string key(declared.name);
        if (!fresh.contains(key)) continue;
        const std::string place = childPointer(pointer, key);
        if ((declared.type & kRecipeSelection) != 0) {
          Carried inner = transferred(old[key], fresh[key], place, name);
          result.written[key] = inner.written;
          result.trial[key] = inner.trial;
        } else if ((declared.type & kRecipeSelections) != 0) {
          for (std::size_t i = 0; i < fresh[key].size(); ++i) {
            Carried inner = transferred(old[key][i], fresh[key][i], childPointer(place, i), name);
            result.written[key][i] = inner.written;
            result.trial[key][i] = inner.trial;
          }
        }
      }
    }
    if (evaluated(result.trial, result.weights) && same(result.weights, carried)) {
      result.stored = stored.size() > stored_before;
      return result;
    }
    stored.resize(stored_before);  // parts of it are not needed any more
    return store(name, carried);
  }

  void report(const char* kind, const std::string& name, bool is_stored, const VisualWeights& old_weights,
              const VisualWeights& weights) {
    TransferredSelection entry;
    entry.kind = kind;
    entry.name = name;
    entry.stored = is_stored;
    double squared = 0;
    std::size_t placed = 0;
    for (std::size_t v = 0; v < weights.size(); ++v) {
      if (!(weights[v] > 0)) continue;
      const SourceMatch::Vertex& m = match_.vertices[v];
      ++entry.matched[std::size_t(m.rule)];
      if (m.triangle == formats::kNone) continue;
      ++placed;
      squared += m.distance * m.distance;
      entry.largest = std::max(entry.largest, m.distance);
    }
    if (placed > 0) entry.rms = std::sqrt(squared / double(placed));
    entry.old_area = weightedArea(old_area_, old_weights);
    entry.new_area = weightedArea(new_area_, weights);
    selections.push_back(std::move(entry));
  }

  void selection(const char* kind, const std::string& name, const std::string& pointer, Json& json) {
    const Json old = oldJson(pointer);
    Carried carried = transferred(old, json, pointer, name);
    report(kind, name, carried.stored, oldWeights(old, pointer), carried.weights);
    json = carried.written;
  }

  Json oldJson(const std::string& pointer) const { return old_recipe_.text->json().at(Json::json_pointer(pointer)); }

  void mask(Json& document, const std::string& name) {
    if (!done_.insert(name).second) return;
    const SelectionText& old = *old_recipe_.mask(name);
    // Masks that it names first; recipes have no cycles.
    visitNames(old.json, [&](const std::string& needed) { mask(document, needed); });
    // "rest" has a meaning within clusters only: judged there.
    if (usesRest(old_recipe_, old.json)) return;
    Json& json = document["masks"][name];
    Carried carried = transferred(old.json, json, old.pointer, name);
    report("mask", name, carried.stored, oldWeights(old.json, old.pointer), carried.weights);
    json = carried.written;
    new_selections_.define(name, carried.weights);
  }

  template <class Visit>
  static void visitNames(const Json& selection, const Visit& visit) {
    if (selection.is_string()) {
      visit(selection.get<std::string>());
      return;
    }
    const RecipeObject* kind = selection.is_object() ? selectionKind(selection) : nullptr;
    if (kind == nullptr) return;
    for (const RecipeKey& key : kind->keys) {
      if (!selection.contains(key.name)) continue;
      const Json& value = selection[std::string(key.name)];
      if (key.name == "rest" && value.is_array()) {
        for (const Json& name : value) visit(name.get<std::string>());
      } else if ((key.type & kRecipeSelection) != 0) {
        visitNames(value, visit);
      } else if ((key.type & kRecipeSelections) != 0) {
        for (const Json& each : value) visitNames(each, visit);
      }
    }
  }

  void clusters(Json& document) {
    const std::vector<RecipeCluster> all = withClusterMeshes(old_recipe_, old_.cluster_meshes);
    if (all.empty()) return;
    const std::vector<VisualWeights> old_weights = old_selections_.clusters();
    VisualWeights covered(new_.mesh.positions.size(), 0);
    for (const bool rest : {false, true}) {
      for (std::size_t c = 0; c < all.size(); ++c) {
        if (usesRest(old_recipe_, all[c].from.json) != rest) continue;
        const VisualWeights weights = cluster(document, all[c], c, old_weights[c], rest ? &covered : nullptr);
        if (rest) continue;
        for (std::size_t v = 0; v < covered.size(); ++v) covered[v] = std::max(covered[v], weights[v]);
      }
    }
  }

  VisualWeights cluster(Json& document, const RecipeCluster& old, std::size_t number, const VisualWeights& old_weights,
                        const VisualWeights* covered) {
    const bool in_recipe = number < old_recipe_.clusters.size();
    const VisualWeights carried_weights = carry(old_weights);
    Carried carried;
    if (covered != nullptr) {
      // Only the plain rest keeps its words; its weights are what the new clusters leave.
      carried.written = document["clusters"][number]["from"];
      carried.weights.resize(covered->size());
      for (std::size_t v = 0; v < covered->size(); ++v) carried.weights[v] = 1 - (*covered)[v];
      if (carried.written != Json{{"rest", true}} || !same(carried.weights, carried_weights)) {
        carried = store(old.name, carried_weights);
      }
    } else if (old.from.json.is_null()) {
      const Json words = {{"cluster_mesh", old.name}};
      if (!evaluated(words, carried.weights) || !same(carried.weights, carried_weights)) {
        carried = store(old.name, carried_weights);
      }
    } else {
      carried = transferred(old.from.json, document["clusters"][number]["from"], old.from.pointer, old.name);
    }
    report("cluster", old.name, carried.stored, old_weights, carried.weights);
    if (!in_recipe && carried.stored) document["clusters"].push_back({{"name", old.name}});
    if (in_recipe || carried.stored) {
      Json& entry = in_recipe ? document["clusters"][number] : document["clusters"].back();
      if (!carried.written.is_null()) entry["from"] = carried.written;
      for (const char* key : {"origin", "insertion"}) {
        if (entry.contains(key)) selection(key, old.name, childPointer(old.pointer, key), entry[key]);
      }
    }
    return carried.weights;
  }

  const Recipe& old_recipe_;
  const Source& old_;
  const Source& new_;
  const SourceMatch& match_;
  std::vector<Finding> findings_;  // of evaluation; the bake will say them
  Selections old_selections_;
  Selections new_selections_;
  std::vector<double> old_area_, new_area_;
  std::set<std::string> done_;
};

// A name for the mask file that nothing has yet: an older one may be what undo needs.
fs::path freeMaskFile(const fs::path& recipe) {
  const fs::path stem = fs::path(recipe).replace_extension();
  std::error_code error;
  for (int n = 1;; ++n) {
    fs::path file = stem.string() + ".masks" + (n == 1 ? "" : "." + std::to_string(n)) + ".json";
    if (!fs::exists(file, error)) return file;
  }
}

void refuseWhatIsMissing(const TransferResult& result, const fs::path& source, const fs::path& recipe) {
  std::string missing;
  std::string first;
  for (const TransferredSelection& s : result.selections) {
    if (s.old_area <= 0 || s.new_area >= kLeastFound * s.old_area) continue;
    if (first.empty()) first = s.name;
    missing += (missing.empty() ? "" : ", ") + s.kind + " " + s.name +
               sentence(" (%.0f %% of its area)", 100 * s.new_area / s.old_area);
  }
  if (missing.empty()) return;
  throw ToolError(ExitCode::bad_input, source.string(), "lacks what the recipe names: " + missing,
                  "If it was taken out on purpose, remove it first: " +
                      commandLine({"sinew", "author", recipe.string(), "remove", first}) + ".");
}

}  // namespace

TransferResult transferRecipe(const TransferOptions& options, Progress& progress) {
  const Recipe old_recipe = readRecipe(options.recipe);
  const fs::path& target = options.output.empty() ? options.recipe : options.output;
  RecipeEditor editor =
      options.output.empty() ? RecipeEditor::open(options.recipe) : RecipeEditor::copy(options.recipe, options.output);
  const fs::path old_source = options.old_source.empty() ? old_recipe.source : options.old_source;
  std::error_code error;
  if (fs::equivalent(old_source, options.new_source, error)) {
    throw ToolError(ExitCode::usage, options.new_source.string(), "is the source that the recipe has already",
                    "Name the new one; where it has replaced the old one, add --old FILE with a copy of the old one.");
  }
  TransferResult result{std::move(editor), {}, {}, {}, 0, 0, false, {}};
  Json document = result.editor.document();

  progress.stage("old source");
  const Source old = readSource(old_source, old_recipe.settings.import, progress);
  progress.stage("new source");
  Alignment alignment;
  const Source fresh =
      readAligned(options.new_source, old_recipe.settings, old, document, alignment, result.notes, progress);
  const Similarity to_new = alignment.to_old.inverse();
  const bool moved = !to_new.isIdentity(old.mesh.diagonal);
  if (moved) {
    describe(to_new, fresh.mesh.diagonal, result.notes);
    Mover(to_new).object(recipeObject("recipe"), document);
  }
  result.error = alignment.error;

  progress.stage("matching");
  const SourceMatch match = matchSources(old.mesh, fresh.mesh, fresh.topology, alignment.to_old);
  result.matched = match.matched;
  result.uvs_kept = match.uvs_kept;
  if (match.matched < kLeastFound) {
    throw ToolError(
        ExitCode::bad_input, options.new_source.string(),
        sentence("only %.0f %% of its surface", 100 * match.matched) + " lies on that of " + old_source.string() +
            sentence(" (mean distance %.2g of the diagonal, in the best of all axes and units)", alignment.error),
        "It is another model; begin a recipe for it with " +
            commandLine({"sinew", "author", "NEW.json", "new", options.new_source.string()}) + ".");
  }

  progress.stage("selections");
  moveFiles(document, old_recipe.folder, target, options.new_source);
  // Files are looked for from where the new recipe will stand.
  const Recipe new_recipe = parseRecipe(document.dump(), target);
  Carrier carrier(old_recipe, new_recipe, old, fresh, match);
  carrier.run(document);
  result.selections = std::move(carrier.selections);
  for (TransferredSelection& s : result.selections) s.old_area *= to_new.scale * to_new.scale;
  refuseWhatIsMissing(result, options.new_source, options.recipe);
  if (!carrier.stored.empty()) {
    result.mask_file = freeMaskFile(target);
    result.mask_text = storedMasksText(fresh.mesh, carrier.stored);
    const std::string name = result.mask_file.filename().string();
    visitSelections(document, [&](Json& selection) {
      visitFiles(selection, [&](Json& file) {
        if (file == kPending) file = name;
      });
    });
  }
  for (const TransferredSelection& s : result.selections) {
    if (s.old_area > 0 || s.new_area > 0) continue;
    result.notes.push_back(s.kind + " " + s.name + " selects nothing, before as now");
  }
  result.editor.replace("transfer " + options.new_source.filename().string(), document);
  progress.finish();
  return result;
}

}  // namespace sinew::tools

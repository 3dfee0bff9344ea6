// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "tools/author/recipe_commands.h"
#include "tools/author/recipe_keys.h"
#include "tools/author/recipe_strokes.h"
#include "tools/author/recipe_values.h"
#include "tools/author/transfer.h"
#include "tools/bake/authored.h"
#include "tools/bake/findings_json.h"
#include "tools/cli/files.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/core/atomic_file.h"
#include "tools/core/command_line.h"
#include "tools/core/progress.h"
#include "tools/import/import.h"
#include "tools/import/topology.h"
#include "tools/render/front.h"
#include "tools/render/weights_picture.h"

namespace sinew::tools {
namespace {

struct AuthorCommand {
  std::string recipe;
  std::string name, other, from, method, target, attach, to, plane, options, picture, old_source;
  std::string mode = "paint";
  std::vector<std::string> assignments, names;
  double value = 1;
  std::string list;
  int places = 1;
  bool json = false, mirror = false;
  Stroke stroke;
};

// Part of the surface that a weight covers.
double coverage(const VisualMesh& mesh, const VisualWeights& weights) {
  double area = 0;
  double covered = 0;
  for (const Triangle& t : mesh.triangles) {
    const auto& x = mesh.positions;
    const Eigen::Vector3d a = x[t[1]] - x[t[0]];
    const Eigen::Vector3d b = x[t[2]] - x[t[0]];
    const double twice =
        Eigen::Vector3d(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]).norm();
    area += twice;
    covered += twice * (weights[t[0]] + weights[t[1]] + weights[t[2]]) / 3;
  }
  return area > 0 ? covered / area : 0;
}

std::size_t selected(const VisualWeights& weights) {
  std::size_t count = 0;
  for (const double w : weights) count += w > 0 ? 1U : 0U;
  return count;
}

struct Shown {
  std::string kind;
  NamedWeights weights;
};

// The weights of the named masks, clusters and pins; of all of them where none is named.
std::vector<Shown> evaluate(const AuthorCommand& command, const Recipe& recipe, const VisualMesh& mesh,
                            const std::vector<ClusterMesh>& cluster_meshes, std::vector<Finding>& findings) {
  const Topology topology = analyzeTopology(mesh);
  Selections selections(recipe, mesh, topology, cluster_meshes, findings);
  std::vector<Shown> shown;
  std::vector<std::string> known;
  const auto wanted = [&](const std::string& name) {
    known.push_back(name);
    return command.names.empty() || std::find(command.names.begin(), command.names.end(), name) != command.names.end();
  };
  const std::vector<RecipeCluster> clusters = withClusterMeshes(recipe, cluster_meshes);
  const std::vector<VisualWeights> weights = selections.clusters();
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    if (wanted(clusters[c].name)) shown.push_back({"cluster", {clusters[c].name, weights[c]}});
  }
  for (const RecipePins& pins : recipe.pins) {
    if (wanted(pins.name)) shown.push_back({"pins", {pins.name, selections.evaluate(pins.from)}});
  }
  for (const RecipePart& part : recipe.parts) {
    if (wanted(part.name)) shown.push_back({"part", {part.name, selections.evaluate(part.from)}});
  }
  const bool nothing_else = shown.empty() && command.names.empty();
  for (const auto& [name, mask] : recipe.masks) {
    if (wanted(name) && (nothing_else || !command.names.empty()))
      shown.push_back({"mask", {name, selections.evaluate(SelectionText{name, mask.pointer})}});
  }
  for (const std::string& name : command.names) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    throw ToolError(ExitCode::usage, "", "there is no mask, cluster, part or set of pins named '" + name + "'",
                    known.empty() ? "The recipe has none yet." : "Did you mean " + nearestName(name, known) + "?");
  }
  return shown;
}

void show(const AuthorCommand& command) {
  const Recipe recipe = readRecipe(command.recipe);
  if (!command.picture.empty()) requireOutput(Output::picture, command.picture, {command.recipe, recipe.source});
  Progress progress(!command.json);
  progress.stage("import");
  VisualMesh mesh = importVisualMesh(recipe.source, recipe.settings.import, progress);
  const std::vector<ClusterMesh> cluster_meshes = takeClusterMeshes(mesh);
  progress.stage("selections");
  std::vector<Finding> findings;
  const std::vector<Shown> shown = evaluate(command, recipe, mesh, cluster_meshes, findings);
  if (!command.picture.empty()) {
    progress.stage("picture");
    std::vector<NamedWeights> named;
    for (const Shown& entry : shown) named.push_back({entry.kind + " " + entry.weights.name, entry.weights.weights});
    renderWeights(mesh, named, command.recipe, command.picture, frontYaw(recipe.settings.import.front, mesh.up_axis));
  }
  progress.finish();
  if (command.json) {
    nlohmann::ordered_json json = {{"recipe", command.recipe}, {"source", recipe.source.string()}};
    json["selections"] = nlohmann::ordered_json::array();
    for (const Shown& entry : shown) {
      json["selections"].push_back({{"kind", entry.kind},
                                    {"name", entry.weights.name},
                                    {"visual_vertices", selected(entry.weights.weights)},
                                    {"coverage", coverage(mesh, entry.weights.weights)}});
    }
    json["findings"] = findingsJson(findings);
    std::cout << jsonText(json);
    return;
  }
  std::printf("%s: clusters %zu, masks %zu, sets of pins %zu, on %s\n", command.recipe.c_str(), recipe.clusters.size(),
              recipe.masks.size(), recipe.pins.size(), recipe.source.c_str());
  for (const Shown& entry : shown) {
    std::printf("  %-8s %-28s %7zu visual vertices, %5.1f %% of the surface\n", entry.kind.c_str(),
                entry.weights.name.c_str(), selected(entry.weights.weights),
                100 * coverage(mesh, entry.weights.weights));
  }
  std::fflush(stdout);
  printFindings(std::cout, findings, false);
}

void say(const std::string& what) { std::cout << what << "\n"; }

void sayChanges(const std::vector<RecipeEditor::Change>& changes) {
  for (const RecipeEditor::Change& c : changes) say("  " + c.place + ": " + c.before + " -> " + c.after);
  if (changes.empty()) say("  nothing changed: the values were there");
}

// Refuses what a command adds that selects nothing, and says what of its pins will not move.
std::vector<Finding> checkNewSelections(const Recipe& before, const Recipe& after) {
  if (newSelections(before, after).empty() && before.pins.size() == after.pins.size()) return {};
  Progress progress(true);
  progress.stage("import");
  VisualMesh mesh = importVisualMesh(after.source, after.settings.import, progress);
  const std::vector<ClusterMesh> cluster_meshes = takeClusterMeshes(mesh);
  progress.stage("selections");
  std::vector<Finding> findings = checkNewSelections(before, after, mesh, analyzeTopology(mesh), cluster_meshes);
  progress.finish();
  return findings;
}

void edit(const AuthorCommand& command, const std::function<void(RecipeEditor&)>& change) {
  RecipeEditor editor = RecipeEditor::open(command.recipe);
  if (JsonText(editor.text(), command.recipe).hasComments()) {
    std::cerr << "sinew: " << command.recipe << ": its comments are dropped (undo brings them back). Use \"note\".\n";
  }
  const Recipe before = parseRecipe(editor.text(), command.recipe);
  change(editor);
  const std::vector<Finding> findings = checkNewSelections(before, parseRecipe(editor.text(), command.recipe));
  editor.save();
  say(command.recipe + ": " + editor.history()[editor.position()]);
  std::cout.flush();
  printFindings(std::cout, findings, false);
}

// The source of a recipe that is edited.
VisualMesh importFor(const RecipeEditor& editor) {
  const Recipe recipe = parseRecipe(editor.text(), editor.file());
  Progress progress(true);
  progress.stage("import");
  VisualMesh mesh = importVisualMesh(recipe.source, recipe.settings.import, progress);
  takeClusterMeshes(mesh);
  return mesh;
}

// The plane of symmetry that "plane": "auto" finds.
MirrorPlane symmetryPlane(const Surface& surface) {
  if (const std::optional<MirrorPlane> plane = surface.symmetryPlane()) return *plane;
  throw ToolError(ExitCode::usage, surface.mesh().file, "has no plane of symmetry that could be found",
                  "Add --plane x, y or z.");
}

MirrorPlane planeNamed(const std::string& name, const Surface& surface) {
  if (name.empty() || name == "auto") return symmetryPlane(surface);
  return {Eigen::Vector3d::Zero(), Eigen::Vector3d::Unit(name == "x" ? 0 : name == "y" ? 1 : 2), 0};
}

// A point "x,y,z" or "[x, y, z]", metres. \param pressure where it may have a fourth number, which comes to its end
Eigen::Vector3d pointNamed(const std::string& text, std::vector<double>* pressures = nullptr) {
  const std::string list = text.starts_with('[') ? text : "[" + text + "]";
  const auto json = nlohmann::ordered_json::parse(list, nullptr, false);
  const bool is_point = json.is_array() && (json.size() == 3 || (json.size() == 4 && pressures != nullptr)) &&
                        std::all_of(json.begin(), json.end(), [](const auto& number) { return number.is_number(); });
  const double pressure = is_point && json.size() == 4 ? json[3].get<double>() : 1;
  if (!is_point || !(pressure >= 0 && pressure <= 1))
    throw ToolError(ExitCode::usage, "", "'" + text + "' is no point", "Write it in metres, as in 0.04,1.55,0.1.");
  if (pressures != nullptr) pressures->push_back(pressure);
  return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
}

void addStroke(const AuthorCommand& command, RecipeEditor& editor) {
  Stroke stroke = command.stroke;
  const auto mode = std::find(strokeModeNames().begin(), strokeModeNames().end(), command.mode);
  stroke.mode = StrokeMode(mode - strokeModeNames().begin());
  for (const std::string& point : command.names) stroke.points.push_back(pointNamed(point, &stroke.pressures));
  if (!command.from.empty()) stroke.eye = pointNamed(command.from);
  if (const std::string wrong = whatIsWrong(stroke); !wrong.empty())
    throw ToolError(ExitCode::usage, "", wrong, "See sinew author --help, and docs/studio.md.");
  if (!command.plane.empty()) {
    const VisualMesh mesh = importFor(editor);
    stroke.mirror = planeNamed(command.plane, Surface(mesh));
  }
  addStrokes(editor, command.name, {&stroke, 1});
}

void addMuscle(const AuthorCommand& command, RecipeEditor& editor) {
  const VisualMesh mesh = importFor(editor);
  const Surface surface(mesh);
  MuscleOptions options;
  options.name = command.name;
  options.path = surface.path(surface.nearest(pointNamed(command.from)), surface.nearest(pointNamed(command.to)));
  options.width = command.value;
  options.mirror = command.mirror;
  if (!command.plane.empty()) options.plane = command.plane;
  sinew::tools::addMuscle(editor, options, [&] { return symmetryPlane(surface).normal; });
}

// "a, b, c and 12 more"
std::string someOf(const std::vector<std::string>& names) {
  constexpr std::size_t kMost = 8;
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kMost); ++i) text += (i == 0 ? "" : ", ") + names[i];
  if (names.size() > kMost) text += " and " + std::to_string(names.size() - kMost) + " more";
  return text;
}

// A cluster for each bone, group, ... of the source that selects something and is no cluster yet.
void addClusters(const AuthorCommand& command) {
  RecipeEditor editor = RecipeEditor::open(command.recipe);
  const Recipe recipe = readRecipe(command.recipe);
  const nlohmann::ordered_json options =
      command.options.empty() ? nlohmann::ordered_json() : furtherKeys(command.options, R"({"weights": "dominant"})");
  Progress progress(true);
  progress.stage("import");
  VisualMesh mesh = importVisualMesh(recipe.source, recipe.settings.import, progress);
  takeClusterMeshes(mesh);
  const Topology topology = analyzeTopology(mesh);
  std::vector<SourceRegion> regions = sourceRegions(command.name, command.names, options, mesh, topology);
  std::vector<std::string> known, empty;
  std::erase_if(regions, [&](const SourceRegion& region) {
    const bool is_known = std::any_of(recipe.clusters.begin(), recipe.clusters.end(),
                                      [&](const RecipeCluster& cluster) { return cluster.name == region.name; });
    if (is_known) known.push_back(region.name);
    return is_known;
  });
  RecipeEditor(editor).addClusters(command.name, regions);  // whether the selections are right
  progress.stage("selections");
  countVertices(recipe, mesh, topology, regions);
  std::erase_if(regions, [&](const SourceRegion& region) {
    if (region.visual_vertices == 0) empty.push_back(region.name);
    return region.visual_vertices == 0;
  });
  progress.finish();
  if (!regions.empty()) {
    editor.addClusters(command.name, regions);
    editor.save();
  }
  std::printf("%s: %zu cluster%s added\n", command.recipe.c_str(), regions.size(), regions.size() == 1 ? "" : "s");
  for (const SourceRegion& region : regions) {
    std::printf("  %-28s %7zu visual vertices\n", region.name.c_str(), region.visual_vertices);
  }
  if (!known.empty()) std::printf("  were there: %s\n", someOf(known).c_str());
  if (!empty.empty()) std::printf("  left out, nothing belongs to them: %s\n", someOf(empty).c_str());
}

nlohmann::ordered_json transferJson(const std::string& recipe, const TransferResult& result) {
  nlohmann::ordered_json json = {{"recipe", recipe},
                                 {"matched", result.matched},
                                 {"surface_distance", result.error},
                                 {"uvs_kept", result.uvs_kept},
                                 {"notes", result.notes}};
  json["mask_file"] =
      result.mask_file.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(result.mask_file.string());
  json["selections"] = nlohmann::ordered_json::array();
  for (const TransferredSelection& s : result.selections) {
    nlohmann::ordered_json matched;
    for (std::size_t r = 0; r < kMatchRules; ++r) matched[matchRuleName(MatchRule(r))] = s.matched[r];
    json["selections"].push_back({{"kind", s.kind},
                                  {"name", s.name},
                                  {"stored", s.stored},
                                  {"matched", matched},
                                  {"largest_metres", s.largest},
                                  {"rms_metres", s.rms},
                                  {"old_area", s.old_area},
                                  {"new_area", s.new_area}});
  }
  return json;
}

void transfer(const AuthorCommand& command) {
  Progress progress(!command.json);
  const TransferResult result =
      transferRecipe({command.recipe, command.other, command.old_source, command.picture}, progress);
  if (!result.mask_file.empty()) writeFileAtomically(result.mask_file, result.mask_text);
  result.editor.save();
  const std::string recipe = result.editor.file().string();
  if (command.json) {
    std::cout << jsonText(transferJson(recipe, result));
    return;
  }
  std::printf("%s: now of %s; %.1f %% of its surface lies where the old one was (mean distance %.2g diagonals)%s\n",
              recipe.c_str(), command.other.c_str(), 100 * result.matched, result.error,
              result.uvs_kept ? ", its UVs are the old ones" : "");
  for (const std::string& note : result.notes) std::printf("  %s\n", note.c_str());
  if (!result.selections.empty()) {
    std::printf("  %-9s %-24s %-7s %7s %8s %6s %9s %6s  %10s %10s  %s\n", "kind", "name", "kept as", "same", "position",
                "uv", "neighbour", "new", "largest m", "rms m", "area");
  }
  for (const TransferredSelection& s : result.selections) {
    std::printf("  %-9s %-24s %-7s %7zu %8zu %6zu %9zu %6zu  %10.3g %10.3g  ", s.kind.c_str(), s.name.c_str(),
                s.stored ? "weights" : "words", s.matched[0], s.matched[1], s.matched[2], s.matched[3], s.matched[4],
                s.largest, s.rms);
    if (s.old_area > 0)
      std::printf("%.1f %%\n", 100 * s.new_area / s.old_area);
    else
      std::printf("%s\n", s.new_area > 0 ? "was nothing" : "nothing");
  }
  if (!result.mask_file.empty()) std::printf("  weights are in %s\n", result.mask_file.c_str());
}

void step(const AuthorCommand& command, bool forward) {
  RecipeEditor editor = RecipeEditor::open(command.recipe);
  const std::string done = forward ? editor.redo() : editor.undo();
  if (done.empty()) {
    throw ToolError(ExitCode::usage, "", std::string("there is nothing to ") + (forward ? "redo" : "undo"),
                    "The history lies in " + command.recipe + ".history.");
  }
  editor.save();
  say(command.recipe + ": " + (forward ? "did again: " : "undid: ") + done);
}

}  // namespace

void addAuthorVerb(CLI::App& app, int& exit_code) {
  auto command = std::make_shared<AuthorCommand>();
  CLI::App* verb = app.add_subcommand(
      "author", "Edit and look at a recipe: masks, clusters, pins, settings. Its format: sinew help recipe");
  verb->add_option("recipe", command->recipe, "The recipe (.json)")->required();
  verb->require_subcommand(1);
  const auto add = [&](const char* name, const char* what, const std::function<void()>& run) {
    CLI::App* sub = verb->add_subcommand(name, what);
    sub->callback([run, &exit_code] {
      run();
      exit_code = int(ExitCode::done);
    });
    return sub;
  };
  const char* selection = "JSON of a selection, or the name of a mask";
  const auto addList = [&](CLI::App* sub) {
    sub->add_option("--list", command->list, "Its list, where several have the name: clusters, pins, parts or masks")
        ->check(CLI::IsMember({"clusters", "pins", "parts", "masks"}));
  };

  CLI::App* make = add("new", "Begin a recipe for a source", [command] {
    const RecipeEditor editor = RecipeEditor::create(command->recipe, command->from);
    editor.save();
    say(command->recipe + ": " + editor.history().back());
    say("  What the file offers: " + commandLine({"sinew", "inspect", command->from}) +
        ". A cluster for each of its parts, groups, bones, ...: " +
        commandLine({"sinew", "author", command->recipe, "add-clusters", "part"}));
  });
  make->add_option("source", command->from, "The artist's mesh")->required();

  CLI::App* cluster = add("add-cluster", "Add a cluster", [command] {
    edit(*command, [&](RecipeEditor& e) { e.addCluster(command->name, command->from); });
  });
  cluster->add_option("name", command->name)->required();
  cluster->add_option("--from", command->from, std::string(selection) + "; without it: the cluster mesh of this name");

  CLI::App* clusters = add("add-clusters", "Add a cluster for each bone, group, ... that the source has",
                           [command] { addClusters(*command); });
  clusters->add_option("kind", command->name, "bone, group, material, object, part or morph")
      ->required()
      ->check(CLI::IsMember(sourceRegionKinds()));
  clusters->add_option("names", command->names, "Which ones, * for any letters; without: all");
  clusters->add_option("--options", command->options, R"(Further keys as JSON, as in '{"weights": "dominant"}')");

  CLI::App* mask = add("add-mask", "Add or replace a mask", [command] {
    edit(*command, [&](RecipeEditor& e) { e.setMask(command->name, command->from); });
  });
  mask->add_option("name", command->name)->required();
  mask->add_option("--from", command->from, selection)->required();

  CLI::App* pins = add("add-pins", "Add a set of pins", [command] {
    edit(*command, [&](RecipeEditor& e) { e.addPins(command->name, command->from, command->method, command->target); });
  });
  pins->add_option("name", command->name)->required();
  pins->add_option("--from", command->from, selection)->required();
  pins->add_option("--method", command->method, legalText(recipeKey("pin", "method")));
  pins->add_option("--target", command->target, "world, or a name of the game's");

  CLI::App* part = add("add-part", "Add loose parts that ride along: eyeballs, teeth, lashes", [command] {
    edit(*command, [&](RecipeEditor& e) { e.addPart(command->name, command->from, command->attach, command->to); });
  });
  part->add_option("name", command->name)->required();
  part->add_option("--from", command->from, selection)->required();
  part->add_option("--attach", command->attach, legalText(recipeKey("part", "attach")));
  part->add_option("--to", command->to, "What carries it: a cluster, a set of pins, a mask, or JSON of a selection");

  for (const std::string& list : {std::string("stiffness"), std::string("thickness")}) {
    const std::string what = "Add a factor of the " + list + (list == "stiffness" ? "" : " of shells");
    CLI::App* factor = add(("add-" + list).c_str(), what.c_str(), [command, list] {
      edit(*command, [&](RecipeEditor& e) { e.addFactor(list, command->from, command->value); });
    });
    factor->add_option("value", command->value, "The factor where the selection's weight is 1")->required();
    factor->add_option("--from", command->from, selection)->required();
  }

  CLI::App* set = add("set",
                      "Set values: KEY=VALUE, NAME.KEY=VALUE or /json/pointer=VALUE; * in KEY and NAME stands for any "
                      "letters (KEY: of settings), default removes a value",
                      [command] {
                        std::vector<RecipeEditor::Change> changes;
                        edit(*command, [&](RecipeEditor& e) {
                          for (const std::string& assignment : command->assignments) {
                            const std::size_t equals = assignment.find('=');
                            if (equals == std::string::npos) {
                              throw ToolError(ExitCode::usage, "", "'" + assignment + "' is no KEY=VALUE",
                                              "Write it as in clusters.mode=linear.");
                            }
                            const auto made = e.set(assignment.substr(0, equals), assignment.substr(equals + 1));
                            changes.insert(changes.end(), made.begin(), made.end());
                          }
                        });
                        sayChanges(changes);
                      });
  set->add_option("assignments", command->assignments, "KEY=VALUE")->required();

  CLI::App* stiff = add("stiffen", "Make all of it stiffer or softer: frequencies times a factor", [command] {
    std::vector<RecipeEditor::Change> changes;
    edit(*command, [&](RecipeEditor& e) { changes = stiffen(e, command->value); });
    sayChanges(changes);
  });
  stiff->add_option("factor", command->value, "0.001 .. 1000")->required()->check(CLI::Range(1e-3, 1e3));

  CLI::App* rename = add("rename", "Rename a mask, a cluster, a part or a set of pins", [command] {
    edit(*command, [&](RecipeEditor& e) { e.rename(command->name, command->other); });
  });
  rename->add_option("from", command->name)->required();
  rename->add_option("to", command->other)->required();

  CLI::App* move = add("move", "Move a mask, a cluster, a part or a set of pins up or down in its list", [command] {
    const int places = command->places * (command->other == "up" ? -1 : 1);
    edit(*command, [&](RecipeEditor& e) { e.move(command->name, places, command->list); });
  });
  move->add_option("name", command->name)->required();
  move->add_option("way", command->other, "up or down")->required()->check(CLI::IsMember({"up", "down"}));
  move->add_option("places", command->places, "How far (default 1)")->check(CLI::Range(1, 1000000));
  addList(move);

  CLI::App* remove = add("remove", "Remove a mask, a cluster, a part or a set of pins",
                         [command] { edit(*command, [&](RecipeEditor& e) { e.remove(command->name); }); });
  remove->add_option("name", command->name)->required();

  CLI::App* mirror = add("mirror", "Add the mirror image of a mask, a cluster, a part or a set of pins", [command] {
    edit(*command, [&](RecipeEditor& e) {
      e.mirror(
          command->name, command->other, command->plane,
          [&e] {
            const VisualMesh mesh = importFor(e);
            return symmetryPlane(Surface(mesh)).normal;
          },
          command->list);
    });
  });
  mirror->add_option("name", command->name)->required();
  mirror->add_option("--to", command->other, "Its name; without it left and right are exchanged (.L/.R, _l/_r)");
  mirror->add_option("--plane", command->plane, "auto, x, y or z")->check(CLI::IsMember({"auto", "x", "y", "z"}));
  addList(mirror);

  CLI::App* paint = add("paint", "Add a mask from a picture, or from a stroke file (.json)", [command] {
    edit(*command, [&](RecipeEditor& e) { e.paint(command->name, command->other, command->options); });
  });
  paint->add_option("name", command->name)->required();
  paint->add_option("file", command->other, "PNG, EXR, TIFF, JPEG or a stroke file")->required();
  paint->add_option("--options", command->options, R"(Further keys as JSON, as in '{"threshold": 0.5}')");

  CLI::App* stroke = add("stroke", "Add a brush stroke to a mask, or begin one; grow or shrink a mask",
                         [command] { edit(*command, [&](RecipeEditor& e) { addStroke(*command, e); }); });
  stroke->add_option("name", command->name, "The mask")->required();
  stroke->add_option("points", command->names, "Where it goes: x,y,z in metres; a pen's pressure may follow, 0 .. 1");
  stroke->add_option("--radius", command->stroke.radius, "m, along the surface; of grow and shrink: how far")
      ->check(CLI::Range(1e-9, 1e9));
  stroke->add_option("--falloff", command->stroke.falloff, "m, from 1 at the radius to 0")->check(CLI::Range(0.0, 1e9));
  stroke->add_option("--strength", command->stroke.strength, "0 .. 1")->check(CLI::Range(0.0, 1.0));
  const std::vector<std::string> modes(strokeModeNames().begin(), strokeModeNames().end());
  stroke->add_option("--mode", command->mode, "What it does to weights")
      ->check(CLI::IsMember(modes))
      ->capture_default_str();
  CLI::Option* eye =
      stroke->add_option("--eye", command->from, "Distances are those seen from x,y,z; only what is seen is painted");
  stroke->add_flag("--lasso", command->stroke.lasso, "Points are a loop: all inside it is painted")->needs(eye);
  stroke->add_flag("--through", command->stroke.through, "What is hidden is painted too")->needs(eye);
  stroke->add_option("--mirror", command->plane, "Its image too, across: auto, x, y or z")
      ->check(CLI::IsMember({"auto", "x", "y", "z"}));

  CLI::App* muscle = add("muscle", "Add a muscle: its region, cluster, fibre and channel",
                         [command] { edit(*command, [&](RecipeEditor& e) { addMuscle(*command, e); }); });
  muscle->add_option("name", command->name)->required();
  muscle->add_option("--from", command->from, "Where it hangs: x,y,z in metres")->required();
  muscle->add_option("--to", command->to, "Where it pulls")->required();
  muscle->add_option("--width", command->value, "m, along the surface")->required()->check(CLI::Range(1e-9, 1e9));
  muscle->add_flag("--mirror", command->mirror, "Its image too, with left and right exchanged in its name");
  muscle->add_option("--plane", command->plane, "Of --mirror: auto, x, y or z")
      ->check(CLI::IsMember({"auto", "x", "y", "z"}));

  CLI::App* look =
      add("show", "Evaluate on the source: what each cluster, pin set or mask covers", [command] { show(*command); });
  look->add_option("names", command->names, "Which ones; without: all clusters and pins");
  look->add_option("-o,--output", command->picture, "Draw the weights on the mesh (.png)");
  look->add_flag("--json", command->json, "Print JSON");

  CLI::App* carry = add("transfer", "Carry masks, clusters and pins over to a new version of the source",
                        [command] { transfer(*command); });
  carry->add_option("source", command->other, "The new source")->required();
  carry->add_option("-o,--output", command->picture, "A new recipe (.json); without it, this one changes");
  carry->add_option("--old", command->old_source, "A copy of the old source, where the new one has taken its place");
  carry->add_flag("--json", command->json, "Print JSON");

  add("undo", "Undo the last command", [command] { step(*command, false); });
  add("redo", "Do again what was undone", [command] { step(*command, true); });
}

}  // namespace sinew::tools

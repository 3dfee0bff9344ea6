// SPDX-License-Identifier: GPL-3.0-or-later
#include <iostream>

#include "tools/bake/authored.h"
#include "tools/bake/check_package.h"
#include "tools/bake/check_source.h"
#include "tools/bake/findings_json.h"
#include "tools/bake/parts.h"
#include "tools/bake/suggest_parts.h"
#include "tools/cli/files.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/import/import.h"
#include "tools/render/defect_picture.h"

namespace sinew::tools {
namespace {

struct CheckCommand {
  std::string file;
  std::vector<std::string> assignments;
  std::string picture;
  unsigned threads = 0;
  bool json = false;
};

struct Diagnosis {
  const char* kind;  // "package", "recipe" or "source"
  std::vector<Finding> findings;
  std::string verdict;
};

Diagnosis checkPackageFile(const CheckCommand& command) {
  if (!command.picture.empty()) {
    throw ToolError(ExitCode::usage, command.file, "--render draws the places of a source, this is a package",
                    "Use: sinew render " + command.file + " -o " + command.picture + ".");
  }
  if (!command.assignments.empty()) {
    throw ToolError(ExitCode::usage, command.file, "--set is for a source, this is a package",
                    "Leave it out; settings take effect when baking.");
  }
  const auto asset = loadPackage(command.file);
  Diagnosis diagnosis{"package", checkPackage(asset->package()), ""};
  diagnosis.verdict = packageVerdict(diagnosis.findings);
  return diagnosis;
}

Diagnosis checkSourceFile(const CheckCommand& command) {
  Recipe recipe = recipeFor(command.file);
  if (!command.picture.empty()) requireOutput(Output::picture, command.picture, {command.file, recipe.source});
  applyAssignments(recipe.settings, command.assignments);
  Progress progress(!command.json);
  progress.stage("import");
  VisualMesh mesh = importVisualMesh(recipe.source, recipe.settings.import, progress);
  const std::vector<ClusterMesh> cluster_meshes = takeClusterMeshes(mesh);
  progress.stage("check");
  const Topology topology = analyzeTopology(mesh);
  CheckOptions options;
  options.join_distance = recipe.settings.tetrahedra.join_distance;
  Diagnosis diagnosis{isRecipe(command.file) ? "recipe" : "source", checkSource(mesh, topology, options), ""};
  const AuthoredWeights authored = evaluateRecipe(recipe, mesh, topology, cluster_meshes, diagnosis.findings);
  if (findParts(recipe, authored, mesh, topology, diagnosis.findings).empty()) {
    const std::vector<Finding> suggested = suggestParts(mesh, topology);
    diagnosis.findings.insert(diagnosis.findings.end(), suggested.begin(), suggested.end());
  }
  diagnosis.verdict = sourceVerdict(diagnosis.findings);
  if (!command.picture.empty()) {
    progress.stage("picture");
    renderDefects(mesh, diagnosis.findings, command.picture);
  }
  progress.finish();
  return diagnosis;
}

}  // namespace

void addCheckVerb(CLI::App& app, int& exit_code) {
  auto command = std::make_shared<CheckCommand>();
  CLI::App* verb = app.add_subcommand(
      "check", "Doctor for a source, a recipe or a package: what is wrong, where (numbers count from 0), and the cure");
  verb->add_option("file", command->file, "A package (.sinew), a recipe (.json) or a mesh")->required();
  verb->add_option("--set", command->assignments, "A setting KEY=VALUE, for a source or recipe")
      ->type_name("KEY=VALUE");
  verb->add_option("--render", command->picture, "Draw the source with the places of the findings into this PNG")
      ->type_name("OUT.png");
  verb->add_option("--threads", command->threads, "Threads to use; 0 = all")->capture_default_str();
  verb->add_flag("--json", command->json, "Print one JSON document");
  verb->callback([command, &exit_code] {
    const auto threads = limitThreads(command->threads);
    const Diagnosis diagnosis =
        command->file.ends_with(".sinew") ? checkPackageFile(*command) : checkSourceFile(*command);
    const bool ok = !hasErrors(diagnosis.findings);
    if (command->json) {
      nlohmann::ordered_json json = {{"file", command->file},
                                     {"kind", diagnosis.kind},
                                     {"ok", ok},
                                     {"verdict", diagnosis.verdict},
                                     {"findings", findingsJson(diagnosis.findings)}};
      std::cout << jsonText(json);
    } else {
      printFindings(std::cout, diagnosis.findings, true);
      std::cout << command->file << ": " << diagnosis.verdict << "\n";
    }
    exit_code = int(ok ? ExitCode::done : ExitCode::findings);
  });
}

}  // namespace sinew::tools

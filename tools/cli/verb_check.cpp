// SPDX-License-Identifier: GPL-3.0-or-later
#include <iostream>

#include "tools/bake/bake.h"
#include "tools/bake/check_package.h"
#include "tools/bake/check_source.h"
#include "tools/bake/findings_json.h"
#include "tools/bake/suggest_up.h"
#include "tools/cli/files.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/core/command_line.h"
#include "tools/render/defect_picture.h"

namespace sinew::tools {
namespace {

struct CheckCommand {
  std::string file;
  std::vector<std::string> assignments;
  std::string unit, picture;
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
                    "Use: " + commandLine({"sinew", "render", command.file, "-o", command.picture}) + ".");
  }
  if (!command.assignments.empty() || !command.unit.empty()) {
    throw ToolError(ExitCode::usage, command.file, "--set and --unit are for a source, this is a package",
                    "Leave them out; settings take effect when baking.");
  }
  const auto asset = loadPackage(command.file);
  Diagnosis diagnosis{"package", checkPackage(asset->package()), ""};
  appendNew(diagnosis.findings, checkPictures(asset->package(), {}));
  diagnosis.verdict = packageVerdict(diagnosis.findings);
  return diagnosis;
}

Diagnosis checkSourceFile(const CheckCommand& command) {
  Recipe recipe = recipeFor(command.file);
  if (!command.picture.empty()) requireOutput(Output::picture, command.picture, {command.file, recipe.source});
  applyAssignments(recipe.settings, command.assignments);
  if (!command.unit.empty()) recipe.settings.set("import.unit", command.unit);
  Progress progress(!command.json);
  ImportedSource source = importSource(recipe, progress);
  progress.stage("check");
  CheckOptions options;
  options.join_distance = recipe.settings.tetrahedra.join_distance;
  Diagnosis diagnosis{isRecipe(command.file) ? "recipe" : "source", checkFaces(source.mesh, source.topology), ""};
  const auto append = [&](const std::vector<Finding>& more) { appendNew(diagnosis.findings, more); };
  if (source.parts.empty()) {
    append(checkFilling(source.mesh, source.topology, options));
  } else {
    const VisualMesh host = withoutParts(source.mesh, source.parts);
    append(checkFilling(host, analyzeTopology(host), options));
  }
  append(source.findings);
  const std::vector<Finding> pins = judgePins(recipe, source.authored);
  if (recipe.settings.import.up == "auto") {
    if (const auto lies = suggestUp(source.mesh)) append({*lies});
  }
  if (!command.picture.empty()) {
    progress.stage("picture");
    renderDefects(source.mesh, diagnosis.findings, command.picture);
  }
  if (!hasErrors(diagnosis.findings)) {
    StageCache cache(StageCache::userFolder());
    append(rehearseBake(recipe, std::move(source), progress, &cache));
  }
  if (hasErrors(diagnosis.findings)) append(pins);  // no bake says what becomes of them
  diagnosis.verdict = sourceVerdict(diagnosis.findings);
  progress.finish();
  return diagnosis;
}

}  // namespace

void addCheckVerb(CLI::App& app, int& exit_code) {
  auto command = std::make_shared<CheckCommand>();
  CLI::App* verb = app.add_subcommand("check",
                                      "Doctor for a source, a recipe or a package: what is wrong, where (numbers count "
                                      "from 0), and the cure; what of a source or recipe it passes, bakes. Fields are "
                                      "not looked at: bake says where a body is too thin for them (no-fields)");
  verb->add_option("file", command->file, "A package (.sinew), a recipe (.json) or a mesh")->required();
  verb->add_option("--set", command->assignments, "A setting KEY=VALUE, for a source or recipe")
      ->type_name("KEY=VALUE");
  verb->add_option("--unit", command->unit, "Unit of the source; the same as --set import.unit=");
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

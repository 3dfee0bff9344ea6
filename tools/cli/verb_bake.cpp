// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <optional>

#include "tools/author/needs.h"
#include "tools/bake/bake.h"
#include "tools/bake/findings_json.h"
#include "tools/bench/budget.h"
#include "tools/cli/files.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/core/atomic_file.h"
#include "tools/core/units.h"
#include "tools/scene/scene_script.h"
#include "tools/tetrahedralize/pieces.h"

namespace sinew::tools {
namespace {

struct BakeCommand {
  std::string input;
  std::string output;
  std::string report_file;
  std::vector<std::string> assignments;
  std::string unit;
  std::vector<std::string> needs;
  std::string time_budget, byte_budget, max_error, cost_file;
  unsigned threads = 0;
  bool json = false;
  bool progress_lines = false;
  bool quiet = false;
  bool no_cache = false;
  bool draft = false;
};

// Of names, lists of them, and scene files. Throws ToolError.
Needs needsOf(const std::vector<std::string>& texts) {
  Needs needs = Needs::none();
  for (const std::string& text : texts) {
    const auto known = text.ends_with(".json") ? neededBy(SceneScript::read(text)) : Needs::parse(text);
    if (!known) {
      throw ToolError(ExitCode::usage, "", "--needs does not know '" + text + "'",
                      "Give all, none, auto, a scene file, or some of these: " + Needs::names(", ") + ".");
    }
    needs = needs.with(*known);
  }
  return needs;
}

// The budget of --budget, --budget-bytes and --max-error; nothing without them. Throws ToolError.
std::optional<Budget> budgetOf(const BakeCommand& command) {
  Budget budget;
  const auto refuse = [](const char* option, const std::string& text, const char* cure) {
    throw ToolError(ExitCode::usage, "", std::string(option) + " cannot be '" + text + "'", cure);
  };
  if (!command.time_budget.empty() && !(budget.microseconds = Budget::readTime(command.time_budget))) {
    refuse("--budget", command.time_budget, "Give a time above 0, as in --budget 0.1ms or --budget 80us.");
  }
  if (!command.byte_budget.empty() && !(budget.bytes = Budget::readBytes(command.byte_budget))) {
    refuse("--budget-bytes", command.byte_budget, "Give a size above 0, as in --budget-bytes 200k or 1.5M.");
  }
  if (!command.max_error.empty() && !(budget.error = Budget::readError(command.max_error))) {
    refuse("--max-error", command.max_error, "Give a share above 0, as in --max-error 5% or 0.05; more than 1 with %.");
  }
  if (budget.microseconds || budget.bytes || budget.error) return budget;
  if (!command.cost_file.empty()) {
    throw ToolError(ExitCode::usage, command.cost_file, "--cost-file is of no use without a budget",
                    "Give --budget, --budget-bytes or --max-error too.");
  }
  return std::nullopt;
}

std::string count(std::uint64_t n, const std::string& noun) {
  const std::string plural = noun.ends_with("ex")   ? noun.substr(0, noun.size() - 2) + "ices"
                             : noun.ends_with("on") ? noun.substr(0, noun.size() - 2) + "a"
                             : noun.ends_with("y")  ? noun.substr(0, noun.size() - 1) + "ies"
                                                    : noun + "s";
  return std::to_string(n) + " " + (n == 1 ? noun : plural);
}

// The chosen bake, and the next ones down and up.
void printBudget(const nlohmann::ordered_json& budget) {
  const auto functionsOf = [](const nlohmann::ordered_json& made) { return made["functions"].get<unsigned>(); };
  const auto print = [](const char* what, const nlohmann::ordered_json& made) {
    std::printf("  %-10s %s\n", what, budgetFigures(made).c_str());
  };
  const auto& tries = budget["tries"];
  std::size_t chosen = 0;
  while (functionsOf(tries[chosen]) != functionsOf(budget["chosen"])) ++chosen;
  print("chosen", tries[chosen]);
  if (chosen > 0) print("one down", tries[chosen - 1]);
  if (chosen + 1 < tries.size()) print("one up", tries[chosen + 1]);
  std::printf("  frames     of 1/60 s, %s, with positions and normals; one thread of this machine\n",
              budget["scene"].get<std::string>().c_str());
}

void printSummary(const BakeCommand& command, const nlohmann::ordered_json& report,
                  const std::vector<Finding>& findings, double seconds) {
  std::printf("%s -> %s (%.0f kB, %.2f s)\n", command.input.c_str(), command.output.c_str(),
              report["package_bytes"].get<double>() / 1000, seconds);
  const auto& size = report["size_metres"];
  std::printf("  size       %.4g x %.4g x %.4g m (%s)\n", size[0].get<double>(), size[1].get<double>(),
              size[2].get<double>(), report["unit"]["from"].get<std::string>().c_str());
  const auto& visual = report["visual"];
  std::printf("  visual     %s, %s\n", count(visual["visual_vertices"], "vertex").c_str(),
              count(visual["visual_triangles"], "triangle").c_str());
  std::printf("  physical   %s, %s, dihedral angles %.1f .. %.1f degrees\n",
              count(report["physical_vertices"], "vertex").c_str(), count(report["tetrahedra"], "tetrahedron").c_str(),
              report["tetrahedra_quality"]["min_dihedral_deg"].get<double>(),
              report["tetrahedra_quality"]["max_dihedral_deg"].get<double>());
  const auto& pieces = report["pieces"];
  std::vector<std::string> names;
  for (const auto& piece : pieces) names.push_back(piece["name"].get<std::string>());
  names = distinctNames(names);
  for (std::size_t b = 0; b < pieces.size(); ++b) {
    if (b == 4 && pieces.size() > 5) {
      std::printf("  ...        and %zu more pieces\n", pieces.size() - b);
      break;
    }
    const auto& piece = pieces[b];
    const std::string volume = piece.contains("volume_ratio")
                                   ? ", " +
                                         std::to_string(int(std::lround(100 * piece["volume_ratio"].get<double>()))) +
                                         " % of the source's volume"
                                   : ", encloses no volume";
    std::printf("  piece      %s: %s, %s%s\n", names[b].c_str(), piece["method"].get<std::string>().c_str(),
                count(piece["clusters"], "cluster").c_str(), volume.c_str());
  }
  std::printf("  attachment rest error %.1e of the diagonal\n", report["attachment"]["max_rest_error"].get<double>());
  if (report.contains("left_out") && report["left_out"].value("packed", false)) {
    std::printf("  packed     drawn within %.1e of the diagonal of exact numbers, %.0f kB of them\n",
                report["left_out"]["drawn_difference"].get<double>(),
                report["left_out"]["bytes_exact"].get<double>() / 1000);
  }
  if (report.contains("left_out") && report["left_out"].contains("unseen")) {
    for (const auto& left : report["left_out"]["unseen"]) {
      std::printf("  unseen     without %s %.0f kB less", left["need"].get<std::string>().c_str(),
                  left["bytes"].get<double>() / 1000);
      if (const double change = left["change"].get<double>(); change > 0) {
        std::printf(", %.2g %s at most (bound %.2g)", change, left["unit"].get<std::string>().c_str(),
                    left["bound"].get<double>());
      }
      std::printf("\n");
    }
  }
  if (report.contains("budget")) printBudget(report["budget"]);
  std::fflush(stdout);
  printFindings(std::cout, findings, false);
}

void runBake(const BakeCommand& command) {
  const auto start = std::chrono::steady_clock::now();
  Recipe recipe = recipeFor(command.input);
  if (!command.unit.empty()) recipe.settings.set("import.unit", command.unit);
  applyAssignments(recipe.settings, command.assignments);
  if (!command.needs.empty()) recipe.settings.package.needs = needsOf(command.needs).text();
  const std::optional<Budget> budget = budgetOf(command);
  requireOutput(Output::package, command.output, {command.input, recipe.source});
  if (!command.cost_file.empty()) requireOutput(Output::times, command.cost_file, {command.input, recipe.source});
  if (!command.report_file.empty()) {
    requireOutput(Output::report, command.report_file, {command.input, recipe.source});
    const auto place = [](const std::string& file) {
      return std::filesystem::weakly_canonical(std::filesystem::absolute(file));
    };
    if (place(command.report_file) == place(command.output)) {
      throw ToolError(ExitCode::usage, command.report_file, "is where the package goes",
                      "Name another file for the report.");
    }
  }
  const auto limit = limitThreads(command.threads);
  Progress progress(!command.quiet && !command.progress_lines);
  if (command.progress_lines) tellLines(progress);
  StageCache cache(command.no_cache ? std::filesystem::path() : StageCache::userFolder());
  BakeResult result;
  if (budget) {
    BudgetResult fitted = bakeWithin(recipe, *budget, command.cost_file, progress, &cache);
    result = std::move(fitted.bake);
    result.report["budget"] = budgetJson(*budget, fitted);
  } else {
    result = bake(recipe, progress, &cache, command.draft);
  }
  progress.stage("write");
  writeFileAtomically(command.output, result.package);
  progress.finish();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.report["package"] = command.output;
  result.report["stages"] = costsJson(progress);
  result.report["cache"] = cacheJson(cache);
  result.report["seconds"] = seconds;
  double peak = 0;
  for (const StageCost& cost : progress.costs()) peak = std::max(peak, cost.peak_megabytes);
  result.report["peak_megabytes"] = peak;
  if (!command.report_file.empty()) writeFileAtomically(command.report_file, jsonText(result.report));
  if (command.json)
    std::cout << jsonText(result.report);
  else if (!command.quiet)
    printSummary(command, result.report, result.findings, seconds);
}

}  // namespace

void addBakeVerb(CLI::App& app, int& exit_code) {
  auto command = std::make_shared<BakeCommand>();
  CLI::App* verb = app.add_subcommand(
      "bake", "Bake a mesh (OBJ, PLY, STL, OFF, glTF, GLB, FBX, DAE, OGRE .mesh) or a recipe into a package");
  verb->add_option("input", command->input, "The artist's mesh, or a recipe (.json)")->required();
  verb->add_option("-o,--output", command->output, "The package to write (.sinew)")->required();
  verb->add_option("--set", command->assignments, "A setting KEY=VALUE; all of them: sinew help settings")
      ->type_name("KEY=VALUE");
  verb->add_option(
      "--unit", command->unit,
      "Unit of the source: " + lengthUnitNames(", ") + " or metres per unit; the same as --set import.unit=");
  verb->add_option("--needs", command->needs,
                   "What the game wants of the package, the rest is left out; the same as --set package.needs=. all, "
                   "none, auto (the others, or all that is seen and felt, less what nobody would miss), scene "
                   "files (what they use, and what is drawn), or some of: " +
                       Needs::names("; ", true))
      ->delimiter(',')
      ->type_name("NEED ...");
  verb->add_option("--budget", command->time_budget,
                   "The finest bake that a frame of one body takes this long, as in 0.1ms (chooses field.functions and "
                   "tetrahedra.vertices)")
      ->type_name("TIME");
  verb->add_option("--budget-bytes", command->byte_budget, "The finest bake of at most this size, as in 200k")
      ->type_name("SIZE");
  verb->add_option("--max-error", command->max_error,
                   "The cheapest bake whose answers to constant loads are this near to all tetrahedra's, as in 5%")
      ->type_name("SHARE");
  verb->add_option("--cost-file", command->cost_file,
                   "Times of packages, read and added to: with the same file a budget chooses the same everywhere");
  verb->add_flag("--no-cache", command->no_cache, "Make every stage anew, and keep none for the next bake");
  const char* const draft_help =
      "Sooner, to look at: new materials on what an earlier bake of the same shape and pins found to move by "
      "(its errors, no residual modes); whole where the cache has none";
  verb->add_flag("--draft", command->draft, draft_help)
      ->excludes("--budget", "--budget-bytes", "--max-error", "--no-cache");
  verb->add_option("--report", command->report_file, "Write what was done, measured and found as JSON");
  verb->add_option("--threads", command->threads, "Threads at most; 0 = all processors")->check(CLI::Range(0U, 1024U));
  verb->add_flag("--json", command->json, "Print the report as JSON instead of the summary");
  addProgressLines(*verb, command->progress_lines);
  verb->add_flag("-q,--quiet", command->quiet, "Print nothing but errors");
  verb->callback([command, &exit_code] {
    runBake(*command);
    exit_code = int(ExitCode::done);
  });
}

}  // namespace sinew::tools

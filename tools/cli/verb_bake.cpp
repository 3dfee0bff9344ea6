// SPDX-License-Identifier: GPL-3.0-or-later
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>

#include "tools/bake/bake.h"
#include "tools/bake/findings_json.h"
#include "tools/cli/files.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/core/atomic_file.h"
#include "tools/core/units.h"
#include "tools/tetrahedralize/pieces.h"

namespace sinew::tools {
namespace {

struct BakeCommand {
  std::string input;
  std::string output;
  std::string report_file;
  std::vector<std::string> assignments;
  std::string unit;
  unsigned threads = 0;
  bool json = false;
  bool progress_lines = false;
  bool quiet = false;
  bool no_cache = false;
};

std::string count(std::uint64_t n, const std::string& noun) {
  const std::string plural = noun.ends_with("ex")   ? noun.substr(0, noun.size() - 2) + "ices"
                             : noun.ends_with("on") ? noun.substr(0, noun.size() - 2) + "a"
                             : noun.ends_with("y")  ? noun.substr(0, noun.size() - 1) + "ies"
                                                    : noun + "s";
  return std::to_string(n) + " " + (n == 1 ? noun : plural);
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
  std::fflush(stdout);
  printFindings(std::cout, findings, false);
}

void runBake(const BakeCommand& command) {
  const auto start = std::chrono::steady_clock::now();
  Recipe recipe = recipeFor(command.input);
  if (!command.unit.empty()) recipe.settings.set("import.unit", command.unit);
  applyAssignments(recipe.settings, command.assignments);
  requireOutput(Output::package, command.output, {command.input, recipe.source});
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
  if (command.progress_lines) {
    progress.tell([](const std::string& stage, double done) {
      std::fprintf(stderr, "%s %.3f\n", stage.c_str(), done);
      std::fflush(stderr);
    });
  }
  StageCache cache(command.no_cache ? std::filesystem::path() : StageCache::userFolder());
  BakeResult result = bake(recipe, progress, &cache);
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
  verb->add_flag("--no-cache", command->no_cache, "Make every stage anew, and keep none for the next bake");
  verb->add_option("--report", command->report_file, "Write what was done, measured and found as JSON");
  verb->add_option("--threads", command->threads, "Threads at most; 0 = all processors")->check(CLI::Range(0U, 1024U));
  verb->add_flag("--json", command->json, "Print the report as JSON instead of the summary");
  verb->add_flag("--progress-lines", command->progress_lines,
                 "Stages and shares done as lines on stderr, for a program that started this one");
  verb->add_flag("-q,--quiet", command->quiet, "Print nothing but errors");
  verb->callback([command, &exit_code] {
    runBake(*command);
    exit_code = int(ExitCode::done);
  });
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdint>
#include <cstdio>
#include <iostream>

#include "tools/bake/inspect.h"
#include "tools/bench/cost.h"
#include "tools/cli/files.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/core/command_line.h"
#include "tools/import/import.h"

namespace sinew::tools {
namespace {

std::string plain(const nlohmann::ordered_json& value) {
  if (value.is_string()) return value.get<std::string>();
  return value.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

// Lists of thousands of numbers are for --json.
std::string shortened(const nlohmann::ordered_json& value) {
  constexpr std::size_t kMost = 200;
  std::string text = plain(value);
  if (value.is_string()) return text;
  if (text.size() > kMost) text = text.substr(0, kMost) + " ... (--json shows all)";
  return text;
}

// The table of --cost.
void printCost(const nlohmann::ordered_json& cost) {
  std::printf("%llu bytes; with nothing that can be left out %llu\n\n",
              static_cast<unsigned long long>(cost["bytes"].get<std::uint64_t>()),
              static_cast<unsigned long long>(cost["none"]["bytes"].get<std::uint64_t>()));
  std::printf("  section      bytes\n");
  for (const auto& section : cost["sections"]) {
    std::printf("  %-7s %10llu%s\n", section["name"].get<std::string>().c_str(),
                static_cast<unsigned long long>(section["bytes"].get<std::uint64_t>()),
                section.contains("packed") ? "  packed" : "");
  }
  std::printf("\n  without      saves bytes   us a step while used   what is seen changes by\n");
  for (const auto& need : cost["needs"]) {
    char time[32] = "", change[48] = "";
    if (need.contains("change")) {
      const double most = need["change"].get<double>();
      const std::string unit = need["unit"].get<std::string>();
      if (most == 0) {
        std::snprintf(change, sizeof change, "nothing");
      } else if (!unit.empty()) {
        std::snprintf(change, sizeof change, "%.2g %s", most, unit.c_str());
      }
    }
    if (need.contains("microseconds")) std::snprintf(time, sizeof time, "%.1f", need["microseconds"].get<double>());
    std::printf("  %-11s %12lld   %20s   %23s   %s\n", need["need"].get<std::string>().c_str(),
                static_cast<long long>(need["bytes"].get<std::int64_t>()), time, change,
                need["for"].get<std::string>().c_str());
  }
  const auto& times = cost["times"];
  const auto microseconds = [&](const char* name) { return times[name].get<double>(); };
  std::printf(
      "\n  a step in the air %.1f us; drawn positions %.1f us, normals %.1f us more; load %.2f ms, with nothing %.2f "
      "ms\n",
      microseconds("step_in_the_air_us"), microseconds("drawn_positions_us"), microseconds("drawn_normals_us"),
      microseconds("load_us") / 1000, microseconds("load_none_us") / 1000);
}

// Arrays of records become lines, everything else a "key value" line.
void printJson(const nlohmann::ordered_json& json) {
  for (const auto& [key, value] : json.items()) {
    if (!value.is_array() || value.empty() || !value.front().is_object()) {
      std::cout << key << ": " << plain(value) << "\n";
      continue;
    }
    std::cout << key << ": " << value.size() << "\n";
    std::size_t shown = 0;
    for (const auto& record : value) {
      if (++shown > 40) {
        std::cout << "  ... (" << value.size() - 40 << " more; --json shows all)\n";
        break;
      }
      std::cout << " ";
      for (const auto& [name, field] : record.items()) {
        std::cout << " " << name << "=" << shortened(field);
      }
      std::cout << "\n";
    }
  }
}

}  // namespace

void addInspectVerb(CLI::App& app, int& exit_code) {
  struct Command {
    std::string file;
    std::vector<std::string> assignments;
    std::string unit;
    std::string vertex, name;
    bool cost = false, json = false;
  };
  auto command = std::make_shared<Command>();
  CLI::App* verb = app.add_subcommand("inspect", "Show what is inside a package or a source, and what each part costs");
  verb->add_option("file", command->file, "A package (.sinew), a recipe (.json) or a mesh")->required();
  verb->add_option("--set", command->assignments, "An import setting KEY=VALUE, for a source")->type_name("KEY=VALUE");
  verb->add_option("--unit", command->unit, "Unit of the source; the same as --set import.unit=");
  verb->add_option("--vertex", command->vertex,
                   "Of a package: what a vertex is and hangs on: source:N, visual:N, welded:N, physical:N or MESH:N");
  verb->add_option("--name", command->name, "Of a package: the group, mask, cluster, pin set, channel of this name")
      ->excludes("--vertex");
  verb->add_flag("--cost", command->cost,
                 "Of a package: bytes of each section, bytes and microseconds of what could be left out (bake --needs)")
      ->excludes("--vertex")
      ->excludes("--name");
  verb->add_flag("--json", command->json, "Print one JSON document");
  verb->callback([command, &exit_code] {
    nlohmann::ordered_json json;
    const bool asks = !command->vertex.empty() || !command->name.empty() || command->cost;
    if (command->file.ends_with(".sinew")) {
      const auto asset = loadPackage(command->file);
      const formats::PackageView& package = asset->package();
      json = command->cost              ? packageCost(asset)
             : !command->vertex.empty() ? inspectVertex(package, command->file, command->vertex)
             : !command->name.empty()   ? inspectName(package, command->file, command->name)
                                        : inspectPackage(package);
    } else if (asks) {
      throw ToolError(ExitCode::usage, command->file, "--vertex, --name and --cost ask a package",
                      "Bake it first: " + commandLine({"sinew", "bake", command->file, "-o", "OUT.sinew"}) + ".");
    } else {
      Recipe recipe = recipeFor(command->file);
      if (!command->unit.empty()) recipe.settings.set("import.unit", command->unit);
      applyAssignments(recipe.settings, command->assignments);
      Progress progress(!command->json);
      progress.stage("import");
      const VisualMesh mesh = importVisualMesh(recipe.source, recipe.settings.import, progress);
      json = inspectSource(mesh, analyzeTopology(mesh));
      progress.finish();
    }
    if (command->json)
      std::cout << jsonText(json);
    else if (command->cost)
      printCost(json);
    else
      printJson(json);
    exit_code = int(ExitCode::done);
  });
}

}  // namespace sinew::tools

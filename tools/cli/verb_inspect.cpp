// SPDX-License-Identifier: GPL-3.0-or-later
#include <iostream>

#include "tools/bake/inspect.h"
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
    bool json = false;
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
  verb->add_flag("--json", command->json, "Print one JSON document");
  verb->callback([command, &exit_code] {
    nlohmann::ordered_json json;
    const bool asks = !command->vertex.empty() || !command->name.empty();
    if (command->file.ends_with(".sinew")) {
      const auto asset = loadPackage(command->file);
      const formats::PackageView& package = asset->package();
      json = !command->vertex.empty() ? inspectVertex(package, command->file, command->vertex)
             : !command->name.empty() ? inspectName(package, command->file, command->name)
                                      : inspectPackage(package);
    } else if (asks) {
      throw ToolError(ExitCode::usage, command->file, "--vertex and --name ask a package",
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
    else
      printJson(json);
    exit_code = int(ExitCode::done);
  });
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>
#include <string>

#include "tools/cli/files.h"
#include "tools/cli/open.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/studio/view_window.h"

namespace sinew::tools {

void addStudioVerb(CLI::App& app, int& exit_code) {
  struct StudioCommand {
    std::string file, recipe;
    StudioOptions options;
  };
  auto command = std::make_shared<StudioCommand>();
  CLI::App* verb = app.add_subcommand(
      "studio", "Open a window on a mesh or recipe: say which regions move, and feel them move (docs/studio.md)");
  verb->add_option("file", command->file, "The artist's mesh, a recipe (.json), or a package (.sinew: to look at)")
      ->required();
  verb->add_option("-o,--output", command->recipe, "The recipe of a mesh; without it, the one beside the mesh");
  addWindowOptions(*verb, command->options);
  verb->callback([command, &exit_code] {
    const ViewOptions& view = command->options.view;
    if (!view.screenshot.empty()) requireOutput(Output::picture, view.screenshot, {command->file});
    runStudioWindow(openForWindow(command->file, command->recipe), command->options);
    exit_code = static_cast<int>(ExitCode::done);
  });
}

}  // namespace sinew::tools

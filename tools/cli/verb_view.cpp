// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>
#include <string>

#include "tools/cli/files.h"
#include "tools/cli/open.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/scene/scene.h"
#include "tools/studio/view_window.h"

namespace sinew::tools {

void addViewVerb(CLI::App& app, int& exit_code) {
  struct ViewCommand {
    std::string package;
    std::vector<std::string> others;
    std::string scene;
    std::string solver = "coupled";
    StudioOptions options;
  };
  auto command = std::make_shared<ViewCommand>();
  CLI::App* verb = app.add_subcommand("view", "Open a window on a package: play scenes, grab the body with the mouse");
  verb->add_option("package", command->package, "A baked package (.sinew)")->required();
  verb->add_option("others", command->others, kOthersSentence);
  verb->add_option("--scene", command->scene,
                   sceneList() + ": docs/scenes.md. Without: rest where pins of the package hold it, else drop");
  addSolverOption(*verb, command->solver);
  addWindowOptions(*verb, command->options);
  verb->callback([command, &exit_code] {
    ViewOptions& view = command->options.view;
    view.solver = solverNamed(command->solver);
    if (!view.screenshot.empty()) requireOutput(Output::picture, view.screenshot, {command->package});
    Opened opened = openForWindow(command->package);
    if (!command->scene.empty()) opened.scene = SceneChoice::byName(command->scene);
    view.others = loadOthers(command->others, {&opened.scene, 1});
    runStudioWindow(opened, command->options);
    exit_code = static_cast<int>(ExitCode::done);
  });
}

}  // namespace sinew::tools

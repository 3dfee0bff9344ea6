// SPDX-License-Identifier: GPL-3.0-or-later
#include <memory>
#include <string>

#include "tools/cli/files.h"
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
    ViewOptions options;
  };
  auto command = std::make_shared<ViewCommand>();
  CLI::App* verb = app.add_subcommand("view", "Open a window on a package: play scenes, grab the body with the mouse");
  verb->add_option("package", command->package, "A baked package (.sinew)")->required();
  verb->add_option("others", command->others, kOthersSentence);
  verb->add_option("--scene", command->scene,
                   sceneList() + ": docs/scenes.md. Without: rest where pins of the package hold it, else drop");
  addSolverOption(*verb, command->solver);
  verb->add_option("--screenshot", command->options.screenshot,
                   "Write a picture of the window (.png) after --frames frames and end");
  verb->add_option("--frames", command->options.frames, "End after so many frames; 0 = when the window is closed")
      ->check(CLI::Range(0U, 1000000U));
  verb->add_option("--log-state", command->options.state_log,
                   "Write what happens in each frame as lines of JSON (for tests)");
  verb->callback([command, &exit_code] {
    if (!command->scene.empty()) command->options.scene = SceneChoice::byName(command->scene);
    command->options.file = command->package;
    command->options.solver = solverNamed(command->solver);
    if (!command->options.screenshot.empty()) {
      requireOutput(Output::picture, command->options.screenshot, {command->package});
    }
    requireDisplay(command->package);
    const std::shared_ptr<const Asset> asset = loadPackage(command->package);
    if (command->scene.empty()) {
      command->options.scene = asset->package().pinSets().empty() ? SceneKind::drop : SceneKind::rest;
    }
    command->options.others = loadOthers(command->others, {&command->options.scene, 1});
    runViewWindow(asset, command->options);
    exit_code = static_cast<int>(ExitCode::done);
  });
}

}  // namespace sinew::tools

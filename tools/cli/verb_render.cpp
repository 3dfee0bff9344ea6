// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "tools/bake/check_source.h"
#include "tools/cli/files.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/core/progress.h"
#include "tools/import/import.h"
#include "tools/import/topology.h"
#include "tools/render/defect_picture.h"
#include "tools/render/headless.h"
#include "tools/render/image.h"
#include "tools/render/picture.h"

namespace sinew::tools {
namespace {

struct RenderCommand {
  std::string input;
  std::vector<std::string> others;
  std::string output;
  std::vector<std::string> scenes;
  std::string solver = "coupled";
  double seconds = 0;
  double step = 1.0 / 60;
  int frames = 0;
  std::string size;
  std::string overlay;
  std::string view;
  int columns = 0;
};

std::string joined(std::span<const std::string_view> names) {
  std::string text;
  for (const std::string_view name : names) text += (text.empty() ? "" : ", ") + std::string(name);
  return text;
}

PictureOptions pictureOptions(const RenderCommand& command) {
  PictureOptions options;
  for (const std::string& name : command.scenes) options.scenes.push_back(SceneChoice::byName(name));
  if (!command.overlay.empty()) {
    options.overlay = overlayByName(command.overlay);
    if (!options.overlay) {
      throw ToolError(ExitCode::usage, "", "there is no overlay '" + command.overlay + "'",
                      "Overlays: " + joined(overlayNames()) + ".");
    }
  }
  if (!command.view.empty()) {
    options.view = viewByName(command.view);
    if (!options.view)
      throw ToolError(ExitCode::usage, "", "there is no view '" + command.view + "'",
                      "Views: " + joined(viewNames()) + ".");
  }
  if (!command.size.empty()) {
    int width = 0;
    int height = 0;
    int used = 0;
    const int read = std::sscanf(command.size.c_str(), "%dx%d%n", &width, &height, &used);
    if (read != 2 || used != static_cast<int>(command.size.size()) || width < 64 || height < 64 || width > 4096 ||
        height > 4096) {
      throw ToolError(ExitCode::usage, "", "'" + command.size + "' is no size",
                      "Write it as WIDTHxHEIGHT, 64 to 4096 each, as in 640x480.");
    }
    options.width = width;
    options.height = height;
  }
  options.seconds = command.seconds;
  options.step_seconds = command.step;
  options.solver = solverNamed(command.solver);
  options.frames = command.frames;
  options.columns = command.columns;
  return options;
}

void renderPackage(const RenderCommand& command, bool video) {
  PictureOptions options = pictureOptions(command);
  if (video && options.scenes.size() > 1) {
    throw ToolError(ExitCode::usage, "", "a video shows one scene", "Name one --scene, or ask for a .png of several.");
  }
  if (video && (options.width % 2 != 0 || options.height % 2 != 0)) {
    throw ToolError(ExitCode::usage, "", "H.264 needs an even width and height", "Round --size up to even numbers.");
  }
  constexpr int kMostPictures = 600;
  if (!video && options.frames * static_cast<int>(std::max<std::size_t>(1, options.scenes.size())) > kMostPictures) {
    throw ToolError(ExitCode::usage, "", "a contact sheet of more than 600 pictures is too large",
                    "Lower --frames, or ask for an .mp4.");
  }
  const auto asset = loadPackage(command.input);
  options.others = loadOthers(command.others, options.scenes);
  if (asset->package().visualTriangles().empty()) {
    throw ToolError(ExitCode::bad_input, command.input, "the package has no visual mesh to draw",
                    "Bake it from a source with faces.");
  }
  std::string title(asset->package().text(asset->package().info().name));
  if (title.empty()) title = std::filesystem::path(command.input).stem().string();
  Progress progress(true);
  progress.stage("draw");
  const auto show = [&](double done) { progress.fraction(done); };
  const HeadlessContext context;
  if (video) {
    renderVideo(asset, title, options, command.output, show);
  } else {
    writePng(renderContactSheet(asset, title, options, show), command.output);
  }
  progress.finish();
}

void renderSource(const RenderCommand& command) {
  Progress progress(true);
  const VisualMesh mesh = importVisualMesh(command.input, {}, progress);
  progress.stage("check");
  const std::vector<Finding> findings = checkSource(mesh, analyzeTopology(mesh));
  progress.stage("draw");
  renderDefects(mesh, findings, command.output);
  progress.finish();
}

void runRender(const RenderCommand& command) {
  requireOutput(Output::picture_or_video, command.output, {command.input});
  const std::string extension = std::filesystem::path(command.output).extension().string();
  const bool video = extension == ".mp4" || extension == ".MP4";
  if (std::filesystem::path(command.input).extension() == ".sinew") {
    renderPackage(command, video);
  } else if (!command.others.empty()) {
    throw ToolError(ExitCode::usage, command.others.front(), "a source is drawn alone", "Bake it first (sinew bake).");
  } else if (video) {
    throw ToolError(ExitCode::usage, command.input, "only a package moves",
                    "Bake it first (sinew bake), or ask for a .png of its defects.");
  } else {
    renderSource(command);
  }
  std::cout << command.output << "\n";
}

}  // namespace

void addRenderVerb(CLI::App& app, int& exit_code) {
  auto command = std::make_shared<RenderCommand>();
  CLI::App* verb = app.add_subcommand(
      "render",
      "Draw a package's scenes (contact sheet or video), or a source with its defects marked, without a display");
  verb->add_option("input", command->input, "A baked package (.sinew), or a source")->required();
  verb->add_option("others", command->others, kOthersSentence);
  verb->add_option("-o,--output", command->output, "The picture (.png) or video (.mp4)")->required();
  verb->add_option("--scene", command->scenes,
                   sceneList() + "; again for more rows (default: rest, squash, drop, hang; video: drop)");
  addSolverOption(*verb, command->solver);
  verb->add_option("--seconds", command->seconds, "Length of each scene; 0 = its own")
      ->check(CLI::Range(0.0, 600.0))
      ->check(finiteNumber());
  verb->add_option("--step", command->step, "Seconds per step")->check(CLI::Range(1e-5, 1.0))->check(finiteNumber());
  verb->add_option("--frames", command->frames,
                   "Pictures of each scene (default 6; 1: all scenes side by side), or frames of the video (default 30 "
                   "a second)")
      ->check(CLI::Range(0, 36000));
  verb->add_option("--size", command->size,
                   "Pixels of one picture (default 320x280) or of the video (default 960x720)");
  verb->add_option("--overlay", command->overlay,
                   "none, physical, clusters or all (default: none, and a sheet ends with a row of overlays)");
  verb->add_option("--view", command->view, "front, side, top or three-quarter");
  verb->add_option("--columns", command->columns, "Pictures in a row (default: --frames)")->check(CLI::Range(0, 64));
  verb->callback([command, &exit_code] {
    runRender(*command);
    exit_code = static_cast<int>(ExitCode::done);
  });
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <numbers>
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
  double step = 0;
  int frames = 0;
  std::string size;
  std::string overlay;
  std::string view, camera, light, background;
  bool turntable = false, progress_lines = false;
  int columns = 0;
};

std::string joined(std::span<const std::string_view> names) {
  std::string text;
  for (const std::string_view name : names) text += (text.empty() ? "" : ", ") + std::string(name);
  return text;
}

// "30,15", degrees.
Direction directionNamed(const std::string& option, const std::string& text) {
  double yaw = 0, pitch = 0;
  int used = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf%n", &yaw, &pitch, &used) != 2 || used != int(text.size()) ||
      !(std::abs(yaw) <= 360) || !(std::abs(pitch) <= 89)) {
    throw ToolError(ExitCode::usage, "", option + " cannot be '" + text + "'",
                    "Write yaw and pitch in degrees from the front, pitch -89 to 89, as in 30,15.");
  }
  constexpr double kRadians = std::numbers::pi / 180;
  return {float(yaw * kRadians), float(pitch * kRadians)};
}

// sRGB, 0..1.
float linearOf(float encoded) {
  return encoded <= 0.04045F ? encoded / 12.92F : std::pow((encoded + 0.055F) / 1.055F, 2.4F);
}

// "202428" or "ffffff,808080", sRGB, as linear RGB.
std::array<Eigen::Vector3f, 2> backgroundNamed(const std::string& text) {
  const auto color = [&](const std::string& hex) {
    unsigned value = 0;
    int used = 0;
    if (hex.size() != 6 || std::sscanf(hex.c_str(), "%6x%n", &value, &used) != 1 || used != 6) {
      throw ToolError(ExitCode::usage, "", "--background cannot be '" + text + "'",
                      "Write RRGGBB, or two for top and bottom, as in ffffff,c0c8d0.");
    }
    Eigen::Vector3f rgb;
    for (int k = 0; k < 3; ++k) rgb[k] = linearOf(float((value >> unsigned(16 - 8 * k)) & 255U) / 255);
    return rgb;
  };
  const std::size_t comma = text.find(',');
  return {color(text.substr(0, comma)), color(comma == std::string::npos ? text : text.substr(comma + 1))};
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
  if (!command.camera.empty()) options.camera = directionNamed("--camera", command.camera);
  if (!command.light.empty()) options.light = directionNamed("--light", command.light);
  if (!command.background.empty()) options.background = backgroundNamed(command.background);
  options.turntable = command.turntable;
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

std::string nameOf(const Asset& asset, const std::string& file) {
  const std::string name(asset.package().text(asset.package().info().name));
  return name.empty() ? std::filesystem::path(file).stem().string() : name;
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
  std::string title = nameOf(*asset, command.input);
  for (std::size_t i = 0; i < options.others.size(); ++i) {
    title += ", " + nameOf(*options.others[i], command.others[i]);
  }
  Progress progress(!command.progress_lines);
  if (command.progress_lines) tellLines(progress);
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
  verb->add_option("--step", command->step, "Seconds per step (default: the scene's own, else 1/60)")
      ->check(CLI::Range(1e-5, 1.0))
      ->check(finiteNumber());
  verb->add_option("--frames", command->frames,
                   "Pictures of each scene (default 6; 1: all scenes side by side), or frames of the video (default 30 "
                   "a second)")
      ->check(CLI::Range(0, 36000));
  verb->add_option("--size", command->size,
                   "Pixels of one picture (default 320x280) or of the video (default 960x720)");
  verb->add_option("--overlay", command->overlay,
                   "none, physical, clusters or all (default: none, and a sheet ends with a row of overlays)");
  CLI::Option* view =
      verb->add_option("--view", command->view, "front, side, top or three-quarter; the front is that of import.front");
  verb->add_option("--camera", command->camera, "Where the eye is: yaw,pitch in degrees from the front")
      ->excludes(view);
  verb->add_flag("--turntable", command->turntable, "The camera goes once around; else it stands still");
  verb->add_option("--light", command->light,
                   "Where the light comes from: yaw,pitch in degrees from the front (default: beside the eye)");
  verb->add_option("--background", command->background, "RRGGBB, or RRGGBB,RRGGBB for top and bottom");
  verb->add_option("--columns", command->columns, "Pictures in a row (default: --frames)")->check(CLI::Range(0, 64));
  addProgressLines(*verb, command->progress_lines);
  verb->callback([command, &exit_code] {
    runRender(*command);
    exit_code = static_cast<int>(ExitCode::done);
  });
}

}  // namespace sinew::tools

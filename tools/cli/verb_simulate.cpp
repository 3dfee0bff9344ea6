// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>

#include "tools/cli/files.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/core/atomic_file.h"
#include "tools/scene/measure.h"
#include "tools/scene/mesh_text.h"
#include "tools/scene/scene.h"
#include "tools/scene/scene_script.h"
#include "tools/scene/tbb_jobs.h"

namespace sinew::tools {
namespace {

using nlohmann::ordered_json;

constexpr double kUsualSeconds = 6;  // of a built-in scene: long enough to come to rest

struct SimulateCommand {
  std::string package;
  std::vector<std::string> others;
  std::string scene = "drop";
  double seconds = 0;
  std::vector<double> steps;  // empty: the scene's own
  std::string solver = "coupled";
  double gravity = std::nan("");
  unsigned threads = 1;
  unsigned iterations = 0;
  bool json = false;
  std::string output;
  std::string frame = "source";
};

double percentile(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  const auto at =
      values.begin() + std::ptrdiff_t(std::min(double(values.size() - 1), std::floor(part * double(values.size()))));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

void runSimulate(const SimulateCommand& command) {
  const SceneChoice choice = SceneChoice::byName(command.scene);
  if (!command.output.empty()) requireOutput(Output::mesh, command.output, {command.package, command.scene});
  const auto asset = loadPackage(command.package);
  SceneOptions options;
  options.scene = choice;
  options.others = loadOthers(command.others, {&choice, 1});
  const std::vector<double> lengths = command.steps.empty() ? std::vector{choice.stepSeconds()} : command.steps;
  options.step_seconds = float(lengths.front());
  if (lengths.size() > 1) options.step_sequence.assign(lengths.begin(), lengths.end());
  options.solver = solverNamed(command.solver);
  options.iterations = command.iterations;
  if (std::isfinite(command.gravity)) options.gravity = float(command.gravity);
  TbbJobs jobs(command.threads);
  Scene scene(asset, options, command.threads > 1 ? &jobs : nullptr);

  const double seconds = command.seconds > 0 ? command.seconds : choice.script ? choice.seconds() : kUsualSeconds;
  double round_seconds = 0;
  for (const double step : lengths) round_seconds += step;
  const auto steps = std::uint64_t(std::llround(seconds / round_seconds * double(lengths.size())));
  std::vector<double> microseconds;
  microseconds.reserve(steps);
  double volume_min = 1;
  double volume_max = 1;
  using Clock = std::chrono::steady_clock;
  for (std::uint64_t i = 0; i < steps; ++i) {
    const auto before = Clock::now();
    scene.step();
    microseconds.push_back(std::chrono::duration<double, std::micro>(Clock::now() - before).count());
    const double volume = measureVolumeRatio(scene.world(), scene.body());
    volume_min = std::min(volume_min, volume);
    volume_max = std::max(volume_max, volume);
  }
  double wall = 0;
  for (double t : microseconds) wall += t / 1e6;
  GroupMeasure group = measureGroup(scene.world(), scene.bodies());
  group.height -= double(scene.groundHeight());
  BodyMeasure measure = measureBody(scene.world(), scene.body());
  const double ground = double(scene.groundHeight() / scene.world().asset(scene.body()).package().info().diagonal);
  measure.lowest -= ground;
  measure.lowest_visual -= ground;
  if (!command.output.empty())
    writeFileAtomically(command.output,
                        meshText(scene, command.frame == "scene" ? ExportFrame::scene : ExportFrame::source));

  const auto number = [](double value) { return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr); };
  if (command.json) {
    ordered_json json = {
        {"package", command.package},
        {"scene", command.scene},
        {"steps", steps},
        {"step_seconds", lengths.size() > 1 ? ordered_json(lengths) : ordered_json(lengths.front())},
        {"solver", command.solver},
        {"threads", command.threads},
        {"wall_seconds", wall},
        {"microseconds_per_step", {{"median", percentile(microseconds, 0.5)}, {"p99", percentile(microseconds, 0.99)}}},
        {"finite", measure.finite},
        {"rest_error", {{"rms", number(measure.rest_error_rms)}, {"max", number(measure.rest_error_max)}}},
        {"rms_speed", number(measure.rms_speed)},
        {"volume_ratio",
         {{"min", number(volume_min)}, {"max", number(volume_max)}, {"final", number(measure.volume_ratio)}}},
        {"lowest", number(measure.lowest)},
        {"lowest_visual", number(measure.lowest_visual)},
        {"seam_gap", number(measure.seam_gap)},
        {"state_hash", measure.state_hash}};
    if (scene.bodies().size() > 1) {
      json["bodies"] = {{"count", scene.bodies().size()},
                        {"asleep", group.asleep},
                        {"rms_speed_m_s", number(group.rms_speed)},
                        {"height_m", number(group.height)}};
    }
    std::cout << jsonText(json);
  } else {
    std::printf("%s: scene %s, %llu steps of %.4g s\n", command.package.c_str(), command.scene.c_str(),
                static_cast<unsigned long long>(steps), lengths.front());
    std::printf("  time       %.1f us a step (median), %.1f us (p99)\n", percentile(microseconds, 0.5),
                percentile(microseconds, 0.99));
    if (scene.bodies().size() > 1) {
      std::printf("  bodies     %zu, %u asleep, %.2e m/s rms, %.4g m high; of the first:\n", scene.bodies().size(),
                  group.asleep, group.rms_speed, group.height);
    }
    std::printf("  rest error %.2e rms, %.2e max (of the diagonal)\n", measure.rest_error_rms, measure.rest_error_max);
    std::printf("  speed      %.2e diagonals/s rms\n", measure.rms_speed);
    std::printf("  volume     %.3f of the rest volume at the end (%.3f .. %.3f on the way)\n", measure.volume_ratio,
                volume_min, volume_max);
    std::printf("  lowest     %.2e of what moves, %.2e of what is drawn (diagonals above the ground)\n", measure.lowest,
                measure.lowest_visual);
    std::printf("  state      %s, %s\n", measure.finite ? "finite" : "NOT FINITE", measure.state_hash.c_str());
  }
}

// As in scenes from files.
CLI::Validator gravityInRange() {
  return {[](const std::string& text) {
            double gravity = 0;
            if (CLI::detail::lexical_cast(text, gravity) && gravity >= 0 && gravity <= kMostGravity)
              return std::string();
            char line[160];
            std::snprintf(line, sizeof line,
                          "%.32s is not within 0 to %g m/s^2 (it points downwards, so write 9.81 for the Earth's)",
                          text.c_str(), kMostGravity);
            return std::string(line);
          },
          ""};
}

}  // namespace

void addSimulateVerb(CLI::App& app, int& exit_code) {
  auto command = std::make_shared<SimulateCommand>();
  CLI::App* verb = app.add_subcommand("simulate", "Run a scene without a window");
  verb->add_option("package", command->package, "A baked package (.sinew)")->required();
  verb->add_option("others", command->others, kOthersSentence);
  verb->add_option("--scene", command->scene, sceneList() + ": docs/scenes.md")->capture_default_str();
  verb->add_option("--seconds", command->seconds, "Simulated time; 0 = 6, or the file's")
      ->check(CLI::Range(0.0, 1e6))
      ->check(finiteNumber());
  verb->add_option("--step", command->steps,
                   "Seconds per step; several, by commas, are taken in turn (default: the scene's own, else 1/60)")
      ->delimiter(',')
      ->check(CLI::Range(1e-5, 1.0))
      ->check(finiteNumber());
  addSolverOption(*verb, command->solver);
  verb->add_option("--gravity", command->gravity,
                   "m/s^2 downwards; without it 9.81 diagonals per s^2, so that any size behaves alike")
      ->check(finiteNumber())
      ->check(gravityInRange());
  verb->add_option("--iterations", command->iterations,
                   "Work a step may take (WorldSettings::iterations); 0 = the scene's own")
      ->check(CLI::Range(0U, 16U));
  verb->add_option("--threads", command->threads, "Threads; the result is the same for any number")
      ->check(CLI::Range(1U, 256U));
  verb->add_option("--export", command->output, "Write the deformed visual meshes at the end, each an object (.obj)");
  verb->add_option(
          "--frame", command->frame,
          "Of --export: source (place, unit and axes of the first body's) or scene (as in its file; metres, y up)")
      ->check(CLI::IsMember({"source", "scene"}))
      ->capture_default_str();
  verb->add_flag("--json", command->json, "Print the measures as JSON");
  verb->callback([command, &exit_code] {
    runSimulate(*command);
    exit_code = int(ExitCode::done);
  });
}

}  // namespace sinew::tools

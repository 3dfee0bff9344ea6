// SPDX-License-Identifier: GPL-3.0-or-later
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <optional>

#include "tools/author/settings.h"
#include "tools/cli/error_list.h"
#include "tools/cli/files.h"
#include "tools/cli/options.h"
#include "tools/cli/verb.h"
#include "tools/core/atomic_file.h"
#include "tools/core/progress.h"
#include "tools/render/headless.h"
#include "tools/study/assets.h"
#include "tools/study/beam.h"
#include "tools/study/collision.h"
#include "tools/study/error.h"
#include "tools/study/error_page.h"
#include "tools/study/kinks.h"
#include "tools/study/pull.h"
#include "tools/study/steps.h"

namespace sinew::tools {
namespace {

void addSteps(CLI::App& study, int& exit_code) {
  struct Command {
    StepsOptions options;
    std::string solver = "coupled";
    std::vector<std::string> packages;
    std::uint32_t minutes = 0;
    bool quick = false, full = false, json = false, markdown = false, all = false;
  };
  auto command = std::make_shared<Command>();
  CLI::App* verb = study.add_subcommand(
      "steps", "Bodies under uneven steps, far away, folded, standing, hung, handled: judged by what a World reports");
  verb->add_option("packages", command->packages, "Packages; without any, seven bodies made and baked here");
  CLI::Option* full = verb->add_flag("--full", command->full, "All cells, in place of every triple of levels once");
  CLI::Option* quick = verb->add_flag("--quick", command->quick, "Every pair of levels once")->excludes(full);
  verb->add_option("--chance", command->options.chance, "So many cells of all that there are, by chance, instead")
      ->check(CLI::Range(1, 1000000))
      ->excludes(full)
      ->excludes(quick);
  verb->add_option("--seed", command->options.seed, "What --chance draws with");
  verb->add_option("--only", command->options.only,
                   "Only cells whose description has all these words, as \"scene=stand place=1km\"")
      ->type_name("WORDS");
  addSolverOption(*verb, command->solver);
  verb->add_option("--minutes", command->minutes, "Let bodies stand and hang for so long: speed and drift by minute")
      ->check(CLI::Range(1, 10000));
  verb->add_option("--threads", command->options.threads, "Threads; 0 = all")->check(CLI::Range(0, 1024));
  verb->add_flag("--json", command->json, "Print one JSON document");
  verb->add_flag("--markdown", command->markdown, "Print the table of docs/stability.md");
  verb->add_flag("--all", command->all, "Every cell (--json), or every cell that fails");
  verb->callback([command, &exit_code] {
    StepsOptions& options = command->options;
    if (command->quick) options.design = StepsDesign::pairs;
    if (command->full) options.design = StepsDesign::full;
    if (options.chance > 0) options.design = StepsDesign::chance;
    Progress progress(!command->json);
    progress.stage("bodies");
    std::vector<StepsBody> bodies;
    for (const std::string& file : command->packages) {
      bodies.push_back({std::filesystem::path(file).stem().string(), loadPackage(file)});
    }
    if (bodies.empty()) bodies = builtInStepsBodies();
    for (StepsBody& body : bodies) body.solver = solverNamed(command->solver);
    progress.stage("steps");
    options.progress = [&](std::size_t done, std::size_t of) { progress.fraction(double(done) / double(of)); };
    bool passed = true, any = true;
    std::string text;
    if (command->minutes > 0) {
      const std::vector<LongRun> runs = runLong(command->minutes, options, bodies);
      any = !runs.empty();
      for (const LongRun& run : runs) passed = passed && run.finite;
      text = command->json ? longJson(runs, bodies).dump(2) + "\n" : longText(runs, bodies);
    } else {
      const std::vector<StepsResult> results = runSteps(options, bodies);
      any = !results.empty();
      for (const StepsResult& result : results) passed = passed && result.passed();
      text = command->json       ? stepsJson(results, options, bodies, command->all).dump(2) + "\n"
             : command->markdown ? stepsMarkdown(results, bodies)
                                 : stepsText(results, bodies, command->all);
    }
    progress.finish();
    if (!any) {
      throw ToolError(ExitCode::usage, "", "no cell has all of: " + options.only,
                      "Words look like scene=stand, place=1km, body=box; without --full not all cells are there.");
    }
    std::cout << text;
    exit_code = int(passed ? ExitCode::done : ExitCode::findings);
  });
}

void addKinks(CLI::App& study, int& exit_code) {
  struct Command {
    std::vector<std::string> packages, arms;
    std::string scene = "stretch", solver = "coupled", mask, picture;
    std::uint32_t iterations = 0;
    bool json = false;
  };
  auto command = std::make_shared<Command>();
  CLI::App* verb = study.add_subcommand("kinks", "The sharpest edge of a surface after a scene, against that at rest");
  verb->add_option("packages", command->packages, "Packages to compare")->required();
  verb->add_option("--scene", command->scene, "A built-in scene, or a file (.json)");
  addSolverOption(*verb, command->solver);
  verb->add_option("--iterations", command->iterations, "Of a step (coupled); 0 = the scene's own")
      ->check(CLI::Range(0, 16));
  verb->add_option("--mask", command->mask, "Only where this mask of the recipe weighs more than one half");
  verb->add_option("--arms", command->arms, "Two masks of straight limbs: measure the angle between them")->expected(2);
  verb->add_option("--picture", command->picture, "Draw the first one at rest, and all after the scene")
      ->type_name("FILE.png");
  verb->add_flag("--json", command->json, "Print one JSON document");
  verb->callback([command, &exit_code] {
    if (!command->picture.empty()) requireOutput(Output::picture, command->picture);
    KinkOptions options;
    options.scene = SceneChoice::byName(command->scene);
    options.solver = solverNamed(command->solver);
    options.iterations = command->iterations;
    options.mask = command->mask;
    if (!command->arms.empty()) options.arms = {command->arms[0], command->arms[1]};
    Progress progress(!command->json);
    progress.stage("kinks");
    std::vector<KinkResult> results;
    for (const std::string& file : command->packages) {
      results.push_back(measureKinks(loadPackage(file), file, options));
      progress.fraction(double(results.size()) / double(command->packages.size()));
    }
    if (!command->picture.empty()) {
      const HeadlessContext context;
      writePng(kinksPicture(results, options), command->picture);
    }
    progress.finish();
    if (command->json) {
      std::cout << kinksJson(results, options).dump(2) << "\n";
    } else {
      std::cout << kinksText(results);
    }
    exit_code = int(ExitCode::done);
  });
}

std::array<double, 3> vectorOf(const std::vector<double>& three) { return {three[0], three[1], three[2]}; }

void addPull(CLI::App& study, int& exit_code) {
  struct Command {
    PullOptions options;
    std::string solver = "coupled", input, picture;
    std::vector<std::string> assignments;
    std::vector<double> pick, pull;
    bool json = false;
  };
  auto command = std::make_shared<Command>();
  CLI::App* verb = study.add_subcommand(
      "pull",
      "A held body pulled at a point, at rest: error against finite elements, by functions, clusters, iterations");
  PullOptions& options = command->options;
  verb->add_option("input", command->input, "A source or a recipe; its pins hold it, else its under side")->required();
  verb->add_option("--set", command->assignments, "A setting KEY=VALUE; all of them: sinew help settings")
      ->type_name("KEY=VALUE");
  verb->add_option("--clusters", options.clusters,
                   "How many along the longest axis, several with commas; 0: those of the recipe")
      ->delimiter(',')
      ->check(CLI::Range(0, 64));
  verb->add_option("--modes", options.modes, "Of clusters, several with commas")
      ->delimiter(',')
      ->check(CLI::IsMember(choicesOf("clusters.mode")));
  verb->add_option("--functions", options.functions, "field.functions, several with commas; absent: the recipe's")
      ->delimiter(',')
      ->check(CLI::Range(1, 256));
  verb->add_option("--iterations", options.iterations, "Of a step, several with commas (coupled)")
      ->delimiter(',')
      ->check(CLI::Range(1, 16));
  addSolverOption(*verb, command->solver);
  verb->add_option("--refinements", options.refinements, "How often the reference cuts each tetrahedron into eight")
      ->check(CLI::Range(1, 4));
  verb->add_option("--pick", command->pick, "Where it is pulled: x,y,z in metres")
      ->delimiter(',')
      ->expected(3)
      ->check(finiteNumber());
  verb->add_option("--pull", command->pull, "How far: x,y,z in metres")
      ->delimiter(',')
      ->expected(3)
      ->check(finiteNumber());
  verb->add_option("--finger", options.finger, "Radius of what is held there, of the diagonal")
      ->check(CLI::Range(1e-6, 1.0))
      ->check(finiteNumber());
  verb->add_option("--seconds", options.seconds, "Simulated time")->check(CLI::Range(1.0, 60.0))->check(finiteNumber());
  verb->add_option("--picture", command->picture, "Draw the reference and all rows")->type_name("FILE.png");
  verb->add_flag("--json", command->json, "Print one JSON document");
  verb->callback([command, &exit_code] {
    if (!command->picture.empty()) requireOutput(Output::picture, command->picture);
    command->options.solver = solverNamed(command->solver);
    if (!command->pick.empty()) command->options.pick = vectorOf(command->pick);
    if (!command->pull.empty()) command->options.pull = vectorOf(command->pull);
    if (command->input.ends_with(".sinew")) {
      throw ToolError(ExitCode::bad_input, command->input, "is a package: its clusters are made",
                      "Give the recipe or the source that it was baked from.");
    }
    Recipe recipe = recipeFor(command->input);
    applyAssignments(recipe.settings, command->assignments);
    Progress progress(!command->json);
    progress.stage("pull");
    const PullStudy result = measurePull(recipe, command->options, [&](double part) { progress.fraction(part); });
    if (!command->picture.empty()) {
      const HeadlessContext context;
      writePng(pullPicture(result), command->picture);
    }
    progress.finish();
    if (command->json) {
      std::cout << pullJson(result).dump(2) << "\n";
    } else {
      std::cout << pullText(result);
    }
    exit_code = int(ExitCode::done);
  });
}

void addError(CLI::App& study, int& exit_code) {
  struct Command {
    ErrorOptions options;
    std::string input, list, page;
    std::vector<std::string> assignments;
    double target = 2;
    bool json = false;
  };
  auto command = std::make_shared<Command>();
  CLI::App* verb = study.add_subcommand(
      "error",
      "Bodies in several scenes, by this runtime and by others, each with many settings: error against fine finite "
      "elements over processor time (minutes)");
  ErrorOptions& options = command->options;
  CLI::Option* input =
      verb->add_option("input", command->input, "A source, a recipe, or a package: that is played as it is");
  CLI::Option* list = verb->add_option("--list", command->list,
                                       "Several inputs, each with scenes and settings of its own, in place of one: "
                                       "docs/error-and-speed.md")
                          ->type_name("FILE.json")
                          ->excludes(input);
  verb->add_option("--set", command->assignments, "A setting KEY=VALUE; all of them: sinew help settings")
      ->type_name("KEY=VALUE")
      ->excludes(list);
  verb->add_option(
          "--scene", options.scenes,
          "Several with commas. hang, lean, cantilever, press, squeeze, twist, pins: as study assets; release: a "
          "cantilever that is let go; feet: dropped on the ground; a scene file (.json). Absent: "
          "hang,release,press,twist,feet, and pins "
          "where "
          "there are any")
      ->delimiter(',')
      ->check([](const std::string& name) {
        if (name.ends_with(".json")) return std::string();
        return CLI::IsMember(std::vector<std::string>(kErrorScenes.begin(), kErrorScenes.end()))(name);
      })
      ->excludes(list);
  verb->add_option("--target", command->target,
                   "Gravity is made as strong as moves the reference by this, rms, percent of the diagonal")
      ->check(CLI::Range(0.01, 50.0))
      ->check(finiteNumber());
  verb->add_option("--functions", options.functions, "field.functions, several with commas")
      ->delimiter(',')
      ->check(CLI::Range(1U, ErrorOptions::kMostFunctions));
  verb->add_option("--vertices", options.vertices, "tetrahedra.vertices of the meshes besides the recipe's, for others")
      ->delimiter(',')
      ->check(CLI::Range(ErrorOptions::kLeastVertices, ErrorOptions::kMostVertices));
  verb->add_flag_callback(
      "--refine", [&options] { options.refine_work = std::numeric_limits<double>::infinity(); },
      "The reference cuts each tetrahedron into eight also where that takes long (an hour)");
  verb->add_flag("!--no-peers", options.peers, "This runtime alone");
  verb->add_option("--html", command->page, "Write one page with diagrams, tables and pictures")
      ->type_name("FILE.html");
  verb->add_flag("--json", command->json, "Print one JSON document (shares, not percents)");
  verb->callback([command, &exit_code] {
    const std::string& from = command->list.empty() ? command->input : command->list;
    if (from.empty()) {
      throw ToolError(ExitCode::usage, "", "there is nothing to play", "Give an input, or --list FILE.json.");
    }
    if (!command->page.empty()) requireOutput(Output::page, command->page, {from});
    command->options.target = command->target / 100;
    std::vector<ErrorEntry> entries;
    if (command->list.empty()) {
      entries.push_back({errorInput(command->input), command->options});
      std::optional<Recipe>& recipe = entries.front().input.recipe;
      if (!recipe && !command->assignments.empty()) {
        throw ToolError(ExitCode::usage, command->input, "is a package: --set changes nothing in it",
                        "Give the recipe or the source that it was baked from.");
      }
      if (recipe) applyAssignments(recipe->settings, command->assignments);
    } else {
      entries = readErrorList(command->list, command->options);
    }
    Progress progress(!command->json);
    progress.stage("error");
    std::vector<ErrorStudy> results;
    for (const ErrorEntry& entry : entries) {
      results.push_back(measureError(entry.input, entry.options, [&](double part) {
        progress.fraction((double(results.size()) + part) / double(entries.size()));
      }));
    }
    if (!command->page.empty()) {
      const HeadlessContext context;
      writeFileAtomically(command->page, errorPage(results));
    }
    progress.finish();
    if (command->json && command->list.empty()) {
      std::cout << jsonText(errorJson(results.front()));
    } else if (command->json) {
      nlohmann::ordered_json json = {{"study", "error"}, {"list", command->list}};
      for (const ErrorStudy& result : results) json["entries"].push_back(errorJson(result));
      std::cout << jsonText(json);
    } else {
      for (const ErrorStudy& result : results) std::cout << errorText(result);
    }
    exit_code = int(ExitCode::done);
  });
}

// "5", "5%", "0.05 %" ... as a share.
double shareOf(const std::string& text) {
  std::string number = text;
  while (!number.empty() && (number.back() == '%' || number.back() == ' ')) number.pop_back();
  double percent = 0;
  if (!CLI::detail::lexical_cast(number, percent) || !(percent >= 1e-4 && percent <= 50)) {
    throw ToolError(ExitCode::usage, "", "--target " + text + " is no share of the diagonal",
                    "Give percents from 0.0001 to 50, several with commas: --target 5,1");
  }
  return percent / 100;
}

void addAssets(CLI::App& study, int& exit_code) {
  struct Command {
    AssetsOptions options;
    std::string solver = "coupled";
    std::vector<std::string> packages, scenes, targets;
    double young = 0, poisson = -1;
    bool json = false;
  };
  auto command = std::make_shared<Command>();
  CLI::App* verb = study.add_subcommand("assets",
                                        "Packages as they are, held and brought to rest, against quadratic finite "
                                        "elements on their own tetrahedra: how wrong, in "
                                        "percent of the way (not moving = 100), how soon at rest, at what cost");
  AssetsOptions& options = command->options;
  verb->add_option("packages", command->packages, "Packages to judge")->required();
  addSolverOption(*verb, command->solver);
  verb->add_option("--scenes", command->scenes,
                   "Several with commas. hang: top tenth held; lean: lowest tenth held, gravity sideways; cantilever: "
                   "rear quarter held; press: top tenth moved down by 20 % of the height; squeeze: by 5 %; twist: one "
                   "end turned by 60 "
                   "degrees; pins: the package's own pins hold it. Absent: all but pins")
      ->delimiter(',')
      ->check(CLI::IsMember({"hang", "lean", "cantilever", "press", "squeeze", "twist", "pins"}));
  verb->add_option("--target", command->targets,
                   "Gravity is made as strong as moves the reference by this, rms, percent of the diagonal; several "
                   "with commas. Absent: 5,1")
      ->delimiter(',');
  verb->add_option("--young", command->young, "Young's modulus of the reference, Pa, in place of the package's own")
      ->check(CLI::Range(1e-3, 1e12))
      ->check(finiteNumber());
  verb->add_option("--poisson", command->poisson, "Poisson's ratio of the reference, in place of the package's own")
      ->check(CLI::Range(0.0, 0.499))
      ->check(finiteNumber());
  verb->add_option("--rate", options.rate_hz, "Steps a second")->check(CLI::Range(1.0, 10000.0))->check(finiteNumber());
  verb->add_option("--seconds", options.seconds, "Simulated time at most")
      ->check(CLI::Range(0.1, 1000.0))
      ->check(finiteNumber());
  verb->add_flag("--json", command->json, "Print one JSON document (shares, not percents)");
  verb->callback([command, &exit_code] {
    AssetsOptions& chosen = command->options;
    chosen.solver = solverNamed(command->solver);
    if (!command->scenes.empty()) chosen.scenes.clear();
    for (const std::string& name : command->scenes) chosen.scenes.push_back(*holdSceneOf(name));
    if (!command->targets.empty()) chosen.targets.clear();
    for (const std::string& text : command->targets) chosen.targets.push_back(shareOf(text));
    if (command->young > 0) chosen.young = command->young;
    if (command->poisson >= 0) chosen.poisson = command->poisson;
    std::vector<NamedAsset> assets;
    for (const std::string& file : command->packages) {
      assets.push_back({std::filesystem::path(file).stem().string(), loadPackage(file)});
    }
    Progress progress(!command->json);
    progress.stage("assets");
    const std::vector<AssetsRow> rows = measureAssets(assets, chosen, [&](double part) { progress.fraction(part); });
    progress.finish();
    if (command->json) {
      std::cout << jsonText(assetsJson(rows, chosen));
    } else {
      std::cout << assetsText(rows);
    }
    exit_code = int(ExitCode::done);
  });
}

void addBeam(CLI::App& study, int& exit_code) {
  auto json = std::make_shared<bool>(false);
  CLI::App* verb = study.add_subcommand(
      "beam",
      "A beam on a wall, a hung box, a ball on a thin neck, baked and at rest, against theory and finite elements, by "
      "steps and ways of holding; how the beam swings when it is let go (minutes)");
  verb->add_flag("--json", *json, "Print one JSON document");
  verb->callback([json, &exit_code] {
    Progress progress(!*json);
    progress.stage("beam");
    std::vector<BeamResult> beams;
    std::vector<SwingResult> swings;
    const std::vector<BeamCase> cases = beamCases();
    const std::vector<SwingCase> swing_cases = swingCases();
    const auto show = [&] {
      progress.fraction(double(beams.size() + swings.size()) / double(cases.size() + swing_cases.size()));
    };
    for (const BeamCase& one : cases) {
      beams.push_back(measureBeam(one));
      show();
    }
    for (const SwingCase& one : swing_cases) {
      swings.push_back(measureSwing(one));
      show();
    }
    progress.finish();
    if (*json) {
      std::cout << jsonText(beamJson(beams, swings));
    } else {
      std::cout << beamText(beams, swings);
    }
    exit_code = int(ExitCode::done);
  });
}

void addCollision(CLI::App& study, int& exit_code) {
  struct Command {
    CollisionOptions options;
    std::vector<std::string> packages;
    bool json = false;
  };
  auto command = std::make_shared<Command>();
  CLI::App* verb = study.add_subcommand(
      "collision",
      "Two bent bodies by chance near or in one another: how contacts are found here against ray parity, "
      "triangle/triangle and edge/triangle: what each misses, sees wrongly, leads the wrong way, and its time");
  verb->add_option("packages", command->packages,
                   "Packages of closed surfaces, with triangles no larger than what touches")
      ->required();
  verb->add_option("--pairs", command->options.pairs, "So many")->check(CLI::Range(1, 1000000));
  verb->add_option("--seed", command->options.seed, "What chance draws with");
  verb->add_flag("--json", command->json, "Print one JSON document");
  verb->callback([command, &exit_code] {
    Progress progress(!command->json);
    progress.stage("bodies");
    std::vector<StepsBody> bodies;
    for (const std::string& file : command->packages) {
      bodies.push_back({std::filesystem::path(file).stem().string(), loadPackage(file)});
      if (!bodies.back().asset->package().distanceGrids().empty()) continue;
      throw ToolError(ExitCode::bad_input, file, "the package has no distance grids, by which bodies touch each other",
                      "Bake it again without field.distances=0.");
    }
    progress.stage("collision");
    command->options.progress = [&](double part) { progress.fraction(part); };
    const CollisionResult result = measureCollisions(bodies, command->options);
    progress.finish();
    if (command->json) {
      std::cout << jsonText(collisionJson(result, command->options));
    } else {
      std::cout << collisionText(result);
    }
    exit_code = int(ExitCode::done);
  });
}

}  // namespace

void addStudyVerb(CLI::App& app, int& exit_code) {
  CLI::App* study = app.add_subcommand("study", kStudySentence);
  study->require_subcommand(1);
  addSteps(*study, exit_code);
  addKinks(*study, exit_code);
  addError(*study, exit_code);
  addPull(*study, exit_code);
  addAssets(*study, exit_code);
  addBeam(*study, exit_code);
  addCollision(*study, exit_code);
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Whether `bake --budget` finds what an exhaustive sweep finds: every number of functions up to MOST, of samples and of
// vertices (halved so often), each timed once, and the choice by the same times. Minutes to an hour.
//
//   sinew_budget_sweep samples/assets/spot/spot.obj 128 3 0.1 0.2 0.4
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/author/recipe.h"
#include "tools/bake/bake.h"
#include "tools/bake/stage_cache.h"
#include "tools/bench/answers.h"
#include "tools/bench/budget.h"
#include "tools/core/atomic_file.h"
#include "tools/core/error.h"
#include "tools/import/import.h"

namespace {

using namespace sinew;
using namespace sinew::tools;

struct Point {
  std::uint32_t functions, samples, vertices;
  double microseconds, error;
};

std::shared_ptr<const Asset> bakeOf(const Recipe& recipe, StageCache& cache) {
  Progress progress(false);
  return *Asset::fromMemory(bake(recipe, progress, &cache).package);
}

double staticErrorOf(const Asset& asset) {
  double error = 0;
  for (const formats::Field& field : asset.package().fields()) error = std::max(error, double(field.static_error));
  return error;
}

int sweep(const std::string& input, std::uint32_t most, unsigned halvings, const std::vector<std::string>& budgets) {
  StageCache cache(StageCache::userFolder());
  const Recipe recipe = recipeFor(input);
  Recipe finest = recipe;
  finest.settings.field.functions = 256;
  const auto own = bakeOf(finest, cache);
  const Answers answers(own->package());
  const double own_error = staticErrorOf(*own);
  nlohmann::ordered_json costs = nlohmann::ordered_json::object();
  std::vector<Point> points;
  const auto own_vertices = std::uint32_t(own->package().physicalVertices().size());
  for (std::uint32_t part = 1; part <= 1U << halvings; part *= 2) {
    for (const std::uint32_t samples : {1U, 2U}) {
      for (const std::uint32_t functions :
           {8U, 10U, 12U, 14U, 16U, 20U, 24U, 28U, 32U, 40U, 48U, 56U, 64U, 80U, 96U, 112U, 128U, 160U, 192U}) {
        if (functions > most) break;
        Recipe trial = recipe;
        trial.settings.field.functions = functions;
        trial.settings.field.samples = samples;
        if (part > 1) trial.settings.tetrahedra.target_vertices = own_vertices / part;
        const auto asset = bakeOf(trial, cache);
        const FrameCost cost = measureFrame(asset, usualScene(*asset));
        char key[20];
        std::snprintf(key, sizeof key, "%016" PRIx64, asset->checksum());
        costs[key] = {{"step", cost.step}, {"drawn", cost.drawn}};
        points.push_back({functions, samples, std::uint32_t(asset->package().physicalVertices().size()), cost.all(),
                          std::hypot(answers.errorOf(asset->package()), own_error)});
        const Point& p = points.back();
        std::printf("%u functions, %u samples, %u vertices: %.1f us, error %.2f %%\n", p.functions, p.samples,
                    p.vertices, p.microseconds, 100 * p.error);
        std::fflush(stdout);
      }
    }
  }
  const std::filesystem::path file = std::filesystem::temp_directory_path() / "budget_sweep_costs.json";
  int worse = 0;
  for (const std::string& text : budgets) {
    Budget budget;
    budget.microseconds = 1000 * std::atof(text.c_str());
    const Point* best = nullptr;
    for (const Point& p : points) {
      if (p.microseconds <= *budget.microseconds && (best == nullptr || p.error < best->error)) best = &p;
    }
    try {
      writeFileAtomically(file, costs.dump());
      Progress progress(false);
      const BudgetResult made = bakeWithin(recipe, budget, file, progress, &cache);
      const auto asset = *Asset::fromMemory(made.bake.package);
      const auto again = measureFrame(asset, made.scene);
      // By the sweep's yardstick, which may be finer than the search's.
      const double error = std::hypot(answers.errorOf(asset->package()), own_error);
      const double ratio = best == nullptr ? 0 : error / best->error;
      std::printf("%s ms: chosen %u functions, %u vertices, %.1f us (again %.1f), error %.2f %%", text.c_str(),
                  made.chosen.functions, made.chosen.vertices, made.chosen.frame.all(), again.all(), 100 * error);
      if (best != nullptr) {
        std::printf("; sweep: %u functions, %u samples, %u vertices, %.1f us, %.2f %%: %.2f x", best->functions,
                    best->samples, best->vertices, best->microseconds, 100 * best->error, ratio);
      }
      std::printf("\n");
      if (ratio > 1.2) ++worse;
    } catch (const ToolError& error) {
      std::printf("%s ms: %s%s\n", text.c_str(), error.what(), best == nullptr ? "" : "; the sweep has one");
      if (best != nullptr) ++worse;
    }
    std::fflush(stdout);
  }
  std::filesystem::remove(file);
  return worse == 0 ? 0 : 1;
}

}  // namespace

int main(int argument_count, char** arguments) {
  if (argument_count > 1 && std::string(arguments[1]) == "--import-worker") {
    return runImportWorker(argument_count, arguments);
  }
  if (argument_count < 5) {
    std::fprintf(stderr, "sinew_budget_sweep INPUT MOST HALVINGS MILLISECONDS..\n");
    return 2;
  }
  return sweep(arguments[1], std::uint32_t(std::atoi(arguments[2])), unsigned(std::atoi(arguments[3])),
               {arguments + 4, arguments + argument_count});
}

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/steps.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <sstream>

#include "tools/study/covering.h"
#include "tools/study/packages.h"

namespace sinew::tools {
namespace {

bool selected(const std::string& text, const std::string& only) {
  std::istringstream words(only);
  std::string word;
  while (words >> word) {
    if ((text + " ").find(word + (word.find('=') == std::string::npos ? "" : " ")) == std::string::npos) return false;
  }
  return true;
}

template <class Work>
void forEach(std::size_t count, const StepsOptions& options, const Work& work) {
  std::mutex mutex;
  std::size_t done = 0;
  tbb::task_arena arena(options.threads == 0 ? tbb::task_arena::automatic : int(options.threads));
  arena.execute([&] {
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t i) {
      work(i);
      const std::lock_guard lock(mutex);
      if (options.progress) options.progress(++done, count);
    });
  });
}

}  // namespace

std::string_view nameOf(StepsFactor factor) {
  return std::array<std::string_view, kStepsFactorCount>{"body", "material", "steps", "place",
                                                         "scene"}[std::size_t(factor)];
}

std::vector<std::string> levelsOf(StepsFactor factor, const std::vector<StepsBody>& bodies) {
  switch (factor) {
    case StepsFactor::body: {
      std::vector<std::string> names;
      for (const StepsBody& body : bodies) names.push_back(body.name);
      return names;
    }
    case StepsFactor::material:
      return {"soft", "usual", "stiff"};
    case StepsFactor::steps:
      return {"1/60", "16.7,4.2ms", "50,1ms", "jitter", "hitch", "33ms", "random"};
    case StepsFactor::place:
      return {"origin", "1km", "4km", "10km"};
    case StepsFactor::scene:
      return {"rest",  "tumble", "scattered", "mirrored", "inside_out", "flat",   "line",
              "point", "stand",  "slope",     "hang",     "move",       "handled"};
  }
  return {};
}

std::string textOf(const StepsCell& cell, const std::vector<StepsBody>& bodies) {
  std::string text;
  for (std::size_t f = 0; f < cell.size(); ++f) {
    text += (f == 0 ? "" : " ") + std::string(nameOf(StepsFactor(f))) + "=" + levelsOf(StepsFactor(f), bodies)[cell[f]];
  }
  return text;
}

const StepsFinding& StepsResult::worst() const {
  return *std::max_element(findings.begin(), findings.end(),
                           [](const auto& a, const auto& b) { return a.ratio() < b.ratio(); });
}

std::vector<StepsCell> stepsCells(const StepsOptions& options, const std::vector<StepsBody>& bodies) {
  std::vector<std::uint8_t> levels;
  for (std::size_t f = 0; f < kStepsFactorCount; ++f) {
    levels.push_back(std::uint8_t(levelsOf(StepsFactor(f), bodies).size()));
  }
  std::vector<StepsCell> cells;
  if (options.design == StepsDesign::pairs || options.design == StepsDesign::triples) {
    for (const auto& chosen : coveringDesign(levels, options.design == StepsDesign::pairs ? 2 : 3)) {
      StepsCell cell{};
      std::copy(chosen.begin(), chosen.end(), cell.begin());
      cells.push_back(cell);
    }
  } else if (options.design == StepsDesign::full) {
    std::size_t count = 1;
    for (const std::uint8_t level : levels) count *= level;
    for (std::size_t i = 0; i < count; ++i) {
      StepsCell cell{};
      std::size_t rest = i;
      for (std::size_t f = kStepsFactorCount; f-- > 0; rest /= levels[f]) cell[f] = std::uint8_t(rest % levels[f]);
      cells.push_back(cell);
    }
  } else {
    std::uint64_t drawn = 0;
    for (std::uint32_t i = 0; i < options.chance; ++i) {
      StepsCell cell{};
      for (std::size_t f = 0; f < kStepsFactorCount; ++f) {
        const auto level = std::size_t(chance(options.seed, drawn++) * double(levels[f]));
        cell[f] = std::uint8_t(std::min<std::size_t>(level, levels[f] - 1U));
      }
      cells.push_back(cell);
    }
  }
  std::erase_if(cells, [&](const StepsCell& cell) { return !selected(textOf(cell, bodies), options.only); });
  return cells;
}

std::vector<StepsResult> runSteps(const StepsOptions& options, const std::vector<StepsBody>& bodies) {
  const std::vector<StepsCell> cells = stepsCells(options, bodies);
  std::vector<StepsResult> results(cells.size());
  forEach(cells.size(), options, [&](std::size_t i) { results[i] = runStepsCell(cells[i], bodies); });
  return results;
}

std::vector<LongRun> runLong(std::uint32_t minutes, const StepsOptions& options, const std::vector<StepsBody>& bodies) {
  std::vector<StepsCell> cells;
  for (std::size_t body = 0; body < bodies.size(); ++body) {
    for (const StepsMaterial material : {StepsMaterial::soft, StepsMaterial::usual, StepsMaterial::stiff}) {
      for (const StepsScene scene : {StepsScene::stand, StepsScene::hang}) {
        const StepsCell cell = {std::uint8_t(body), std::uint8_t(material), std::uint8_t(StepsSequence::constant), 0,
                                std::uint8_t(scene)};
        if (selected(textOf(cell, bodies), options.only)) cells.push_back(cell);
      }
    }
  }
  std::vector<LongRun> runs(cells.size());
  forEach(cells.size(), options, [&](std::size_t i) { runs[i] = runLongCell(cells[i], bodies, minutes); });
  return runs;
}
}  // namespace sinew::tools

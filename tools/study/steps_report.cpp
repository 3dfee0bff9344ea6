// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <sstream>
#include <utility>

#include "tools/study/steps.h"

namespace sinew::tools {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kShownFailures = 40;

// Failing cells, the worst over its limit first.
std::vector<const StepsResult*> failures(const std::vector<StepsResult>& results) {
  std::vector<const StepsResult*> failed;
  for (const StepsResult& result : results) {
    if (!result.passed()) failed.push_back(&result);
  }
  std::stable_sort(failed.begin(), failed.end(),
                   [](const auto* a, const auto* b) { return a->worst().ratio() > b->worst().ratio(); });
  return failed;
}

struct LevelTotal {
  std::size_t cells = 0, failed = 0;
  double worst = 0;
  std::map<std::string, std::size_t> criteria;  // a cell counts with each one that it fails
};

// Of the cells that have a level of a factor, and another of another factor if one is given.
LevelTotal totalOf(const std::vector<StepsResult>& results, std::size_t factor, std::size_t level,
                   std::optional<std::pair<StepsFactor, std::size_t>> also = {}) {
  LevelTotal total;
  for (const StepsResult& result : results) {
    if (result.cell[factor] != level) continue;
    if (also && result.cell[std::size_t(also->first)] != also->second) continue;
    ++total.cells;
    total.worst = std::max(total.worst, result.worst().ratio());
    if (result.passed()) continue;
    ++total.failed;
    for (const StepsFinding& finding : result.findings) {
      if (finding.ratio() > 1) ++total.criteria[std::string(nameOf(finding.criterion))];
    }
  }
  return total;
}

std::string nameOf(StepsDesign design) {
  return std::array<const char*, 4>{"pairs", "triples", "full", "chance"}[std::size_t(design)];
}

ordered_json number(double value) { return std::isfinite(value) ? ordered_json(value) : ordered_json("infinite"); }

}  // namespace

ordered_json stepsJson(const std::vector<StepsResult>& results, const StepsOptions& options,
                       const std::vector<StepsBody>& bodies, bool all) {
  const auto entry = [&](const StepsResult& result) {
    ordered_json cell, findings = ordered_json::array();
    for (std::size_t f = 0; f < result.cell.size(); ++f) {
      cell[std::string(nameOf(StepsFactor(f)))] = levelsOf(StepsFactor(f), bodies)[result.cell[f]];
    }
    for (const StepsFinding& finding : result.findings) {
      findings.push_back({{"criterion", nameOf(finding.criterion)},
                          {"unit", unitOf(finding.criterion)},
                          {"value", number(finding.value)},
                          {"limit", finding.limit},
                          {"over_limit", number(finding.ratio())}});
    }
    return ordered_json{{"cell", cell},
                        {"passed", result.passed()},
                        {"worst", nameOf(result.worst().criterion)},
                        {"over_limit", number(result.worst().ratio())},
                        {"findings", findings},
                        {"seconds", result.seconds}};
  };
  ordered_json json;
  json["study"] = "steps";
  json["design"] = nameOf(options.design) +
                   (options.design == StepsDesign::chance ? ", seed " + std::to_string(options.seed) : std::string());
  json["cells"] = results.size();
  const auto failed = failures(results);
  json["failed"] = failed.size();
  double seconds = 0;
  for (const StepsResult& result : results) seconds += result.seconds;
  json["seconds"] = seconds;
  for (std::size_t f = 0; f < kStepsFactorCount; ++f) {
    const std::vector<std::string> levels = levelsOf(StepsFactor(f), bodies);
    for (std::size_t level = 0; level < levels.size(); ++level) {
      const LevelTotal total = totalOf(results, f, level);
      json["levels"][std::string(nameOf(StepsFactor(f)))][levels[level]] = {{"cells", total.cells},
                                                                            {"failed", total.failed},
                                                                            {"worst_over_limit", number(total.worst)},
                                                                            {"failed_by_criterion", total.criteria}};
    }
  }
  json["failures"] = ordered_json::array();
  for (const StepsResult* result : failed) json["failures"].push_back(entry(*result));
  if (all) {
    json["results"] = ordered_json::array();
    for (const StepsResult& result : results) json["results"].push_back(entry(result));
  }
  return json;
}

std::string stepsText(const std::vector<StepsResult>& results, const std::vector<StepsBody>& bodies, bool all) {
  std::ostringstream text;
  char line[256];
  for (std::size_t f = 0; f < kStepsFactorCount; ++f) {
    const std::vector<std::string> levels = levelsOf(StepsFactor(f), bodies);
    std::snprintf(line, sizeof line, "%-16s %6s %6s  %8s  %s\n", std::string(nameOf(StepsFactor(f))).c_str(), "cells",
                  "failed", "worst", "by criterion");
    text << line;
    for (std::size_t level = 0; level < levels.size(); ++level) {
      const LevelTotal total = totalOf(results, f, level);
      std::string criteria;
      for (const auto& [criterion, count] : total.criteria) criteria += " " + criterion + " " + std::to_string(count);
      std::snprintf(line, sizeof line, "  %-14.60s %6zu %6zu  %8.2g ", levels[level].c_str(), total.cells, total.failed,
                    total.worst);
      text << line << criteria << "\n";
    }
  }
  const auto failed = failures(results);
  if (!failed.empty()) text << "failing cells\n  over limit criterion      value      limit\n";
  for (std::size_t i = 0; i < failed.size(); ++i) {
    if (!all && i == kShownFailures) {
      text << "  ... and " << failed.size() - i << " more (--all)\n";
      break;
    }
    const StepsFinding& worst = failed[i]->worst();
    std::snprintf(line, sizeof line, "  %10.3g %-9s %10.3g %10.3g %-8s ", worst.ratio(),
                  std::string(nameOf(worst.criterion)).c_str(), worst.value, worst.limit,
                  std::string(unitOf(worst.criterion)).c_str());
    text << line << textOf(failed[i]->cell, bodies) << "\n";
  }
  double seconds = 0;
  for (const StepsResult& result : results) seconds += result.seconds;
  std::snprintf(line, sizeof line, "%zu cells, %zu failed, %.0f s\n", results.size(), failed.size(), seconds);
  text << line;
  return text.str();
}

std::string stepsMarkdown(const std::vector<StepsResult>& results, const std::vector<StepsBody>& bodies) {
  std::ostringstream text;
  text << results.size() << " cells, " << failures(results).size() << " fail.\n\n| scene |";
  for (const StepsBody& body : bodies) text << " " << body.name << " |";
  text << "\n|---|";
  for (std::size_t b = 0; b < bodies.size(); ++b) text << "---|";
  const std::vector<std::string> scenes = levelsOf(StepsFactor::scene, bodies);
  for (std::size_t scene = 0; scene < scenes.size(); ++scene) {
    text << "\n| " << scenes[scene] << " |";
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      const LevelTotal total =
          totalOf(results, std::size_t(StepsFactor::scene), scene, std::pair{StepsFactor::body, b});
      text << " " << total.failed << "/" << total.cells;
      for (const auto& [criterion, count] : total.criteria) text << " " << criterion;
      text << " |";
    }
  }
  text << "\n";
  for (const StepsFactor factor : {StepsFactor::material, StepsFactor::steps, StepsFactor::place}) {
    text << "\nBy " << nameOf(factor) << ":";
    const std::vector<std::string> levels = levelsOf(factor, bodies);
    for (std::size_t level = 0; level < levels.size(); ++level) {
      const LevelTotal total = totalOf(results, std::size_t(factor), level);
      text << (level == 0 ? " " : ", ") << levels[level] << " " << total.failed << "/" << total.cells;
    }
    text << ".\n";
  }
  return text.str();
}

ordered_json longJson(const std::vector<LongRun>& runs, const std::vector<StepsBody>& bodies) {
  ordered_json json = {{"study", "steps, minutes"}, {"runs", ordered_json::array()}};
  for (const LongRun& run : runs) {
    ordered_json minutes = ordered_json::array();
    for (const LongRun::Minute& minute : run.minutes) {
      minutes.push_back({{"rms_speed_diagonals_per_s", minute.speed},
                         {"drift_diagonals", minute.drift},
                         {"moved_rms_diagonals", minute.moved}});
    }
    json["runs"].push_back({{"cell", textOf(run.cell, bodies)}, {"finite", run.finite}, {"minutes", minutes}});
  }
  return json;
}

std::string longText(const std::vector<LongRun>& runs, const std::vector<StepsBody>& bodies) {
  std::ostringstream text;
  char line[256];
  text << "rms speed (diagonals/s) in the last second of a minute; drift of the centre, and rms way of vertices, in a "
          "minute (diagonals)\n";
  std::snprintf(line, sizeof line, "%-12s %-8s %-6s  %6s  %10s %10s %10s\n", "body", "material", "scene", "minute",
                "speed", "drift", "moved");
  text << line;
  for (const LongRun& run : runs) {
    const std::size_t count = run.minutes.size();
    for (std::size_t i = 0; i < count; ++i) {
      // The first two, the middle and the last.
      if (i > 1 && i != count / 2 && i + 1 != count) continue;
      std::snprintf(line, sizeof line, "%-12.60s %-8s %-6s  %6zu  %10.2e %10.2e %10.2e\n",
                    bodies[run.cell[0]].name.c_str(), levelsOf(StepsFactor::material, bodies)[run.cell[1]].c_str(),
                    levelsOf(StepsFactor::scene, bodies)[run.cell[4]].c_str(), i + 1, run.minutes[i].speed,
                    run.minutes[i].drift, run.minutes[i].moved);
      text << line;
    }
    if (!run.finite) text << "  not finite in minute " << count + 1 << ": " << textOf(run.cell, bodies) << "\n";
  }
  return text.str();
}

}  // namespace sinew::tools

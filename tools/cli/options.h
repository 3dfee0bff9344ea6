// SPDX-License-Identifier: GPL-3.0-or-later
//
// Shared parts of verbs.
#pragma once

#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sinew/runtime/report.h"
#include "sinew/runtime/settings.h"
#include "tools/author/recipe.h"
#include "tools/core/error.h"
#include "tools/core/progress.h"

namespace sinew::tools {

inline constexpr const char* kOthersSentence = "More packages, for scenes of several bodies";

/// Applies `--set KEY=VALUE` in order.
inline void applyAssignments(Settings& settings, const std::vector<std::string>& assignments) {
  for (const std::string& assignment : assignments) settings.assign(assignment);
}

/// Bounds the tools' threads while it lives; 0 = all.
inline std::unique_ptr<tbb::global_control> limitThreads(unsigned threads) {
  if (threads == 0) return nullptr;
  return std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism, threads);
}

/// For an option's check(): refuses "nan" and "inf", which CLI::Range lets through or other options would read over.
inline CLI::Validator finiteNumber() {
  return {[](const std::string& text) {
            double number = 0;
            const bool finite = CLI::detail::lexical_cast(text, number) && std::isfinite(number);
            return finite ? std::string() : "Value " + text + " is no finite number";
          },
          ""};
}

/// The solver of this name, one that addSolverOption() lets through.
inline const SolverFactory* solverNamed(const std::string& name) {
  return name == "report" ? &reportSolver() : nullptr;
}

/// Adds --progress-lines, for a program that started this one.
inline void addProgressLines(CLI::App& verb, bool& wanted) {
  verb.add_flag("--progress-lines", wanted,
                "Stages and shares done as lines on stderr, for a program that started this one");
}
inline void tellLines(Progress& progress) {
  progress.tell([](const std::string& stage, double done) {
    std::fprintf(stderr, "%s %.3f\n", stage.c_str(), done);
    std::fflush(stderr);
  });
}

/// Adds --solver.
inline void addSolverOption(CLI::App& verb, std::string& name) {
  verb.add_option("--solver", name,
                  "coupled: one energy for each piece (docs/method.md); report: clusters matched and averaged")
      ->check(CLI::IsMember({"coupled", "report"}))
      ->capture_default_str();
}

/// One JSON document, as every verb prints it. Text not in UTF-8 (a file's name, a text of a damaged package) gets
/// replacement characters.
inline std::string jsonText(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Bakes that fit: the finest that a time and a size allow, or the cheapest within an error.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/author/recipe.h"
#include "tools/bake/bake.h"
#include "tools/bench/cost.h"

namespace sinew::tools {

/// Limits of a bake, at least one of the three.
struct Budget {
  std::optional<double> microseconds;  ///< of a frame: FrameCost::all() in the package's usualScene()
  std::optional<std::uint64_t> bytes;  ///< of the package
  std::optional<double> error;         ///< BudgetTry::error; the cheapest bake within it is taken

  /// "0.1ms" or "100us"; "200k", "1.5M" or bytes; "5%" or 0.05. \return nothing where the text is no such value above
  /// 0.
  static std::optional<double> readTime(std::string_view text);
  static std::optional<std::uint64_t> readBytes(std::string_view text);
  static std::optional<double> readError(std::string_view text);
};

/// A bake that was tried.
struct BudgetTry {
  std::uint32_t functions = 0;  ///< field.functions
  std::uint32_t vertices = 0;   ///< physical
  std::uint64_t bytes = 0;
  FrameCost frame;
  /// Of answers to small constant loads, of their rms displacement: from those of the recipe's own mesh with 128
  /// functions, or 256 (tools/bench/answers.h), and what these lack of all its tetrahedra's
  /// (formats::Field::static_error). That alone where the surface does not hang on tetrahedra.
  double error = 0;
};

struct BudgetResult {
  BakeResult bake;
  BudgetTry chosen;
  std::vector<BudgetTry> tries;  ///< all of the chosen one's mesh, by functions
  FrameScene scene = FrameScene::air;
};

/// Chooses field.functions, and tetrahedra.vertices where fewer than the recipe's are nearer within the budget. Throws
/// ToolError(bad_input) with what was reached where nothing fits, or as bake() does. \param costs a file of times by
/// package, read where it is there: then the choice is the same on every machine. Missing ones are measured and added.
/// Empty: everything is measured.
BudgetResult bakeWithin(const Recipe& recipe, const Budget& budget, const std::filesystem::path& costs,
                        Progress& progress, StageCache* cache);

/// `chosen`, and `tries`: each what budgetFigures() writes in words.
nlohmann::ordered_json budgetJson(const Budget& budget, const BudgetResult& result);

std::string budgetFigures(const nlohmann::ordered_json& made);

}  // namespace sinew::tools

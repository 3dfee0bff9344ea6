// SPDX-License-Identifier: GPL-3.0-or-later
//
// The stability matrix (docs/stability.md): bodies of every kind, started from states that no game should reach and
// stepped with every length of step, must stay finite, keep their momentum, gain no energy and come back.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "tools/render/image.h"
#include "tools/study/packages.h"

namespace sinew::tools {

/// What a cell of the matrix is made of; a level of each gives a cell.
enum class StabilityFactor : std::uint8_t {
  start,
  step,
  stiffness,
  mass_ratio,
  mode,
  passes,
  body,
  before,
  model,
  limit,
  volume,
  matter,
  size,
};
inline constexpr std::size_t kStabilityFactorCount = 13;

std::string_view nameOf(StabilityFactor factor);
/// Names of a factor's levels, in order.
std::vector<std::string> levelsOf(StabilityFactor factor);

/// A cell: one level of each factor.
using StabilityCell = std::array<std::uint8_t, kStabilityFactorCount>;

/// "start=point step=0.001 ...".
std::string textOf(const StabilityCell& cell);

/// What one cell did, each measured as a ratio to its limit: above 1 is a failure, infinity where a state was not
/// finite or a vertex was lost. docs/stability.md defines each.
struct StabilityResult {
  StabilityCell cell{};
  double momentum = 0;    ///< change of linear or angular momentum while free
  double energy = 0;      ///< growth of kinetic and elastic energy while free
  double shape = 0;       ///< distance from the rest shape at the end
  double contained = 0;   ///< what a lost vertex did to the others
  bool finite = true;     ///< after every step
  double rest_error = 0;  ///< largest distance from the rest shape at the end, diagonals
  double seconds = 0;     ///< wall time
  double worst() const;
  bool passed() const { return worst() <= 1; }
  /// The measure that is worst: "finite", "momentum", "energy", "shape", "contained".
  std::string_view cause() const;
};

struct StabilityOptions {
  bool quick =
      false;  ///< every pair of levels; else every triple, and the full product of start, step, stiffness, mode
  std::uint32_t chance = 0;  ///< not 0: so many cells of all that there are, by chance, in place of a design
  std::uint64_t seed = 1;    ///< of that chance
  std::string only;          ///< runs cells whose text contains this (words separated by spaces must all occur)
  unsigned threads = 0;      ///< 0 = all
  std::function<void(std::size_t done, std::size_t of)> progress;  ///< may be empty; calls do not overlap
};

/// The cells of the design, deterministic.
std::vector<StabilityCell> stabilityDesign(bool quick);
/// Cells of all that there are (2e9), each level as likely as the others of its factor; the same for the same seed.
std::vector<StabilityCell> stabilityChance(std::uint32_t count, std::uint64_t seed);

/// Runs one cell. \param quick fewer steps where they are short.
StabilityResult runStabilityCell(const StabilityCell& cell, bool quick);

/// Runs the design; results in its order, whatever the threads.
std::vector<StabilityResult> runStability(const StabilityOptions& options);

/// Totals, worst cells and failures by cause; every cell too where `all`.
nlohmann::ordered_json stabilityJson(const std::vector<StabilityResult>& results, const StabilityOptions& options,
                                     bool all);
/// The same for a person.
std::string stabilityText(const std::vector<StabilityResult>& results);
/// Rows: start states; columns: levels of the other factors; colour: the share of the cells with both that fail.
Image stabilityPicture(const std::vector<StabilityResult>& results);

}  // namespace sinew::tools

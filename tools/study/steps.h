// SPDX-License-Identifier: GPL-3.0-or-later
//
// `study steps`: bodies under every sequence of steps, anywhere, free, standing, hung and handled, judged by what a
// World reports alone: finite, momentum, energy, back in shape, at rest (steps_measure.h says by which equations).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "tools/study/steps_bodies.h"
#include "tools/study/steps_measure.h"

namespace sinew::tools {

/// Factors of a cell; a level of each gives a cell.
enum class StepsFactor : std::uint8_t { body, material, steps, place, scene };
inline constexpr std::size_t kStepsFactorCount = 5;

/// Frequency that the body is given by BodySettings::stiffness_scale; `usual` leaves the package's own.
enum class StepsMaterial : std::uint8_t { soft /* 0.5 Hz */, usual, stiff /* 100 Hz */ };

enum class StepsSequence : std::uint8_t {
  constant,         ///< 1/60 s
  alternating,      ///< 1/60, 1/240 s, in turn
  alternating_far,  ///< 50, 1 ms, in turn
  jitter,           ///< 5..50 ms, log-uniform
  hitch,            ///< 1/60 s for half a second, then one step of half a second
  slow_frame,       ///< 1/60 s, 1/30 s once a second
  random,           ///< 1e-5..1 s, log-uniform
};
inline constexpr std::size_t kStepsSequenceCount = 7;

enum class StepsScene : std::uint8_t {
  rest,        ///< free, no gravity
  tumble,      ///< free, 3 rad/s about an oblique axis
  scattered,   ///< free, every vertex 0.3 diagonals of its part from its place in a direction by chance
  mirrored,    ///< free, in a plane
  inside_out,  ///< free, what was outside is inside
  flat,        ///< free, in a plane
  line,        ///< free
  point,       ///< free
  stand,       ///< on the ground, 9.81 m/s²
  slope,       ///< of 0.3, friction 0.5
  hang,        ///< by a pin set at its upper end, the longest axis upright
  move,        ///< the same, and in the first second the pin set goes sideways and turns, then stops
  handled,     ///< free; for some seconds pin sets, pins and picks come and go by chance, then air stops it
};
inline constexpr std::size_t kStepsSceneCount = 13;

std::string_view nameOf(StepsFactor factor);
/// Names of a factor's levels, in order. \param bodies give those of StepsFactor::body.
std::vector<std::string> levelsOf(StepsFactor factor, const std::vector<StepsBody>& bodies);

/// A cell: one level of each factor.
using StepsCell = std::array<std::uint8_t, kStepsFactorCount>;

/// "body=box material=soft steps=1/60 place=1km scene=stand".
std::string textOf(const StepsCell& cell, const std::vector<StepsBody>& bodies);

/// Lengths of steps, one after the other, without end. \param seed of those by chance.
class StepLengths {
 public:
  StepLengths(StepsSequence sequence, std::uint64_t seed) : sequence_(sequence), seed_(seed) {}
  float next();

 private:
  StepsSequence sequence_;
  std::uint64_t seed_, count_ = 0;
};

struct StepsResult {
  StepsCell cell{};
  std::vector<StepsFinding> findings;  ///< one each of what the scene is judged by; only `finite` where that failed
  double seconds = 0;                  ///< wall time
  /// The finding that is worst over its limit.
  const StepsFinding& worst() const;
  bool passed() const { return worst().ratio() <= 1; }
};

enum class StepsDesign : std::uint8_t {
  pairs,    ///< every pair of levels of any two factors at least once
  triples,  ///< the same of any three
  full,     ///< the product
  chance
};

struct StepsOptions {
  StepsDesign design = StepsDesign::triples;
  std::uint32_t chance = 0;  ///< of StepsDesign::chance: how many
  std::uint64_t seed = 1;    ///< of that chance
  std::string only;          ///< cells whose text contains these words (separated by spaces) alone
  unsigned threads = 0;      ///< 0 = all
  std::function<void(std::size_t done, std::size_t of)> progress;  ///< may be empty; calls do not overlap
};

/// The cells of a design; deterministic. \param bodies 1..255
std::vector<StepsCell> stepsCells(const StepsOptions& options, const std::vector<StepsBody>& bodies);

/// Runs one cell. The same each time.
///
/// hz = the package's lowest authored frequency of stretching, times the body's stiffness scale. Free bodies are
/// followed for 5 s at rest, 10 s tumbling, 3 s + 10 / hz deformed; what is held or stands has 20 s + 10 / hz to come
/// to rest and 2 s to show it, and what was handled 4 s of that, 3 s of air (5/s) and 3 s + 10 / hz to return.
StepsResult runStepsCell(const StepsCell& cell, const std::vector<StepsBody>& bodies);

/// Runs a design; results in its order, whatever the threads.
std::vector<StepsResult> runSteps(const StepsOptions& options, const std::vector<StepsBody>& bodies);

/// A body that stands or hangs for minutes, in constant steps.
struct LongRun {
  StepsCell cell{};
  struct Minute {
    double speed = 0;  ///< largest rms speed of a step in the last second, diagonals/s
    double drift = 0;  ///< way of the centre of mass in the minute, diagonals
    double moved = 0;  ///< distance of vertices from where they were a minute ago, rms over the mass, diagonals
  };
  std::vector<Minute> minutes;  ///< up to where it was no longer finite
  bool finite = true;
};

/// Runs one cell for minutes. The same each time.
LongRun runLongCell(const StepsCell& cell, const std::vector<StepsBody>& bodies, std::uint32_t minutes);

/// All bodies and materials, standing and hanging, at the origin, 1/60 s. \param options only, threads and progress.
std::vector<LongRun> runLong(std::uint32_t minutes, const StepsOptions& options, const std::vector<StepsBody>& bodies);

/// Totals by level, and cells that fail with each criterion they fail; every cell too where `all`.
nlohmann::ordered_json stepsJson(const std::vector<StepsResult>& results, const StepsOptions& options,
                                 const std::vector<StepsBody>& bodies, bool all);
/// The same for a person. \param all every cell that fails, not only the worst 40.
std::string stepsText(const std::vector<StepsResult>& results, const std::vector<StepsBody>& bodies, bool all);
/// A table of Markdown, scene by body: failing of all cells, with the criteria that failed; then failures by the other
/// factors.
std::string stepsMarkdown(const std::vector<StepsResult>& results, const std::vector<StepsBody>& bodies);

nlohmann::ordered_json longJson(const std::vector<LongRun>& runs, const std::vector<StepsBody>& bodies);
std::string longText(const std::vector<LongRun>& runs, const std::vector<StepsBody>& bodies);

}  // namespace sinew::tools

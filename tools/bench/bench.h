// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/bench/machine.h"

namespace sinew::tools {

struct BenchOptions {
  std::string filter;             ///< runs the groups with this in their name; empty for all
  bool quick = false;             ///< few samples, small sizes: to see that it runs, not to quote
  std::filesystem::path program;  ///< this program's file, started again to run other instruction sets; may be empty
  std::filesystem::path library;  ///< libsinew_runtime.so to weigh; empty: beside the program, in ../lib
  std::filesystem::path models;   ///< tests/assets/models; empty: rows of real meshes are not measured
  std::filesystem::path face;     ///< the baked samples/gallery/face; empty: its rows are not measured
};

/// One measured figure, with what it is compared with.
struct BenchLine {
  std::string group;     ///< of benchGroups()
  std::string name;      ///< unique within its group
  double value = 0;      ///< the figure; NaN where it could not be measured (note says why)
  std::string unit;      ///< "ns/membership", "bytes", ...
  double spread = 0;     ///< half the distance of the quartiles, of the value
  double bound = 0;      ///< the machine's limit in the same unit; 0 = none
  double reference = 0;  ///< the other side of a comparison in the same unit; 0 = none
  std::string reference_name;
  bool reference_is_peer = false;  ///< another library; else this one in another way
  bool lower_is_better = true;
  double ratio = 0;         ///< reference / value, from interleaved samples
  double ratio_spread = 0;  ///< half the distance of the quartiles of the ratio, of the ratio
  std::string limit;        ///< what it is held to, in words; empty: shown only
  double margin = 0;        ///< how far within the limit: >= 1 passes
  unsigned attempts = 1;    ///< measurements made; the best one is shown
  std::string note;

  std::optional<bool> passed() const {
    return limit.empty() || margin == 0 ? std::nullopt : std::optional(margin >= 1);
  }
};

/// A line without figures.
BenchLine lineOf(std::string name, std::string unit);

struct BenchReport {
  MachineLimits machine;
  std::vector<BenchLine> lines;
  bool passed() const;  ///< no line misses its limit
};

/// Names of the groups, in the order they run.
std::vector<std::string_view> benchGroups();

/// Runs the benchmarks. \param show is called with each line as it is done. Throws ToolError(usage) where
/// no group matches the filter.
BenchReport runBench(const BenchOptions& options, const std::function<void(const BenchLine&)>& show);

/// {machine, results: [{name: "group/name", value, unit, lower_is_better, ...}], passed}; what other libraries took is
/// a result of its own, named "peer/group/name, library".
nlohmann::ordered_json benchJson(const BenchReport& report);

/// The machine, the date, and the lines as one table of Markdown.
std::string benchMarkdown(const BenchReport& report);

/// Hash (XXH3-64 is not needed: FNV-1a, 64 bits) of the state after the determinism scene, with so many threads (0: no
/// job system).
std::uint64_t determinismHash(unsigned threads, unsigned steps);

/// Microseconds of a step of one of its bodies in the air, one thread.
double determinismStepMicroseconds(bool quick);

// Data of all groups.
struct BenchContext {
  const BenchOptions& options;
  const MachineLimits& machine;
  std::function<void(BenchLine)> emit;

  /// Timing options of this run.
  TimingOptions timing(ClockKind clock = ClockKind::thread_cpu) const;
  /// Emits make()'s line; one that misses its limit is made again, twice at most, and the best is kept.
  void emitBest(const std::function<BenchLine()>& make) const;
};

void benchStep(const BenchContext& context);
void benchOutput(const BenchContext& context);
void benchLinearity(const BenchContext& context);
void benchThreads(const BenchContext& context);
void benchTouch(const BenchContext& context);
void benchDeterminism(const BenchContext& context);
void benchMemory(const BenchContext& context);
void benchLibrary(const BenchContext& context);
void benchOpen(const BenchContext& context);

}  // namespace sinew::tools

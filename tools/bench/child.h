// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include "tools/bench/bench.h"

namespace sinew::tools {

/// Result of this program, started again with one instruction set forced.
struct ChildResult {
  bool ran = false;
  std::string reason;            ///< why not, one clause
  std::uint64_t hash = 0;        ///< determinismHash()
  double step_microseconds = 0;  ///< determinismStepMicroseconds()
};

/// Starts `BenchOptions::program` with SINEW_INSTRUCTION_SET set, which the runtime reads once. \param instruction_set
/// "sse42", "avx2" or "avx512"; not run where the processor lacks it.
ChildResult runBenchChild(const BenchOptions& options, const char* instruction_set, unsigned steps);

/// The child's side: one line for runBenchChild() to read.
std::string benchChildLine(unsigned steps, bool quick);

}  // namespace sinew::tools

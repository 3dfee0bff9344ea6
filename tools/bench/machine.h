// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tools/bench/timing.h"

namespace sinew::tools {

/// Copy bandwidth at one size: bytes read plus bytes written, per second.
struct CopyBandwidth {
  std::size_t bytes = 0;   ///< working set of a thread, source and destination together
  double one_thread = 0;   ///< bytes/s
  double two_threads = 0;  ///< bytes/s of both, each on a working set of its own
};

/// The machine's limits, measured.
struct MachineLimits {
  std::string processor;        ///< its name, as the system tells it; empty where it does not
  unsigned processors = 0;      ///< threads that run at once
  std::string instruction_set;  ///< widest with FMA: "avx512", "avx2", else "compiler" (what the build assumes)
  double fma_flops = 0;         ///< float multiply-adds in registers, the fastest width, flops/s of one thread
  unsigned fma_bits = 0;        ///< that width
  /// The same of each width that the processor has.
  struct AtWidth {
    unsigned bits = 0;
    double fma = 0;    ///< flops/s
    double plain = 0;  ///< flops/s, multiplications and additions apart, as the runtime's kernels compute
  };
  std::vector<AtWidth> widths;
  double fma_two_threads = 0;         ///< the same on two threads at once, flops/s of both
  std::vector<CopyBandwidth> copies;  ///< sizes ascending: two in L1, L2, L3 and DRAM of usual machines each

  /// Bandwidth for a working set, one thread: that of the next larger measured size.
  double bandwidth(std::size_t working_set_bytes) const;
};

/// Measures for about half a second (`quick`: a tenth).
MachineLimits measureMachine(bool quick);

/// How many times two threads do the work of one in the same wall time at this moment, on half a millisecond of
/// arithmetic that shares nothing: what others leave of the second core. 2 on an idle machine.
double measureSecondCore();

}  // namespace sinew::tools

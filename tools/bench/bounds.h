// SPDX-License-Identifier: GPL-3.0-or-later
//
// Least work of output, counted from its formulas (docs/report.md §6). Peak arithmetic counts fused multiply-adds,
// although kernels do not fuse. The cofactors that normals need at physical vertices are left out.
#pragma once

#include <algorithm>

#include "tools/bench/machine.h"

namespace sinew::tools {

/// Arithmetic and memory traffic of one element.
struct Work {
  double flops = 0;  ///< additions and multiplications
  double bytes = 0;  ///< loaded and stored
  friend Work operator+(const Work& a, const Work& b) { return {a.flops + b.flops, a.bytes + b.bytes}; }
  friend Work operator*(double s, const Work& a) { return {s * a.flops, s * a.bytes}; }
};

/// Seconds at the machine's peak: the slower of arithmetic and traffic.
inline double boundSeconds(const Work& work, const MachineLimits& machine, std::size_t working_set_bytes) {
  return std::max(work.flops / machine.fma_flops, work.bytes / machine.bandwidth(working_set_bytes));
}

/// A physical vertex from k functions: for each one value, a product and a sum by axis; the position out.
inline Work fieldVertexWork(double functions) { return {6 * functions, 4 * functions + 12}; }
/// A visual vertex in its tetrahedron: its record 16, the tetrahedron 16, four positions 48, the result 12 bytes.
inline constexpr Work kVisualPositionWork{21, 92};
/// Its normal: the rest normal 12, four cofactors 144, the result 12 bytes.
inline constexpr Work kVisualNormalWork{95, 168};

}  // namespace sinew::tools

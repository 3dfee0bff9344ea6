// SPDX-License-Identifier: GPL-3.0-or-later
//
// What the method needs at least, counted from its formulas: docs/performance.md has the derivation.
#pragma once

#include <algorithm>

#include "sinew/formats/sections.h"
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

/// Moments and goals of one membership, without what is done once a vertex or once a cluster.
inline Work membershipWork(formats::ClusterMode mode) {
  return mode == formats::ClusterMode::quadratic ? Work{135, 52} : Work{51, 52};
}
/// What matching does once a cluster: rotation (one Newton step), deviation, F, the test of the guard.
inline Work clusterWork(formats::ClusterMode mode) {
  return mode == formats::ClusterMode::quadratic ? Work{910, 556} : Work{316, 172};
}
/// What matching does once a vertex: the old position in, the new one out.
inline constexpr Work kMatchedVertexWork{0, 24};
/// Prediction, momentum and settling of one vertex.
inline constexpr Work kSteppedVertexWork{130, 108};
/// A visual vertex in its tetrahedron: its record, the tetrahedron, four positions, the result.
inline constexpr Work kVisualPositionWork{21, 92};
/// And its normal: the rest normal, four cofactors, the result.
inline constexpr Work kVisualNormalWork{95, 168};

/// Matching, all phases, of one membership. \param cluster_size members of a cluster. \param memberships of a vertex.
inline Work matchingWork(formats::ClusterMode mode, double cluster_size, double memberships) {
  return membershipWork(mode) + (1 / cluster_size) * clusterWork(mode) + (1 / memberships) * kMatchedVertexWork;
}

}  // namespace sinew::tools

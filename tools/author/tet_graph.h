// SPDX-License-Identifier: GPL-3.0-or-later
//
// Neighbours over the edges of tetrahedra: distances that never jump a gap.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tools/tetrahedralize/tetrahedralize.h"

namespace sinew::tools {

struct TetGraph {
  std::vector<std::uint32_t> first;      ///< per physical vertex, and one more: its run of the two below
  std::vector<std::uint32_t> neighbour;  ///< ascending in each run
  std::vector<double> length;            ///< metres
  std::vector<double> mean_edge;         ///< metres, per body
};

TetGraph makeTetGraph(const PhysicalMesh& mesh);

/// Shortest ways along edges.
struct TetDistances {
  std::vector<double> distance;  ///< metres; infinite where no way leads
  std::vector<std::uint32_t>
      nearest;  ///< the source whose distance it is (of equal ones the lowest); formats::kNone: none
};

/// From all `sources` at once.
/// \param limit metres; distances beyond it stay infinite.
/// \param inside empty, or per vertex whether ways may pass there.
TetDistances tetDistances(const TetGraph& graph, std::span<const std::uint32_t> sources, double limit,
                          std::span<const std::uint8_t> inside = {});
/// The same from places between vertices. \param start per vertex its distance from the nearest place, infinite where
/// there is none beside it.
TetDistances tetDistances(const TetGraph& graph, std::span<const double> start, double limit);

}  // namespace sinew::tools

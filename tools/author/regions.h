// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tools/author/clusters.h"
#include "tools/author/tet_graph.h"

namespace sinew::tools {

/// Cuts a set of physical vertices into regions that follow the shape, as few as are `size` wide in the mean: centres
/// by farthest-point sampling, then Lloyd's rounds, distances along the tetrahedra's edges within the set. At most 256
/// regions. Pieces that do not touch are never in one, but that those of fewer than 8 vertices go to the nearest.
/// \param members physical vertices. \param size metres, > 0.
/// \return region of each member, from 0.
std::vector<std::uint32_t> regionsOfSize(const PhysicalMesh& mesh, const TetGraph& graph,
                                         std::span<const std::uint32_t> members, double size);

/// The clusters of pieces that nobody authored, by options.method.
/// \param authored per piece: not 0 where it has clusters already; empty: none has.
std::vector<ClusterSource> automaticClusters(const PhysicalMesh& mesh, const ClusterOptions& options,
                                             std::span<const std::uint8_t> authored, std::vector<Finding>& findings);

}  // namespace sinew::tools

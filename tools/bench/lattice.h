// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "sinew/formats/sections.h"
#include "sinew/runtime/asset.h"
#include "sinew/runtime/settings.h"
#include "tools/bench/moving_state.h"

namespace sinew::tools {

/// A body for benchmarks: a block of lattice points, five tetrahedra a cell, in overlapping boxes.
struct LatticeOptions {
  std::array<std::uint32_t, 3> points = {15, 10, 10};  ///< physical vertices along x, y, z; each >= 2
  std::array<std::uint32_t, 3> boxes = {3, 2, 2};      ///< clusters along x, y, z; each <= points
  /// Memberships a vertex wanted; each box grows by whole layers of points, as near to it as they come. 1 = none grows.
  double memberships = 2.5;
  formats::ClusterMode mode = formats::ClusterMode::quadratic;
  double stretch_hz = 10, bend_hz = 10, twist_hz = 10;
  std::uint32_t visual_vertices = 0;  ///< on an ellipsoid within the block; 0 = none, so that nothing can touch
};

/// The asset and what was made.
struct LatticeBody {
  std::shared_ptr<const Asset> asset;
  std::vector<std::byte> package;  ///< the file's bytes
  std::uint32_t vertices = 0, clusters = 0, memberships = 0, visual_vertices = 0;
  double membershipsPerVertex() const { return double(memberships) / vertices; }
};

/// Makes the package in memory, with the moments and the fields that `bake` computes. The longest side is 1 m. Throws
/// ToolError where the package reader refuses it.
LatticeBody makeLattice(const LatticeOptions& options);

/// The body of most groups: 1,500 vertices, as many as a bake makes by default, in 12 clusters. Made once for each
/// number of visual vertices.
const LatticeBody& blockBody(std::uint32_t visual_vertices);

}  // namespace sinew::tools

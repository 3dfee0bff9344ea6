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

namespace sinew::tools {

/// A body for benchmarks: a block of lattice points, five tetrahedra a cell, in overlapping boxes.
struct LatticeOptions {
  std::array<std::uint32_t, 3> points = {17, 17, 17};  ///< physical vertices along x, y, z; each >= 2
  std::array<std::uint32_t, 3> boxes = {4, 4, 4};      ///< clusters along x, y, z; each <= points
  /// Memberships a vertex wanted; each box grows by whole layers of points, as near to it as they come. 1 = none grows.
  double memberships = 2.5;
  formats::ClusterMode mode = formats::ClusterMode::quadratic;
  double stretch_hz = 10, bend_hz = 10, twist_hz = 10;
  float per_step_beta = -1;           ///< 0..1: StiffnessModel::per_step with it, in place of frequencies; -1: none
  bool limits = false;                ///< principal stretches limited and volume kept, as a bake's default
  std::uint32_t visual_vertices = 0;  ///< on an ellipsoid within the block; 0 = neither these nor tetrahedra
};

/// The asset and what was made.
struct LatticeBody {
  std::shared_ptr<const Asset> asset;
  std::vector<std::byte> package;  ///< the file's bytes
  std::uint32_t vertices = 0, clusters = 0, memberships = 0, visual_vertices = 0;
  double membershipsPerVertex() const { return double(memberships) / vertices; }
};

/// Makes the package in memory, with the moments that `bake` computes. The longest side is 1 m. Throws ToolError where
/// the package reader refuses it.
LatticeBody makeLattice(const LatticeOptions& options);

/// A state that every phase has to work for: turned, bent, twisted by a few percent, spinning and swinging.
struct MovingState {
  std::vector<Vec3> positions;   ///< metres
  std::vector<Vec3> velocities;  ///< m/s
};
MovingState movingState(const Asset& asset);

}  // namespace sinew::tools

// SPDX-License-Identifier: MIT
//
// Buffers of the caller that the runtime writes deformed vertices into.
#pragma once

#include <cstdint>

#include "sinew/runtime/settings.h"

namespace sinew {

/// A stream of vectors in a buffer of the caller's: element i is three floats at `data` + i * `stride` bytes. Bytes
/// between the elements stay as they are.
struct StridedFloat3 {
  float* data = nullptr;      ///< null: not wanted
  std::uint32_t stride = 12;  ///< bytes, >= 12, a multiple of 4
  std::uint32_t count = 0;    ///< elements the buffer has room for; those beyond the mesh are left alone
};

/// The same with four floats an element.
struct StridedFloat4 {
  float* data = nullptr;
  std::uint32_t stride = 16;  ///< bytes, >= 16, a multiple of 4
  std::uint32_t count = 0;
};

/// A run of visual vertices.
struct VertexRun {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

/// Streams of a body's visual mesh. Element i of each is visual vertex i, also if only a sub-mesh is written. They may
/// share a buffer (interleaved vertices).
struct VisualOutput {
  StridedFloat3 positions;  ///< metres, world
  /// Unit in every state, even of a collapsed body (docs/report.md §6). They follow the cofactors of the transforms
  /// that best fit the clusters. No such transform mirrors, so a body turned inside out is lit as the rest shape.
  StridedFloat3 normals;
  /// xyz unit, orthogonal to the normal, where texture coordinate u grows; w is +1 or -1: cross(normal, tangent) * w
  /// points where v grows (as in glTF). From the package's texture coordinates; any direction in the surface where
  /// there are none.
  StridedFloat4 tangents;
  /// Positions before the last step, for motion vectors: needs BodySettings::keep_previous, else the positions. Equal
  /// to the positions after addBody, resetBody, setState and restoreState; teleport moves them along.
  StridedFloat3 previous_positions;
};

/// A box along the axes, metres, world.
struct Bounds {
  Vec3 low = {0, 0, 0};
  Vec3 high = {0, 0, 0};
};

}  // namespace sinew

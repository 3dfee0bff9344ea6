// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "runtime/kernels/attach_layout.h"
#include "runtime/memory/array.h"
#include "sinew/formats/package.h"
#include "sinew/runtime/output.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// Constants of outputs that a package does not hold in this form. One per Asset, made at the first output, shared by
/// its bodies.
struct VisualConstants {
  Array<AttachmentRecord> records;     ///< barycentric attachments, by visual vertex
  Array<AttachmentRecord> directions;  ///< with weights brought into 0..1, sum 1; empty: as `records`
  Array<SlotCorners> corners;          ///< of the tetrahedra that a visual vertex hangs on: slots
  Array<SlotInverse> inverses;         ///< by slot
  Array<BlendRun> slots_at;            ///< by physical vertex: slots that it is a corner of
  Array<BlendTerm> slot_terms;         ///< their parts of the volume of these slots
  Array<Vec3> made_normals;            ///< rest normals where the package has none

  Array<VertexRun> sub_mesh_runs;           ///< visual vertices of the sub-meshes, ascending within one
  Array<std::uint32_t> first_sub_mesh_run;  ///< sub-mesh -> runs, sub-mesh count + 1 entries

  std::span<const AttachmentRecord> directionRecords() const { return directions.empty() ? records : directions; }
  std::span<const VertexRun> runsOf(std::uint32_t sub_mesh) const {
    return {sub_mesh_runs.data() + first_sub_mesh_run[sub_mesh],
            sub_mesh_runs.data() + first_sub_mesh_run[sub_mesh + 1]};
  }
};

VisualConstants makeVisualConstants(const formats::PackageView& package);

/// Rest tangents by visual vertex: xyz unit, orthogonal to the normal, where u grows; w = +1 or -1, so that
/// cross(normal, tangent) * w points where v grows. Angle-weighted mean of the triangles' tangents, of the handedness
/// that has the larger angle at the vertex; without usable texture coordinates any direction in the surface, w = 1.
Array<std::array<float, 4>> makeTangents(const formats::PackageView& package, std::span<const Vec3> normals);

}  // namespace sinew::internal

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "runtime/geometry/winding_number.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"
#include "tools/tetrahedralize/enclosure.h"

namespace sinew::tools {

/// Triangles over welded points, neighbours turned the same way, relative to the middle of the mesh.
struct WeldedSurface {
  Eigen::Vector3d center;  ///< metres, world
  std::vector<Eigen::Vector3d> points;
  std::vector<Triangle> triangles;
};

WeldedSurface weldedSurface(const VisualMesh& mesh, const Topology& topology);

/// Parts of a surface that touch, taken together.
struct PartGroup {
  std::vector<std::uint32_t> parts, solid_parts;
  std::vector<std::uint32_t> turned;  ///< open solid parts that were inside out
  std::vector<Triangle> triangles;    ///< of the solid parts (all where it encloses nothing)
  Enclosure enclosure;
  Eigen::AlignedBox3d bounds;
  geometry::WindingNumber winding;  ///< over these triangles, where the caller has made it
};

/// Decides which of the parts bound a solid together, and turns parts facing the wrong way.
PartGroup makePartGroup(const Topology& topology, const WeldedSurface& surface,
                        const std::vector<std::uint32_t>& parts);

}  // namespace sinew::tools

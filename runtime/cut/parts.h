// SPDX-License-Identifier: MIT
//
// The parts of the physical mesh: what hangs together on each side, which tetrahedra and how much of each mass it has.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/cut/section.h"

namespace sinew::cutting {

/// A tetrahedron of a part.
struct PartTetrahedron {
  std::uint32_t source = 0;           ///< of the package
  std::array<double, 4> center = {};  ///< barycentric: middle of what the part has of it
  double volume = 0;                  ///< m^3 at rest: what the part has of it
};

struct PartMesh {
  Side side = 0;
  std::vector<PartTetrahedron> tetrahedra;  ///< by source. Those that the plane passes through are in two parts, whole
  std::vector<std::uint32_t> vertices;      ///< of the package, ascending: all that these have
  std::vector<float> masses;                ///< kg, of the vertices
  std::vector<std::uint8_t> own;            ///< the vertex lies on the part's side
  std::vector<std::uint32_t> fragments;     ///< of the surface
  std::vector<std::uint32_t> polygons;      ///< of the section
};

struct Partition {
  std::vector<PartMesh> parts;
  std::vector<std::uint32_t> part_of;  ///< of vertices, below then above: the part that has it there; none
  /// Some part was too small: `sides` has it on the other side now, and all is to be done anew.
  bool again = false;
};

/// \param least share of the body's mass that a part has at least. \param last no part is too small any more: what is
/// joins the largest one.
Partition findParts(const formats::PackageView& package, const Surface& surface, const Section& section,
                    const std::vector<Hung>& nodes, double least, bool last, Sides& sides);

}  // namespace sinew::cutting

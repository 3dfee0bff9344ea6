// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/geometry/parallel.h"
#include "runtime/geometry/tet_mesh.h"
#include "tools/tetrahedralize/lattice_faces.h"
#include "tools/tetrahedralize/pieces.h"

namespace sinew::tools {

/// A tetrahedron of the lattice and what passes through it.
struct LatticeCell {
  std::vector<std::uint32_t> triangles;  ///< of the surface, ascending
  std::vector<std::uint32_t> fragment;   ///< of each
  std::vector<std::uint8_t> faces;       ///< of each: bits of the cell's faces that it reaches
  std::uint32_t fragments = 1;
  bool solid = true;      ///< its middle, where no triangle passes through
  bool doubtful = false;  ///< sheets of one part pierce each other
  /// Only where there are several fragments:
  std::array<std::array<std::int32_t, kFaceSamples>, 4> face_fragment{};  ///< fragment of solid at each sample
  std::vector<double> inside;                                             ///< of each fragment
  /// Points of the surface in it, with their fragments.
  std::vector<std::array<std::uint32_t, 2>> points;
};

/// The connected fragments of solid (of surface, where the piece encloses nothing) in each cell of a lattice; what is
/// one, splitAtGaps() says. \return by tetrahedron.
std::vector<LatticeCell> cellFragments(const SolidPiece& piece, const geometry::TetMesh& lattice,
                                       const LatticeFaces& faces, double join_distance,
                                       const geometry::ParallelFor& parallel_for);

}  // namespace sinew::tools

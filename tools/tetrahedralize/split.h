// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/geometry/parallel.h"
#include "runtime/geometry/tet_mesh.h"
#include "tools/tetrahedralize/pieces.h"

namespace sinew::tools {

/// Tetrahedra of a lattice, split where several fragments of solid pass through one.
struct SplitMesh {
  geometry::TetMesh mesh;
  /// Per tetrahedron: fraction of it inside its own fragment of solid, where it has copies; else negative.
  std::vector<double> inside;
  /// Per position of the piece: the tetrahedron it lies in, of several copies the one of its own fragment. Outside all
  /// of them: the nearest that a triangle of its own passes through, so never across a gap; formats::kNone where there
  /// is none.
  std::vector<std::uint32_t> home;
  double volume = 0;           ///< of the lattice that is left, m^3: copies of one cell count once
  std::uint32_t cells = 0;     ///< tetrahedra that have copies now
  std::uint32_t vertices = 0;  ///< added
  std::uint32_t joined = 0;    ///< splits taken back because the piece would have fallen apart
  /// A triangle each of cells in which sheets of one part pierce each other: each was taken for a surface of its own,
  /// and what is solid twice joins neither to the other.
  std::vector<std::uint32_t> doubtful;
};

/// Gives every tetrahedron one copy for each connected fragment of solid (of surface, where the piece encloses nothing)
/// inside it, and copies share a vertex only where the fragments meet across the faces around it: the virtual nodes of
/// Molino et al. 2004 and Sifakis et al. 2007, cut along the piece's own surface. So two lips in one cell stay two.
///
/// Fragments are found from the triangles clipped to the cell: any that share a point or an edge inside it are one,
/// and any that see each other (or the same sample of the solid) along a line that crosses no triangle. Parts closer
/// than `join_distance` metres are one, as in findPieces; but a much smaller part joins no two fragments of a larger
/// one (an eyeball between its lids). The result is one fragment again over shared vertices, as the lattice was.
/// Deterministic for any number of threads.
///
/// \param lattice tetrahedra that meet in whole faces and cover the piece, relative to its centre.
SplitMesh splitAtGaps(const SolidPiece& piece, const geometry::TetMesh& lattice, double join_distance,
                      const geometry::ParallelFor& parallel_for);

}  // namespace sinew::tools

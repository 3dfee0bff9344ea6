// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "tools/tetrahedralize/fill.h"

namespace sinew::tools {

/// The least dihedral angle that `delaunay` returns, degrees.
inline constexpr double kDelaunayDihedral = 10;

/// How delaunay went for a piece, for the report.
struct DelaunayOutcome {
  std::string reason;        ///< why the result is empty, if it is
  bool only_angles = false;  ///< it is empty only because an angle stays below kDelaunayDihedral
  std::string note;          ///< what the user should know about a result (sealed, ...); may stay empty
};

/// Delaunay refinement of a piece's solid (CGAL), on its own surface where that is closed, manifold and does not cross
/// itself, else on an alpha wrap whose volume agrees with the piece's. Tetrahedra below kDelaunayDihedral are smoothed.
/// \param crosses_itself some triangles of the piece pierce each other.
FilledPiece fillWithDelaunay(const SolidPiece& piece, std::uint32_t target_vertices, bool crosses_itself,
                             const geometry::ParallelFor& parallel_for, DelaunayOutcome& outcome);

/// Raises the smallest dihedral angles below `wanted_deg` by moving vertices of bad tetrahedra, never inverting one.
/// \param reach how far a vertex may end up from where it was, metres.
void smoothBadTetrahedra(geometry::TetMesh& mesh, double wanted_deg, double reach);

}  // namespace sinew::tools

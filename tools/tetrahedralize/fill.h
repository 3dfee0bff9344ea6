// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/geometry/parallel.h"
#include "runtime/geometry/tet_mesh.h"
#include "tools/tetrahedralize/pieces.h"

namespace sinew::tools {

/// Tetrahedra of one piece, relative to its centre.
struct FilledPiece {
  geometry::TetMesh mesh;
  double spacing = 0;            ///< size of a cell, metres
  std::uint32_t components = 0;  ///< that share no vertex
  double volume = 0;             ///< m^3
  double uncovered = 0;          ///< fraction of the surface's area further than a cell outside the tetrahedra
  std::uint32_t bridges = 0;     ///< cells added to join parts
  std::uint32_t ties = 0;        ///< shell: the last tetrahedra, which only hold its parts together
  double widened = 1;            ///< grid: largest factor by which an axis was widened to keep the angles
  double thickened = 0;          ///< stuffing: fraction of the surface area that was thickened to a cell
};

/// A cage of boxes (method `grid`). Never empty, always one component. Widens an axis where its cells would be too
/// flat.
FilledPiece fillWithGrid(const SolidPiece& piece, std::uint32_t target_vertices,
                         const geometry::ParallelFor& parallel_for);

/// Isosurface stuffing. Features that slip through the lattice are thickened until it catches them: points within the
/// lattice's covering radius of the triangles that the first try left outside count as inside. The rest follows the
/// surface. The caller still looks at volume, components and what is uncovered.
/// \param thin triangles to be thickened from the start
FilledPiece fillWithStuffing(const SolidPiece& piece, std::uint32_t target_vertices,
                             const std::vector<std::uint32_t>& thin, const geometry::ParallelFor& parallel_for);

/// Triangles within reach of vertices that alone, by no face, hold parts of the tetrahedra together: a joint there
/// would turn without strain, where the solid between them was too thin for the lattice. Ascending.
std::vector<std::uint32_t> trianglesAtJoints(const SolidPiece& piece, const geometry::TetMesh& mesh, double reach);

/// Sets components, volume and uncovered.
void measureFill(const SolidPiece& piece, FilledPiece& filled, const geometry::ParallelFor& parallel_for);

/// Fraction of each tetrahedron inside the solid, from 10 points each where the surface passes, at least 0.02, so that
/// no vertex is without mass; then scaled so that volume times fill adds up to the piece's volume. So a cage that cuts
/// corners has fills a little above 1. For pieces that enclose something.
/// \param known what splitAtGaps says of tetrahedra that have copies, negative for the others; may be empty.
std::vector<double> fillFractions(const SolidPiece& piece, const geometry::TetMesh& mesh, std::span<const double> known,
                                  const geometry::ParallelFor& parallel_for);

}  // namespace sinew::tools

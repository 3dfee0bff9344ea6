// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tools/core/finding.h"
#include "tools/core/progress.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

enum class TetrahedraMethod { automatic, grid, stuffing, delaunay, shell };

struct TetrahedraOptions {
  TetrahedraMethod method = TetrahedraMethod::automatic;
  std::uint32_t target_vertices = 1500;  ///< physical vertices over all pieces; the result is within about 30 %
  double join_distance = 1e-3;           ///< parts closer than this share a piece; of the diagonal
  double shell_thickness = 0;            ///< of a shell, metres; 0 = half of the mean edge of its coarse surface
  /// Factors on that, per welded point, > 0; empty: 1 everywhere.
  std::vector<double> shell_factors;
};

/// One separate piece of the source.
struct PhysicalPiece {
  std::string name;                                  ///< from its largest part's sub-mesh
  TetrahedraMethod method = TetrahedraMethod::grid;  ///< what was used
  std::vector<std::uint32_t> parts;                  ///< surface parts that belong to it (loose sheets included)
  std::uint32_t first_vertex = 0, vertex_count = 0;
  std::uint32_t first_tetrahedron = 0, tetrahedron_count = 0;
  double volume = 0;  ///< of the space its tetrahedra take, m^3: copies of one cell count once
  double source_volume =
      -1;  ///< enclosed by its surface (winding number > 1/2), m^3; negative where it encloses nothing
  std::uint32_t tie_count = 0;  ///< its last tetrahedra, which only hold parts of a shell together: nothing hangs there
};

/// Tetrahedra over the angle between two faces, degrees.
struct TetrahedraQuality {
  double min_dihedral_deg = 0, max_dihedral_deg = 0;
  std::uint32_t inverted = 0;
};

/// The coarse mesh that is simulated. Vertices, tetrahedra grouped by piece. Every tetrahedron has positive volume.
/// Where near but separate parts of a piece pass through one cell of its lattice (lips, fingers), the cell has a copy
/// for each: these tetrahedra lie over one another. Behind a piece's vertices and tetrahedra may be those of its
/// accessories (bake/parts.h), which its counts leave out.
struct PhysicalMesh {
  std::vector<Eigen::Vector3d> positions;  ///< metres, world
  std::vector<std::array<std::uint32_t, 4>> tetrahedra;
  /// Per tetrahedron: fraction that lies in the solid, > 0, scaled a little so that volume times fill adds up to a
  /// piece's source_volume (so it can exceed 1 where the tetrahedra cut corners). 1 where the piece encloses nothing.
  std::vector<double> fill;
  std::vector<PhysicalPiece> pieces;
  TetrahedraQuality quality;
  std::vector<std::uint32_t> part_piece;  ///< piece of each surface part (loose sheets: the nearest piece)
  /// Per welded point: the tetrahedron it lies in, of several copies in one place the one on its own side of the gap;
  /// outside all of them the nearest that one of its own triangles passes through. formats::kNone where there is none,
  /// for points of loose sheets and of pieces filled by delaunay. May be empty: nothing is known.
  std::vector<std::uint32_t> home;
  std::vector<Finding> findings;  ///< method chosen and why, volume ratio, fattened thin parts, sheets attached, ...

  /// The piece of a tetrahedron.
  std::size_t pieceOf(std::uint32_t tetrahedron) const {
    const auto behind = [](std::uint32_t t, const PhysicalPiece& piece) { return t < piece.first_tetrahedron; };
    return std::size_t(std::upper_bound(pieces.begin(), pieces.end(), tetrahedron, behind) - pieces.begin()) - 1;
  }
};

/// Fills a visual mesh with tetrahedra. Throws ToolError(bad_input) where the asked method cannot serve this mesh.
/// Deterministic for any number of threads.
PhysicalMesh tetrahedralize(const VisualMesh& mesh, const Topology& topology, const TetrahedraOptions& options,
                            Progress& progress);

/// Recomputes angles and counts inverted tetrahedra.
TetrahedraQuality measureQuality(const std::vector<Eigen::Vector3d>& positions,
                                 const std::vector<std::array<std::uint32_t, 4>>& tetrahedra);

}  // namespace sinew::tools

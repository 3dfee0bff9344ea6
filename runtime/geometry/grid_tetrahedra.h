// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

#include "runtime/geometry/parallel.h"
#include "runtime/geometry/tet_mesh.h"
#include "runtime/geometry/winding_number.h"

namespace sinew::geometry {

/// A block of equal boxes and which of them are filled.
struct CellGrid {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();   ///< corner of box (0, 0, 0), metres
  Eigen::Vector3d spacing = Eigen::Vector3d::Ones();  ///< size of a box, metres
  std::array<int, 3> size = {0, 0, 0};                ///< boxes along x, y, z
  std::vector<char> kept;                             ///< x fastest

  std::size_t index(int x, int y, int z) const {
    return (std::size_t(z) * std::size_t(size[1]) + std::size_t(y)) * std::size_t(size[0]) + std::size_t(x);
  }
  Eigen::AlignedBox3d box(int x, int y, int z) const {
    const Eigen::Vector3d low = origin + spacing.cwiseProduct(Eigen::Vector3d(x, y, z));
    return {low, low + spacing};
  }
};

/// Smallest dihedral angle, degrees, of the five tetrahedra of a box.
double boxDihedral(const Eigen::Vector3d& size);

/// Divides `bounds` into whole boxes of about `spacing` along each axis, all tetrahedra of at least `min_dihedral_deg`
/// (at most 45). An axis thinner than the angle allows is widened evenly to both sides: then origin lies below the
/// bounds. \return a grid with no box kept.
CellGrid fitGrid(const Eigen::AlignedBox3d& bounds, double spacing, double min_dihedral_deg);

/// Keeps the boxes that the surface enters (by more than 1e-3 of the box) or whose centre is inside the solid, and one
/// on a side that the surface runs in where neither of the two is kept.
/// \param solid also decides the inside; may be empty: then only `surface` counts.
void keepTouchedCells(CellGrid& grid, const TriangleBvh& surface, const WindingNumber* solid,
                      const ParallelFor& parallel_for = serialFor);

/// Joins kept boxes that fall apart (over faces, edges and corners) by the shortest chains of further boxes.
/// \return boxes added.
std::size_t bridgeCells(CellGrid& grid);

/// Five tetrahedra a kept box: one over the four corners with an even sum of grid coordinates, four around it. So
/// neighbours share diagonals (Dompierre et al. 1999 discuss such schemes), whichever boxes are kept.
TetMesh gridTetrahedra(const CellGrid& grid);

}  // namespace sinew::geometry

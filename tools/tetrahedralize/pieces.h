// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "runtime/geometry/parallel.h"
#include "runtime/geometry/winding_number.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A piece of the source before it has tetrahedra. Coordinates are relative to `center`, so that a piece far
/// from the origin loses no digits.
struct SolidPiece {
  std::string name;
  std::string title;                                 ///< for messages: the name, numbered where several share it
  std::vector<std::uint32_t> parts;                  ///< of the surface, ascending, loose sheets included
  std::vector<std::uint32_t> sheets;                 ///< `parts` that enclose nothing
  bool encloses = false;                             ///< false: all its parts are sheets
  bool balanced = false;                             ///< its surface has no open edge: winding numbers are whole
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< metres, world
  Eigen::AlignedBox3d bounds;                        ///< of its solid parts (else of its sheets), relative to center
  std::vector<Eigen::Vector3d> positions;            ///< relative to center
  std::vector<std::uint32_t> points;                 ///< welded point of each position
  std::vector<geometry::Triangle>
      triangles;                    ///< of its solid parts, outward; of its sheets where it is only these; no crowds
  geometry::WindingNumber winding;  ///< over these
  bool crowded = false;             ///< withoutCrowds() merged points
  double area = 0;                  ///< m^2
  double volume = -1;               ///< enclosed (winding number > 1/2), m^3; negative where it encloses nothing
  bool volume_exact = false;        ///< by the divergence theorem; else sampled
};

/// Message and cure of check and bake for a source without pieces.
inline constexpr const char* kNoArea = "no triangle has an area, so there is nothing to fill";
inline constexpr const char* kNoAreaCure = "Export a mesh with faces that have an area.";

struct PieceSet {
  std::vector<SolidPiece> pieces;
  std::vector<std::uint32_t> part_piece;
  std::vector<std::uint32_t> attached_solids;  ///< parts of small solids that move with a much larger neighbour
  std::vector<std::uint32_t> attached_sheets;  ///< parts that joined the nearest piece though they do not touch it
  std::vector<std::uint32_t> turned_parts;     ///< open parts around a solid, taken as if they faced the other way
};

/// Groups surface parts into pieces. Parts within `join_distance` metres (or piercing) are one; a part inside the solid
/// of another belongs to it, and turned inwards makes a cavity; parts that enclose nothing join the nearest piece, or
/// are pieces themselves where nothing encloses anything.
PieceSet findPieces(const VisualMesh& mesh, const Topology& topology, double join_distance,
                    const geometry::ParallelFor& parallel_for);

/// Of some parts of a surface the one with the largest area.
std::uint32_t largestPart(const Topology& topology, const std::vector<std::uint32_t>& parts);

/// Source's name for the largest of some parts.
std::string pieceName(const VisualMesh& mesh, const Topology& topology, const std::vector<std::uint32_t>& parts);

/// The names, numbered where several are equal.
std::vector<std::string> distinctNames(const std::vector<std::string>& names);

}  // namespace sinew::tools

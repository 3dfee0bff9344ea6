// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A connected part of the welded surface.
struct SurfacePart {
  std::vector<std::uint32_t> triangles;  ///< ascending
  bool closed = false;                   ///< no boundary edge
  bool orientable = true;                ///< neighbours agree on a side
  double area = 0;                       ///< m^2
  double signed_volume = 0;              ///< m^3, divergence theorem about the part's centre; a volume only where closed
};

/// Facts about the welded triangles. Degenerate triangles (repeated welded index or zero area) take no part in edges.
struct Topology {
  std::vector<std::uint32_t> part_of_triangle;  ///< kNoIndex for degenerate ones
  std::vector<SurfacePart> parts;               ///< connected over shared edges of welded points, by first triangle
  std::vector<std::array<std::uint32_t, 2>> boundary_edges;      ///< welded points
  std::vector<std::array<std::uint32_t, 2>> non_manifold_edges;  ///< more than two faces
  std::vector<std::array<std::uint32_t, 2>> flipped_edges;       ///< two faces that run along it in the same direction
  std::vector<std::uint32_t> non_manifold_vertices;              ///< welded points whose faces are no single fan
  std::vector<std::vector<std::uint32_t>> boundary_loops;        ///< welded points in order; one each hole
  std::vector<std::uint32_t> degenerate_triangles;
  std::vector<std::uint32_t> duplicate_triangles;  ///< same three welded points as an earlier one, either way round
  bool closed = false;  ///< every part is
};

Topology analyzeTopology(const VisualMesh& mesh);

/// Pairs of triangles that pierce each other (sharing no point, or crossing beyond what they share), exact predicates.
/// \param limit stop after so many pairs.
/// \param different_parts_only look only at pairs from two parts.
std::vector<std::pair<std::uint32_t, std::uint32_t>> findSelfIntersections(const VisualMesh& mesh, const Topology& topology,
                                                                           std::size_t limit, bool different_parts_only);

}  // namespace sinew::tools

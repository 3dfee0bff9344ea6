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
  std::vector<std::uint32_t> triangles;  ///< ascending; without the duplicates left out
  bool closed = false;                   ///< no boundary edge
  bool manifold = true;                  ///< no edge with more than two faces
  bool orientable = true;                ///< its faces can be turned so that neighbours agree on a side
  double area = 0;                       ///< m^2
  double signed_volume = 0;  ///< m^3, divergence theorem about the part's centre; a volume only where closed
};

/// Facts about the welded triangles. Triangles in edges, parts, fans and loops:
/// - not a triangle with a repeated welded point;
/// - not a triangle of zero area, unless leaving it out would open a hole (the cap of a T-junction);
/// - not a later copy of a face, unless leaving it out would open a hole (the surface runs out and back there).
struct Topology {
  std::vector<std::uint32_t>
      part_of_triangle;            ///< formats::kNone for degenerate ones left out; a copy's is its original's
  std::vector<SurfacePart> parts;  ///< connected over shared edges of welded points, by first triangle
  std::vector<std::array<std::uint32_t, 2>> boundary_edges;      ///< welded points, ascending
  std::vector<std::array<std::uint32_t, 2>> non_manifold_edges;  ///< more than two faces
  std::vector<std::array<std::uint32_t, 2>> flipped_edges;       ///< two faces that run along it in the same direction
  std::vector<std::uint32_t> turned_triangles;  ///< against the larger side (by area) of their neighbours, ascending:
                                                ///< turning these round leaves no flipped edge where that is possible
  /// Welded points where fans of faces meet that share no edge there (a bowtie), ascending. Points of a non-manifold
  /// edge are not among them unless they also join separate fans: the edge is listed itself.
  std::vector<std::uint32_t> non_manifold_vertices;
  /// Welded points of a rim in order, the way its first edge's face runs; one each hole. Rims that touch in a point are
  /// separate. A rim that ends on a non-manifold edge is listed from end to end.
  std::vector<std::vector<std::uint32_t>> boundary_loops;
  std::vector<std::uint32_t> degenerate_triangles;  ///< repeated welded point, or zero area, ascending
  std::vector<std::uint32_t> duplicate_triangles;   ///< of a face (triangle or polygon) with the same welded points as
                                                    ///< an earlier one, either way round, ascending
  bool closed = false;                              ///< there are parts, and every one is
};

/// Cost: about 0.1 s for 400,000 triangles. Never throws but for lack of memory.
Topology analyzeTopology(const VisualMesh& mesh);

/// Pairs of triangles that pierce each other (sharing no point, or crossing beyond what they share), exact predicates.
/// \param limit stop after so many pairs.
/// \param different_parts_only look only at pairs from two parts.
std::vector<std::pair<std::uint32_t, std::uint32_t>> findSelfIntersections(const VisualMesh& mesh,
                                                                           const Topology& topology, std::size_t limit,
                                                                           bool different_parts_only);

}  // namespace sinew::tools

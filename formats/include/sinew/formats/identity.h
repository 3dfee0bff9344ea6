// SPDX-License-Identifier: MIT
//
// Identity of vertices: from an artist's vertex to the drawn and simulated ones, and back, by number.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "sinew/formats/package.h"

namespace sinew::formats {

/// The list that a vertex number counts in.
enum class VertexKind : std::uint8_t {
  source,   ///< as in the artist's file, over its meshes in SMSH's order
  visual,   ///< as drawn: VPOS
  welded,   ///< points: visual vertices of one position
  physical  ///< as simulated: PVTX
};

/// Visual vertices of a vertex, ascending. Of a source vertex or welded point: all that it became. Of a visual vertex:
/// itself. Of a physical vertex: all that hang on a tetrahedron with this corner (none in a package whose visual
/// vertices hang on clusters). \param number from 0, counted as `kind` says. \return nullopt where there is no such
/// vertex; empty for a source vertex that no face uses. A package without section VSRC has no source and no welded
/// vertices. Cost: source and visual vertices one lookup, the others one pass over the visual vertices.
std::optional<std::vector<std::uint32_t>> visualVerticesOf(const PackageView& package, VertexKind kind,
                                                           std::uint32_t number);

/// A source vertex as the artist counts it.
struct SourcePlace {
  std::string_view mesh;     ///< name in the source; lives as long as the package's bytes
  std::uint32_t vertex = 0;  ///< from 0 within that mesh
};

/// \return nullopt where there is no such source vertex.
std::optional<SourcePlace> sourcePlace(const PackageView& package, std::uint32_t source_vertex);

/// The tetrahedron that a visual vertex hangs on.
struct TetrahedronHold {
  std::uint32_t tetrahedron = 0;               ///< into TETS
  std::array<std::uint32_t, 4> physical = {};  ///< its corners
  std::array<float, 4> weight = {0, 0, 0, 0};  ///< sum to 1; outside 0..1 where the vertex lies outside
};

/// \return nullopt where the package's visual vertices hang on clusters (ATCR, ATCW), or there is no such vertex.
std::optional<TetrahedronHold> tetrahedronOf(const PackageView& package, std::uint32_t visual_vertex);

/// The weight of a visual vertex in a mask, 0 where it has none there. \param mask into MASK, below its size.
float maskWeight(const PackageView& package, std::uint32_t mask, std::uint32_t visual_vertex);

}  // namespace sinew::formats

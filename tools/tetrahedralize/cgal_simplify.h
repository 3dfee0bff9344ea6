// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tools/tetrahedralize/cgal_wrap.h"

namespace sinew::tools {

/// A surface of fewer triangles.
struct SimplifiedSurface {
  PlainSurface surface;
  std::vector<std::uint32_t> vertex_of;  ///< of each position given: the vertex it was merged into
};

/// Collapses the shortest edges of a surface, one after another, until about `vertices` are left (CGAL
/// Surface_mesh_simplification): triangles of even size. Corners of borders and vertices of creases of more than 30
/// degrees stay where they are, and borders stay borders. The result can have more where no further edge may go.
/// Deterministic.
/// \param surface manifold, neighbours turned the same way, every position used.
/// \param vertices at least 4.
/// \param keep per position: nonzero where no edge may be collapsed; empty: nowhere.
/// \param reason receives why the result is empty, if it is. Never throws but for lack of memory.
SimplifiedSurface simplifySurface(const PlainSurface& surface, std::uint32_t vertices, std::span<const char> keep,
                                  std::string& reason);

}  // namespace sinew::tools

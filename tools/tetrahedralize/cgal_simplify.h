// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/tetrahedralize/cgal_wrap.h"

namespace sinew::tools {

/// A surface of fewer triangles.
struct SimplifiedSurface {
  PlainSurface surface;
  std::vector<std::uint32_t> vertex_of;  ///< of each position given: the vertex it was merged into
};

/// Collapses edges of an open or closed surface until about `vertices` are left, keeping the shape of its borders and
/// its volume to first order (Lindstrom & Turk 1998, 1999; CGAL Surface_mesh_simplification). The result can have more
/// where no further edge may go. Deterministic.
/// \param surface manifold, neighbours turned the same way, every position used.
/// \param vertices at least 4.
/// \param reason receives why the result is empty, if it is. Never throws but for lack of memory.
SimplifiedSurface simplifySurface(const PlainSurface& surface, std::uint32_t vertices, std::string& reason);

}  // namespace sinew::tools

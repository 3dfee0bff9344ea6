// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Triangles that orientFaces turned, as flags.
struct Turned {
  std::vector<std::uint8_t> triangle;
  bool any = false;
};

/// Makes neighbouring faces agree and closed parts face outward, and records findings ("flipped-faces",
/// "inside-out-part", "cavity"). Parts are sets of faces connected over edges of exactly two faces.
/// - Within an orientable part the faces of the smaller area turn. One-sided parts (Moebius strips) stay.
/// - A closed part of negative volume turns, unless it lies within another closed part that faces outward: then it is
///   the wall of a cavity. A part within one that turns, turns with it.
/// - Open parts have no outside; they stay as the majority of their faces has them.
Turned orientFaces(VisualMesh& mesh);

}  // namespace sinew::tools

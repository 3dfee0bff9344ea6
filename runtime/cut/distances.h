// SPDX-License-Identifier: MIT
//
// Distance grids (sections DIST, DVAL) of parts.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/cut/sides.h"
#include "sinew/formats/writer.h"

namespace sinew::cutting {

struct Cut;
struct PartPiece;

/// Of each node of a grid, the tetrahedron of its piece that has it, or of those beside it where none does.
std::vector<std::uint32_t> nodeTetrahedra(const formats::PackageView& package, const Sides& sides,
                                          const formats::DistanceGrid& grid);

/// Appends grids of the part's pieces where the package has them: distance to what is solid on both the whole and the
/// part's side of the section, the larger of the two. Exact near each of these surfaces; beside their common edge the
/// places outside count as nearer than they are.
void addDistances(const Cut& cut, std::uint32_t part, const std::vector<PartPiece>& pieces,
                  formats::PackageContent& content);

}  // namespace sinew::cutting

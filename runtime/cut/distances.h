// SPDX-License-Identifier: MIT
//
// Distance grids (sections DIST, DVAL) of parts.
#pragma once

#include <vector>

#include "runtime/cut/content.h"
#include "runtime/cut/fields.h"

namespace sinew::cutting {

/// Appends grids of the part's pieces where the package has them: distance to what is solid on both the whole and the
/// part's side of the section, the larger of the two. Exact near each of these surfaces; beside their common edge the
/// places outside count as nearer than they are.
void addDistances(const Cut& cut, std::uint32_t part, const std::vector<PartPiece>& pieces,
                  formats::PackageContent& content);

}  // namespace sinew::cutting

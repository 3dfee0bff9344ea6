// SPDX-License-Identifier: MIT
//
// The clusters of a part.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/cut/content.h"
#include "runtime/cut/fields.h"

namespace sinew::cutting {

/// Appends pieces and clusters, with curves and channels: those of the package that the part has members of, constants
/// made anew where it was cut. \param local of the package's vertices: the part's, kNone where it has none.
/// \return of the package's clusters: the part's, kNone where it has none.
std::vector<std::uint32_t> addClusters(const Cut& cut, const PartMesh& mesh, const std::vector<PartPiece>& pieces,
                                       const std::vector<std::uint32_t>& local, formats::PackageContent& content);

}  // namespace sinew::cutting

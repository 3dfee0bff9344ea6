// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "sinew/formats/package.h"
#include "tools/core/finding.h"
#include "tools/import/import.h"

namespace sinew::tools {

/// The doctor for a package that PackageView::open() accepted: recomputes, in double and from the package alone, what
/// the format's own checks take on trust. Tetrahedra that are inverted or flat, the rest error of both kinds of
/// attachment (error above 1e-6 of the diagonal), masses and moments of clusters, clusters that are too small, flat, in
/// several pieces or there twice, mass ratios, pictures. (That shares and weights sum to 1 and that every vertex has a
/// cluster and every visual vertex an attachment, open() has checked.) Places are source vertices where the package has
/// the identity maps. Cost: about 20 ms for 10,000 tetrahedra and 30,000 visual vertices.
std::vector<Finding> checkPackage(const formats::PackageView& package);

/// Which pictures of a package cannot be drawn. Unpacks them in children, as import does.
/// \param options bounds and program of the children
std::vector<Finding> checkPictures(const formats::PackageView& package, const ImportOptions& options);

/// One line: "sound: it can be simulated".
std::string packageVerdict(const std::vector<Finding>& findings);

}  // namespace sinew::tools

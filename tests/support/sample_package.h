// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

#include "sinew/formats/writer.h"

namespace sinew::test {

/// A small package with every section of the format but those of mechanics: two tetrahedra that share a face (unit
/// corner and its mirror, 5 physical vertices, 6 kg), a linear cluster "lower" over the first four vertices and a
/// quadratic one "whole" over all, a closed visual mesh of 6 vertices (one source vertex split at a UV seam) attached
/// both ways, two source meshes with an unused vertex each, groups (one empty), a material with a picture. Made with +
/// - * / and square roots only, so its bytes are the same everywhere.
[[nodiscard]] formats::PackageContent samplePackage();

/// The same with CMEC, CURV, CHAN, PSTF and PPIN: a plastic, elastic cluster with a fibre, and one with a curve.
[[nodiscard]] formats::PackageContent mechanicsPackage();

/// samplePackage() with two pin sets, one of them empty, and both fields of its body: the free one of the four linear
/// functions, the held one of the four that the second pin set drives and one more; two samples (the tetrahedra, the
/// first one under the laws of "lower") and nine contact points (the vertices, and midpoints of edges). Both clusters
/// have an activated fibre; that of "whole" has a record in the free field only. Tethers tie the last two vertices of
/// the held field to its pin set, by 40 and 90 N/m.
[[nodiscard]] formats::PackageContent fieldPackage();
/// The same with a residual of two modes.
[[nodiscard]] formats::PackageContent residualPackage();

/// So many copies of a content's bodies in one package, in one place: of samplePackage() or fieldPackage().
[[nodiscard]] formats::PackageContent repeated(formats::PackageContent content, std::size_t copies);

}  // namespace sinew::test

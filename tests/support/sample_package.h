// SPDX-License-Identifier: MIT
#pragma once

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

}  // namespace sinew::test

// SPDX-License-Identifier: MIT
#pragma once

#include "reach.h"
#include "refusal.h"
#include "sinew/formats/package.h"

namespace sinew::formats {

// The format's rules for the values in a package's sections (docs/package-format.md), beyond the header, the section
// table and section INFO, which have been checked. In this order: each relies on those before it. False where `refuse`
// has the reason.

/// Physics, BODY to PSTV.
[[nodiscard]] bool checkPhysical(const PackageView& view, const Reach& reach, Refusal& refuse);
/// The visual mesh and its attachment, PART to MSKV.
[[nodiscard]] bool checkVisual(const PackageView& view, const Reach& reach, Refusal& refuse);
/// The sections of fields, FELD to DVAL; one pass over each.
[[nodiscard]] bool checkFields(const PackageView& view, const Reach& reach, Refusal& refuse);

}  // namespace sinew::formats

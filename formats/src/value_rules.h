// SPDX-License-Identifier: MIT
#pragma once

#include "reach.h"
#include "refusal.h"
#include "sinew/formats/package.h"

namespace sinew::formats {

// What the format says of the values in a package's sections (docs/package-format.md), beyond the header, the section
// table and section INFO, which have been checked. In this order: each relies on those before it. False where `refuse`
// has the reason.

/// What moves, BODY to PSTV.
[[nodiscard]] bool checkPhysical(const PackageView& view, const Reach& reach, Refusal& refuse);
/// What is drawn and how it hangs on what moves, PART to MSKV.
[[nodiscard]] bool checkVisual(const PackageView& view, const Reach& reach, Refusal& refuse);
/// The sections of fields, FELD to DVAL; one pass over each.
[[nodiscard]] bool checkFields(const PackageView& view, const Reach& reach, Refusal& refuse);

}  // namespace sinew::formats

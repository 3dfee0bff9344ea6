// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>

#include "reach.h"
#include "sinew/formats/package.h"

namespace sinew::formats {

/// A rule that the sections of fields break.
struct FieldFault {
  static constexpr std::size_t kWhole = ~std::size_t{0};
  std::uint32_t section = 0;
  std::size_t element = kWhole;  ///< of the section; kWhole: none in particular
  const char* what = nullptr;    ///< null: no fault
};

/// The first fault of the sections of fields, FELD to FFBV (docs/package-format.md); one pass over each.
/// \param view whose other sections, and presence, have been checked.
[[nodiscard]] FieldFault findFieldFault(const PackageView& view, const Reach& reach);

}  // namespace sinew::formats

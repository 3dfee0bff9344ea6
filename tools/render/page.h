// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tools/render/image.h"

namespace sinew::tools {

// Style of all pictures' pages.
inline constexpr Rgb8 kPaper = {250, 250, 251};
inline constexpr Rgb8 kInk = {34, 38, 46};
inline constexpr Rgb8 kGreyInk = {98, 104, 116};
/// Where a single view stands so that the lights fall as they were made to.
inline constexpr float kLitYaw = 0.70F;

}  // namespace sinew::tools

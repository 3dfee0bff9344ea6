// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

namespace sinew::geometry {

/// 3 t² - 2 t³ of t clamped to 0..1: from 0 to 1 with level ends.
template <class Float>
constexpr Float smoothstep(Float t) {
  t = std::clamp(t, Float(0), Float(1));
  return t * t * (3 - 2 * t);
}

}  // namespace sinew::geometry

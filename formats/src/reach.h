// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>

#include "sinew/formats/sections.h"

namespace sinew::formats {

/// Where a package may have places at rest: within one diagonal of the bounds that it states, along each axis.
class Reach {
 public:
  Reach() = default;
  explicit Reach(const PackageInfo& info) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low_[axis] = info.bounds_min[axis] - info.diagonal;
      high_[axis] = info.bounds_max[axis] + info.diagonal;
    }
  }
  /// Nonzero of a place beyond it, and of NaN. Branch-free, so that loops over it vectorize.
  unsigned beyond(const std::array<float, 3>& place) const {
    return beyond(place[0], 0) | beyond(place[1], 1) | beyond(place[2], 2);
  }
  /// The same of one coordinate.
  unsigned beyond(float value, std::size_t axis) const {
    return unsigned(!(value >= low_[axis])) | unsigned(!(value <= high_[axis]));
  }

 private:
  std::array<float, 3> low_ = {}, high_ = {};
};

}  // namespace sinew::formats

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "sinew/runtime/asset.h"
#include "sinew/runtime/settings.h"

namespace sinew::tools {

/// A state that every phase has to work for: turned, bent, twisted by a few percent, spinning and swinging.
struct MovingState {
  std::vector<Vec3> positions;   ///< metres
  std::vector<Vec3> velocities;  ///< m/s
};
MovingState movingState(const Asset& asset);

}  // namespace sinew::tools

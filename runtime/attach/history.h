// SPDX-License-Identifier: MIT
#pragma once

#include <memory_resource>
#include <vector>

#include "runtime/kernels/attach_layout.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// Where a body was before the last step, for motion vectors; empty unless BodySettings::keep_previous.
struct History {
  explicit History(std::pmr::memory_resource* memory) : positions(memory), columns(memory) {}

  std::pmr::vector<Vec3> positions;          ///< by physical vertex, metres
  std::pmr::vector<ClusterColumns> columns;  ///< by cluster; only where the visual mesh hangs on clusters
};

}  // namespace sinew::internal

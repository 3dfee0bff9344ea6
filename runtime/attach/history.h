// SPDX-License-Identifier: MIT
#pragma once

#include <memory_resource>

#include "runtime/kernels/attach_layout.h"
#include "runtime/memory/array.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// Where a body was before the last step, for motion vectors; empty unless BodySettings::keep_previous.
struct History {
  explicit History(std::pmr::memory_resource* memory) : positions(memory), columns(memory) {}

  Array<Vec3> positions;          ///< by physical vertex, metres
  Array<ClusterColumns> columns;  ///< by cluster; only where the visual mesh hangs on clusters
};

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#pragma once

#include "runtime/world/body.h"

namespace sinew::internal {

/// R and F of the clusters of blocks begin..end from their moments: by the kernel, and where a cluster has more to it
/// than frequencies (docs/method.md §9, §10) by itself.
void matchBlocks(Body& body, std::uint32_t begin, std::uint32_t end, float pass_seconds);

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include "runtime/clusters/frame.h"
#include "runtime/load/rest_constants.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

/// c = Σ mu x and A_pq = Σ mu p q~^T of one cluster (docs/method.md eq. 1, 2). \param y predicted positions, metres.
void accumulateMoments(const formats::PackageView& package, const RestConstants& rest, std::uint32_t cluster,
                       std::span<const Vec3> y, ClusterFrame& frame);

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include "runtime/world/body.h"
#include "sinew/runtime/world.h"

namespace sinew::internal {

/// Position of a visual vertex, metres, world. \param positions of the physical vertices.
Vector3 attachedPosition(const Body& body, std::uint32_t visual_vertex, std::span<const Vec3> positions);

/// Writes positions and unit normals of visual vertices [begin, end) (docs/method.md §7). Either stream may be empty.
/// Normals of barycentric attachments need updateCofactors() since the last change of state.
void writeVisual(const Body& body, std::uint32_t begin, std::uint32_t end, const StridedFloat3& positions,
                 const StridedFloat3& normals);

/// Fills Body::cofactors for physical vertices [begin, end).
void updateCofactors(const Body& body, std::uint32_t begin, std::uint32_t end);

}  // namespace sinew::internal

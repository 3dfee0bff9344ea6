// SPDX-License-Identifier: MIT
#pragma once

#include "runtime/world/body.h"

namespace sinew::internal {

/// Height of a point above the ground plane, metres; negative inside.
inline float heightAbove(const GroundPlane& ground, const Vector3& point) {
  return asVector(ground.normal).dot(point) - ground.offset;
}

/// Where the surface is for a vertex that starts the pass at `height`: the plane itself; for one that starts inside,
/// deeper, so that it comes out at a bounded speed instead of being shot out.
float reachableHeight(float height, float diagonal, float pass_seconds);

/// How far what starts inside may come out in one pass, metres.
float recoveryHeight(float diagonal, float pass_seconds);

/// Appends a row for each vertex that would touch the ground in this pass; drops the remembered force of the others.
void addGroundRows(Body& body, const GroundPlane& ground, float pass_seconds);

}  // namespace sinew::internal

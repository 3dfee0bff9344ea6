// SPDX-License-Identifier: MIT
//
// The cut of a plane that ends: a slit, whose two sides meet where the plane ends.
#pragma once

#include "runtime/cut/section.h"
#include "runtime/cut/surface.h"

namespace sinew::cutting {

/// Clips the visual triangles that the plane meets within its outline; others stay whole. A triangle in which the plane
/// ends is cut from where the outline crosses it: new vertices there are tips. Nothing lies on the plane (Sides).
Surface clipSlit(const formats::PackageView& package, const Sides& sides);

/// Closes the rim along the outline: from each tip at which the surface leaves it, counter-clockwise to the one at
/// which it comes back, by nodes that are tips too. \param spacing of these, m; 0: the mean length of the rim's edges.
void endSlit(Surface& surface, const PlaneFrame& plane, double spacing, const Locate& locate);

}  // namespace sinew::cutting

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Surfaces of colliders, to be drawn.
#pragma once

#include <memory>
#include <vector>

#include "sinew/runtime/collider.h"

namespace sinew::tools {

/// Triangles, counter-clockwise from outside, of which each side has vertices of its own; in the collider's frame.
struct SolidMesh {
  std::vector<Vec3> positions, normals;  ///< m; unit
  std::vector<formats::Triangle> triangles;
  bool one_sided = false;  ///< seen from outside alone
  bool endless = false;    ///< more of it than is drawn
};

/// Of a hull, of up to a hundred points or so. \param reach m, half the side of the square that stands for a plane.
std::shared_ptr<const SolidMesh> meshOf(const ColliderShape& shape, float reach);

/// A wall of a box that is open at its top: its inner side, which is seen from inside alone, and its rim. \param
/// half_size of the wall. \param axis, sign where its inner side faces.
std::shared_ptr<const SolidMesh> wallOf(const Vec3& half_size, std::size_t axis, float sign);

/// A level plate that presses with its upper (sign 1) or lower side (-1): that side and its edges, so that what is
/// between two of them is seen from above. \param half_size of the plate.
std::shared_ptr<const SolidMesh> plateOf(const Vec3& half_size, float sign);

}  // namespace sinew::tools

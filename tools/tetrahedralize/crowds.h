// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "runtime/geometry/tet_mesh.h"

namespace sinew::tools {

/// Faces around a point from which on it is a crowd: the hub of a finely cut disc or cone.
inline constexpr std::uint32_t kCrowd = 500;

/// A surface without crowds. No tree of boxes parts a fan of slivers: each of them is as long as all of the fan, and
/// whoever asks for one meets thousands. Points on the rim of a crowd are merged along its edges, within 1 / kCrowd of
/// the rim's length, so about kCrowd to 2 kCrowd faces stay around each hub. Merging points maps boundaries to
/// boundaries: what was closed stays closed, what was apart and shares no short edge of a rim stays apart.
/// \param triangles over `positions`. \return the same where there is no crowd; else all that still have three
/// corners, in their order. Deterministic.
std::vector<geometry::Triangle> withoutCrowds(std::span<const Eigen::Vector3d> positions,
                                              std::vector<geometry::Triangle> triangles);

}  // namespace sinew::tools

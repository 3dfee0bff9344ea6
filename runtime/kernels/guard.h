// SPDX-License-Identifier: MIT
//
// What no goal of a cluster may exceed, whatever its settings (docs/method.md eq. 10).
#pragma once

namespace sinew::internal {

/// Least and largest stretch a cluster's goal may have along any direction. Not authored limits but a guard: what is
/// squashed or mirrored past it comes back on the right side.
inline constexpr float kLeastStretch = 0.1F;
inline constexpr float kLargestStretch = 3.0F;
/// A stiff cluster is brought this factor inside them, so that tangled neighbours cannot hold each other there. In the
/// short passes of a soft one such a jump would be a speed.
inline constexpr float kStiffGuardMargin = 1.05F;

/// Squares and products of a cluster that is stopped are cut in proportion to its linear block, and beyond kMostSquares
/// to kSquaresKept of themselves: cut at once they fling the neighbours.
inline constexpr float kMostSquares = kLargestStretch, kSquaresKept = 0.95F;

/// A cluster further from its volume than by this part of it is pushed no harder (docs/method.md eq. 18).
inline constexpr float kVolumeYield = 0.3F;

/// A_pq of more than this part of what the largest stretches make of its norm at rest: the cluster is torn apart. What
/// the guard has let through, stretched by 3 along every axis, is not.
inline constexpr float kTorn = 1.1F;

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// How contacts give way, alike for colliders and for other pieces (docs/method.md §4).
#pragma once

#include <algorithm>
#include <cmath>

namespace sinew::internal {

/// Points so close to a surface at the prediction are looked at: the minimization may press them in. Diagonals.
inline constexpr double kMargin = 2e-3;
/// Speed at which what starts inside comes out, diagonals per second.
inline constexpr double kRecoverySpeed = 0.25;
/// Depths in kappa = weight / (kFew depth), which bound a point's own E sqrt(area). Where a piece is too soft to carry
/// its weight, diagonals:
inline constexpr double kSinking = 2e-3;
/// And at least, where it is stiff: a hundred times what floats resolve of a place. Diagonals.
inline constexpr double kResolved = 2e-5;
/// Points that are taken to share the weight there; more press in less.
inline constexpr double kFew = 8;
/// Depth that springs let points in: what comes in is stopped there, what is drawn is lifted out of it, and what lies
/// deeper has not been pressed there. Diagonals.
inline constexpr double kPressedIn = 0.02;
/// What counts as gravity at least, diagonals per second squared.
inline constexpr double kLeastGravity = 1;

/// kappa of a contact point, N/m. \param young of its piece, Pa. \param area of the surface that it stands for, m^2.
/// \param weight of its piece, N. \param diagonal m.
inline double pointFirmness(double young, double area, double weight, double diagonal) {
  const double shared = weight / (kFew * diagonal);
  return std::clamp(young * std::sqrt(area), shared / kSinking, shared / kResolved);
}

}  // namespace sinew::internal

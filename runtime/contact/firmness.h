// SPDX-License-Identifier: MIT
//
// Firmness and margins of contacts with colliders and with other pieces (docs/method.md §4).
#pragma once

#include <algorithm>
#include <cmath>

namespace sinew::internal {

/// Distance from a surface within which a point is a contact: minimizing may press it in. Diagonals.
inline constexpr double kMargin = 2e-3;
/// Speed at which points that start inside come out, diagonals per second.
inline constexpr double kRecoverySpeed = 0.25;
/// Largest depth in kappa = weight / (kFew depth), the lower bound of E sqrt(area): for pieces too soft to carry their
/// weight. Diagonals.
inline constexpr double kSinking = 2e-3;
/// Least depth, the upper bound: a hundred times the resolution of a place in floats. Diagonals.
inline constexpr double kResolved = 2e-5;
/// Points that are assumed to share the weight; more of them press in less.
inline constexpr double kFew = 8;
/// Depth that springs let points in: arrivals are stopped there, and the drawn surface is lifted out of it, beyond what
/// contact points are pressed in; vertices that lie deeper have not been pressed there. Diagonals.
inline constexpr double kPressedIn = 0.02;
/// Least gravity in these bounds, diagonals per second squared.
inline constexpr double kLeastGravity = 1;

/// Times E sqrt(area) where a piece meets what stands, or moves as it is told. Points that are pressed alike give way
/// as a layer of sqrt(area) / kFirmer, on both sides of what is squeezed: 2 sqrt(area) / (kFirmer L) of the give of a
/// piece L thick, 2.5 % where it is ten points thick. What gives way itself (bodies, an engine's) is solved for in
/// turns, and stays.
inline constexpr double kFirmer = 8;

/// kappa of a contact point, N/m. \param young of its piece, Pa. \param area of the surface that it stands for, m^2.
/// \param weight of its piece, N. \param diagonal m. \param firmer kFirmer or 1.
inline double pointFirmness(double young, double area, double weight, double diagonal, double firmer) {
  const double shared = weight / (kFew * diagonal);
  return std::clamp(firmer * young * std::sqrt(area), shared / kSinking, shared / kResolved);
}

/// Dashpot beside the spring of a contact point, N s/m. \param ratio to that in which the mass on kFew of them comes to
/// rest without swinging.
inline double pointDamping(double kappa, double mass, double ratio) {
  return 2 * ratio * std::sqrt(kappa * mass / kFew);
}

}  // namespace sinew::internal

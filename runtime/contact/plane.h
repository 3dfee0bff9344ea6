// SPDX-License-Identifier: MIT
//
// Contacts of a piece with a plane: which of its contact points a step has to look at.
#pragma once

#include "runtime/solver/minimize.h"
#include "runtime/solver/piece.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// Contact points that one piece keeps at most; of more that touch, the first in the package's order, which spreads
/// them over the surface, carry for all.
inline constexpr std::uint32_t kMostContacts = 96;

/// What a step asks of a plane.
struct PlaneStep {
  const GroundPlane* plane;
  double h;         ///< s
  double diagonal;  ///< of the package, m
  double weight;    ///< of the piece: its mass times gravity, N
  float stiffness;  ///< factor on the moduli
};

/// Fills scratch.contacts and scratch.rows. \param y predicted coefficients. \param center what scratch.base is
/// relative to. \param lent scratch of two floats a contact point, rounded up to eight.
void findContacts(const Piece& piece, const PlaneStep& step, const ConstCoefficientMap& y, const Vector3d& center,
                  std::span<float> lent, MinimizeScratch& scratch);

/// What touches at offset scratch.d becomes PieceState::touching.
void rememberContacts(Piece& piece, const PlaneStep& step, const ConstCoefficientMap& y, const Vector3d& center,
                      const MinimizeScratch& scratch);

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// Pins and picks of a piece as springs between points of its field and targets. Permanent holds are the field's own
// (its driven functions).
#pragma once

#include "runtime/solver/holds.h"
#include "runtime/solver/minimize.h"
#include "runtime/solver/piece.h"
#include "runtime/world/body.h"

namespace sinew::internal {

/// A step as its springs see it.
struct SpringStep {
  double h;         ///< s
  double weight;    ///< of the piece: its mass times gravity, N
  float stiffness;  ///< factor on the moduli
  Matrix3d turned;  ///< the frame of the piece when the step begins
  Vector3d moved;   ///< and where its rest shape's origin is then: a rigid motion, m
  Matrix3d frame;   ///< of the objective
  Vector3d center;  ///< a place near the piece: functions add up to 1 to the digits of floats only
};

/// Whether a spring acts on the piece.
bool hasSprings(const Body& body, const Piece& piece);

/// Pull of a field's tethers on its first functions, N: one for each of `pull`, at most k.
void tetherPull(const Field& field, const SpringStep& step, const ConstCoefficientMap& z, std::span<Vector3d> pull);

/// Makes piece.springs where pins or picks have changed, and scratch.springs and scratch.residual for this step: the
/// pull at the predicted coefficients, in the frame of the piece. \param y predicted. \pre prepareHolds()
void prepareSprings(const Body& body, Piece& piece, const SpringStep& step, const ConstCoefficientMap& y,
                    MinimizeScratch& scratch);

/// Adds what the springs and driven functions do to the owners of pin sets. \param z coefficients at the end of the
/// step. \param pull of the driven functions: the gradient of elasticity and inertia, k rows; empty without them.
void addReactions(Body& body, Piece& piece, const SpringStep& step, std::span<const Vector3d> pull);

}  // namespace sinew::internal

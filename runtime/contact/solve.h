// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

#include "runtime/world/body.h"

namespace sinew::internal {

/// How a pass solves rows.
struct RowSolverSettings {
  std::uint32_t rounds = 2;  ///< times the clusters are matched again to the impulses found
  /// The same where vertices are held, for the same reason as kRememberedHold.
  std::uint32_t held_rounds = 4;
  std::uint32_t sweeps = 6;  ///< projected Gauss-Seidel sweeps in each round, at most
  float tolerance = 1e-6F;   ///< a sweep that moves no point further than this (diagonals) is the last of its round
};

/// How many terms the rows of a body can have at most: every vertex and every pick in a row.
std::size_t mostTerms(const Body& body);

/// Moves a part whose rows are more than a quarter of a diagonal off (a fall at 10,000 g, a pin that was set elsewhere)
/// as a whole: turns and deformations of the match answer only what is near. Call between moments and warmStartRows.
void bringNear(Body& body, float pass_seconds);

/// Adds the rows' remembered impulses to the clusters' moments. Call between moments and match.
void warmStartRows(Body& body);

/// What a row's point remembers of its impulse for the next pass, as a force over the body's mass.
Vec3& rememberedForce(Body& body, const Row& row);

/// Finds the impulses with which the goals of the clusters satisfy the rows, adds them to the moments and matches
/// again; leaves the forces in Body::force and Pick::force for the next pass. Needs matched clusters.
void solveRows(Body& body, float pass_seconds, const RowSolverSettings& settings);

}  // namespace sinew::internal

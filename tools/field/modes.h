// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "tools/field/elastic.h"
#include "tools/field/solver.h"

namespace sinew::tools::field {

/// Modes of H x = lambda M x, M-orthonormal, ascending; those with lambda near 0 (motions without resistance) included.
struct Modes {
  MatrixXd vectors;  ///< 3f x m, 1/sqrt(kg)
  VectorXd lambda;   ///< m, 1/s^2
};

/// The lowest modes that are orthogonal to some motions, by a block Krylov space of (H + shift M)^-1 M (Golub and
/// Underwood 1977) and one Rayleigh-Ritz step: blocks find what symmetry makes several times.
/// @param without 3f x r, M-orthonormal and invariant: rigid motions; may have no columns
/// @param count at most so many
Modes lowestModes(const Elastic& elastic, const Solver& solver, const std::vector<bool>& fixed, const MatrixXd& without,
                  Index count);

/// Rigid motions on nodes, M-orthonormal: 6 columns, less for points on a line.
MatrixXd rigidMotions(const Elastic& elastic);

/// Columns that span the same, M-orthonormal and orthogonal to `have` (which is M-orthonormal), of largest share
/// first, at most count. Columns whose share is less than 1e-6 of the largest are left out.
MatrixXd leading(const MatrixXd& columns, const VectorXd& mass, const MatrixXd& have, Index count);

/// Columns made M-orthonormal in their order: the first j of them span what they did.
MatrixXd inOrder(const MatrixXd& columns, const VectorXd& mass);

}  // namespace sinew::tools::field

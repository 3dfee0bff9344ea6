// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/SparseCholesky>
#include <vector>

#include "tools/field/elastic.h"

namespace sinew::tools::field {

/// Answers of the piece to forces, with some nodes fixed: (H + shift M)^-1 on the others.
class Solver {
 public:
  /// @param fixed f: nodes that do not move
  /// @param shift 1/s^2, > 0 where nothing holds the piece
  Solver(const Elastic& elastic, const std::vector<bool>& fixed, double shift);

  /// @param forces 3f x c, N @return 3f x c, metres; 0 at fixed nodes
  MatrixXd solve(const MatrixXd& forces) const;

 private:
  std::vector<Index> row_;  // of the permuted system: its unknown
  Index full_ = 0;
  Eigen::SimplicialLDLT<Sparse, Eigen::Lower, Eigen::NaturalOrdering<int>> factor_;
};

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

/// Repeats each entry for x, y, z.
VectorXd byAxis(const VectorXd& on_nodes);

/// Columns that span the same, M-orthonormal and orthogonal to `have` (which is M-orthonormal), those that carry most
/// first, at most count. Columns whose share is less than 1e-6 of the largest are left out.
MatrixXd leading(const MatrixXd& columns, const VectorXd& mass, const MatrixXd& have, Index count);

}  // namespace sinew::tools::field

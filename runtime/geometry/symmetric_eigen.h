// SPDX-License-Identifier: MIT
//
// Eigen's solver of symmetric matrices, compiled once: its templates take the compiler ten seconds for each file and
// size.
#pragma once

#include <Eigen/Core>

namespace sinew::geometry {

/// matrix = vectors diag(values) vectors^T.
struct SymmetricEigen {
  Eigen::VectorXd values;   ///< ascending
  Eigen::MatrixXd vectors;  ///< columns, orthonormal
};

/// \param matrix n x n; its lower triangle is read.
SymmetricEigen symmetricEigen(const Eigen::MatrixXd& matrix);
/// Ascending.
Eigen::VectorXd symmetricEigenvalues(const Eigen::MatrixXd& matrix);

}  // namespace sinew::geometry

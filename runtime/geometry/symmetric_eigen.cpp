// SPDX-License-Identifier: MIT
#include "runtime/geometry/symmetric_eigen.h"

#include <Eigen/Eigenvalues>

namespace sinew::geometry {

using Solver = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>;

SymmetricEigen symmetricEigen(const Eigen::MatrixXd& matrix) {
  if (matrix.size() == 0) return {};
  const Solver solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::VectorXd symmetricEigenvalues(const Eigen::MatrixXd& matrix) {
  return Solver(matrix, Eigen::EigenvaluesOnly).eigenvalues();
}

}  // namespace sinew::geometry

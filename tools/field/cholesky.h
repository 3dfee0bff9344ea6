// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <memory>

namespace sinew::tools::field {

/// Cholesky factors of symmetric matrices of one pattern, by CHOLMOD (Chen et al. 2008, supernodal). On the calling
/// thread alone: what is computed does not depend on the number of cores.
class Cholesky {
 public:
  /// The pattern: that of the lower triangle.
  explicit Cholesky(const Eigen::SparseMatrix<double>& lower);
  ~Cholesky();
  Cholesky(const Cholesky&) = delete;
  Cholesky& operator=(const Cholesky&) = delete;

  /// \return whether the matrix is positive definite; where it is not, there is no factor.
  /// \param lower of the constructor's pattern
  bool factorize(const Eigen::SparseMatrix<double>& lower);
  /// The inverse times right-hand sides. Several threads may solve at a time. \pre factorize() said yes last
  Eigen::MatrixXd solve(const Eigen::MatrixXd& right) const;

 private:
  struct Factor;
  std::unique_ptr<Factor> factor_;
};

/// The factor of a matrix that is positive but for rounding: where that has left none, entries of its diagonal get
/// 1e-13 of themselves, or a hundred times as much, and so on.
std::unique_ptr<Cholesky> firmFactor(Eigen::SparseMatrix<double>& lower);

}  // namespace sinew::tools::field

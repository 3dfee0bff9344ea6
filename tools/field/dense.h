// SPDX-License-Identifier: GPL-3.0-or-later
//
// Products and factors of dense matrices, compiled once: as expressions each takes the compiler a second for every
// place that it stands in.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace sinew::tools::field {

using DenseRef = Eigen::Ref<const Eigen::MatrixXd>;

using NarrowRef = Eigen::Ref<const Eigen::MatrixXf>;

/// a b
Eigen::MatrixXd product(const DenseRef& a, const DenseRef& b);
Eigen::MatrixXd product(const Eigen::SparseMatrix<double>& a, const DenseRef& b);
Eigen::MatrixXd product(const Eigen::SparseMatrix<double, Eigen::RowMajor>& a, const DenseRef& b);
Eigen::MatrixXf product(const NarrowRef& a, const NarrowRef& b);
/// a^T b
Eigen::MatrixXd innerProducts(const DenseRef& a, const DenseRef& b);
Eigen::MatrixXf innerProducts(const NarrowRef& a, const NarrowRef& b);
/// a^T diag(weight) b. @param weight as many as rows
Eigen::MatrixXd innerProducts(const DenseRef& a, const Eigen::VectorXd& weight, const DenseRef& b);
/// (m + m^T) / 2
Eigen::MatrixXd symmetric(const Eigen::MatrixXd& m);
/// Orthonormal columns of the same span, as many. @param m n x c of rank c, c <= n
Eigen::MatrixXd orthonormal(const Eigen::MatrixXd& m);

/// matrix = L L^T.
class DenseCholesky {
 public:
  DenseCholesky() = default;  ///< of 0 x 0
  /// @param matrix symmetric and positive; its lower triangle is read
  explicit DenseCholesky(Eigen::MatrixXd matrix);
  const Eigen::MatrixXd& lower() const { return lower_; }  ///< L; 0 above the diagonal
  Eigen::MatrixXd solve(const DenseRef& b) const;          ///< matrix^-1 b
  void solveLower(Eigen::MatrixXd& b) const;               ///< L^-1 b, in place
  void solveUpper(Eigen::MatrixXd& b) const;               ///< L^-T b, in place
  /// b L^-T, in place: rows of b become orthonormal where their products are the matrix.
  void divide(Eigen::MatrixXd& b) const;

 private:
  Eigen::MatrixXd lower_;
};

}  // namespace sinew::tools::field

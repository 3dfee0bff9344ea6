// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/dense.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <utility>

namespace sinew::tools::field {

using Eigen::MatrixXd;

MatrixXd product(const DenseRef& a, const DenseRef& b) { return a * b; }

MatrixXd product(const Eigen::SparseMatrix<double>& a, const DenseRef& b) { return a * b; }

MatrixXd product(const Eigen::SparseMatrix<double, Eigen::RowMajor>& a, const DenseRef& b) { return a * b; }

Eigen::MatrixXf product(const NarrowRef& a, const NarrowRef& b) { return a * b; }

MatrixXd innerProducts(const DenseRef& a, const DenseRef& b) { return a.transpose() * b; }

Eigen::MatrixXf innerProducts(const NarrowRef& a, const NarrowRef& b) { return a.transpose() * b; }

MatrixXd innerProducts(const DenseRef& a, const Eigen::VectorXd& weight, const DenseRef& b) {
  return innerProducts(a, MatrixXd(weight.asDiagonal() * b));
}

MatrixXd symmetric(const MatrixXd& m) { return 0.5 * (m + m.transpose()); }

MatrixXd orthonormal(const MatrixXd& m) {
  return Eigen::HouseholderQR<MatrixXd>(m).householderQ() * MatrixXd::Identity(m.rows(), m.cols());
}

DenseCholesky::DenseCholesky(MatrixXd matrix) : lower_(std::move(matrix)) {
  const Eigen::LLT<Eigen::Ref<MatrixXd>> factor(lower_);
  lower_.triangularView<Eigen::StrictlyUpper>().setZero();
}

MatrixXd DenseCholesky::solve(const DenseRef& b) const {
  MatrixXd result = b;
  solveLower(result);
  solveUpper(result);
  return result;
}

void DenseCholesky::solveLower(MatrixXd& b) const { lower_.triangularView<Eigen::Lower>().solveInPlace(b); }

void DenseCholesky::solveUpper(MatrixXd& b) const { lower_.triangularView<Eigen::Lower>().transpose().solveInPlace(b); }

void DenseCholesky::divide(MatrixXd& b) const {
  lower_.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(b);
}

}  // namespace sinew::tools::field

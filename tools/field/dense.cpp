// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/dense.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <utility>

namespace sinew::tools::field {

using Eigen::MatrixXd;

namespace {

// Some columns at once, side by side in memory: entries are read once for all of them, and sums are those of Eigen's
// product, column by column.
template <class Sparse>
MatrixXd sparseProduct(const Sparse& a, const DenseRef& b) {
  constexpr Eigen::Index kTogether = 8;
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, kTogether, Eigen::RowMajor>;
  MatrixXd result(a.rows(), b.cols());
  Rows from = Rows::Zero(b.rows(), kTogether), to(a.rows(), kTogether);
  for (Eigen::Index first = 0; first < b.cols(); first += kTogether) {
    const Eigen::Index count = std::min(kTogether, b.cols() - first);
    from.leftCols(count) = b.middleCols(first, count);
    to.setZero();
    for (Eigen::Index outer = 0; outer < a.outerSize(); ++outer) {
      for (typename Sparse::InnerIterator entry(a, outer); entry; ++entry) {
        to.row(entry.row()) += entry.value() * from.row(entry.col());
      }
    }
    result.middleCols(first, count) = to.leftCols(count);
  }
  return result;
}

}  // namespace

MatrixXd product(const DenseRef& a, const DenseRef& b) { return a * b; }

MatrixXd product(const Eigen::SparseMatrix<double>& a, const DenseRef& b) { return sparseProduct(a, b); }

MatrixXd product(const Eigen::SparseMatrix<double, Eigen::RowMajor>& a, const DenseRef& b) {
  return sparseProduct(a, b);
}

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

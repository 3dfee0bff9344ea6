// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/SparseCore>
#include <cstdint>
#include <memory>
#include <vector>

#include "tools/field/cholesky.h"

namespace sinew::tools {

/// The places of a symmetric matrix of 3 x 3 blocks that may differ from 0, by columns: rows from the column on,
/// ascending. The matrix is the blocks in that order.
struct BlockPattern {
  std::vector<std::size_t> first = {0};  ///< of each column in `row`, one more than columns
  std::vector<std::uint32_t> row;

  std::size_t columns() const { return first.size() - 1; }
};

/// Cholesky factors of matrices of one pattern of blocks.
class SparseCholesky {
 public:
  explicit SparseCholesky(const BlockPattern& pattern);

  /// \param blocks one for each place of the pattern. \return whether the matrix is positive definite; where it is not,
  /// there is no factor.
  bool factorize(const std::vector<Eigen::Matrix3d>& blocks);
  /// The inverse times right-hand sides: 3 rows a column of the pattern. \pre factorize() said yes last
  Eigen::MatrixXd solve(const Eigen::MatrixXd& right) const;

 private:
  Eigen::SparseMatrix<double> matrix_;  // the lower triangle
  std::vector<std::size_t> source_;     // of its values: numbers in the blocks
  std::unique_ptr<field::Cholesky> factor_;
};

}  // namespace sinew::tools

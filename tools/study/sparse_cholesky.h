// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

namespace sinew::tools {

/// The places of a symmetric matrix of 3 x 3 blocks that may differ from 0, by columns: rows from the column on,
/// ascending. The matrix is the blocks in that order.
struct BlockPattern {
  std::vector<std::size_t> first = {0};  ///< of each column in `row`, one more than columns
  std::vector<std::uint32_t> row;

  std::size_t columns() const { return first.size() - 1; }
};

/// Cholesky factors of matrices of one pattern: multifrontal (Duff and Reid 1983), in an order by nested dissection
/// (George 1973) across axes, diagonals and distances in the mesh. With all threads; results do not depend on how many.
class SparseCholesky {
 public:
  /// \param positions of the columns' nodes, where cuts are made.
  SparseCholesky(const BlockPattern& pattern, const std::vector<Eigen::Vector3d>& positions);
  ~SparseCholesky();

  /// \param blocks one for each place of the pattern. \return whether the matrix is positive definite; where it is not,
  /// there is no factor.
  bool factorize(const std::vector<Eigen::Matrix3d>& blocks);
  /// The inverse times right-hand sides: 3 rows a column of the pattern. \pre factorize() said yes last
  Eigen::MatrixXd solve(const Eigen::MatrixXd& right) const;
  /// Numbers in the factor.
  std::size_t entries() const;

 private:
  class Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace sinew::tools

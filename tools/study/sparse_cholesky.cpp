// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/sparse_cholesky.h"

namespace sinew::tools {

SparseCholesky::SparseCholesky(const BlockPattern& pattern) {
  const auto count = Eigen::Index(3 * pattern.columns());
  matrix_.resize(count, count);
  for (std::size_t c = 0; c < pattern.columns(); ++c) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      matrix_.startVec(Eigen::Index(3 * c) + k);
      for (std::size_t i = pattern.first[c]; i < pattern.first[c + 1]; ++i) {
        for (Eigen::Index r = pattern.row[i] == c ? k : 0; r < 3; ++r) {
          matrix_.insertBack(Eigen::Index(3 * pattern.row[i]) + r, Eigen::Index(3 * c) + k) = 0;
          source_.push_back(9 * i + std::size_t(3 * k + r));
        }
      }
    }
  }
  matrix_.finalize();
  factor_ = std::make_unique<field::Cholesky>(matrix_);
}

bool SparseCholesky::factorize(const std::vector<Eigen::Matrix3d>& blocks) {
  const double* const from = blocks.data()->data();
  double* to = matrix_.valuePtr();
  for (const std::size_t source : source_) *to++ = from[source];
  return factor_->factorize(matrix_);
}

Eigen::MatrixXd SparseCholesky::solve(const Eigen::MatrixXd& right) const { return factor_->solve(right); }

}  // namespace sinew::tools

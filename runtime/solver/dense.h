// SPDX-License-Identifier: MIT
//
// Cholesky factors of columns in memory that is there: Eigen's own takes memory at sizes known at run time.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace sinew::internal {

using Column = Eigen::Map<Eigen::VectorXd>;
using ConstColumn = Eigen::Map<const Eigen::VectorXd>;

/// Of the columns of an n x n matrix.
inline std::size_t strideOf(std::size_t n) { return (n + 7) / 8 * 8; }

/// The lower triangle becomes its Cholesky factor; columns are strideOf(n) apart. \pre its eigenvalues are at least 1
inline void factorize(double* a, std::uint32_t n) {
  for (std::uint32_t j = 0; j < n; ++j) {
    double* const column = a + strideOf(n) * j;
    for (std::uint32_t i = 0; i < j; ++i) {
      const double* const before = a + strideOf(n) * i;
      Column(column + j, n - j) -= before[j] * ConstColumn(before + j, n - j);
    }
    Column(column + j, n - j) *= 1 / std::sqrt(std::max(column[j], 1.0));
  }
}

/// x becomes L^-T x.
inline void solveUpper(const double* factor, std::uint32_t n, double* x) {
  for (std::uint32_t i = n; i-- > 0;) {
    const double* const column = factor + strideOf(n) * i;
    const std::uint32_t left = n - i - 1;
    x[i] = (x[i] - ConstColumn(column + i + 1, left).dot(Column(x + i + 1, left))) / column[i];
  }
}

/// x becomes L^-1 x.
inline void solveLower(const double* factor, std::uint32_t n, double* x) {
  for (std::uint32_t i = 0; i < n; ++i) {
    const double* const column = factor + strideOf(n) * i;
    x[i] /= column[i];
    const std::uint32_t left = n - i - 1;
    Column(x + i + 1, left) -= x[i] * ConstColumn(column + i + 1, left);
  }
}

}  // namespace sinew::internal

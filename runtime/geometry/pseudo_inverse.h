// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>

#include "runtime/geometry/small_matrix.h"

namespace sinew::geometry {

/// Relative cut-off for moments of float positions, at bake and at run time: a direction in which the spread of a
/// cluster is less than 1/316 of its largest one (1e-5 in the moment) cannot be told from noise and counts as missing.
inline constexpr double kMomentCutoff = 1e-5;

/// An Eigen matrix of fixed size, for the functions of small_matrix.h.
template <int kRows, int kColumns>
ConstMatrixView viewOf(const Eigen::Matrix<double, kRows, kColumns>& matrix) {
  return {matrix.data(), MatrixShape{kRows, kColumns, 1, kRows}};
}
template <int kRows, int kColumns>
MatrixView viewOf(Eigen::Matrix<double, kRows, kColumns>& matrix) {
  return {matrix.data(), MatrixShape{kRows, kColumns, 1, kRows}};
}

/// Moore-Penrose pseudo-inverse of a symmetric positive semi-definite matrix (a moment: Σ mu q q^T).
///
/// Guarantee: symmetric, finite for finite input; directions whose eigenvalue is below `cutoff` times the largest are
/// dropped (zero in the result), so that flat, straight and single-vertex clusters stay well defined.
/// \param cutoff relative to the largest eigenvalue, > 0.
template <int N>
Eigen::Matrix<double, N, N> pseudoInverse(const Eigen::Matrix<double, N, N>& moment, double cutoff = kMomentCutoff) {
  Eigen::Matrix<double, N, N> result;
  pseudoInverse(viewOf(moment), cutoff, viewOf(result));
  return result;
}

}  // namespace sinew::geometry

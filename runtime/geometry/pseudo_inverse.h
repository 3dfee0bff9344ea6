// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <cmath>

namespace sinew::geometry {

/// Default relative cut-off of pseudoInverse() for moments of float positions: a direction in which the spread of a
/// cluster is less than 1/1000 of its largest one (1e-6 in the moment) counts as missing.
inline constexpr double kMomentCutoff = 1e-6;

/// Moore-Penrose pseudo-inverse of a symmetric positive semi-definite matrix (a moment: Σ mu q q^T).
///
/// Guarantee: symmetric, finite for finite input; directions whose eigenvalue is below `cutoff` times the largest are
/// dropped (zero in the result), so that flat, straight and single-vertex clusters stay well defined.
/// \param cutoff relative to the largest eigenvalue, > 0.
template <int N>
Eigen::Matrix<double, N, N> pseudoInverse(const Eigen::Matrix<double, N, N>& moment, double cutoff = kMomentCutoff) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, N, N>> solver(moment);
  const double largest = solver.eigenvalues()[N - 1];
  Eigen::Matrix<double, N, 1> inverse = Eigen::Matrix<double, N, 1>::Zero();
  for (int i = 0; i < N; ++i) {
    const double value = solver.eigenvalues()[i];
    if (value > cutoff * largest && value > 0) inverse[i] = 1.0 / value;
  }
  const Eigen::Matrix<double, N, N> result =
      solver.eigenvectors() * inverse.asDiagonal() * solver.eigenvectors().transpose();
  return 0.5 * (result + result.transpose());
}

/// The same for a moment whose coordinates differ in scale (squares beside lengths): scaled to unit diagonal first, so
/// that the cut-off means dependence between coordinates and not their size. Coordinates with a diagonal below
/// `cutoff` times the largest are dropped.
template <int N>
Eigen::Matrix<double, N, N> equilibratedPseudoInverse(const Eigen::Matrix<double, N, N>& moment,
                                                      double cutoff = kMomentCutoff) {
  const double largest = moment.diagonal().maxCoeff();
  Eigen::Matrix<double, N, 1> scale = Eigen::Matrix<double, N, 1>::Zero();
  for (int i = 0; i < N; ++i) {
    if (moment(i, i) > cutoff * largest && moment(i, i) > 0) scale[i] = 1.0 / std::sqrt(moment(i, i));
  }
  const Eigen::Matrix<double, N, N> scaled = scale.asDiagonal() * moment * scale.asDiagonal();
  return scale.asDiagonal() * pseudoInverse<N>(scaled, cutoff) * scale.asDiagonal();
}

}  // namespace sinew::geometry

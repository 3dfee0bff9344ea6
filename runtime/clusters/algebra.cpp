// SPDX-License-Identifier: MIT
#include "runtime/clusters/algebra.h"

#include <Eigen/LU>

namespace sinew::internal {

Vector3 timesColumn(const Columns<9>& a, const Monomials<9>& b) { return a.lazyProduct(b); }

Matrix3 asMatrix(const Mat3& m) { return Eigen::Map<const Matrix3>(m.data()).transpose(); }

float determinantOf(const Matrix3& a) { return a.determinant(); }
Matrix3 inverseOf(const Matrix3& a) { return a.inverse(); }

void MomentSums::add(double mu, const Eigen::Matrix<double, 9, 1>& q) {
  total += mu;
  for (int j = 0; j < 9; ++j) {
    mean[j] += mu * q[j];
    for (int i = 0; i < 9; ++i) moment(i, j) += mu * q[i] * q[j];
  }
}

void MomentSums::finish() {
  for (int j = 0; j < 9; ++j) mean[j] /= total;
  for (int j = 0; j < 9; ++j) {
    for (int i = 0; i < 9; ++i) moment(i, j) = moment(i, j) / total - mean[i] * mean[j];
  }
}

}  // namespace sinew::internal

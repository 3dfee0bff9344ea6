// SPDX-License-Identifier: MIT
#include "runtime/clusters/algebra.h"

#include <Eigen/LU>

namespace sinew::internal {
namespace {

template <class T>
[[gnu::always_inline]] inline void multiplyThree(const T* a, int a_row_step, int a_column_step, const T* b,
                                                 int b_row_step, int b_column_step, int columns, T* to) {
  for (int j = 0; j < columns; ++j, b += b_column_step, to += 3) {
    const T x = b[0], y = b[b_row_step], z = b[2 * b_row_step];
    for (int i = 0; i < 3; ++i) {
      const T* row = a + i * a_row_step;
      to[i] = row[0] * x + (row[a_column_step] * y + row[2 * a_column_step] * z);
    }
  }
}

// Σ a_k b_k of nine, each `step` further.
[[gnu::always_inline]] inline float sumOfNine(const float* a, const float* b, int b_step) {
  return internal::sumOfNine([&](int k) { return a[3 * k] * b[k * b_step]; });
}

}  // namespace

Columns<9> timesSymmetric(const Columns<9>& a, const Square<9>& s) {
  Columns<9> result;
  for (int j = 0; j < 9; ++j) {
    for (int i = 0; i < 3; ++i) result(i, j) = sumOfNine(a.data() + i, s.data() + 9 * j, 1);
  }
  return result;
}

Vector3 timesColumn(const Columns<9>& a, const Monomials<9>& b) {
  Vector3 result;
  for (int i = 0; i < 3; ++i) result[i] = sumOfNine(a.data() + i, b.data(), 1);
  return result;
}

Matrix3 timesTransposed(const Columns<9>& a, const Columns<9>& b) {
  Matrix3 result;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) result(i, j) = sumOfNine(a.data() + i, b.data() + j, 3);
  }
  return result;
}

void multiply(const float* a, int a_row_step, int a_column_step, const float* b, int b_row_step, int b_column_step,
              int columns, float* to) {
  multiplyThree(a, a_row_step, a_column_step, b, b_row_step, b_column_step, columns, to);
}
void multiply(const double* a, int a_row_step, int a_column_step, const double* b, int b_row_step, int b_column_step,
              int columns, double* to) {
  multiplyThree(a, a_row_step, a_column_step, b, b_row_step, b_column_step, columns, to);
}

Eigen::Matrix3d widened(const Matrix3& a) { return a.cast<double>(); }
Eigen::Matrix<double, 3, 9> widened(const Columns<9>& a) {
  Eigen::Matrix<double, 3, 9> result;
  for (int k = 0; k < 27; ++k) result.data()[k] = double(a.data()[k]);
  return result;
}
Columns<9> narrowed(const Eigen::Matrix<double, 3, 9>& a) {
  Columns<9> result;
  for (int k = 0; k < 27; ++k) result.data()[k] = float(a.data()[k]);
  return result;
}

Eigen::Matrix<double, 9, 1> monomials(const Eigen::Vector3d& q) {
  Eigen::Matrix<double, 9, 1> result;
  for (int axis = 0; axis < 3; ++axis) {
    result[axis] = q[axis];
    result[3 + axis] = q[axis] * q[axis];
    result[6 + axis] = q[axis] * q[axis < 2 ? axis + 1 : 0];
  }
  return result;
}

Matrix3 asMatrix(const Mat3& m) { return Eigen::Map<const Matrix3>(m.data()).transpose(); }

float determinantOf(const Matrix3& a) { return a.determinant(); }
Matrix3 inverseOf(const Matrix3& a) { return a.inverse(); }
Eigen::Matrix3d inverseOf(const Eigen::Matrix3d& a) { return a.inverse(); }

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

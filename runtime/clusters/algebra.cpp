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

}  // namespace

void multiply(const float* a, int a_row_step, int a_column_step, const float* b, int b_row_step, int b_column_step,
              int columns, float* to) {
  multiplyThree(a, a_row_step, a_column_step, b, b_row_step, b_column_step, columns, to);
}
void multiply(const double* a, int a_row_step, int a_column_step, const double* b, int b_row_step, int b_column_step,
              int columns, double* to) {
  multiplyThree(a, a_row_step, a_column_step, b, b_row_step, b_column_step, columns, to);
}

float determinantOf(const Matrix3& a) { return a.determinant(); }
Matrix3 inverseOf(const Matrix3& a) { return a.inverse(); }
Eigen::Matrix3d inverseOf(const Eigen::Matrix3d& a) { return a.inverse(); }

}  // namespace sinew::internal

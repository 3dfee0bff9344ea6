// SPDX-License-Identifier: MIT
//
// Dense matrices of at most 30 rows and columns whose sizes are known at run time only: products, symmetric eigenvalues
// and inverses, each compiled once. Eigen's own bring a megabyte of code for blocking that such sizes never need; its
// results are the reference of tests/runtime/small_matrix_test.cpp. Nothing here allocates.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace sinew::geometry {

/// Rows and columns that the functions of this file take, at most.
inline constexpr int kSmallRows = 30;

/// How a matrix lies in memory: element (row, column) at row * row_step + column * column_step.
struct MatrixShape {
  std::int16_t rows = 0, columns = 0;
  std::int16_t row_step = 1, column_step = 0;
};
static_assert(sizeof(MatrixShape) == 8);
// Out of line: to put four small numbers into a register is more code than a call.
MatrixShape shapeOf(int rows, int columns, int row_step, int column_step);
MatrixShape resized(MatrixShape shape, int rows, int columns);
MatrixShape transposed(MatrixShape shape);

/// A part of a matrix, seen in place. Small enough to be passed in registers.
template <class Number>
struct MatrixViewOf : MatrixShape {
  Number* data;

  MatrixViewOf(Number* first, MatrixShape shape) : MatrixShape(shape), data(first) {}
  MatrixViewOf(Number* first, int row_count, int column_count, int to_next_row, int to_next_column)
      : MatrixViewOf(first, shapeOf(row_count, column_count, to_next_row, to_next_column)) {}
  Number& operator()(int row, int column) const { return data[row * row_step + column * column_step]; }
  MatrixViewOf block(int row, int column, int row_count, int column_count) const {
    return {&(*this)(row, column), resized(*this, row_count, column_count)};
  }
  MatrixViewOf transposed() const { return {data, geometry::transposed(*this)}; }
  // NOLINTNEXTLINE(google-explicit-constructor): a view to read is a view to write, seen with less
  operator MatrixViewOf<const Number>() const { return {data, *this}; }
};
using MatrixView = MatrixViewOf<double>;
using ConstMatrixView = MatrixViewOf<const double>;

/// A matrix column by column, zero at first. \tparam kMost elements, at most.
template <int kMost>
class SmallMatrix {
 public:
  SmallMatrix() = default;
  SmallMatrix(int rows, int columns) : shape_(shapeOf(rows, columns, 1, rows)) {}

  int rows() const { return shape_.rows; }
  int columns() const { return shape_.columns; }
  /// Drops columns from the end.
  void keepColumns(int count) { shape_.columns = std::int16_t(count); }
  double& operator()(int row, int column) { return data()[row + column * shape_.rows]; }
  double operator()(int row, int column) const { return data()[row + column * shape_.rows]; }
  double* data() { return values_.data(); }
  const double* data() const { return values_.data(); }
  MatrixView view() { return {values_.data(), shape_}; }
  ConstMatrixView view() const { return {values_.data(), shape_}; }
  MatrixView block(int row, int column, int rows, int columns) { return view().block(row, column, rows, columns); }
  ConstMatrixView block(int row, int column, int rows, int columns) const {
    return view().block(row, column, rows, columns);
  }
  ConstMatrixView transposed() const { return view().transposed(); }
  // NOLINTNEXTLINE(google-explicit-constructor): the functions below take either
  operator MatrixView() { return view(); }
  // NOLINTNEXTLINE(google-explicit-constructor): the functions below take either
  operator ConstMatrixView() const { return view(); }

 private:
  std::array<double, std::size_t(kMost)> values_ = {};
  MatrixShape shape_;
};

/// to += scale * a * b. Sizes have to fit; `to` shares no element with a or b.
void addProduct(MatrixView to, double scale, ConstMatrixView a, ConstMatrixView b);

/// to += scale * t^T * a * t. `to` shares no element with a or t.
void addCongruence(MatrixView to, double scale, ConstMatrixView a, ConstMatrixView t);

/// to += scale * a. `to` may be a.
void addScaled(MatrixView to, double scale, ConstMatrixView a);

/// Adds to each element of the diagonal.
void addToDiagonal(MatrixView to, double value);

/// Eigenvalues, ascending, and orthonormal eigenvectors (columns, in the same order) of a symmetric matrix, by Jacobi's
/// rotations (Golub & Van Loan, Matrix Computations, §8.5). Accurate to rounding of the largest eigenvalue, also for
/// multiple ones. NaN in, NaN out; always ends.
/// \param a symmetric; its lower triangle is read. \param[out] values a.rows of them. \param[out] vectors of a's size.
void symmetricEigen(ConstMatrixView a, std::span<double> values, MatrixView vectors);

/// a becomes its inverse, by Cholesky's factors. \param a symmetric positive definite; its lower triangle is read.
void invertPositive(MatrixView a);

/// Moore-Penrose pseudo-inverse of a symmetric positive semi-definite matrix, as pseudo_inverse.h says.
/// \param to of a's size; may be a.
void pseudoInverse(ConstMatrixView a, double cutoff, MatrixView to);

/// The same of a moment whose coordinates differ in scale (squares beside lengths): scaled to unit diagonal first, so
/// that the cut-off means dependence between coordinates and not their size. Coordinates with a diagonal below `cutoff`
/// times the largest are dropped. \param to of a's size; may be a.
void equilibratedPseudoInverse(ConstMatrixView a, double cutoff, MatrixView to);

/// Scales of coordinates that give a moment a unit diagonal; 0 for those whose diagonal is below `cutoff` times the
/// largest. \param[out] scale moment.rows of them.
void equilibration(ConstMatrixView moment, double cutoff, std::span<double> scale);

}  // namespace sinew::geometry

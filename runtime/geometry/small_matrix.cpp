// SPDX-License-Identifier: MIT
#include "runtime/geometry/small_matrix.h"

#include <cmath>
#include <limits>
#include <utility>

namespace sinew::geometry {
namespace {

using Square = std::array<double, std::size_t(kSmallRows) * std::size_t(kSmallRows)>;

MatrixView squareIn(Square& storage, int rows) { return {storage.data(), rows, rows, 1, rows}; }

void copy(ConstMatrixView from, MatrixView to) {
  for (int j = 0; j < from.columns; ++j) {
    for (int i = 0; i < from.rows; ++i) to(i, j) = from(i, j);
  }
}

void scaleBothSides(MatrixView a, std::span<const double> scale) {
  for (int j = 0; j < a.columns; ++j) {
    for (int i = 0; i < a.rows; ++i) a(i, j) *= scale[std::size_t(i)] * scale[std::size_t(j)];
  }
}

// Columns p and q become cos p - sin q and sin p + cos q.
void rotateColumns(MatrixView a, int p, int q, double cosine, double sine) {
  for (int i = 0; i < a.rows; ++i) {
    const double x = a(i, p), y = a(i, q);
    a(i, p) = cosine * x - sine * y;
    a(i, q) = sine * x + cosine * y;
  }
}

// One Jacobi rotation that makes a(p, q) vanish. \return whether there was anything to do.
bool annihilate(MatrixView a, MatrixView vectors, int p, int q) {
  const double entry = a(p, q);
  if (!(std::abs(entry) > std::numeric_limits<double>::min())) return false;
  // The eigenvalue moves by less than the rounding of both.
  const double gap = a(q, q) - a(p, p);
  const double theta = 0.5 * gap / entry;
  const double tangent = (theta < 0 ? -1 : 1) / (std::abs(theta) + std::sqrt(theta * theta + 1));
  const double cosine = 1 / std::sqrt(tangent * tangent + 1), sine = tangent * cosine;
  rotateColumns(a, p, q, cosine, sine);
  rotateColumns(a.transposed(), p, q, cosine, sine);
  a(p, q) = a(q, p) = 0;
  rotateColumns(vectors, p, q, cosine, sine);
  return true;
}

}  // namespace

MatrixShape shapeOf(int rows, int columns, int row_step, int column_step) {
  return {std::int16_t(rows), std::int16_t(columns), std::int16_t(row_step), std::int16_t(column_step)};
}

MatrixShape resized(MatrixShape shape, int rows, int columns) {
  return {std::int16_t(rows), std::int16_t(columns), shape.row_step, shape.column_step};
}

MatrixShape transposed(MatrixShape shape) { return {shape.columns, shape.rows, shape.column_step, shape.row_step}; }

void addProduct(MatrixView to, double scale, ConstMatrixView a, ConstMatrixView b) {
  const std::ptrdiff_t a_row_step = a.row_step, to_row_step = to.row_step;
  for (int j = 0; j < b.columns; ++j, to.data += to.column_step, b.data += b.column_step) {
    const double* column = a.data;
    const double* entry = b.data;
    for (int k = a.columns; k > 0; --k, column += a.column_step, entry += b.row_step) {
      const double factor = scale * *entry;
      const double* from = column;
      double* at = to.data;
      for (int i = a.rows; i > 0; --i, from += a_row_step, at += to_row_step) *at += *from * factor;
    }
  }
}

void addCongruence(MatrixView to, double scale, ConstMatrixView a, ConstMatrixView t) {
  Square storage;
  std::fill_n(storage.data(), a.rows * t.columns, 0.0);
  const MatrixView product(storage.data(), a.rows, t.columns, 1, a.rows);
  addProduct(product, scale, a, t);
  addProduct(to, 1, t.transposed(), product);
}

void addScaled(MatrixView to, double scale, ConstMatrixView a) {
  for (int j = 0; j < a.columns; ++j) {
    for (int i = 0; i < a.rows; ++i) to(i, j) += scale * a(i, j);
  }
}

void addToDiagonal(MatrixView to, double value) {
  for (int i = 0; i < to.rows; ++i) to(i, i) += value;
}

void symmetricEigen(ConstMatrixView a, std::span<double> values, MatrixView vectors) {
  // Ten sweeps are more than matrices of 30 rows need: each squares what is left off the diagonal.
  constexpr int kMostSweeps = 30;
  const int n = a.rows;
  Square work_storage, turned_storage;
  const MatrixView work = squareIn(work_storage, n), turned = squareIn(turned_storage, n);
  double largest = 0;
  for (int j = 0; j < n; ++j) {
    for (int i = j; i < n; ++i) {
      work(i, j) = work(j, i) = a(i, j);
      turned(i, j) = turned(j, i) = i == j ? 1 : 0;
      largest = std::max(largest, std::abs(a(i, j)));
    }
  }
  const double small = std::numeric_limits<double>::epsilon() * 1e-3 * largest;
  bool changed = true;
  for (int sweep = 0; changed && sweep < kMostSweeps; ++sweep) {
    changed = false;
    for (int p = 0; p < n; ++p) {
      for (int q = p + 1; q < n; ++q) {
        if (std::abs(work(p, q)) > small) changed |= annihilate(work, turned, p, q);
      }
    }
  }
  std::array<int, std::size_t(kSmallRows)> order;
  for (int k = 0; k < n; ++k) {
    int place = k;
    for (; place > 0; --place) {
      const int before = order[std::size_t(place - 1)];
      if (!(work(k, k) < work(before, before))) break;
      order[std::size_t(place)] = before;
    }
    order[std::size_t(place)] = k;
  }
  for (int k = 0; k < n; ++k) {
    values[std::size_t(k)] = work(order[std::size_t(k)], order[std::size_t(k)]);
    for (int i = 0; i < n; ++i) vectors(i, k) = turned(i, order[std::size_t(k)]);
  }
}

void invertPositive(MatrixView a) {
  const int n = a.rows;
  // A = L L^T in the lower triangle.
  for (int j = 0; j < n; ++j) {
    for (int i = j; i < n; ++i) {
      double sum = a(i, j);
      for (int k = 0; k < j; ++k) sum -= a(i, k) * a(j, k);
      a(i, j) = i == j ? std::sqrt(sum) : sum / a(j, j);
    }
  }
  // L^-1 in its place, then A^-1 = L^-T L^-1.
  for (int j = 0; j < n; ++j) {
    a(j, j) = 1 / a(j, j);
    for (int i = j + 1; i < n; ++i) {
      double sum = 0;
      for (int k = j; k < i; ++k) sum -= a(i, k) * a(k, j);
      a(i, j) = sum / a(i, i);
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = j; i < n; ++i) {
      double sum = 0;
      for (int k = i; k < n; ++k) sum += a(k, i) * a(k, j);
      a(i, j) = sum;
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < j; ++i) a(i, j) = a(j, i);
  }
}

void pseudoInverse(ConstMatrixView a, double cutoff, MatrixView to) {
  const int n = a.rows;
  Square vector_storage;
  const MatrixView vectors = squareIn(vector_storage, n);
  std::array<double, std::size_t(kSmallRows)> values;
  symmetricEigen(a, values, vectors);
  const double largest = values[std::size_t(n - 1)];
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) to(i, j) = 0;
  }
  for (int k = 0; k < n; ++k) {
    const double value = values[std::size_t(k)];
    if (!(value > cutoff * largest) || !(value > 0)) continue;
    const ConstMatrixView vector = vectors.block(0, k, n, 1);
    addProduct(to, 1 / value, vector, vector.transposed());
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < j; ++i) to(i, j) = to(j, i) = 0.5 * (to(i, j) + to(j, i));
  }
}

void equilibration(ConstMatrixView moment, double cutoff, std::span<double> scale) {
  double largest = 0;
  for (int i = 0; i < moment.rows; ++i) largest = std::max(largest, moment(i, i));
  for (int i = 0; i < moment.rows; ++i) {
    const double own = moment(i, i);
    scale[std::size_t(i)] = own > cutoff * largest && own > 0 ? 1 / std::sqrt(own) : 0;
  }
}

void equilibratedPseudoInverse(ConstMatrixView a, double cutoff, MatrixView to) {
  std::array<double, std::size_t(kSmallRows)> scale;
  equilibration(a, cutoff, scale);
  Square scaled_storage;
  const MatrixView scaled = squareIn(scaled_storage, a.rows);
  copy(a, scaled);
  scaleBothSides(scaled, scale);
  pseudoInverse(scaled, cutoff, to);
  scaleBothSides(to, scale);
}

}  // namespace sinew::geometry

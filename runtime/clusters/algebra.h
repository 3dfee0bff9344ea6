// SPDX-License-Identifier: MIT
//
// The fixed-size algebra of clusters: symbols of docs/method.md §1.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <type_traits>

#include "sinew/formats/sections.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

using Vector3 = Eigen::Vector3f;
using Matrix3 = Eigen::Matrix3f;
/// Columns a cluster matches with: 3 (rigid, linear) or 9 (quadratic).
template <int N>
using Columns = Eigen::Matrix<float, 3, N>;
template <int N>
using Square = Eigen::Matrix<float, N, N>;
template <int N>
using Monomials = Eigen::Matrix<float, N, 1>;

/// to = a b, a and b of three rows, a of three columns; compiled once, in Eigen's order of sums. A step is the distance
/// of neighbours in a column (row_step) or in a row (column_step).
void multiply(const float* a, int a_row_step, int a_column_step, const float* b, int b_row_step, int b_column_step,
              int columns, float* to);
void multiply(const double* a, int a_row_step, int a_column_step, const double* b, int b_row_step, int b_column_step,
              int columns, double* to);

template <class T>
struct ThreeRows : std::false_type {};  ///< what multiply() takes: matrices as they lie in memory, or transposed
template <class T, int N>
struct ThreeRows<Eigen::Matrix<T, 3, N>> : std::true_type {};
template <class T>
struct ThreeRows<Eigen::Transpose<Eigen::Matrix<T, 3, 3>>> : std::true_type {};
template <class T>
struct ThreeRows<Eigen::Transpose<const Eigen::Matrix<T, 3, 3>>> : std::true_type {};
template <>
struct ThreeRows<Eigen::Map<const Vector3>> : std::true_type {};

/// Eigen's own product is a page of code at each place that writes it.
template <class A, class B>
requires(
    ThreeRows<A>::value&& A::ColsAtCompileTime == 3 && ThreeRows<B>::value &&
    std::is_same_v<typename A::Scalar, typename B::Scalar>) Eigen::Matrix<typename A::Scalar, 3, B::ColsAtCompileTime>
operator*(const A& a, const B& b) {
  Eigen::Matrix<typename A::Scalar, 3, B::ColsAtCompileTime> result;
  multiply(a.data(), int(a.rowStride()), int(a.colStride()), b.data(), int(b.rowStride()), int(b.colStride()),
           B::ColsAtCompileTime, result.data());
  return result;
}

/// Σ term(k), k = 0..8, in Eigen's order.
template <class Term>
[[gnu::always_inline]] inline float sumOfNine(const Term& term) {
  return ((term(0) + term(1)) + (term(2) + term(3))) + ((term(4) + term(5)) + (term(6) + (term(7) + term(8))));
}

/// a s, s symmetric, a b, and a b^T: sums of nine, compiled once as well.
Columns<9> timesSymmetric(const Columns<9>& a, const Square<9>& s);
Vector3 timesColumn(const Columns<9>& a, const Monomials<9>& b);
Matrix3 timesTransposed(const Columns<9>& a, const Columns<9>& b);

/// The same numbers in double, and back in float.
Eigen::Matrix3d widened(const Matrix3& a);
Eigen::Matrix<double, 3, 9> widened(const Columns<9>& a);
Columns<9> narrowed(const Eigen::Matrix<double, 3, 9>& a);

float determinantOf(const Matrix3& a);
Matrix3 inverseOf(const Matrix3& a);
Eigen::Matrix3d inverseOf(const Eigen::Matrix3d& a);

inline Eigen::Map<const Vector3> asVector(const std::array<float, 3>& v) { return Eigen::Map<const Vector3>(v.data()); }
inline Eigen::Map<Vector3> asVector(std::array<float, 3>& v) { return Eigen::Map<Vector3>(v.data()); }
/// A rotation as settings give it, row by row.
Matrix3 asMatrix(const Mat3& m);
inline Vec3 asArray(const Vector3& v) { return {v[0], v[1], v[2]}; }

/// q = (X - c0) / radius.
inline Vector3 restOffset(const formats::Cluster& cluster, const Vector3& rest_position) {
  return (rest_position - asVector(cluster.rest_center)) / cluster.radius;
}

/// q~ before centring: qx qy qz, then qx² qy² qz² qxqy qyqz qzqx.
template <int N>
Monomials<N> monomials(const Vector3& q) {
  Monomials<N> result;
  result.template head<3>() = q;
  if constexpr (N == 9) {
    result.template tail<6>() << q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0];
  }
  return result;
}

/// The nine of them in double.
Eigen::Matrix<double, 9, 1> monomials(const Eigen::Vector3d& q);

/// d q~ / d q, N x 3.
template <int N>
Eigen::Matrix<float, N, 3> monomialGradient(const Vector3& q) {
  Eigen::Matrix<float, N, 3> result;
  result.template topRows<3>().setIdentity();
  if constexpr (N == 9) {
    result.template bottomRows<6>() << 2 * q[0], 0, 0, 0, 2 * q[1], 0, 0, 0, 2 * q[2],  //
        q[1], q[0], 0, 0, q[2], q[1], q[2], 0, q[0];
  }
  return result;
}

/// Σ mu q~ and Σ mu q~ q~^T over the members of a cluster.
struct MomentSums {
  double total = 0;                                                          ///< Σ mu
  Eigen::Matrix<double, 9, 1> mean = Eigen::Matrix<double, 9, 1>::Zero();    ///< of q~, behind finish()
  Eigen::Matrix<double, 9, 9> moment = Eigen::Matrix<double, 9, 9>::Zero();  ///< about the mean, behind finish()

  void add(double mu, const Eigen::Matrix<double, 9, 1>& q);
  void finish();
};

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// The fixed-size algebra of clusters: symbols of docs/report.md §1.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>

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

/// a b, compiled once as well.
Vector3 timesColumn(const Columns<9>& a, const Monomials<9>& b);

float determinantOf(const Matrix3& a);
Matrix3 inverseOf(const Matrix3& a);

inline Eigen::Map<const Vector3> asVector(const std::array<float, 3>& v) { return Eigen::Map<const Vector3>(v.data()); }
inline Eigen::Map<Vector3> asVector(std::array<float, 3>& v) { return Eigen::Map<Vector3>(v.data()); }
/// A rotation as settings give it, row by row.
Matrix3 asMatrix(const Mat3& m);
/// Where a place in a rigid transform is.
inline Eigen::Vector3d placeOf(const RigidTransform& at, const Vec3& local) {
  Eigen::Vector3d place;
  for (std::size_t row = 0; row < 3; ++row) {
    place[int(row)] = double(at.position[row]);
    for (std::size_t c = 0; c < 3; ++c) place[int(row)] += double(at.rotation[3 * row + c]) * double(local[c]);
  }
  return place;
}
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

/// Σ mu q~ and Σ mu q~ q~^T over the members of a cluster.
struct MomentSums {
  double total = 0;                                                          ///< Σ mu
  Eigen::Matrix<double, 9, 1> mean = Eigen::Matrix<double, 9, 1>::Zero();    ///< of q~, behind finish()
  Eigen::Matrix<double, 9, 9> moment = Eigen::Matrix<double, 9, 9>::Zero();  ///< about the mean, behind finish()

  void add(double mu, const Eigen::Matrix<double, 9, 1>& q);
  void finish();
};

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// The fixed-size algebra of clusters: symbols of docs/method.md §1.
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

inline Eigen::Map<const Vector3> asVector(const std::array<float, 3>& v) { return Eigen::Map<const Vector3>(v.data()); }
inline Eigen::Map<Vector3> asVector(std::array<float, 3>& v) { return Eigen::Map<Vector3>(v.data()); }
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

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// The proper rotation nearest to a 3x3 matrix, for every input (docs/report.md §3).
#pragma once

#include <Eigen/Core>
#include <array>

namespace sinew::geometry {

/// Unit quaternion w, x, y, z.
using Quaternion = std::array<float, 4>;

inline constexpr Quaternion kIdentityQuaternion = {1.0F, 0.0F, 0.0F, 0.0F};

/// The rotation of a unit quaternion.
Eigen::Matrix3f rotationMatrix(const Quaternion& q);

/// Finds the proper rotation R (det = +1) that is nearest to `a`, i.e. that maximizes tr(R^T a).
///
/// Guarantee: R is a rotation for every input, also singular, mirrored, zero or non-finite ones, at any scale a float
/// can hold. Where the nearest rotation is not unique (rank < 2, or mirrored with equal smallest stretches) the result
/// is the one nearest to the rotation passed in; for zero and non-finite `a` that is the rotation passed in.
///
/// Method: Newton's iteration on the rotation from the previous one, as Müller et al. 2016 ("A robust method to extract
/// the rotational part of deformations") but with the exact Hessian J = tr(S) I - S, S = sym(R^T a). q^T K q on the
/// unit sphere has no local maximum but the global one, so a stationary point with positive definite J is the answer;
/// what Newton cannot settle (far away, J not definite) goes to the eigenvectors of Horn's matrix. No sticking at 180°.
///
/// \param a any 3x3 matrix.
/// \param[in,out] q the previous rotation as a unit quaternion (warm start); the result.
void nearestRotation(const Eigen::Matrix3f& a, Quaternion& q);

/// The nearest rotation without a previous one.
Eigen::Matrix3f nearestRotation(const Eigen::Matrix3f& a);
/// The same to the digits of floats, as a rotation to the digits of doubles; at any scale a double can hold.
Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& a);

}  // namespace sinew::geometry

// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace sinew::geometry {

/// A = u diag(sigma) v^T with u and v proper rotations.
struct RotationSvd {
  Eigen::Matrix3f u, v;
  Eigen::Vector3f sigma;  ///< |sigma| descending; only the last may be negative, and is exactly where A mirrors
};

/// Rotation-variant singular value decomposition (Irving et al. 2004, §5): the sign of a reflection goes into the
/// smallest singular value instead of into u or v. In double inside; for finite input of any rank and scale (zero for
/// any other).
inline RotationSvd rotationSvd(const Eigen::Matrix3f& a) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a.cast<double>(), Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (svd.info() != Eigen::Success) return {Eigen::Matrix3f::Identity(), Eigen::Matrix3f::Identity(), {0, 0, 0}};
  Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV();
  Eigen::Vector3d sigma = svd.singularValues();
  if (u.determinant() < 0) {
    u.col(2) = -u.col(2);
    sigma[2] = -sigma[2];
  }
  if (v.determinant() < 0) {
    v.col(2) = -v.col(2);
    sigma[2] = -sigma[2];
  }
  return {u.cast<float>(), v.cast<float>(), sigma.cast<float>()};
}

}  // namespace sinew::geometry

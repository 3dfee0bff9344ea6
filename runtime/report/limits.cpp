// SPDX-License-Identifier: MIT
#include "runtime/report/limits.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace sinew::internal {
namespace {

using Eigen::Matrix3f;

// gamma of |gamma A + (1 - gamma) R|^2 = wanted, the root in 0..1 (4.1.2, method 2); |R|^2 = 3 and wanted >= 3.
float gammaFor(const Matrix3f& a, const Matrix3f& r, float wanted) {
  const Matrix3f change = a - r;
  const double square = double(change.squaredNorm()), along = double(r.cwiseProduct(change).sum());
  const double rest = std::min(0.0, double(r.squaredNorm()) - double(wanted));
  if (!(square > 0)) return 1;
  const double root = (-along + std::sqrt(along * along - square * rest)) / square;
  return float(std::clamp(root, 0.0, 1.0));
}

// f(phi), linear between the points of a curve, constant behind the last.
float responseOf(std::span<const formats::CurvePoint> curve, float phi) {
  for (std::size_t k = 1; k < curve.size(); ++k) {
    if (phi > curve[k].norm) continue;
    const float part = (phi - curve[k - 1].norm) / (curve[k].norm - curve[k - 1].norm);
    return curve[k - 1].response + part * (curve[k].response - curve[k - 1].response);
  }
  return curve.back().response;
}

}  // namespace

Matrix3f volumeKept(const Matrix3f& a) {
  constexpr float kNoVolume = 1e-6F;
  const float volume = std::abs(a.determinant());
  return volume > kNoVolume ? Matrix3f(a / std::cbrt(volume)) : a;
}

Matrix3f rowsLimited(const Matrix3f& a, float longest) {
  Matrix3f result = a;
  for (int i = 0; i < 3; ++i) {
    const float length = a.row(i).norm();
    if (length > longest) result.row(i) *= longest / length;
  }
  return result;
}

Matrix3f stretchesLimited(const Matrix3f& a, float least, float largest) {
  if (!a.allFinite()) return a;
  const Eigen::JacobiSVD<Matrix3f> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3f u = svd.matrixU(), v = svd.matrixV();
  Eigen::Vector3f stretch = svd.singularValues();
  for (Matrix3f* factor : {&u, &v}) {
    if (factor->determinant() > 0) continue;
    factor->col(2) *= -1;
    stretch[2] *= -1;
  }
  return u * stretch.cwiseMax(least).cwiseMin(largest).asDiagonal() * v.transpose();
}

float blendOf(const formats::ClusterMechanics& m, std::span<const formats::CurvePoint> curve, const Matrix3f& a,
              const Matrix3f& r) {
  const float phi = a.squaredNorm();
  switch (m.limit) {
    case formats::LimitMethod::frobenius:
      return phi > m.norm_max ? gammaFor(a, r, m.norm_max) : 1;
    case formats::LimitMethod::frobenius_cheap:
      return phi > m.norm_max ? m.norm_max / phi : 1;
    case formats::LimitMethod::soft:
      if (!(phi > m.norm_max)) return 1;
      return gammaFor(a, r, m.norm_limit - m.norm_max / phi * (m.norm_limit - m.norm_max));
    case formats::LimitMethod::curve:
      return phi > curve.front().norm ? gammaFor(a, r, responseOf(curve, phi)) : 1;
    case formats::LimitMethod::none:
    case formats::LimitMethod::rows:
    case formats::LimitMethod::principal:
      break;
  }
  return 1;
}

}  // namespace sinew::internal

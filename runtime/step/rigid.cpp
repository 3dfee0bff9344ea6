// SPDX-License-Identifier: MIT
#include "runtime/step/rigid.h"

#include <Eigen/Geometry>
#include <cmath>

#include "runtime/geometry/rotation.h"

namespace sinew::internal {

Matrix3d turnBy(const Vector3d& angle) {
  const double length = angle.norm();
  return length > 0 ? Eigen::AngleAxisd(length, angle / length).toRotationMatrix() : Matrix3d::Identity();
}

Vector3d meanOf(const Field& field, const ConstCoefficientMap& z) {
  // Even and odd functions apart: sums do not wait for one another.
  Vector3d even = Vector3d::Zero(), odd = even;
  std::uint32_t j = 0;
  for (; j + 1 < field.k; j += 2) {
    even += field.oneOf(j) * z.row(j).transpose();
    odd += field.oneOf(j + 1) * z.row(j + 1).transpose();
  }
  if (j < field.k) even += field.oneOf(j) * z.row(j).transpose();
  return (even + odd) / field.ones;
}

Vector3d angularMomentum(const Field& field, const ConstCoefficientMap& z, const ConstCoefficientMap& v,
                         const Vector3d& center, const Vector3d& velocity) {
  Vector3d sum = Vector3d::Zero();
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const Vector3d arm = z.row(j).transpose() - field.oneOf(j) * center;
    sum += arm.cross(Vector3d(v.row(j).transpose() - field.oneOf(j) * velocity));
  }
  return sum;
}

Matrix3d inertiaOf(const Field& field, const ConstCoefficientMap& z, const Vector3d& center) {
  // Six sums that stay in registers.
  double xx = 0, yy = 0, zz = 0, xy = 0, yz = 0, zx = 0;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const double one = field.oneOf(j);
    const double x = z(j, 0) - one * center[0], y = z(j, 1) - one * center[1], t = z(j, 2) - one * center[2];
    xx += x * x;
    yy += y * y;
    zz += t * t;
    xy += x * y;
    yz += y * t;
    zx += t * x;
  }
  Matrix3d moment;
  moment << xx, xy, zx, xy, yy, yz, zx, yz, zz;
  return inertiaFrom(moment);
}

Vector3d solved(const Matrix3d& a, const Vector3d& b) {
  const Matrix3d inverse = a.inverse();
  const Vector3d x = inverse * b;
  return x.allFinite() ? x : Vector3d::Zero();
}

Matrix3d rotationOf(const Field& field, const ConstCoefficientMap& z, const Vector3d& center) {
  Matrix3d sum = Matrix3d::Zero();
  for (std::uint32_t j = 0; j < field.k; ++j) {
    sum += Vector3d(z.row(j).transpose() - field.oneOf(j) * center) *
           (field.restOf(j) - field.oneOf(j) * field.rest_center).transpose();
  }
  return geometry::nearestRotation(sum);
}

}  // namespace sinew::internal

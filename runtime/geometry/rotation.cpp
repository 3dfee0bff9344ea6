// SPDX-License-Identifier: MIT
#include "runtime/geometry/rotation.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "runtime/geometry/pseudo_inverse.h"

namespace sinew::geometry {
namespace {

// The leading eigenvector of a traceless symmetric K, where its eigenvalue is well apart from the others: Newton's
// method on the characteristic polynomial, from above, where it is monotone (Horn 1987 §5; Shuster and Oh 1981), and
// the null space as a column of the inverse beside the eigenvalue. \return false: it is not.
bool leadingEigenvector(const Eigen::Matrix4d& k, const Quaternion& previous, Quaternion& q) {
  constexpr double kApart = 1e-3, kBeside = 1e-11, kSettled = 1e-14;
  const Eigen::Matrix4d squared = k * k;
  const double c2 = -0.5 * squared.trace(), c1 = -(squared.cwiseProduct(k)).sum() / 3, c0 = k.determinant();
  // Of eigenvalues that add up to 0 none is larger than this.
  double value = std::sqrt(0.75 * squared.trace()), slope = 0;
  bool found = false;
  for (int round = 0; round < 20 && !found; ++round) {
    const double square = value * value;
    slope = (4 * square + 2 * c2) * value + c1;
    if (!(slope > 0)) return false;
    const double step = ((square + c2) * square + c1 * value + c0) / slope;
    value -= step;
    found = std::abs(step) <= kSettled * value;
  }
  // The slope is the product of the distances to the other eigenvalues.
  if (!found || !(slope > kApart * value * value * value)) return false;
  const Eigen::Matrix4d inverse = (k - (1 + kBeside) * value * Eigen::Matrix4d::Identity()).inverse();
  Eigen::Index column = 0;
  inverse.diagonal().cwiseAbs().maxCoeff(&column);
  Eigen::Vector4d vector = inverse.col(column).normalized();
  if (!vector.allFinite()) return false;
  double along = 0;
  for (int j = 0; j < 4; ++j) along += vector[j] * double(previous[std::size_t(j)]);
  if (along < 0) vector = -vector;
  for (int j = 0; j < 4; ++j) q[std::size_t(j)] = float(vector[j]);
  return true;
}

// The nearest rotation as the leading eigenvector of Horn's 4x4 matrix K (Horn 1987, eq. 31: tr(R^T A) = q^T K q),
// in double. Where the leading eigenvalue is multiple (a collapsed or mirrored A) every vector of its eigenspace is
// equally near: the one closest to the previous quaternion is taken, so that R stays continuous in time.
Quaternion nearestRotationByEigenvectors(const Eigen::Matrix3d& a, const Quaternion& previous) {
  Eigen::Matrix4d k;
  k << a.trace(), a(2, 1) - a(1, 2), a(0, 2) - a(2, 0), a(1, 0) - a(0, 1),                   //
      a(2, 1) - a(1, 2), a(0, 0) - a(1, 1) - a(2, 2), a(0, 1) + a(1, 0), a(0, 2) + a(2, 0),  //
      a(0, 2) - a(2, 0), a(0, 1) + a(1, 0), a(1, 1) - a(0, 0) - a(2, 2), a(1, 2) + a(2, 1),  //
      a(1, 0) - a(0, 1), a(0, 2) + a(2, 0), a(1, 2) + a(2, 1), a(2, 2) - a(0, 0) - a(1, 1);
  Quaternion simple;
  if (leadingEigenvector(k, previous, simple)) return simple;
  Eigen::Vector4d values;  // ascending
  Eigen::Matrix4d vectors;
  symmetricEigen(viewOf(std::as_const(k)), {values.data(), 4}, viewOf(vectors));
  const double tie =
      2e-6 * std::max(std::abs(values[0]), std::abs(values[3]));  // a few times the rounding of a float A
  Eigen::Vector4d before, q = Eigen::Vector4d::Zero();
  for (int j = 0; j < 4; ++j) before[j] = double(previous[std::size_t(j)]);
  for (int i = 3; i >= 0 && values[i] >= values[3] - tie; --i) {
    const double along = vectors.col(i).dot(before);
    for (int j = 0; j < 4; ++j) q[j] += vectors(j, i) * along;
  }
  if (!(q.squaredNorm() > 1e-6)) q = vectors.col(3);  // the previous rotation is as far off as can be
  q.normalize();
  if (q.dot(before) < 0) q = -q;
  return {float(q[0]), float(q[1]), float(q[2]), float(q[3])};
}

}  // namespace

Eigen::Matrix3f rotationMatrix(const Quaternion& q) {
  const float w = q[0], x = q[1], y = q[2], z = q[3];
  Eigen::Matrix3f r;  // written entry by entry: Eigen's comma is a call each where code is compiled to be small
  r(0, 0) = 1 - 2 * (y * y + z * z);
  r(0, 1) = 2 * (x * y - w * z);
  r(0, 2) = 2 * (x * z + w * y);
  r(1, 0) = 2 * (x * y + w * z);
  r(1, 1) = 1 - 2 * (x * x + z * z);
  r(1, 2) = 2 * (y * z - w * x);
  r(2, 0) = 2 * (x * z - w * y);
  r(2, 1) = 2 * (y * z + w * x);
  r(2, 2) = 1 - 2 * (x * x + y * y);
  return r;
}

void nearestRotation(const Eigen::Matrix3f& a, Quaternion& q) {
  const float scale = a.cwiseAbs().maxCoeff();
  if (!(scale > 0) || !(scale <= std::numeric_limits<float>::max()) || a.hasNaN()) return;
  const Eigen::Matrix3f b = a * (1.0F / scale);
  if (!(scale >= std::numeric_limits<float>::min())) {  // 1/scale may overflow
    q = nearestRotationByEigenvectors(a.cast<double>() / double(scale), q);
    return;
  }
  constexpr float kDefinite =
      1e-2F;                     // least pivot of J that Newton is trusted with, relative to the largest entry of a
  constexpr float kNear = 1.0F;  // largest step, radians
  Quaternion iterate = q;
  for (int iteration = 0; iteration < 6; ++iteration) {
    const Eigen::Matrix3f c = rotationMatrix(iterate).transpose() * b;
    const Eigen::Vector3f gradient(c(2, 1) - c(1, 2), c(0, 2) - c(2, 0), c(1, 0) - c(0, 1));
    const float j00 = c(1, 1) + c(2, 2), j11 = c(0, 0) + c(2, 2), j22 = c(0, 0) + c(1, 1);
    const float j01 = -0.5F * (c(0, 1) + c(1, 0)), j02 = -0.5F * (c(0, 2) + c(2, 0)), j12 = -0.5F * (c(1, 2) + c(2, 1));
    // J = L D L^T; its pivots tell whether this is the neighbourhood of the maximum.
    const float d0 = j00;
    if (!(d0 > kDefinite)) break;
    const float l10 = j01 / d0, l20 = j02 / d0;
    const float d1 = j11 - l10 * j01;
    if (!(d1 > kDefinite)) break;
    const float l21 = (j12 - l20 * j01) / d1;
    const float d2 = j22 - l20 * j02 - l21 * l21 * d1;
    if (!(d2 > kDefinite)) break;
    const float y1 = gradient[1] - l10 * gradient[0];
    const float y2 = gradient[2] - l20 * gradient[0] - l21 * y1;
    Eigen::Vector3f step;
    step[2] = y2 / d2;
    step[1] = y1 / d1 - l21 * step[2];
    step[0] = gradient[0] / d0 - l10 * step[1] - l20 * step[2];
    const float length2 = step.squaredNorm();
    if (!(length2 < kNear * kNear)) break;
    // iterate * (1, step/2), normalized: the Cayley map, exact to third order.
    const float w = iterate[0], x = iterate[1], y = iterate[2], z = iterate[3];
    const Eigen::Vector3f s = 0.5F * step;
    Quaternion next = {w - x * s[0] - y * s[1] - z * s[2], x + w * s[0] + y * s[2] - z * s[1],
                       y + w * s[1] + z * s[0] - x * s[2], z + w * s[2] + x * s[1] - y * s[0]};
    const float inverse =
        1.0F / std::sqrt(next[0] * next[0] + next[1] * next[1] + next[2] * next[2] + next[3] * next[3]);
    for (float& component : next) component *= inverse;
    iterate = next;
    if (length2 < 1e-6F) {  // the step after this one would be about length^2: below rounding
      q = iterate;
      return;
    }
  }
  q = nearestRotationByEigenvectors(b.cast<double>(), q);
}

Eigen::Matrix3f nearestRotation(const Eigen::Matrix3f& a) {
  Quaternion q = kIdentityQuaternion;
  nearestRotation(a, q);
  return rotationMatrix(q);
}

Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& a) {
  const double scale = a.cwiseAbs().maxCoeff();
  if (!(scale > 0) || !std::isfinite(scale)) return Eigen::Matrix3d::Identity();
  Quaternion q = kIdentityQuaternion;
  nearestRotation(Eigen::Matrix3f((a / scale).cast<float>()), q);
  return Eigen::Quaterniond(double(q[0]), double(q[1]), double(q[2]), double(q[3])).normalized().toRotationMatrix();
}

}  // namespace sinew::geometry

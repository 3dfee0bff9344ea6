// SPDX-License-Identifier: MIT
#include "runtime/clusters/goal.h"

#include <Eigen/LU>

#include "runtime/geometry/svd3.h"

namespace sinew::internal {
namespace {

// True when all singular values of a surely lie within the guard; cheap, so that the SVD stays off the usual path.
bool surelyInsideGuard(const Matrix3& a) {
  const float norm2 = a.squaredNorm();  // >= sigma_max², and sigma_1 sigma_2 <= norm2 / 2
  return norm2 <= kLargestStretch * kLargestStretch && a.determinant() >= 0.5F * kLeastStretch * norm2;
}

// Turns F so that the match exerts no torque: A_pq F^T becomes symmetric.
template <int N>
void removeTorque(Columns<N>& f, const Columns<N>& a_pq) {
  const Matrix3 turn = geometry::nearestRotation(a_pq * f.transpose());
  f = (turn * f).eval();
}

// Eq. 10: clamps the stretches of F's linear block, then takes the torque out again.
template <int N>
bool limitStretch(Columns<N>& f, const Columns<N>& a_pq) {
  const Matrix3 linear = f.template leftCols<3>();
  if (surelyInsideGuard(linear) || !linear.allFinite()) return false;
  const geometry::RotationSvd svd = geometry::rotationSvd(linear);
  const Vector3 sigma = svd.sigma.cwiseMax(kLeastStretch).cwiseMin(kLargestStretch);
  if (sigma == svd.sigma) return false;
  f.template leftCols<3>() = svd.u * sigma.asDiagonal() * svd.v.transpose();
  if constexpr (N == 9) {
    // Bends beyond the guard fold the cluster over although its linear block is sound.
    f.template rightCols<6>() = f.template rightCols<6>().cwiseMax(-kLargestStretch).cwiseMin(kLargestStretch);
  }
  removeTorque<N>(f, a_pq);
  return true;
}

template <int N>
void update(const ClusterRest& rest, const ClusterStiffness& stiffness, ClusterFrame& frame) {
  const auto a_pq = frame.a_pq.leftCols<N>();
  geometry::nearestRotation(a_pq.template leftCols<3>(), frame.rotation);
  const Matrix3 r = geometry::rotationMatrix(frame.rotation);
  Columns<N> f = Columns<N>::Zero();
  f.template leftCols<3>() = r;
  frame.limited = false;
  if (stiffness.deforms) {
    const Columns<N> deviation = a_pq - r * rest.moment.leftCols<N>();
    f.noalias() += deviation * stiffness.s.topLeftCorner<N, N>();
    frame.limited = limitStretch<N>(f, a_pq);
    // Where the classes of modes differ in stiffness, S mixes them and the deviation turns the cluster by itself: in a
    // C-shaped cluster that grew without bound out of nothing (a ring of four, stretch 12 Hz, bend 6 Hz). Turned back,
    // the match is symmetric in the mass norm and never lengthens a deviation.
    if (stiffness.mixes_classes && !frame.limited) removeTorque<N>(f, Columns<N>(a_pq));
  }
  frame.f.leftCols<N>() = f;
}

}  // namespace

void updateFrame(const formats::Cluster& cluster, const ClusterRest& rest, const ClusterStiffness& stiffness,
                 ClusterFrame& frame) {
  if (cluster.mode == formats::ClusterMode::quadratic) {
    update<9>(rest, stiffness, frame);
  } else {
    update<3>(rest, stiffness, frame);
  }
}

}  // namespace sinew::internal

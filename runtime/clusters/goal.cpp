// SPDX-License-Identifier: MIT
#include "runtime/clusters/goal.h"

#include <Eigen/LU>
#include <cmath>

namespace sinew::internal {
namespace {

// A cluster has lost its orientation where what resists a turn of R falls below this part of the rest shape's.
constexpr float kLostResistance = 0.3F;

// Eq. 11: turns F so that the match exerts no torque: A_pq F^T becomes symmetric.
template <int N>
void removeTorque(Columns<N>& f, const Columns<N>& a_pq) {
  const Matrix3 turn = geometry::nearestRotation(a_pq * f.transpose());
  f = (turn * f).eval();
}

// Eq. 5, 8: [R S 0] plus the elastic answer to A_pq - R S M, with S the rest shape's own deformation.
template <int N>
Columns<N> deform(const Matrix3& r, const Columns<N>& a_pq, const ClusterRest& rest, const ClusterStiffness& stiffness,
                  const MatchExtras& extras) {
  const Matrix3 rest_linear = extras.shape != nullptr ? Matrix3(r * *extras.shape) : r;
  Columns<N> f = Columns<N>::Zero();
  f.template leftCols<3>() = rest_linear;
  if (!stiffness.deforms) return f;
  Columns<N> deviation = a_pq - rest_linear * rest.moment.leftCols<N>();
  // Implicit damping: what was left of the deformation a pass ago pulls towards itself (eq. 8d).
  if (extras.previous != nullptr) deviation += extras.damping_passes * (r * extras.previous->leftCols<N>());
  if (extras.modes != nullptr) {
    const Columns<N> local = r.transpose() * deviation;
    constexpr int kCount = 3 * N;
    const auto vectors = extras.modes->vectors.topLeftCorner<kCount, kCount>();
    const Eigen::Map<const Eigen::Matrix<float, kCount, 1>> flat(local.data());
    const Eigen::Matrix<float, kCount, 1> amplitude =
        (vectors.transpose() * flat).cwiseProduct(extras.kept->head<kCount>());
    const Eigen::Matrix<float, kCount, 1> answer = vectors * amplitude;
    f += r * Eigen::Map<const Columns<N>>(answer.data());
    return f;
  }
  f.noalias() += deviation * stiffness.s.topLeftCorner<N, N>();
  return f;
}

// Whether the moments no longer say how the cluster is turned: J = tr(S) 1 - S, S = sym(R^T A_pq), the curvature of
// tr(R^T A_pq) at its maximum, is not above kLostResistance of its rest value in every direction (Sylvester's minors).
// Directions that the rest shape lacks as well do not count.
bool orientationIsLost(const Matrix3& r, const Matrix3& a_pq, const Matrix3& moment) {
  const float trace = moment.trace();
  if (!(trace > 0)) return false;
  const Matrix3 c = r.transpose() * a_pq;
  const Matrix3 s = 0.5F * (c + c.transpose());
  const Matrix3 margin =
      (s.trace() - kLostResistance * trace + 1e-3F * trace) * Matrix3::Identity() - (s - kLostResistance * moment);
  return !(margin(0, 0) > 0 && margin(0, 0) * margin(1, 1) - margin(0, 1) * margin(1, 0) > 0 &&
           margin.determinant() > 0);
}

template <int N>
void update(const ClusterRest& rest, const ClusterStiffness& stiffness, const MatchExtras& extras,
            ClusterFrame& frame) {
  const Columns<N> a_pq = frame.a_pq.leftCols<N>();
  // Of the deformed rest shape S q: R is nearest to A_pq S^T.
  const Matrix3 towards = extras.shape != nullptr ? Matrix3(a_pq.template leftCols<3>() * extras.shape->transpose())
                                                  : Matrix3(a_pq.template leftCols<3>());
  const Matrix3 moment = extras.shape != nullptr
                             ? Matrix3(*extras.shape * rest.moment.template leftCols<3>() * extras.shape->transpose())
                             : Matrix3(rest.moment.template leftCols<3>());
  geometry::nearestRotation(towards, frame.rotation);
  Matrix3 r = geometry::rotationMatrix(frame.rotation);
  const bool lost = orientationIsLost(r, towards, moment);
  if (lost) {
    // Neighbours that guess differently would tangle for good (a ring of four, scattered, came to rest inside out), so
    // all that are lost take the part's rotation.
    frame.rotation = frame.part_rotation;
    r = geometry::rotationMatrix(frame.rotation);
  }
  Columns<N> f = deform<N>(r, a_pq, rest, stiffness, extras);
  static const GoalLimits kGuardOnly{
      formats::LimitMethod::none, formats::VolumeMethod::none, kLeastStretch, kLargestStretch, 0, 0, 0, {}};
  Limited limited = Limited::nothing;
  if (stiffness.deforms) {
    limited = applyGoalLimits<N>(extras.limits != nullptr ? *extras.limits : kGuardOnly, r, extras.shape, f);
  }
  frame.limited = limited == Limited::guarded || lost;
  // Where the classes of modes differ in stiffness, S mixes them and the deviation turns the cluster by itself: in a
  // C-shaped cluster that grew without bound out of nothing (a ring of four, stretch 12 Hz, bend 6 Hz). Turned back,
  // the match is symmetric in the mass norm and never lengthens a deviation.
  if (!lost && (limited != Limited::nothing || stiffness.mixes_classes)) removeTorque<N>(f, a_pq);
  frame.f.leftCols<N>() = f;
}

}  // namespace

void updatePartRotation(const formats::PackageView& package, std::uint32_t first, std::uint32_t count,
                        std::span<ClusterFrame> frames) {
  if (count == 0) return;
  const auto clusters = package.clusters().subspan(first, count);
  const auto members = frames.subspan(first, count);
  // Σ m p q^T of the part, put together from its clusters; relative to the first one's centres.
  double mass = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), rest_center = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (std::size_t c = 0; c < count; ++c) {
    const double m = double(clusters[c].mass), radius = double(clusters[c].radius);
    const Eigen::Vector3d at = (members[c].center - members[0].center).cast<double>();
    const Eigen::Vector3d rest = (asVector(clusters[c].rest_center) - asVector(clusters[0].rest_center)).cast<double>();
    mass += m;
    center += m * at;
    rest_center += m * rest;
    moment += m * (at * rest.transpose() + radius * radius * members[c].a_pq.leftCols<3>().cast<double>());
  }
  moment -= center * rest_center.transpose() / mass;
  const double scale = moment.cwiseAbs().maxCoeff();
  geometry::Quaternion rotation = members[0].part_rotation;
  if (scale > 0 && std::isfinite(scale)) geometry::nearestRotation((moment / scale).cast<float>(), rotation);
  for (ClusterFrame& frame : members) frame.part_rotation = rotation;
}

void updateFrame(const formats::Cluster& cluster, const ClusterRest& rest, const ClusterStiffness& stiffness,
                 const MatchExtras& extras, ClusterFrame& frame) {
  if (cluster.mode == formats::ClusterMode::quadratic) {
    update<9>(rest, stiffness, extras, frame);
  } else {
    update<3>(rest, stiffness, extras, frame);
  }
}

}  // namespace sinew::internal

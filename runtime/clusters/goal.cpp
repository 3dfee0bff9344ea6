// SPDX-License-Identifier: MIT
#include "runtime/clusters/goal.h"

#include <Eigen/LU>
#include <cmath>

#include "runtime/geometry/svd3.h"

namespace sinew::internal {
namespace {

// A cluster has lost its orientation where what resists a turn of R falls below this part of the rest shape's.
constexpr float kLostResistance = 0.3F;

// A part is astray where it is this far from its rest shape (root mean square), in radii of gyration. Flattened to a
// plane a cube has 0.58, bent to a quarter circle a bar 0.25.
const double kAstray = getenv("KA") ? atof(getenv("KA")) : 0.5;

// True when all singular values of a surely lie within the guard; cheap, so that the SVD stays off the usual path.
bool surelyInsideGuard(const Matrix3& a) {
  const float norm2 = a.squaredNorm();  // >= sigma_max², and sigma_1 sigma_2 <= norm2 / 2
  return norm2 <= kLargestStretch * kLargestStretch && a.determinant() >= 0.5F * kLeastStretch * norm2;
}

// Eq. 11: turns F so that the match exerts no torque: A_pq F^T becomes symmetric.
template <int N>
void removeTorque(Columns<N>& f, const Columns<N>& a_pq) {
  const Matrix3 turn = geometry::nearestRotation(a_pq * f.transpose());
  f = (turn * f).eval();
}

// Eq. 10: clamps the stretches of F's linear block and what bends fold over although the linear block is sound.
template <int N>
bool limitStretch(Columns<N>& f) {
  const Matrix3 linear = f.template leftCols<3>();
  if (surelyInsideGuard(linear) || !linear.allFinite()) return false;
  const geometry::RotationSvd svd = geometry::rotationSvd(linear);
  const Vector3 sigma = svd.sigma.cwiseMax(kLeastStretch).cwiseMin(kLargestStretch);
  if (sigma == svd.sigma) return false;
  f.template leftCols<3>() = svd.u * sigma.asDiagonal() * svd.v.transpose();
  if constexpr (N == 9) {
    f.template rightCols<6>() = f.template rightCols<6>().cwiseMax(-kLargestStretch).cwiseMin(kLargestStretch);
  }
  return true;
}

// Eq. 5, 8.
template <int N>
Columns<N> deform(const Matrix3& r, const Columns<N>& a_pq, const ClusterRest& rest,
                  const ClusterStiffness& stiffness) {
  Columns<N> f = Columns<N>::Zero();
  f.template leftCols<3>() = r;
  if (stiffness.deforms) {
    const Columns<N> deviation = a_pq - r * rest.moment.leftCols<N>();
    f.noalias() += deviation * stiffness.s.topLeftCorner<N, N>();
  }
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

// A pass in which a deformation of this cluster keeps less than half of itself puts vertices where they belong at once.
bool isStiff(const ClusterStiffness& stiffness) { return stiffness.kept < 0.5F; }

template <int N>
void update(const ClusterRest& rest, const ClusterStiffness& stiffness, ClusterFrame& frame) {
  const Columns<N> a_pq = frame.a_pq.leftCols<N>();
  geometry::nearestRotation(a_pq.template leftCols<3>(), frame.rotation);
  Matrix3 r = geometry::rotationMatrix(frame.rotation);
  const bool lost = frame.part_astray || orientationIsLost(r, a_pq.template leftCols<3>(), rest.moment.leftCols<3>());
  if (lost) {
    // Neighbours that guess differently would tangle for good (a ring of four, scattered, came to rest inside out), so
    // all that are lost take the part's rotation.
    frame.rotation = frame.part_rotation;
    r = geometry::rotationMatrix(frame.rotation);
  }
  Columns<N> f = deform<N>(r, a_pq, rest, stiffness);
  if (frame.part_astray) frame.center += (1.0F - stiffness.kept) * (frame.part_center - frame.center);
  frame.limited = (stiffness.deforms && limitStretch<N>(f)) || (lost && isStiff(stiffness));
  // Where the classes of modes differ in stiffness, S mixes them and the deviation turns the cluster by itself: in a
  // C-shaped cluster that grew without bound out of nothing (a ring of four, stretch 12 Hz, bend 6 Hz). Turned back,
  // the match is symmetric in the mass norm and never lengthens a deviation.
  if (!lost && (frame.limited || stiffness.mixes_classes)) removeTorque<N>(f, a_pq);
  frame.f.leftCols<N>() = f;
}

}  // namespace

void updatePartPose(const formats::PackageView& package, const RestConstants& constants, std::uint32_t first,
                    std::uint32_t count, std::span<ClusterFrame> frames) {
  if (count == 0) return;
  const auto clusters = package.clusters().subspan(first, count);
  const auto members = frames.subspan(first, count);
  const std::span<const ClusterRest> rest = std::span(constants.clusters).subspan(first, count);
  // Σ m p q^T of the part, put together from its clusters; relative to the first one's centres.
  double mass = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), rest_center = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (std::size_t c = 0; c < count; ++c) {
    const double m = double(clusters[c].mass), radius = double(clusters[c].radius);
    const Eigen::Vector3d at = (members[c].center - members[0].center).cast<double>();
    const Eigen::Vector3d rest_at =
        (asVector(clusters[c].rest_center) - asVector(clusters[0].rest_center)).cast<double>();
    mass += m;
    center += m * at;
    rest_center += m * rest_at;
    moment += m * (at * rest_at.transpose() + radius * radius * members[c].a_pq.leftCols<3>().cast<double>());
  }
  moment -= center * rest_center.transpose() / mass;
  center /= mass;
  rest_center /= mass;
  const double scale = moment.cwiseAbs().maxCoeff();
  geometry::Quaternion rotation = members[0].part_rotation;
  if (scale > 0 && std::isfinite(scale)) geometry::nearestRotation((moment / scale).cast<float>(), rotation);
  // How far the part is from its rest shape, best rigid motion removed: mean squares over its mass, of the moments.
  const Eigen::Matrix3d r = geometry::rotationMatrix(rotation).cast<double>();
  double deviation = 0, spread = 0;
  for (std::size_t c = 0; c < count; ++c) {
    const double m = double(clusters[c].mass), radius = double(clusters[c].radius);
    const Eigen::Matrix3d rest_moment = rest[c].moment.leftCols<3>().cast<double>();
    const Eigen::Vector3d rest_arm =
        (asVector(clusters[c].rest_center) - asVector(clusters[0].rest_center)).cast<double>() - rest_center;
    const Eigen::Vector3d arm = (members[c].center - members[0].center).cast<double>() - center;
    const Eigen::Matrix3d off = members[c].a_pq.leftCols<3>().cast<double>() - r * rest_moment;
    const double own_spread = rest_moment.trace();
    spread += m * (rest_arm.squaredNorm() + radius * radius * own_spread);
    // |A - R|² in the mass norm is at least |A_pq - R M|² / tr M.
    deviation += m * (arm - r * rest_arm).squaredNorm();
    if (own_spread > 0) deviation += m * radius * radius * off.squaredNorm() / own_spread;
    members[c].part_center = members[0].center + (center + r * rest_arm).cast<float>();
  }
  const bool astray = count > 1 && deviation > kAstray * kAstray * spread;
  for (ClusterFrame& frame : members) {
    frame.part_rotation = rotation;
    frame.part_astray = astray;
  }
}

void updateFrame(const formats::Cluster& cluster, const ClusterRest& rest, const ClusterStiffness& stiffness,
                 ClusterFrame& frame) {
  if (cluster.mode == formats::ClusterMode::quadratic) {
    update<9>(rest, stiffness, frame);
  } else {
    update<3>(rest, stiffness, frame);
  }
}

}  // namespace sinew::internal

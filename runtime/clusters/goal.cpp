// SPDX-License-Identifier: MIT
#include "runtime/clusters/goal.h"

#include <cmath>

namespace sinew::internal {

bool updatePartPose(const formats::PackageView& package, const RestConstants& constants,
                    std::span<const ClusterStiffness> stiffness, std::uint32_t first, std::uint32_t count,
                    std::span<ClusterBlock> blocks, double far) {
  if (count == 0) return false;
  const auto clusters = package.clusters().subspan(first, count);
  const auto component = [&](const float(&values)[8], std::size_t c) { return values[(first + c) % 8]; };
  const auto block = [&](std::size_t c) -> ClusterBlock& { return blocks[(first + c) / 8]; };
  const auto centerOf = [&](std::size_t c) {
    const ClusterBlock& b = block(c);
    return Vector3(component(b.center[0], c), component(b.center[1], c), component(b.center[2], c));
  };
  const auto restAt = [&](std::size_t c) -> Eigen::Vector3d {
    return (asVector(clusters[c].rest_center) - asVector(clusters[0].rest_center)).cast<double>();
  };
  const auto momentOf = [&](std::size_t c) {
    Eigen::Matrix3d a_pq;
    for (int k = 0; k < 9; ++k) a_pq.data()[k] = double(component(block(c).a_pq[k], c));
    return a_pq;
  };
  // Σ m p q^T of the part, put together from its clusters; relative to the first one's centres.
  const Vector3 reference = centerOf(0);
  double mass = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), rest_center = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (std::size_t c = 0; c < count; ++c) {
    const double m = double(clusters[c].mass), radius = double(clusters[c].radius);
    const Eigen::Vector3d at = (centerOf(c) - reference).cast<double>();
    mass += m;
    center += m * at;
    rest_center += m * restAt(c);
    moment += m * (at * restAt(c).transpose() + radius * radius * momentOf(c));
  }
  moment -= center * rest_center.transpose() / mass;
  const double scale = moment.cwiseAbs().maxCoeff();
  geometry::Quaternion rotation;
  for (std::size_t k = 0; k < 4; ++k) rotation[k] = component(block(0).part_rotation[k], 0);
  if (scale > 0 && std::isfinite(scale)) geometry::nearestRotation((moment / scale).cast<float>(), rotation);
  center /= mass;
  rest_center /= mass;
  // How far the part is from its rest shape, best rigid motion removed, from the moments: |A - R|² in the mass norm is
  // at least |A_pq - R M|² / tr M.
  const Eigen::Matrix3d r = geometry::rotationMatrix(rotation).cast<double>();
  double deviation = 0, spread = 0;
  for (std::size_t c = 0; c < count; ++c) {
    const double m = double(clusters[c].mass), radius = double(clusters[c].radius);
    const Eigen::Matrix3d rest_moment = constants.clusters[first + c].moment.leftCols<3>().cast<double>();
    const Eigen::Vector3d rest_arm = restAt(c) - rest_center;
    const Eigen::Vector3d arm = (centerOf(c) - reference).cast<double>() - center;
    const double own_spread = rest_moment.trace();
    spread += m * (rest_arm.squaredNorm() + radius * radius * own_spread);
    deviation += m * (arm - r * rest_arm).squaredNorm();
    if (own_spread > 0) deviation += m * radius * radius * (momentOf(c) - r * rest_moment).squaredNorm() / own_spread;
  }
  bool astray = count > 1 && deviation > far * far * spread;
  if (astray && far >= kAstray) {
    // A rope on a heap is far from its rest shape too, but piece by piece it is only bent.
    double own_deviation = 0, own_spread = 0;
    for (std::size_t c = 0; c < count; ++c) {
      const double m = double(clusters[c].mass) * double(clusters[c].radius) * double(clusters[c].radius);
      const Eigen::Matrix3d rest_moment = constants.clusters[first + c].moment.leftCols<3>().cast<double>();
      const Eigen::Matrix3d own = momentOf(c);
      const double trace = rest_moment.trace(), size = own.cwiseAbs().maxCoeff();
      if (!(trace > 0)) continue;
      Eigen::Matrix3d turned = Eigen::Matrix3d::Identity();
      if (size > 0 && std::isfinite(size)) {
        turned = geometry::nearestRotation(Eigen::Matrix3f((own / size).cast<float>())).cast<double>();
      }
      own_spread += m * trace;
      own_deviation += m * (own - turned * rest_moment).squaredNorm() / trace;
    }
    astray = !(own_deviation <= kDistorted * kDistorted * own_spread);
  }
  for (std::size_t c = 0; c < count; ++c) {
    const std::size_t lane = (first + c) % 8;
    for (std::size_t k = 0; k < 4; ++k) block(c).part_rotation[k][lane] = rotation[k];
    block(c).astray[lane] = astray ? -1 : 0;
    if (!astray) continue;
    const Vector3 goal = reference + (center + r * (restAt(c) - rest_center)).cast<float>();
    const float kept = stiffness.empty() ? 0.0F : stiffness[first + c].kept;
    const Vector3 moved = centerOf(c) + (1.0F - kept) * (goal - centerOf(c));
    for (int k = 0; k < 3; ++k) block(c).center[k][lane] = moved[k];
  }
  return astray;
}

}  // namespace sinew::internal

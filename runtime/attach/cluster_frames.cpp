// SPDX-License-Identifier: MIT
#include "runtime/attach/cluster_frames.h"

#include "runtime/geometry/rotation.h"

namespace sinew::internal {
namespace {

// A fitted frame of less volume than this, of the rest shape's, would give no normals: the rotation does then.
constexpr float kLeastVolume = 0.02F;

Monomials<9> coordinatesOf(const formats::Cluster& cluster, const ClusterRest& rest, const Vec3& rest_position) {
  return monomials<9>(restOffset(cluster, asVector(rest_position))) - rest.mean;
}

}  // namespace

ClusterFrame fitCluster(const formats::PackageView& package, std::span<const ClusterRest> rest,
                        std::span<const Vec3> positions, std::uint32_t index) {
  const formats::Cluster& cluster = package.clusters()[index];
  const ClusterRest& constants = rest[index];
  const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
  ClusterFrame frame;
  if (members.empty()) return frame;
  // Relative to a member, so that little is lost far from the origin.
  const Vector3 reference = asVector(positions[members[0].vertex]);
  Columns<9> a_pq = Columns<9>::Zero();
  for (const formats::Membership& member : members) {
    const Vector3 arm = asVector(positions[member.vertex]) - reference;
    frame.center += member.mu * arm;
    a_pq += (member.mu / cluster.radius * arm) *
            coordinatesOf(cluster, constants, package.physicalVertices()[member.vertex].rest_position).transpose();
  }
  frame.center += reference;
  const Matrix3 moment = a_pq.leftCols<3>();
  frame.rotation = geometry::nearestRotation(moment);
  frame.f.leftCols<3>() = frame.rotation;
  if (cluster.mode == formats::ClusterMode::rigid) return frame;
  const bool quadratic = cluster.mode == formats::ClusterMode::quadratic;
  if (!quadratic) a_pq.rightCols<6>().setZero();
  const Columns<9> fitted =
      frame.f + (a_pq - frame.rotation * constants.moment).lazyProduct(momentInverse(package, cluster)).eval();
  if (determinantOf(Matrix3(fitted.leftCols<3>())) > kLeastVolume && fitted.allFinite()) frame.f = fitted;
  return frame;
}

}  // namespace sinew::internal

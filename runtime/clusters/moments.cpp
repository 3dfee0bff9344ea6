// SPDX-License-Identifier: MIT
#include "runtime/clusters/moments.h"

namespace sinew::internal {
namespace {

template <int N>
void accumulate(const formats::Cluster& cluster, std::span<const formats::Membership> members,
                std::span<const formats::PhysicalVertex> vertices, const ClusterRest& rest, std::span<const Vec3> y,
                ClusterFrame& frame) {
  // Relative to a member, not to the world's origin: far from the origin the differences are what floats still hold.
  const Vector3 reference = asVector(y[members.front().vertex]);
  Vector3 offset = Vector3::Zero();
  for (const formats::Membership& member : members) offset += member.mu * (asVector(y[member.vertex]) - reference);
  const Vector3 center = reference + offset;

  Columns<N> a_pq = Columns<N>::Zero();
  const auto mean = rest.mean.head<N>();
  for (const formats::Membership& member : members) {
    const Vector3 p = asVector(y[member.vertex]) - center;
    const Monomials<N> q = monomials<N>(restOffset(cluster, asVector(vertices[member.vertex].rest_position))) - mean;
    a_pq.noalias() += (member.mu * p) * q.transpose();
  }
  frame.center = center;
  frame.a_pq.leftCols<N>() = a_pq / cluster.radius;
}

}  // namespace

void accumulateMoments(const formats::PackageView& package, const RestConstants& rest, std::uint32_t index,
                       std::span<const Vec3> y, ClusterFrame& frame) {
  const formats::Cluster& cluster = package.clusters()[index];
  const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
  if (cluster.mode == formats::ClusterMode::quadratic) {
    accumulate<9>(cluster, members, package.physicalVertices(), rest.clusters[index], y, frame);
  } else {
    accumulate<3>(cluster, members, package.physicalVertices(), rest.clusters[index], y, frame);
  }
}

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#include "runtime/load/rest_constants.h"

namespace sinew::internal {
namespace {

void addMoments(const formats::PackageView& package, const formats::Cluster& cluster, ClusterRest& rest) {
  const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
  MomentSums sums;
  for (const formats::Membership& member : members) {
    const Vector3 offset = restOffset(cluster, asVector(package.physicalVertices()[member.vertex].rest_position));
    sums.add(double(member.mu), monomials<9>(offset).cast<double>());
  }
  sums.finish();
  const int columns = cluster.mode == formats::ClusterMode::quadratic ? 9 : 3;
  for (int k = 0; k < columns; ++k) {
    rest.mean[k] = float(sums.mean[k]);
    for (int axis = 0; axis < 3; ++axis) rest.moment(axis, k) = float(sums.moment(axis, k));
  }
}

}  // namespace

RestConstants makeRestConstants(const formats::PackageView& package) {
  RestConstants result;
  result.fields = makeFields(package, result.driven_masses, result.field_stiffness, result.field_limits);
  for (const formats::DistanceGrid& grid : package.distanceGrids()) result.depths.emplace_back(package, grid);
  const auto clusters = package.clusters();
  const auto members = package.memberships();
  result.clusters.resize(clusters.size());
  for (std::size_t c = 0; c < clusters.size(); ++c) addMoments(package, clusters[c], result.clusters[c]);

  const std::size_t vertex_count = package.physicalVertices().size();
  result.first_use.resize(vertex_count + 1);
  for (const formats::Membership& member : members) ++result.first_use[member.vertex + 1];
  for (std::size_t i = 0; i < vertex_count; ++i) result.first_use[i + 1] += result.first_use[i];
  result.uses.resize(members.size());
  Array<std::uint32_t> next;
  next.assign(result.first_use);
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    for (const formats::Membership& member : members.subspan(clusters[c].first_member, clusters[c].member_count)) {
      result.uses[next[member.vertex]++] = {std::uint32_t(c), member.share};
    }
  }
  return result;
}

}  // namespace sinew::internal

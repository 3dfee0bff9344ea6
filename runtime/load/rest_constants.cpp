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
  makeFibres(package, {result.fields.data(), result.fields.size()}, result.fibres, result.fibre_matrices);
  for (const formats::DistanceGrid& grid : package.distanceGrids()) result.depths.emplace_back(package, grid);
  return result;
}

Array<ClusterRest> makeClusterConstants(const formats::PackageView& package) {
  Array<ClusterRest> result;
  const auto clusters = package.clusters();
  result.resize(clusters.size());
  for (std::size_t c = 0; c < clusters.size(); ++c) addMoments(package, clusters[c], result[c]);
  return result;
}

}  // namespace sinew::internal

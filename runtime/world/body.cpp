// SPDX-License-Identifier: MIT
#include "runtime/world/body.h"

#include "runtime/clusters/goal.h"
#include "runtime/clusters/moments.h"
#include "runtime/step/integrate.h"

namespace sinew::internal {

Body::Body(std::shared_ptr<const Asset> source, const BodySettings& body_settings)
    : asset(std::move(source)), settings(body_settings), mechanics(package(), rest().mechanics) {
  const std::size_t vertex_count = vertices().size(), cluster_count = package().clusters().size();
  x.resize(vertex_count);
  v.resize(vertex_count);
  y.resize(vertex_count);
  force.resize(vertex_count);
  pinned.resize(vertex_count);
  frames.resize(cluster_count);
  stiffness.resize(cluster_count);
  reset();
}

void Body::reset() {
  const Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>> rotation(settings.rotation.data());
  const Vector3 position = asVector(settings.position);
  for (std::size_t i = 0; i < x.size(); ++i) {
    x[i] = asArray(rotation * asVector(vertices()[i].rest_position) + position);
    v[i] = force[i] = {};
    pinned[i] = 0;
  }
  pins.clear();
  picks.clear();
  pin_sets.clear();
  fits.clear();
  fit_of.clear();
  mechanics.reset();
  rows.clear();
  repaired = 0;
  geometry::Quaternion start = geometry::kIdentityQuaternion;
  geometry::nearestRotation(rotation, start);
  for (ClusterFrame& frame : frames) frame.rotation = frame.part_rotation = start;
  matchPositions();
}

void Body::matchPositions() {
  // A lost vertex must not take its clusters along: it counts as being where they had wanted it.
  for (std::uint32_t i = 0; i < x.size(); ++i) y[i] = stateIsUsable(x[i], {}) ? x[i] : asArray(blendedGoal(*this, i));
  for (std::uint32_t c = 0; c < frames.size(); ++c) {
    accumulateMoments(package(), rest(), c, y, frames[c]);
    // No frequency: F = A shows the positions as they are.
    updateFrame(package().clusters()[c], rest().clusters[c], freeStiffness(package(), c), {}, frames[c]);
    frames[c].limited = false;
  }
  cofactors_fresh = false;
}

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#include "runtime/contact/collider.h"

#include <cmath>

#include "runtime/contact/firmness.h"
#include "runtime/interact/pin_sets.h"

namespace sinew::internal {

Pose::Pose(const RigidTransform& t) : position(asVector(t.position).cast<double>()) {
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = double(t.rotation[std::size_t(i)]);
}

Collider::Collider(std::uint32_t number, const ColliderShape& collider_shape, const ColliderSettings& given,
                   std::pmr::memory_resource* memory)
    : id(number), shape(collider_shape, memory), settings(given), before(given.at), at(given.at), target(given.at) {
  place();
}

void Collider::move(double share, double seconds) {
  before = at;
  const Vector3d way = (asVector(target.position) - asVector(at.position)).cast<double>();
  const double most = double(settings.most_speed) * seconds,
               part = most < share * way.norm() ? most / way.norm() : share;
  at = between(at, target, part);
  place();
}

void Collider::giveWay(const Vector3d& got, const Vector3d& turned, double seconds, double left) {
  const bool led = std::isfinite(settings.most_speed);
  if (!(settings.mass > 0) || !(led || moves())) return;
  const Vector3d speed = got / double(settings.mass);
  Vector3d spin = pose.rotation.transpose() * turned;
  for (int c = 0; c < 3; ++c) {
    const double moment = double(settings.inertia[std::size_t(c)]);
    spin[c] = moment > 0 ? spin[c] / moment : 0;
  }
  spin = pose.rotation * spin;
  const auto moveOn = [&](RigidTransform& t, double time) {
    asVector(t.position) += (time * speed).cast<float>();
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(time * spin.norm(), spin.stableNormalized()) * Pose(t).rotation;
    for (int i = 0; i < 9; ++i) t.rotation[std::size_t(i)] = float(turn(i / 3, i % 3));
  };
  moveOn(at, seconds);
  if (!led) moveOn(target, seconds + left);
  pose = Pose(at);
}

void Collider::goTo(const RigidTransform& was, const RigidTransform& now, const RigidTransform& later) {
  before = was;
  at = now;
  target = later;
  place();
}

void Collider::shift(const Eigen::Vector3f& by) {
  for (RigidTransform* t : {&before, &at, &target}) asVector(t->position) += by;
  place();
}

void Collider::place() {
  pose_before = Pose(before);
  pose = Pose(at);
  if (shape.isPlane()) {
    bounds_ = shape.bounds();
    return;
  }
  const Vector3d middle = shape.bounds().center(), half = 0.5 * shape.bounds().sizes();
  bounds_.setEmpty();
  for (const Pose* p : {&pose_before, &pose}) {
    const Vector3d reach = p->rotation.cwiseAbs() * half, there = p->toWorld(middle);
    bounds_.extend(Eigen::AlignedBox3d(there - reach, there + reach));
  }
}

bool Collider::moves() const { return before.rotation != at.rotation || before.position != at.position; }

bool Collider::takesAlong() const { return moves() || settings.surface_velocity != Vec3{}; }

double Collider::firmer() const { return settings.mass > 0 ? 1 : kFirmer; }

double Collider::inverseMassAt(const Vector3d& spot, const Vector3d& direction) const {
  if (!(settings.mass > 0)) return 0;
  const Vector3d lever = pose.rotation.transpose() * (spot - pose.position).cross(direction);
  double inverse = 1 / double(settings.mass);
  for (int c = 0; c < 3; ++c) {
    const double moment = double(settings.inertia[std::size_t(c)]);
    if (moment > 0) inverse += lever[c] * lever[c] / moment;
  }
  return inverse;
}

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// What a step leaves: places and velocities, momentum and energy kept, what bounces, pulls of what holds.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "runtime/interact/pin_sets.h"
#include "runtime/solver/plasticity.h"
#include "runtime/step/piece_step.h"
#include "runtime/step/rigid.h"

namespace sinew::internal {

void PieceStep::settle() {
  if (body_.settings.drag > 0) takeDrag();
  PieceState& state = piece_.state;
  state.z_before.swap(state.z);
  state.v_before.swap(state.v);
  CoefficientMap z = piece_.z(), v = piece_.v();
  for (std::uint32_t j = 0; j < k_; ++j) {
    const float* const d = s_.d.data() + 4 * j;
    const Vector3d moved = ahead_ * Vector3d(double(d[0]), double(d[1]), double(d[2]));
    state.z[j] = s_.prediction[j] + moved;
    state.v[j] = s_.predicted_velocity[j] + moved / effective_h_;
  }
  const Eigen::AngleAxisd turn(turn_);
  state.turn = turn.angle() * turn.axis();
  state.omega = rigid_.omega;
  const bool touched = !state.touching.empty();
  // Beside its weight and the air only contacts have changed the momentum, unless something holds the piece.
  Vector3d given = Vector3d::Zero();
  if (!s_.contacts.empty()) given = -(field_.mass * (meanOf(field_, std::as_const(piece_).v()) - rigid_velocity_));
  const bool held = springs_ || field_.driven > 0;
  const std::size_t first_touch = body_.touches.size();
  const double elastic_before = state.elastic;
  rememberContacts(piece_, contactStep(), center_, scratch_.contacts, effective_h_,
                   held || together_ ? nullptr : &given, objective_, body_.touches);
  // A two-step formula does not reach across contacts: it would gain energy where they come and go.
  state.h_before = touched || together_ || forced_ || !state.touching.empty() ? 0 : h_;
  state.leaning = false;
  // Momentum goes into the contacts of this step alone, even if they ceased to press within it: not into
  // earlier ones.
  const bool free = field_.driven == 0 && !springs_ && s_.contacts.empty() && !together_;
  state.elastic = value_.elastic;
  held || together_ ? state.endImpact() : rebound(v, first_touch, elastic_before);
  if (forced_) state.budget = -1;
  if (free) keepMomentum(z, v);
  keepEnergy(z, v, free);
  if (springs_ || field_.driven > 0) react();
  if (field_.plastic) becomePermanent();
}

void PieceStep::becomePermanent() {
  objective_.placeAt(s_.d.data(), s_.x.data());
  if (!flow(body_.package(), field_, s_.x.data(), h_, piece_.state.plastic)) return;
  invertPlasticity(piece_.state.plastic, piece_.rest_change);
  piece_.state.elastic = -1;
}

// Implicit Euler would have it fall g h^2 / 2 too far in each step: by the mean of its velocities it falls as it does
// at any other step length.
Vector3d PieceStep::centerAfter() const {
  const Vector3d center = center_ + dragged_;
  return two_step_ ? center : Vector3d(center - 0.5 * h_ * (rigid_velocity_ - rigid_.velocity));
}

void PieceStep::keepMomentum(CoefficientMap& z, CoefficientMap& v) const {
  const ConstCoefficientMap at(z.data(), z.rows(), 3), moving(v.data(), v.rows(), 3);
  const Vector3d center = centerAfter(), astray = meanOf(field_, at) - center;
  for (std::uint32_t j = 0; j < k_; ++j) z.row(j) -= (field_.oneOf(j) * astray).transpose();
  const Vector3d velocity = meanOf(field_, moving), lacking = rigid_velocity_ - velocity;
  // Angular momentum: what it was, less what the air took.
  Vector3d wanted = angularMomentumBefore() * std::exp(-double(settings_.damping) * h_);
  if (forced_) wanted += h_ * twist_;
  const Vector3d found = angularMomentum(field_, at, moving, center, velocity);
  const Vector3d turn = solved(inertiaOf(field_, at, center), wanted - found);
  for (std::uint32_t j = 0; j < k_; ++j) {
    const Vector3d arm = z.row(j).transpose() - field_.oneOf(j) * center;
    v.row(j) += (field_.oneOf(j) * lacking + turn.cross(arm)).transpose();
  }
}

Vector3d PieceStep::angularMomentumBefore() const {
  const ConstCoefficientMap z(piece_.state.z_before.data()->data(), Eigen::Index(k_), 3);
  const ConstCoefficientMap v(piece_.state.v_before.data()->data(), Eigen::Index(k_), 3);
  return angularMomentum(field_, z, v, rigid_.center, rigid_.velocity);
}

void PieceStep::keepEnergy(const CoefficientMap& z, CoefficientMap& v, bool free) {
  PieceState& state = piece_.state;
  if (field_.driven > 0) return;
  const ConstCoefficientMap at(z.data(), z.rows(), 3), moving(v.data(), v.rows(), 3);
  // Of a free piece as keepMomentum() leaves them.
  const Vector3d center = free ? centerAfter() : meanOf(field_, at),
                 velocity = free ? rigid_velocity_ : meanOf(field_, moving);
  const Vector3d omega = solved(inertiaOf(field_, at, center), angularMomentum(field_, at, moving, center, velocity));
  double whole = 0, deforming = 0;
  for (std::uint32_t j = 0; j < k_; ++j) {
    const Vector3d arm = z.row(j).transpose() - field_.oneOf(j) * center;
    const Vector3d own = v.row(j).transpose() - field_.oneOf(j) * velocity;
    whole += 0.5 * own.squaredNorm();
    deforming += 0.5 * (own - omega.cross(arm)).squaredNorm();
  }
  const double energy = whole + state.elastic;
  if (!free || !(state.budget >= 0)) {
    state.budget = energy;
    return;
  }
  // Energies are sums of floats.
  if (energy <= state.budget * (1 + 1e-5) || !(deforming > 0)) return;
  const double left = std::max(0.0, state.budget - state.elastic - (whole - deforming));
  const double kept = std::sqrt(std::min(1.0, left / deforming));
  for (std::uint32_t j = 0; j < k_; ++j) {
    const Vector3d arm = z.row(j).transpose() - field_.oneOf(j) * center;
    const Vector3d rigid = field_.oneOf(j) * velocity + omega.cross(arm);
    v.row(j) = (rigid + kept * (v.row(j).transpose() - rigid)).transpose();
  }
}

// An impact that a body loses energy in goes on while the places where it is pushed still come; what it takes of its
// momentum beyond its weight is returned, times the restitution e, when they cease to (Poisson's hypothesis). e^2 of
// what was lost bounds what is returned: nothing that rings pumps itself up. Of colliders that push together e is the
// mean over what pushes their way: what squeezes it on the other side neither takes nor returns.
void PieceStep::rebound(CoefficientMap& v, std::size_t first, double before) {
  PieceState& state = piece_.state;
  const std::span<ColliderTouch> touches(body_.touches.data() + first, body_.touches.size() - first);
  Vector3d push = Vector3d::Zero(), place = push, carried = push;
  double load = 0;
  for (const ColliderTouch& touch : touches) {
    const Collider& collider = colliderOf(touch);
    push += touch.push;
    const Vector3d at = collider.pose.position + touch.place / touch.load;
    place += touch.load * at;
    carried += touch.load * (at - collider.pose_before.toWorld(collider.pose.toLocal(at))) / h_;
    load += touch.load;
  }
  const double size = push.norm();
  const Vector3d normal = push.normalized();
  double returned = 0, along = 0;
  for (const ColliderTouch& touch : touches) {
    const double part = std::max(0.0, touch.push.dot(normal));
    returned += double(colliderOf(touch).settings.restitution) * part;
    along += part;
  }
  if (!(returned > 0)) return state.endImpact();
  const double e = returned / along;
  place /= load;
  carried /= load;
  const double weight = field_.mass * std::max(0.0, -normal.dot(gravity_)) * h_;
  if (size > weight) state.rebound += e * (size - weight) * normal;
  const ConstCoefficientMap z = std::as_const(piece_).z(), now(v.data(), v.rows(), 3),
                            z_before(state.z_before.data()->data(), Eigen::Index(k_), 3),
                            v_before(state.v_before.data()->data(), Eigen::Index(k_), 3);
  const auto kinetic = [&](const ConstCoefficientMap& of) {
    double sum = 0;
    for (std::uint32_t j = 0; j < k_; ++j) {
      sum += 0.5 * (of.row(j).transpose() - field_.oneOf(j) * carried).squaredNorm();
    }
    return sum;
  };
  const Vector3d center = meanOf(field_, z);
  const double fallen = field_.mass * gravity_.dot(center - meanOf(field_, z_before));
  state.lost += kinetic(v_before) + std::max(0.0, before) + fallen - kinetic(now) - state.elastic;
  if (state.rebound.isZero(0)) return state.endImpact();
  const Vector3d velocity = meanOf(field_, now), arm = place - center;
  const Matrix3d inertia = inertiaOf(field_, z, center);
  const Vector3d omega = solved(inertia, angularMomentum(field_, z, now, center, velocity));
  const double coming = -normal.dot(velocity + omega.cross(arm) - carried);
  const double leaving = state.rebound.norm() / field_.mass;
  if (coming > 0) return;
  // A step's weight is taken back: v^2 / 2 + g v h is what it has left of the energy.
  const double fall = weight / field_.mass;
  const Vector3d impulse = (std::sqrt(fall * fall + leaving * leaving) - fall) / leaving * state.rebound;
  const Vector3d turn = solved(inertia, arm.cross(impulse));
  // The energy that a part s of it brings is a s + b s^2.
  double a = 0, b = 0;
  const auto added = [&](std::uint32_t j) {
    const double one = field_.oneOf(j);
    return Vector3d(one / field_.mass * impulse + turn.cross(Vector3d(z.row(j).transpose() - one * center)));
  };
  for (std::uint32_t j = 0; j < k_; ++j) {
    a += added(j).dot(v.row(j).transpose() - field_.oneOf(j) * carried);
    b += 0.5 * added(j).squaredNorm();
  }
  const double part =
      b > 0 ? std::min(1.0, (std::sqrt(std::max(0.0, a * a + 4 * b * e * e * state.lost)) - a) / (2 * b)) : 0;
  state.endImpact();
  if (!(part > 0)) return;
  for (std::uint32_t j = 0; j < k_; ++j) v.row(j) += part * added(j).transpose();
  for (ColliderTouch& touch : touches) {
    const Vector3d given = -part * touch.load / load * impulse;
    touch.impulse += given;
    touch.torque += (place - colliderOf(touch).pose.position).cross(given);
  }
}

void PieceStep::react() {
  std::uint32_t rows = 0;
  if (field_.driven > 0) {
    // Elasticity pulls at the driven functions, and their own weight hangs on them.
    rows = field_.driven;
    tetherPull(field_, springStep(), std::as_const(piece_).z(), {s_.external.data(), rows});
    for (std::uint32_t j = 0; j < rows; ++j) {
      const float* const g = s_.gradient.data() + 4 * j;
      s_.external[j] += ahead_ * Vector3d(double(g[0]), double(g[1]), double(g[2])) - field_.driven_mass[j] * gravity_;
      if (forced_) s_.external[j] -= s_.forces[j];
    }
  }
  addReactions(body_, piece_, springStep(), {s_.external.data(), rows});
}

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#include "runtime/step/piece_step.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "runtime/contact/collider_points.h"
#include "runtime/contact/firmness.h"
#include "runtime/interact/pin_sets.h"
#include "runtime/solver/held_modes.h"
#include "runtime/solver/holds.h"
#include "runtime/solver/plasticity.h"
#include "runtime/step/body_state.h"
#include "runtime/step/rigid.h"

namespace sinew::internal {
namespace {

/// Turns of more than this, rad, are taken in parts, three rounds of the midpoint each: what those leave is of fourth
/// order in the part. A two-step formula does not reach across them (docs/method.md).
constexpr double kLargeTurn = 0.1;
/// Bounded work: a turn of a revolution, beyond which no step of a second looks like one.
constexpr double kMostParts = 64;
/// Steps whose lengths differ by more than this factor do not continue a two-step formula.
constexpr double kUnlike = 2.0;
/// A turn by t that is taken linearly stretches a shape by 1 - cos t, which may be so much.
constexpr double kStretched = 1e-3;
/// Of the step's length that of the inertia of what stands: a trillion times its mass.
constexpr double kStanding = 1e-6;

}  // namespace

void setMaterial(const Piece& piece, Objective& objective) {
  if (!piece.rest_change.empty()) objective.rest_change = piece.rest_change.data();
  objective.fibres = piece.fibres.empty() ? nullptr : &piece;
}

void PieceStep::run() {
  begin();
  finishAlone();
}

void PieceStep::begin() {
  s_.reserve(field_, kMostContacts);
  const ConstCoefficientMap now = std::as_const(piece_).z();
  const Vector3d mean = meanOf(field_, now);
  frame_ = rotationOf(field_, now, mean);
  moved_ = mean - frame_ * field_.rest_center;
  ahead_ = frame_;
  if (stands()) {
    stand();
    return;
  }
  springs_ = hasSprings(body_, piece_);
  if (springs_) prepareHolds(body_, piece_, stiffness_, s_);
  forced_ = findForces();
  findMotion(mean);
  two_step_ = mayContinue();
  predict();
  findExternal();
  if (two_step_ && touches()) {
    two_step_ = false;
    predict();
    findExternal();
  }
  if (springs_ && s_.contacts.empty()) rebase();
  if (body_.settings.drag > 0) addDrag();
}

void PieceStep::stand() {
  const ConstCoefficientMap now = std::as_const(piece_).z();
  rigid_.center = center_ = meanOf(field_, now);
  effective_h_ = h_;
  std::copy_n(piece_.state.z.begin(), k_, s_.prediction.begin());
  std::fill_n(s_.predicted_velocity.begin(), k_, Vector3d::Zero());
  setBase();
  s_.contacts.clear();
  findObjective();
  objective_.h = kStanding * h_;
}

bool PieceStep::findForces() {
  if (body_.forces.empty() && !(body_.settings.drag > 0)) return false;
  std::fill_n(s_.forces.begin(), k_, Vector3d::Zero());
  const double whole = double(body_.package().info().total_mass);
  for (const PointForce& force : body_.forces) {
    const Vector3d pull = asVector(force.force).cast<double>();
    for (std::uint32_t j = 0; j < k_; ++j) {
      const double part = force.point.weight[0] != 0 ? valueAt(field_, force.point, j)
                          : j < field_.driven        ? field_.driven_mass[j] / whole
                                                     : field_.oneOf(j) / whole;
      s_.forces[j] += part * pull;
    }
  }
  return true;
}

void PieceStep::addDrag() {
  const Vector3d wind = asVector(settings_.wind).cast<double>();
  const double factor = 0.5 * double(settings_.air_density) * double(body_.settings.drag);
  float *const springs = s_.springs.data(), *const residual = s_.residual.data();
  if (!springs_) {
    std::fill_n(springs, std::size_t(k_) * k_, 0.0F);
    std::fill_n(residual, 4 * k_, 0.0F);
  }
  for (std::uint32_t p = 0; p < field_.points.size(); ++p) {
    Vector3d before = -wind, way = -h_ * wind;
    for (std::uint32_t j = 0; j < k_; ++j) {
      const double phi = double(field_.valueAtPoint(p, j));
      before += phi * piece_.state.v[j];
      way += phi * (y().row(j).transpose() - piece_.state.z[j]);
    }
    const double c = factor * double(field_.points[p].area) * before.norm() / h_;
    const Vector3d pull = ahead_.transpose() * way;
    for (std::uint32_t i = 0; i < k_; ++i) {
      const double row = c * double(field_.valueAtPoint(p, i));
      for (std::uint32_t a = 0; a < 3; ++a) residual[4 * i + a] += float(row * pull[int(a)]);
      for (std::uint32_t j = 0; j < k_; ++j) {
        springs[std::size_t(k_) * i + j] += float(row * double(field_.valueAtPoint(p, j)));
      }
    }
  }
  objective_.has_springs = true;
  piece_.system.h = 0;
}

void PieceStep::takeDrag() {
  piece_.system.h = 0;
  if (springs_ || field_.driven > 0) return;
  for (std::uint32_t i = 0; i < k_; ++i) {
    Vector3d pull = Vector3d::Zero();
    for (std::uint32_t a = 0; a < 3; ++a) {
      double sum = double(s_.residual[4 * i + a]);
      for (std::uint32_t j = 0; j < k_; ++j) {
        sum += double(s_.springs[std::size_t(k_) * i + j]) * double(s_.d[4 * j + a]);
      }
      pull[int(a)] = -sum;
    }
    s_.external[i] = ahead_ * pull;
  }
  const ConstCoefficientMap drag(s_.external.data()->data(), Eigen::Index(k_), 3);
  const Vector3d mean = meanOf(field_, drag);
  twist_ += angularMomentum(field_, std::as_const(piece_).z(), drag, rigid_.center, mean);
  forced_mean_ += mean;
  rigid_velocity_ += h_ * mean;
  dragged_ = h_ * h_ * mean;
}

// The part beta of it: the two-step formula goes on with a third of what the step before has lost.
void PieceStep::dampOnHolds() {
  if (piece_.holds.lacking.empty()) return;
  const RigidPlace own = {frame_, moved_};
  const HoldsMotion motion = {placeOfHolds(body_, piece_, 0, own), placeOfHolds(body_, piece_, 1, own), h_};
  const double ratio = double(settings_.deformation_damping_ratio) * std::sqrt(double(stiffness_));
  lostOnHolds(field_, piece_.holds, motion, ratio, std::as_const(piece_).v(),
              [&](std::uint32_t j, const Vector3d& lost) {
                const Vector3d less = effective_h_ / h_ * lost;
                s_.predicted_velocity[j] -= less;
                s_.prediction[j] -= effective_h_ * less;
              });
}

void PieceStep::finishAlone() {
  if (stands()) return;
  solve();
  settle();
}

void PieceStep::useEuler() {
  if (!two_step_) return;
  two_step_ = false;
  predict();
  findExternal();
  if (springs_ && s_.contacts.empty()) rebase();
}

TouchingPiece PieceStep::touchingPiece(std::span<float> before) const {
  TouchingPiece result;
  result.body = body_.id;
  result.piece = field_.piece;
  result.field = &field_;
  result.map = body_.rest().depthsOf(field_.piece);
  result.base = s_.base.data();
  for (std::uint32_t j = 0; j < k_; ++j) {
    const Vector3d old = piece_.state.z[j] - field_.oneOf(j) * center_;
    for (std::uint32_t c = 0; c < 4; ++c) before[4 * j + c] = c < 3 ? float(old[int(c)]) : 0;
  }
  result.before = before.data();
  result.center = center_;
  result.center_before = (rigid_.center - center_).cast<float>();
  for (std::uint32_t j = 0; j < k_; ++j) {
    const Vector3d way = s_.prediction[j] - piece_.state.z[j] - field_.oneOf(j) * (center_ - rigid_.center);
    result.stirring += piece_.reach()[j] * float(way.norm());
  }
  const ConstCoefficientMap now = std::as_const(piece_).z();
  result.turn = (turn_ * rotationOf(field_, now, meanOf(field_, now))).cast<float>();
  result.rest_center = field_.rest_center.cast<float>();
  result.diagonal = double(body_.package().info().diagonal);
  result.mass = stands() ? std::numeric_limits<double>::infinity() : field_.mass;
  result.weight = field_.mass * std::max(gravity_.norm(), kLeastGravity * result.diagonal);
  result.stiffness = stiffness_;
  const float own = body_.settings.friction;
  result.friction = own >= 0 ? own : settings_.ground.friction;
  result.fall = fall().cast<float>();
  result.damping_ratio = settings_.deformation_damping_ratio;
  return result;
}

void PieceStep::reserveSystem(std::size_t rows) {
  piece_.system.factor.reserve(std::size_t(field_.unknowns()) * field_.stride);
  piece_.system.points.reserve(s_.contacts.size() + rows);
}

void PieceStep::prepareTogether(std::span<TouchRow> rows) {
  objective_.touch_rows = rows;
  setFrame();
  useRestSystem(objective_, piece_.system);
}

void PieceStep::setFrame() {
  objective_.setFrame({s_.prediction.data(), k_}, center_, ahead_);
  if (field_.driven == 0 && !stands() && !(springs_ && two_step_)) objective_.spin(momentum_, omega_after_);
}

void PieceStep::oldPlace(float* d) const {
  std::fill_n(d, 4 * field_.driven, 0.0F);
  for (std::uint32_t j = field_.driven; j < k_; ++j) setOffset(d, j, oldPlaceOf(j) - s_.prediction[j]);
}

void PieceStep::placeAlong(float* d) const {
  std::fill_n(d, 4 * field_.driven, 0.0F);
  for (std::uint32_t j = field_.driven; j < k_; ++j) {
    setOffset(d, j, movedAlong(j, rigid_.center + h_ * rigid_.velocity) - s_.prediction[j]);
  }
}

bool PieceStep::turnsFar() const {
  const double turn = h_ * rigid_.omega.norm(), radius2 = double(field_.second_moment) / field_.mass;
  return 1 - std::cos(turn) > kStretched && turn * turn * radius2 > fall().squaredNorm();
}

Vector3d PieceStep::oldPlaceOf(std::uint32_t j) const {
  return field_.driven > 0 ? movedAlong(j, center_) : piece_.state.z[j];
}

Vector3d PieceStep::movedAlong(std::uint32_t j, const Vector3d& center) const {
  const double one = field_.oneOf(j);
  return one * center + turn_ * Vector3d(piece_.state.z[j] - one * rigid_.center);
}

void PieceStep::setOffset(float* d, std::uint32_t j, const Vector3d& way) const {
  const Vector3d local = ahead_.transpose() * way;
  for (std::uint32_t c = 0; c < 4; ++c) d[4 * j + c] = c < 3 ? float(local[int(c)]) : 0;
}

void PieceStep::finishTogether(bool leaning, double elastic) {
  if (stands()) return;
  value_ = {};
  value_.elastic = elastic;
  settle();
  piece_.state.leaning = leaning;
}

PieceStep::Whole PieceStep::whole() const {
  const PieceState& state = piece_.state;
  const ConstCoefficientMap z = std::as_const(piece_).z(), v = std::as_const(piece_).v();
  const ConstCoefficientMap z_before(state.z_before.data()->data(), Eigen::Index(k_), 3),
      v_before(state.v_before.data()->data(), Eigen::Index(k_), 3);
  Whole result;
  result.mass = field_.mass;
  result.before = meanOf(field_, z_before);
  result.velocity_before = meanOf(field_, v_before);
  result.spin_before = angularMomentum(field_, z_before, v_before, result.before, result.velocity_before);
  result.predicted = center_ + dragged_;
  result.velocity_predicted = rigid_velocity_;
  result.after = meanOf(field_, z);
  result.velocity = meanOf(field_, v);
  result.spin = angularMomentum(field_, z, v, result.after, result.velocity);
  result.inertia = inertiaOf(field_, z, result.after);
  if (stands()) result.velocity = result.spin = Vector3d::Zero();
  if (forced_) {
    const double air = std::exp(-double(settings_.damping) * h_);
    result.velocity_before += h_ / air * forced_mean_;
    result.spin_before += h_ / air * twist_;
  }
  return result;
}

void PieceStep::add(const Vector3d& way, const Vector3d& velocity, const Vector3d& omega, const Vector3d& about) {
  if (stands()) return;
  CoefficientMap z = piece_.z(), v = piece_.v();
  for (std::uint32_t j = 0; j < k_; ++j) {
    z.row(j) += field_.oneOf(j) * way.transpose();
    const Vector3d arm = z.row(j).transpose() - field_.oneOf(j) * about;
    v.row(j) += (field_.oneOf(j) * velocity + omega.cross(arm)).transpose();
  }
}

std::span<const Collider* const> PieceStep::nearby() const {
  return {scratch_.contacts.near.data(), scratch_.contacts.near.size()};
}

const Collider& PieceStep::colliderOf(const ColliderTouch& touch) const {
  const auto all = nearby();
  const auto comes_before = [](const Collider* collider, std::uint32_t id) { return collider->id < id; };
  return **std::lower_bound(all.begin(), all.end(), touch.collider, comes_before);
}

ContactStep PieceStep::contactStep() const {
  const double diagonal = double(body_.package().info().diagonal);
  return {nearby(),   &body_.settings,
          h_,         diagonal,
          fall(),     field_.mass * gravity_.norm(),
          stiffness_, double(settings_.deformation_damping_ratio)};
}

Vector3d PieceStep::fall() const {
  const bool held = leaned() || springs_ || field_.driven > 0;
  return held && !stands() ? Vector3d(effective_h_ * effective_h_ * gravity_) : Vector3d(Vector3d::Zero());
}

void PieceStep::findMotion(const Vector3d& center) {
  const ConstCoefficientMap z = std::as_const(piece_).z(), v = std::as_const(piece_).v();
  rigid_ = {};
  if (field_.driven > 0) {
    // A rigid motion of the pin sets moves the driven functions' coefficients like points: the mean of the sets.
    double sets = 0;
    Vector3d spin = Vector3d::Zero();
    for (std::uint32_t j = 0; j < field_.driven; ++j) {
      const Vector3d target = targetOf(j), change = (target - z.row(j).transpose()) / h_;
      if (field_.functions[j].monomial == 0) {
        rigid_.center += z.row(j).transpose();
        rigid_.velocity += change;
        ++sets;
      } else {
        spin += 0.5 * Vector3d(z.row(j).transpose()).cross(change);
      }
    }
    rigid_.center /= sets;
    rigid_.velocity /= sets;
    rigid_.omega = omega_after_ = spin / sets;
    turn_ = turnBy(h_ * rigid_.omega);
    return;
  }
  rigid_.center = center;
  rigid_.velocity = meanOf(field_, v);
  Vector3d momentum = angularMomentum(field_, z, v, rigid_.center, rigid_.velocity);
  const Matrix3d inertia = inertiaOf(field_, z, rigid_.center);
  rigid_.omega = solved(inertia, momentum);
  Vector3d omega = rigid_.omega;
  if (forced_) {
    const ConstCoefficientMap forces(s_.forces.data()->data(), Eigen::Index(k_), 3);
    forced_mean_ = meanOf(field_, forces);
    twist_ = angularMomentum(field_, z, forces, rigid_.center, forced_mean_);
    momentum += h_ / keptOfTurns() * twist_;
    omega = solved(inertia, momentum);
  }
  // The turn of a rigid body by the implicit midpoint, which keeps its energy, in parts of at most kLargeTurn and
  // three rounds each.
  const double parts = std::clamp(std::ceil(h_ * omega.norm() / kLargeTurn), 1.0, kMostParts);
  for (double part = 0; part < parts; ++part) {
    const Matrix3d before = turn_;
    for (int round = 0; round < 3; ++round) {
      const Matrix3d half = turnBy(0.5 * h_ / parts * omega) * before;
      omega = half * solved(inertia, half.transpose() * momentum);
    }
    turn_ = turnBy(h_ / parts * omega) * before;
  }
  omega_after_ = turn_ * solved(inertia, turn_.transpose() * momentum);
  momentum_ = keptOfTurns() * momentum;
}

/// Part of a turn that a step leaves of it. Pin sets turn what they drive as they turn themselves.
double PieceStep::keptOfTurns() const {
  if (field_.driven > 0) return 1;
  const bool supported = springs_ || leaned();
  return std::exp(-double(settings_.damping) * h_) * (supported ? std::exp(-supportDamping() * h_) : 1);
}

double PieceStep::supportDamping() const {
  const float own = body_.settings.support_damping;
  return double(own >= 0 ? own : settings_.support_damping);
}

bool PieceStep::mayContinue() const {
  if (forced_) return false;  // forces come and go, and give their whole momentum in the step in which they act
  const double before = piece_.state.h_before;
  if (!(before > 0) || h_ > kUnlike * before || before > kUnlike * h_) return false;
  return h_ * rigid_.omega.norm() <= kLargeTurn;
}

Vector3d PieceStep::targetOf(std::uint32_t j) const {
  const formats::FieldFunction& function = field_.functions[j];
  for (const PinSet& set : body_.pin_sets) {
    if (set.source != function.pin_set) continue;
    const RigidTransform& at = set.at;
    if (function.monomial == 0) return asVector(at.position).cast<double>();
    const std::size_t column = function.monomial - 1;
    return {double(at.rotation[column]), double(at.rotation[3 + column]), double(at.rotation[6 + column])};
  }
  return piece_.state.z[j];
}

void PieceStep::predict() {
  const ConstCoefficientMap z = std::as_const(piece_).z(), v = std::as_const(piece_).v();
  double now = 1, before = 0;  // weights of the two states
  effective_h_ = h_;
  const double h_before = piece_.state.h_before;
  if (two_step_) {
    const double ratio = h_ / h_before;
    now = (1 + ratio) * (1 + ratio) / (1 + 2 * ratio);
    before = ratio * ratio / (1 + 2 * ratio);
    effective_h_ = h_ * (1 + ratio) / (1 + 2 * ratio);
  }
  const double air = std::exp(-double(settings_.damping) * h_);
  const double air_before = std::exp(-double(settings_.damping) * h_before);
  const double turning = keptOfTurns();
  const Vector3d omega = rigid_.omega;
  // In the frame of the world what springs hold: they stop a turn at once, and a frame that has turned on takes that
  // for a turn back, larger each time.
  const bool turns = !(springs_ && two_step_);
  const Matrix3d turn = turns ? turn_ : Matrix3d::Identity();
  ahead_ = turn * frame_;
  const Matrix3d turn_before = turns ? turnBy(piece_.state.turn) : Matrix3d::Identity();
  const Vector3d omega_before = piece_.state.omega;
  rigid_omega_ = turning * omega_after_;
  const double damping = 4 * M_PI * double(settings_.deformation_damping_ratio) * std::sqrt(double(stiffness_));
  ConstCoefficientMap z_before(nullptr, 0, 3), v_before(nullptr, 0, 3);
  Vector3d mean_before = Vector3d::Zero(), velocity_before = Vector3d::Zero();
  if (two_step_) {
    new (&z_before) ConstCoefficientMap(piece_.state.z_before.data()->data(), Eigen::Index(k_), 3);
    new (&v_before) ConstCoefficientMap(piece_.state.v_before.data()->data(), Eigen::Index(k_), 3);
    if (field_.driven > 0) {
      mean_before = rigid_.center - h_before * rigid_.velocity;
      velocity_before = rigid_.velocity;
    } else {
      mean_before = meanOf(field_, z_before);
      velocity_before = meanOf(field_, v_before);
    }
  }
  const Vector3d fall = effective_h_ * gravity_;
  if (field_.driven > 0) {
    center_ = rigid_.center + h_ * rigid_.velocity;
    rigid_velocity_ = rigid_.velocity + fall;
  } else {
    rigid_velocity_ = air * (now * rigid_.velocity - before * air_before * velocity_before) + fall;
    if (forced_) rigid_velocity_ += h_ * forced_mean_;
    center_ = now * rigid_.center - before * mean_before + effective_h_ * rigid_velocity_;
  }
  for (std::uint32_t j = 0; j < k_; ++j) {
    if (j < field_.driven) {
      const Vector3d target = targetOf(j);
      s_.prediction[j] = target;
      s_.predicted_velocity[j] = (target - z.row(j).transpose()) / h_;
      continue;
    }
    const double one = field_.oneOf(j);
    const double rate = damping * double(field_.functions[j].damping_hz) + double(field_.functions[j].decay);
    const double kept = air * std::exp(-rate * h_);
    const Vector3d arm = z.row(j).transpose() - one * rigid_.center;
    Vector3d shape = now * arm;
    Vector3d speed = now * Vector3d(v.row(j).transpose() - one * rigid_.velocity - omega.cross(arm));
    if (two_step_) {
      const Vector3d old = z_before.row(j).transpose() - one * mean_before;
      const Vector3d old_speed = v_before.row(j).transpose() - one * velocity_before - omega_before.cross(old);
      shape -= before * (turn_before * old);
      const double kept_before = h_before == h_ ? kept : air_before * std::exp(-rate * h_before);
      speed -= before * kept_before * (turn_before * old_speed);
    }
    speed *= kept;
    if (!turns) {
      const Vector3d old = z_before.row(j).transpose() - one * mean_before;
      speed += turning * (now * omega.cross(arm) - before * omega_before.cross(old));
    }
    s_.prediction[j] = shape + effective_h_ * speed;
    s_.predicted_velocity[j] = speed;
  }
  if (turns && field_.driven > 0) addCentrifugal();
  for (std::uint32_t j = field_.driven; j < k_; ++j) {
    const double one = field_.oneOf(j);
    s_.prediction[j] = one * center_ + turn * s_.prediction[j];
    s_.predicted_velocity[j] = one * rigid_velocity_ + turn * s_.predicted_velocity[j];
    if (turns) {
      const Vector3d arm = z.row(j).transpose() - one * rigid_.center;
      s_.predicted_velocity[j] += rigid_omega_.cross(Vector3d(turn * arm));
    }
    if (field_.driven > 0) s_.prediction[j] += one * effective_h_ * effective_h_ * gravity_;
  }
  if (springs_) dampOnHolds();
  if (forced_) addForces();
  setBase();
}

// In the frame that turns with what drives the piece: the force w^2 r, where inertia leads. It is explicit, and of a
// turn of more than a radian a step no more than of one.
void PieceStep::addCentrifugal() {
  const double turn2 = h_ * h_ * rigid_.omega.squaredNorm(), step = effective_h_ / std::max(1.0, turn2);
  for (std::uint32_t j = field_.driven; j < k_; ++j) {
    const Vector3d out = step * rigid_.omega.cross(s_.prediction[j].cross(rigid_.omega));
    s_.prediction[j] += effective_h_ * out;
    s_.predicted_velocity[j] += out;
  }
}

/// Of a free piece what moves it as a whole is in its motion already.
void PieceStep::addForces() {
  const ConstCoefficientMap z = std::as_const(piece_).z();
  const Vector3d spin = field_.driven > 0 ? Vector3d::Zero() : solved(inertiaOf(field_, z, rigid_.center), twist_);
  for (std::uint32_t j = field_.driven; j < k_; ++j) {
    Vector3d rest = s_.forces[j];
    if (field_.driven == 0) {
      const double one = field_.oneOf(j);
      rest -= one * forced_mean_ + spin.cross(Vector3d(z.row(j).transpose() - one * rigid_.center));
    }
    s_.prediction[j] += h_ * h_ * rest;
    s_.predicted_velocity[j] += h_ * rest;
  }
}

[[gnu::noinline]] void PieceStep::setBase() {
  for (std::uint32_t j = 0; j < k_; ++j) {
    const double one = field_.oneOf(j);
    for (std::uint32_t c = 0; c < 3; ++c) {
      s_.base[4 * j + c] = float(s_.prediction[j][int(c)] - one * center_[int(c)]);
    }
    s_.base[4 * j + 3] = 0;
  }
}

void PieceStep::findObjective() {
  objective_ = {};
  objective_.field = &field_;
  objective_.h = effective_h_;
  objective_.stiffness = stiffness_;
  objective_.scratch = &s_;
  setMaterial(piece_, objective_);
}

[[gnu::noinline]] void PieceStep::findExternal() {
  findObjective();
  findNear(piece_, colliders_, contactStep(), y(), center_, scratch_.contacts);
  const ContactStep step = contactStep();
  findContacts(piece_, step, y(), center_, scratch_.contacts, s_);
  if (body_.rest().depthsOf(field_.piece) != nullptr && mayMeetPoints(step, field_, center_, scratch_.contacts)) {
    std::array<float, 4 * 1024> before;
    TouchingPiece seen = touchingPiece({before.data(), 4 * std::size_t(k_)});
    seen.points = {scratch_.contacts.places.data(), pointFloats(field_)};
    placePoints(seen);
    findPointContacts(piece_, step, seen, scratch_.contacts, s_);
  }
  giveWay(step, {s_.contacts.data(), s_.contacts.size()});
  objective_.has_springs = springs_;
  if (springs_ && !s_.contacts.empty()) findSprings();  // else rebase() does
}

void PieceStep::findSprings() {
  prepareSprings(body_, piece_, springStep(), y(), s_);
  objective_.holds = piece_.holds.count > 0 ? piece_.holds.by_function.data() : nullptr;
  objective_.holds_rotation = (ahead_.transpose() * piece_.holds_turned).cast<float>();
}

void PieceStep::rebase() {
  for (std::uint32_t j = 0; j < k_; ++j) {
    Vector3d offset = Vector3d::Zero();
    if (j >= field_.driven) offset = oldPlaceOf(j) - s_.prediction[j];
    setOffset(s_.offset.data(), j, offset);
    s_.prediction[j] += offset;
    s_.predicted_velocity[j] += offset / effective_h_;
  }
  setBase();
  findSprings();
  objective_.has_offset = true;
}

bool PieceStep::touches() const {
  return std::any_of(s_.contacts.begin(), s_.contacts.end(), [](const Contact& contact) { return contact.gap < 0; });
}

bool PieceStep::touched(const Contact& contact) const {
  return touchedBefore(piece_, nearby()[contact.collider]->id, contact.point) != nullptr;
}

bool PieceStep::touchesAsBefore() const {
  return std::all_of(s_.contacts.begin(), s_.contacts.end(),
                     [this](const Contact& contact) { return !(contact.gap < 0) || touched(contact); });
}

// The second derivative changes little from step to step where nothing comes or goes, and pairs of a step that needs
// none are not carried on: they may be of another shape.
Pairs& PieceStep::carriedPairs() {
  PieceState& state = piece_.state;
  if (two_step_ && state.pairs.fresh()) {
    const double identity = 1 / (effective_h_ * effective_h_) - 1 / (state.pairs_h * state.pairs_h);
    state.pairs.carry(float(identity));
  } else {
    state.pairs.start(4 * k_);
  }
  state.pairs_h = effective_h_;
  return state.pairs;
}

// The other place to start from: the old shape, moved along unless it lies on something.
void PieceStep::setOldPlace() {
  for (std::uint32_t j = field_.driven; j < k_; ++j) {
    const Vector3d old = s_.contacts.empty() ? movedAlong(j, center_) : oldPlaceOf(j);
    setOffset(s_.next.data(), j, old - s_.prediction[j]);
  }
}

void PieceStep::solve() {
  setFrame();
  useRestSystem(objective_, piece_.system);
  std::fill_n(s_.d.begin(), 4 * k_, 0.0F);
  std::fill_n(s_.next.begin(), 4 * field_.driven, 0.0F);
  objective_.press(s_.d.data());
  Pairs& pairs = carriedPairs();
  // Where the old shape was the lower place the energy here is likely to do, and where it was the end as well it is
  // likely to be this step's.
  const bool alone = !objective_.has_offset && s_.contacts.empty();
  const bool stayed = std::exchange(piece_.state.stays, false) && alone,
             rested = std::exchange(piece_.state.rests, false) && alone;
  Objective::Value value, old;
  const auto takeNext = [&](const Objective::Value& there) {
    value = there;
    std::copy_n(s_.next.data(), 4 * k_, s_.d.data());
    std::copy_n(s_.next_gradient.data(), 4 * k_, s_.gradient.data());
  };
  if (rested) {
    setOldPlace();
    old = objective_.at(s_.next.data(), s_.next_gradient.data(), true);
    if (isSettled(objective_, s_.next.data(), s_.next_gradient.data())) {
      piece_.state.stays = piece_.state.rests = true;
      takeNext(old);
      value_ = value;
      return;
    }
  }
  const bool known = stayed && !rested;
  value = objective_.at(s_.d.data(), known ? nullptr : s_.gradient.data(), true);
  // What pin sets move takes more: what is left lacks in the forces on them.
  std::uint32_t most = (field_.driven > 0 ? 4 : 2) * settings_.iterations;
  if (objective_.has_offset) {
    if (field_.driven == 0) {
      // What springs hold goes on where they do.
      placeAlong(s_.next.data());
      if (value.elastic + objective_.besideElastic(s_.next.data(), nullptr) < value.total) {
        const Objective::Value moved = objective_.at(s_.next.data(), s_.next_gradient.data(), false);
        if (moved.total < value.total) takeNext(moved);
      }
    }
    value_ = minimize(objective_, piece_.system, pairs, most, value);
    return;
  }
  setOldPlace();
  if (!s_.contacts.empty()) {
    // Contacts come and go within a step: twice as many iterations at most (docs/decisions/0033-colliders.md).
    most = 4 * settings_.iterations;
    // A touching piece starts at y, where contacts push and A knows them: at the old place they may not push yet. Where
    // all that push have touched before the old place is as good a start, and at rest the end.
    std::copy_n(s_.next.data(), 4 * k_, s_.old.data());
    objective_.press(s_.old.data());
    const double expected = piece_.state.elastic + objective_.besideElastic(s_.old.data(), nullptr);
    if (maySlide(objective_)) {
      // What slides or rolls goes on as a whole, under the loads that it had.
      bool taken = false, last = false;
      for (const bool along : {true, false}) {
        if (along && !turnsFar()) continue;
        along ? placeAlong(s_.old.data()) : oldPlace(s_.old.data());
        const Objective::Value from = objective_.at(s_.old.data(), s_.next_gradient.data(), false);
        slide(objective_, s_.old.data(), s_.next_gradient.data(), s_.next.data());
        const Objective::Value slid = objective_.at(s_.next.data(), s_.next_gradient.data(), false);
        last = slid.total < std::min(from.total, value.total);
        if (!last) continue;
        taken = true;
        takeNext(slid);
      }
      if (taken && !last) {
        value = objective_.at(s_.d.data(), s_.gradient.data(), false);
        // The fall of the prediction presses on what it does not roll on.
        for (Contact& contact : s_.contacts) {
          if (!(gapOf(contact) < 0) && !touched(contact)) contact.firm = 0;
        }
        useRestSystem(objective_, piece_.system);
      }
      if (taken) {
        value_ = minimize(objective_, piece_.system, pairs, most, value);
        return;
      }
      std::copy_n(s_.old.data(), 4 * k_, s_.next.data());
    }
    if (piece_.state.elastic >= 0 && expected < value.total) {
      old = objective_.at(s_.next.data(), s_.next_gradient.data(), false);
      if (touchesAsBefore() || isSettled(objective_, s_.next.data(), s_.next_gradient.data())) {
        takeNext(old);
        value_ = minimize(objective_, piece_.system, pairs, most, value);
        return;
      }
    }
    objective_.press(s_.d.data());
    value_ = minimize(objective_, piece_.system, pairs, most, value);
    if (piece_.state.elastic < 0 || !(value_.total > expected)) return;
    std::copy_n(s_.old.data(), 4 * k_, s_.next.data());
    objective_.press(s_.next.data());
    takeNext(objective_.at(s_.next.data(), s_.next_gradient.data(), false));
    useSystemAt(objective_, piece_.system, s_.d.data());
    pairs.clear();
    value_ = minimize(objective_, piece_.system, pairs, most, value);
    return;
  }
  // The old shape's energy is known.
  const bool may_stay = rested || piece_.state.elastic < 0 ||
                        piece_.state.elastic + objective_.besideElastic(s_.next.data(), nullptr) < value.total;
  if (may_stay && !rested) old = objective_.at(s_.next.data(), s_.next_gradient.data(), false);
  const bool stays = may_stay && old.total < value.total;
  if (stays) takeNext(old);
  if (known && !stays) value = objective_.at(s_.d.data(), s_.gradient.data(), false);
  value_ = minimize(objective_, piece_.system, pairs, most, value);
  piece_.state.stays = stays;
  piece_.state.rests = stays && value_.total == value.total;
}

bool isUsable(const Piece& piece) {
  const PieceState& state = piece.state;
  double largest = 0;
  bool finite = true;
  for (const Array<Vector3d>* array : {&state.z, &state.v}) {
    for (const Vector3d& row : *array) {
      finite = finite && row.allFinite();
      largest = std::max(largest, row.cwiseAbs().maxCoeff());
    }
  }
  // Of one vertex of the piece's mass there.
  return finite && largest < double(kLargestPosition) * std::sqrt(piece.field().mass);
}

void PieceScratch::reserve(const Piece& piece) {
  for (const Field* field : {piece.free, piece.fixed}) {
    if (field == nullptr) continue;
    minimize.reserve(*field, kMostContacts);
    reserveHolds(piece, minimize);
    contacts.reserve(*field);
  }
}

void stepPieces(Body& body, const StepWorld& world, double seconds, PieceScratch& scratch) {
  body.repaired = 0;
  for (Piece& piece : body.pieces) {
    PieceStep(body, piece, world, seconds, scratch).run();
    if (isUsable(piece)) continue;
    restPiece(body, piece);
    body.repaired += piece.field().vertex_count;
  }
  body.outdated = true;
}

}  // namespace sinew::internal

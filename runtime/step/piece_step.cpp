// SPDX-License-Identifier: MIT
#include "runtime/step/piece_step.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "runtime/geometry/rotation.h"
#include "runtime/interact/pin_sets.h"
#include "runtime/solver/plasticity.h"
#include "runtime/solver/springs.h"
#include "runtime/step/together.h"

namespace sinew::internal {
namespace {

/// Turns of more than this, rad, are taken in parts, three rounds of the midpoint each: what those leave is of fourth
/// order in the part. A two-step formula does not reach across them (docs/method.md).
constexpr double kLargeTurn = 0.1;
/// Bounded work: a turn of a revolution, beyond which no step of a second looks like one.
constexpr double kMostParts = 64;
/// Steps whose lengths differ by more than this factor do not continue a two-step formula.
constexpr double kUnlike = 2.0;

/// What counts as gravity at least where pieces touch, diagonals per second squared.
constexpr double kLeastGravity = 1;

/// The rigid motion of a piece: centre, velocity of the centre, angular velocity.
struct Rigid {
  Vector3d center = Vector3d::Zero(), velocity = Vector3d::Zero(), omega = Vector3d::Zero();
};

[[gnu::noinline]] Matrix3d turnBy(const Vector3d& angle) {
  const double length = angle.norm();
  return length > 0 ? Eigen::AngleAxisd(length, angle / length).toRotationMatrix() : Matrix3d::Identity();
}

double oneOf(const Field& field, std::uint32_t j) { return double(field.functions[j].one); }

Vector3d restOf(const Field& field, std::uint32_t j) {
  const auto& rest = field.functions[j].rest;
  return {double(rest[0]), double(rest[1]), double(rest[2])};
}

/// sum m x over the mass: exact where the field is orthonormal, the free one.
[[gnu::noinline]] Vector3d meanOf(const Field& field, const ConstCoefficientMap& z) {
  Vector3d sum = Vector3d::Zero();
  double mass = 0;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    sum += oneOf(field, j) * z.row(j).transpose();
    mass += oneOf(field, j) * oneOf(field, j);
  }
  return sum / mass;
}

[[gnu::noinline]] Vector3d angularMomentum(const Field& field, const ConstCoefficientMap& z,
                                           const ConstCoefficientMap& v, const Vector3d& center,
                                           const Vector3d& velocity) {
  Vector3d sum = Vector3d::Zero();
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const Vector3d arm = z.row(j).transpose() - oneOf(field, j) * center;
    sum += arm.cross(Vector3d(v.row(j).transpose() - oneOf(field, j) * velocity));
  }
  return sum;
}

Matrix3d inertiaOf(const Field& field, const ConstCoefficientMap& z, const Vector3d& center) {
  Matrix3d moment = Matrix3d::Zero();
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const Vector3d arm = z.row(j).transpose() - oneOf(field, j) * center;
    moment += arm * arm.transpose();
  }
  const double trace = moment.trace();
  // What is straight has no inertia about its line.
  return (trace * (1 + 1e-9)) * Matrix3d::Identity() - moment;
}

[[gnu::noinline]] Vector3d solved(const Matrix3d& a, const Vector3d& b) {
  const Matrix3d inverse = a.inverse();
  const Vector3d x = inverse * b;
  return x.allFinite() ? x : Vector3d::Zero();
}

[[gnu::noinline]] Vector3d restCenterOf(const Field& field) {
  Vector3d center = Vector3d::Zero();
  double mass = 0;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    center += oneOf(field, j) * restOf(field, j);
    mass += oneOf(field, j) * oneOf(field, j);
  }
  return center / mass;
}

/// The rotation that the piece has as a whole, to the digits of doubles.
Matrix3d rotationOf(const Field& field, const ConstCoefficientMap& z, const Vector3d& center) {
  Matrix3d sum = Matrix3d::Zero();
  const Vector3d rest_center = restCenterOf(field);
  for (std::uint32_t j = 0; j < field.k; ++j) {
    sum += Vector3d(z.row(j).transpose() - oneOf(field, j) * center) *
           (restOf(field, j) - oneOf(field, j) * rest_center).transpose();
  }
  const double scale = sum.cwiseAbs().maxCoeff();
  if (!(scale > 0) || !std::isfinite(scale)) return Matrix3d::Identity();
  geometry::Quaternion q = geometry::kIdentityQuaternion;
  geometry::nearestRotation(Matrix3((sum / scale).cast<float>()), q);
  return Eigen::Quaterniond(double(q[0]), double(q[1]), double(q[2]), double(q[3])).normalized().toRotationMatrix();
}

void setMaterial(const Piece& piece, Objective& objective) {
  if (!piece.rest_change.empty()) objective.rest_change = piece.rest_change.data();
  objective.tensions = {piece.tensions.data(), piece.tensions.size()};
  objective.holds = {piece.holds.begin(), piece.holds.size()};
}

class PieceStep {
 public:
  PieceStep(Body& body, Piece& piece, const StepWorld& world, double seconds, PieceScratch& scratch)
      : body_(body),
        piece_(piece),
        field_(piece.field()),
        settings_(world.settings),
        colliders_(world.colliders),
        h_(seconds),
        scratch_(scratch),
        s_(scratch.minimize),
        k_(field_.k),
        stiffness_(body.settings.stiffness_scale * body.settings.stiffness_scale),
        gravity_(asVector(world.settings.gravity).cast<double>()) {}

  void run() {
    begin();
    finishAlone();
  }

  /// Up to where the step is a minimization.
  void begin() {
    s_.reserve(field_, kMostContacts);
    springs_ = hasSprings(body_, piece_);
    findMotion();
    two_step_ = mayContinue();
    predict();
    findExternal();
    if (two_step_ && touches()) {
      two_step_ = false;
      predict();
      findExternal();
    }
    if (springs_ && s_.contacts.empty()) rebase();
  }

  /// The end of a step that touches nothing else.
  void finishAlone() {
    solve();
    settle();
  }
  void setTogether() { together_ = true; }

  /// The same near other pieces: a two-step formula does not reach across contacts.
  void useEuler() {
    if (!two_step_) return;
    two_step_ = false;
    predict();
    findExternal();
    if (springs_ && s_.contacts.empty()) rebase();
  }

  /// What contacts with other pieces see. \param before room for the coefficients before the step, k x 4.
  TouchingPiece touchingPiece(std::span<float> before) const {
    TouchingPiece result;
    result.body = body_.id;
    result.piece = field_.piece;
    result.field = &field_;
    for (const DepthMap& map : body_.rest().depths) {
      if (map.piece() == field_.piece) result.map = &map;
    }
    result.base = s_.base.data();
    for (std::uint32_t j = 0; j < k_; ++j) {
      const Vector3d old = piece_.state.z[j] - oneOf(field_, j) * center_;
      for (std::uint32_t c = 0; c < 4; ++c) before[4 * j + c] = c < 3 ? float(old[int(c)]) : 0;
    }
    result.before = before.data();
    result.center = center_;
    const ConstCoefficientMap now = std::as_const(piece_).z();
    result.turn = (turn_ * rotationOf(field_, now, meanOf(field_, now))).cast<float>();
    result.rest_center = restCenterOf(field_).cast<float>();
    result.diagonal = double(body_.package().info().diagonal);
    result.weight = field_.mass * std::max(gravity_.norm(), kLeastGravity * result.diagonal);
    result.stiffness = stiffness_;
    const float own = body_.settings.friction;
    result.friction = own >= 0 ? own : settings_.ground.friction;
    return result;
  }

  Objective& objective() { return objective_; }
  SystemFactor& system() { return piece_.system; }
  MinimizeScratch& scratch() { return s_; }
  const Field& field() const { return field_; }
  bool isSupported() const { return springs_ || field_.driven > 0 || !s_.contacts.empty(); }
  bool leaned() const { return piece_.state.leaning || !piece_.state.touching.empty(); }

  /// The objective with its touches: its first matrix and its frame.
  void prepareTogether(std::span<const TouchRow> rows) {
    objective_.touch_rows = rows;
    useRestSystem(objective_, piece_.system);
    const ConstCoefficientMap now = std::as_const(piece_).z();
    objective_.setFrame({s_.prediction.data(), k_}, center_, restCenterOf(field_),
                        rotationOf(field_, now, meanOf(field_, now)));
  }
  /// Where it was, from the prediction. \param d k x 4.
  void oldPlace(float* d) const {
    for (std::uint32_t j = 0; j < k_; ++j) {
      const Vector3d moved = j < field_.driven ? Vector3d::Zero() : Vector3d(piece_.state.z[j] - s_.prediction[j]);
      for (std::uint32_t c = 0; c < 4; ++c) d[4 * j + c] = c < 3 ? float(moved[int(c)]) : 0;
    }
  }
  /// The end of a step whose offset and gradient are in scratch(). \param leaning on something that is held.
  void finishTogether(bool leaning) {
    value_ = {};
    value_.elastic = objective_.elastic(s_.d.data(), s_.next_gradient.data(), false);
    settle();
    piece_.state.leaning = leaning;
  }

  /// Mass, centre and motion as a whole: before the step, as predicted, and after it.
  struct Whole {
    double mass;
    Vector3d before, velocity_before, spin_before, predicted, velocity_predicted, after, velocity, spin;
    Matrix3d inertia;
  };
  Whole whole() const {
    const PieceState& state = piece_.state;
    const ConstCoefficientMap z = std::as_const(piece_).z(), v = std::as_const(piece_).v();
    const ConstCoefficientMap z_before(state.z_before.data()->data(), Eigen::Index(k_), 3),
        v_before(state.v_before.data()->data(), Eigen::Index(k_), 3);
    Whole result;
    result.mass = field_.mass;
    result.before = meanOf(field_, z_before);
    result.velocity_before = meanOf(field_, v_before);
    result.spin_before = angularMomentum(field_, z_before, v_before, result.before, result.velocity_before);
    result.predicted = center_;
    result.velocity_predicted = rigid_velocity_;
    result.after = meanOf(field_, z);
    result.velocity = meanOf(field_, v);
    result.spin = angularMomentum(field_, z, v, result.after, result.velocity);
    result.inertia = inertiaOf(field_, z, result.after);
    return result;
  }
  /// Moved as a whole: by a way, and by a motion about a point.
  void add(const Vector3d& way, const Vector3d& velocity, const Vector3d& omega, const Vector3d& about) {
    CoefficientMap z = piece_.z(), v = piece_.v();
    for (std::uint32_t j = 0; j < k_; ++j) {
      z.row(j) += oneOf(field_, j) * way.transpose();
      const Vector3d arm = z.row(j).transpose() - oneOf(field_, j) * about;
      v.row(j) += (oneOf(field_, j) * velocity + omega.cross(arm)).transpose();
    }
  }

 private:
  ConstCoefficientMap y() const { return {s_.prediction.data()->data(), Eigen::Index(k_), 3}; }
  std::span<const Collider* const> nearby() const {
    return {scratch_.contacts.near.data(), scratch_.contacts.near.size()};
  }
  ContactStep contactStep() const {
    const double diagonal = double(body_.package().info().diagonal);
    return {nearby(), &body_.settings, h_, diagonal, gravity_, field_.mass * gravity_.norm(), stiffness_};
  }
  SpringStep springStep() const { return {h_, field_.mass * gravity_.norm(), stiffness_, center_}; }

  /// What moves as one: of a piece that the field holds, its pin sets; of another its mass.
  void findMotion() {
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
    rigid_.center = meanOf(field_, z);
    rigid_.velocity = meanOf(field_, v);
    const Vector3d momentum = angularMomentum(field_, z, v, rigid_.center, rigid_.velocity);
    const Matrix3d inertia = inertiaOf(field_, z, rigid_.center);
    rigid_.omega = solved(inertia, momentum);
    // The turn of a rigid body by the implicit midpoint, which keeps its energy, in parts of at most kLargeTurn and
    // three rounds each.
    const double parts = std::clamp(std::ceil(h_ * rigid_.omega.norm() / kLargeTurn), 1.0, kMostParts);
    Vector3d omega = rigid_.omega;
    for (double part = 0; part < parts; ++part) {
      const Matrix3d before = turn_;
      for (int round = 0; round < 3; ++round) {
        const Matrix3d half = turnBy(0.5 * h_ / parts * omega) * before;
        omega = half * solved(inertia, half.transpose() * momentum);
      }
      turn_ = turnBy(h_ / parts * omega) * before;
    }
    omega_after_ = turn_ * solved(inertia, turn_.transpose() * momentum);
  }

  bool mayContinue() const {
    const double before = piece_.state.h_before;
    if (!(before > 0) || h_ > kUnlike * before || before > kUnlike * h_) return false;
    return h_ * rigid_.omega.norm() <= kLargeTurn;
  }

  Vector3d targetOf(std::uint32_t j) const {
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

  /// y, the predicted velocity, and what the inertia is about: BDF2 or implicit Euler, in a frame that turns with the
  /// piece.
  void predict() {
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
    const bool supported = springs_ || leaned();
    const double turning = air * (supported ? std::exp(-double(settings_.support_damping) * h_) : 1);
    const Vector3d omega = rigid_.omega;
    // In the frame of the world what springs hold: they stop a turn at once, and a frame that has turned on takes that
    // for a turn back, larger each time.
    const bool turns = !(springs_ && two_step_);
    const Matrix3d turn = turns ? turn_ : Matrix3d::Identity();
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
      center_ = now * rigid_.center - before * mean_before + effective_h_ * rigid_velocity_;
    }
    for (std::uint32_t j = 0; j < k_; ++j) {
      if (j < field_.driven) {
        const Vector3d target = targetOf(j);
        s_.prediction[j] = target;
        s_.predicted_velocity[j] = (target - z.row(j).transpose()) / h_;
        continue;
      }
      const double one = oneOf(field_, j);
      const double rate = damping * double(field_.functions[j].damping_hz) + double(field_.functions[j].decay);
      const double kept = air * std::exp(-rate * h_);
      const Vector3d arm = z.row(j).transpose() - one * rigid_.center;
      Vector3d shape = now * arm;
      Vector3d speed = now * Vector3d(v.row(j).transpose() - one * rigid_.velocity - omega.cross(arm));
      if (two_step_) {
        const Vector3d old = z_before.row(j).transpose() - one * mean_before;
        const Vector3d old_speed = v_before.row(j).transpose() - one * velocity_before - omega_before.cross(old);
        shape -= before * (turn_before * old);
        speed -= before * air_before * std::exp(-rate * h_before) * (turn_before * old_speed);
      }
      speed *= kept;
      if (!turns) {
        const Vector3d old = z_before.row(j).transpose() - one * mean_before;
        speed += turning * (now * omega.cross(arm) - before * omega_before.cross(old));
      }
      const Vector3d turned = turn * (shape + effective_h_ * speed);
      s_.prediction[j] = one * center_ + turned;
      s_.predicted_velocity[j] = one * rigid_velocity_ + turn * speed;
      if (turns) s_.predicted_velocity[j] += rigid_omega_.cross(Vector3d(turn * arm));
      if (field_.driven > 0) s_.prediction[j] += one * effective_h_ * effective_h_ * gravity_;
    }
    setBase();
  }

  [[gnu::noinline]] void setBase() {
    for (std::uint32_t j = 0; j < k_; ++j) {
      const double one = oneOf(field_, j);
      for (std::uint32_t c = 0; c < 3; ++c) {
        s_.base[4 * j + c] = float(s_.prediction[j][int(c)] - one * center_[int(c)]);
      }
      s_.base[4 * j + 3] = 0;
    }
  }

  [[gnu::noinline]] void findExternal() {
    objective_ = {};
    objective_.field = &field_;
    objective_.h = effective_h_;
    objective_.stiffness = stiffness_;
    objective_.scratch = &s_;
    setMaterial(piece_, objective_);
    findNear(piece_, colliders_, contactStep(), y(), center_, scratch_.contacts);
    findContacts(piece_, contactStep(), y(), center_, scratch_.contacts, s_);
    objective_.has_springs = springs_;
    if (springs_ && !s_.contacts.empty()) prepareSprings(body_, piece_, springStep(), y(), s_);  // else rebase() does
  }

  /// Offsets from the old place in place of the prediction: stiff springs of what is at rest pull by the difference of
  /// where it is from where it should be, which floats hold only where both are near.
  void rebase() {
    for (std::uint32_t j = 0; j < k_; ++j) {
      const Vector3d offset = j < field_.driven ? Vector3d::Zero() : Vector3d(piece_.state.z[j] - s_.prediction[j]);
      for (std::uint32_t c = 0; c < 4; ++c) s_.offset[4 * j + c] = c < 3 ? float(offset[int(c)]) : 0;
      s_.prediction[j] += offset;
      s_.predicted_velocity[j] += offset / effective_h_;
    }
    setBase();
    prepareSprings(body_, piece_, springStep(), y(), s_);
    objective_.has_offset = true;
  }

  bool touches() const {
    return std::any_of(s_.contacts.begin(), s_.contacts.end(), [](const Contact& contact) { return contact.gap < 0; });
  }

  /// Whether all that push at the prediction touched at the end of the last step.
  bool touchesAsBefore() const {
    const auto colliders = nearby();
    return std::all_of(s_.contacts.begin(), s_.contacts.end(), [&](const Contact& contact) {
      return !(contact.gap < 0) || touchedBefore(piece_, colliders[contact.collider]->id, contact.point) != nullptr;
    });
  }

  void solve() {
    useRestSystem(objective_, piece_.system);
    const ConstCoefficientMap now = std::as_const(piece_).z();
    objective_.setFrame({s_.prediction.data(), k_}, center_, restCenterOf(field_),
                        rotationOf(field_, now, meanOf(field_, now)));
    std::fill_n(s_.d.begin(), 4 * k_, 0.0F);
    std::fill_n(s_.next.begin(), 4 * field_.driven, 0.0F);
    objective_.press(s_.d.data());
    Objective::Value value = objective_.at(s_.d.data(), s_.gradient.data(), true);
    if (objective_.has_offset) {
      value_ = minimize(objective_, piece_.system, 2 * settings_.iterations, value);
      return;
    }
    // The other place to start from: the old shape, moved along where nothing holds the piece.
    const bool stays = springs_ || field_.driven > 0 || !s_.contacts.empty();
    for (std::uint32_t j = field_.driven; j < k_; ++j) {
      const Vector3d z = piece_.state.z[j];
      const Vector3d moved =
          stays ? z : Vector3d(oneOf(field_, j) * center_ + turn_ * (z - oneOf(field_, j) * rigid_.center));
      for (std::uint32_t c = 0; c < 3; ++c) s_.next[4 * j + c] = float(moved[int(c)] - s_.prediction[j][int(c)]);
      s_.next[4 * j + 3] = 0;
    }
    const auto takeOld = [&](const Objective::Value& old) {
      value = old;
      std::copy_n(s_.next.data(), 4 * k_, s_.d.data());
      std::copy_n(s_.next_gradient.data(), 4 * k_, s_.gradient.data());
    };
    if (!s_.contacts.empty()) {
      // What touches starts at y, where contacts push and A knows them: at the old place they may not push yet. Where
      // all that push have touched before the old place is as good a start, and of what rests it is the end.
      std::copy_n(s_.next.data(), 4 * k_, s_.old.data());
      objective_.press(s_.old.data());
      const double expected = piece_.state.elastic + objective_.besideElastic(s_.old.data(), nullptr);
      if (piece_.state.elastic >= 0 && expected < value.total) {
        const Objective::Value old = objective_.at(s_.next.data(), s_.next_gradient.data(), false);
        if (touchesAsBefore() || isSettled(objective_, s_.next.data(), s_.next_gradient.data())) {
          takeOld(old);
          value_ = minimize(objective_, piece_.system, 2 * settings_.iterations, value);
          return;
        }
      }
      objective_.press(s_.d.data());
      value_ = minimize(objective_, piece_.system, 2 * settings_.iterations, value);
      if (piece_.state.elastic < 0 || !(value_.total > expected)) return;
      std::copy_n(s_.old.data(), 4 * k_, s_.next.data());
      objective_.press(s_.next.data());
      takeOld(objective_.at(s_.next.data(), s_.next_gradient.data(), false));
      useSystemAt(objective_, piece_.system, s_.d.data());
      value_ = minimize(objective_, piece_.system, 2 * settings_.iterations, value);
      return;
    }
    // The old shape's energy is known.
    const double expected = piece_.state.elastic + objective_.besideElastic(s_.next.data(), nullptr);
    if (piece_.state.elastic < 0 || expected < value.total) {
      const Objective::Value old = objective_.at(s_.next.data(), s_.next_gradient.data(), false);
      if (old.total < value.total) takeOld(old);
    }
    value_ = minimize(objective_, piece_.system, 2 * settings_.iterations, value);
  }

  void settle() {
    PieceState& state = piece_.state;
    state.z_before.swap(state.z);
    state.v_before.swap(state.v);
    CoefficientMap z = piece_.z(), v = piece_.v();
    for (std::uint32_t j = 0; j < k_; ++j) {
      const float* const d = s_.d.data() + 4 * j;
      const Vector3d moved = {double(d[0]), double(d[1]), double(d[2])};
      state.z[j] = s_.prediction[j] + moved;
      state.v[j] = s_.predicted_velocity[j] + moved / effective_h_;
    }
    const Eigen::AngleAxisd turn(turn_);
    state.turn = turn.angle() * turn.axis();
    state.omega = rigid_.omega;
    const bool touched = !state.touching.empty();
    // Beside its weight and the air only contacts have changed the momentum, unless something holds the piece.
    const Vector3d given = -(field_.mass * (meanOf(field_, std::as_const(piece_).v()) - rigid_velocity_));
    const bool held = springs_ || field_.driven > 0;
    rememberContacts(piece_, contactStep(), y(), center_, effective_h_, held || together_ ? nullptr : &given, s_, body_.touches);
    // A two-step formula does not reach across contacts: it would gain energy where they come and go.
    state.h_before = touched || together_ || !state.touching.empty() ? 0 : h_;
    state.leaning = false;
    // A contact may have stopped the piece and not touch any more.
    const bool free = field_.driven == 0 && !springs_ && s_.contacts.empty() && !touched && !together_;
    state.elastic = value_.elastic;
    if (free) keepMomentum(z, v);
    keepEnergy(z, v, free);
    if (springs_ || field_.driven > 0) react();
    if (field_.plastic) becomePermanent();
  }

  /// What is deformed beyond its yield stays so: the shape stores less then.
  void becomePermanent() {
    objective_.toFrame(s_.d.data());
    if (!flow(body_.package(), field_, s_.x.data(), h_, piece_.state.plastic)) return;
    invertPlasticity(piece_.state.plastic, piece_.rest_change);
    piece_.state.elastic = -1;
  }

  /// The rigid motion that minimizing, in floats, has lost is put back: a minimum has the prediction's centre.
  void keepMomentum(CoefficientMap& z, CoefficientMap& v) const {
    const ConstCoefficientMap at(z.data(), z.rows(), 3), moving(v.data(), v.rows(), 3);
    const Vector3d astray = meanOf(field_, at) - meanOf(field_, y());
    for (std::uint32_t j = 0; j < k_; ++j) z.row(j) -= (oneOf(field_, j) * astray).transpose();
    const Vector3d center = meanOf(field_, at);
    const Vector3d lacking = rigid_velocity_ - meanOf(field_, moving);
    // Angular momentum: what it was, less what the air took.
    const Vector3d wanted = angularMomentumBefore() * std::exp(-double(settings_.damping) * h_);
    const Vector3d found = angularMomentum(field_, at, moving, center, meanOf(field_, moving));
    const Vector3d turn = solved(inertiaOf(field_, at, center), wanted - found);
    for (std::uint32_t j = 0; j < k_; ++j) {
      const Vector3d arm = z.row(j).transpose() - oneOf(field_, j) * center;
      v.row(j) += (oneOf(field_, j) * lacking + turn.cross(arm)).transpose();
    }
  }

  Vector3d angularMomentumBefore() const {
    const ConstCoefficientMap z(piece_.state.z_before.data()->data(), Eigen::Index(k_), 3);
    const ConstCoefficientMap v(piece_.state.v_before.data()->data(), Eigen::Index(k_), 3);
    return angularMomentum(field_, z, v, rigid_.center, rigid_.velocity);
  }

  /// A free piece never has more energy than when something last acted on it.
  void keepEnergy(const CoefficientMap& z, CoefficientMap& v, bool free) {
    PieceState& state = piece_.state;
    if (field_.driven > 0) return;
    const ConstCoefficientMap at(z.data(), z.rows(), 3), moving(v.data(), v.rows(), 3);
    const Vector3d center = meanOf(field_, at), velocity = meanOf(field_, moving);
    const Vector3d omega = solved(inertiaOf(field_, at, center), angularMomentum(field_, at, moving, center, velocity));
    double whole = 0, deforming = 0;
    for (std::uint32_t j = 0; j < k_; ++j) {
      const Vector3d arm = z.row(j).transpose() - oneOf(field_, j) * center;
      const Vector3d own = v.row(j).transpose() - oneOf(field_, j) * velocity;
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
      const Vector3d arm = z.row(j).transpose() - oneOf(field_, j) * center;
      const Vector3d rigid = oneOf(field_, j) * velocity + omega.cross(arm);
      v.row(j) = (rigid + kept * (v.row(j).transpose() - rigid)).transpose();
    }
  }

  void react() {
    std::uint32_t rows = 0;
    if (field_.driven > 0) {
      // Elasticity pulls at the driven functions, and their own weight hangs on them.
      rows = field_.driven;
      tetherPull(field_, springStep(), std::as_const(piece_).z(), {s_.external.data(), rows});
      for (std::uint32_t j = 0; j < rows; ++j) {
        const float* const g = s_.gradient.data() + 4 * j;
        s_.external[j] += Vector3d(double(g[0]), double(g[1]), double(g[2])) - field_.driven_mass[j] * gravity_;
      }
    }
    addReactions(body_, piece_, springStep(), {s_.external.data(), rows});
  }

  Body& body_;
  Piece& piece_;
  const Field& field_;
  const WorldSettings& settings_;
  const std::span<const Collider* const> colliders_;
  const double h_;
  PieceScratch& scratch_;
  MinimizeScratch& s_;
  const std::uint32_t k_;
  const float stiffness_;
  const Vector3d gravity_;
  bool springs_ = false, two_step_ = false, together_ = false;
  Rigid rigid_;
  Matrix3d turn_ = Matrix3d::Identity();     ///< of a rigid body in this step
  Vector3d omega_after_ = Vector3d::Zero();  ///< its angular velocity then, rad/s
  double effective_h_ = 0;
  Vector3d center_ = Vector3d::Zero();  ///< that floats are relative to
  Vector3d rigid_velocity_ = Vector3d::Zero(), rigid_omega_ = Vector3d::Zero();
  Objective objective_;
  Objective::Value value_;
};

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

/// The four vertices that carry a rigid part: as their rest shape, turned and moved to where they are.
void stiffen(Body& body, const formats::Cluster& cluster) {
  std::array<std::uint32_t, 4> corner = {};
  std::size_t found = 0;
  for (const formats::Membership& member :
       body.package().memberships().subspan(cluster.first_member, cluster.member_count)) {
    if (member.share > 0 && found < 4) corner[found++] = member.vertex;
  }
  if (found < 4) return;
  Vector3 rest_middle = Vector3::Zero(), middle = Vector3::Zero();
  for (const std::uint32_t v : corner) {
    rest_middle += 0.25F * asVector(body.vertices()[v].rest_position);
    middle += 0.25F * asVector(body.x[v]);
  }
  Matrix3 moment = Matrix3::Zero();
  for (const std::uint32_t v : corner) {
    moment += Vector3(asVector(body.x[v]) - middle) *
              Vector3(asVector(body.vertices()[v].rest_position) - rest_middle).transpose();
  }
  const Matrix3 rotation = geometry::nearestRotation(moment);
  for (const std::uint32_t v : corner) {
    body.x[v] = asArray(middle + rotation * (asVector(body.vertices()[v].rest_position) - rest_middle));
  }
}

void resizeState(Piece& piece) {
  const std::size_t k = piece.field().k;
  for (Array<Vector3d>* array : {&piece.state.z, &piece.state.v, &piece.state.z_before, &piece.state.v_before}) {
    array->resize(k);
  }
  piece.springs_firm = -1;
  piece.system.h = 0;
}

/// There was no step before.
void standStill(PieceState& state) {
  std::copy(state.z.begin(), state.z.end(), state.z_before.begin());
  std::copy(state.v.begin(), state.v.end(), state.v_before.begin());
  state.turn.setZero();
  state.h_before = 0;
}

}  // namespace

void PieceScratch::reserve(const Piece& piece) {
  for (const Field* field : {piece.free, piece.fixed}) {
    if (field == nullptr) continue;
    minimize.reserve(*field, kMostContacts);
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

void restPiece(const Body& body, Piece& piece) {
  resizeState(piece);
  const Field& field = piece.field();
  Matrix3d rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = double(body.settings.rotation[std::size_t(i)]);
  const Vector3d position = asVector(body.settings.position).cast<double>();
  PieceState& state = piece.state;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    state.z[j] = rotation * restOf(field, j) + oneOf(field, j) * position;
    state.v[j].setZero();
  }
  standStill(state);
  state.elastic = state.budget = piece.tensions.empty() ? 0 : -1;
  state.touching.clear();
  resetPlasticity(field, state.plastic);
  invertPlasticity(state.plastic, piece.rest_change);
}

void updateFibres(Body& body, bool changed) {
  const auto& activation = body.activation;
  const float stiffness = body.settings.stiffness_scale * body.settings.stiffness_scale;
  const bool active = std::any_of(activation.begin(), activation.end(), [](float value) { return value > 0; });
  for (Piece& piece : body.pieces) {
    const Field& field = piece.field();
    piece.tensions.resize(active ? field.fibres.size() : 0);
    for (std::size_t i = 0; i < piece.tensions.size(); ++i) {
      const formats::FieldFibre& fibre = field.fibres[i];
      const std::uint32_t channel = body.package().mechanics()[fibre.cluster].channel;
      piece.tensions[i] = stiffness * activation[channel] * fibre.tension;
    }
    if (field.fibres.empty() || !changed) continue;
    piece.state.elastic = piece.state.budget = -1;
  }
}

void refresh(Body& body, double part) {
  if (!body.outdated && body.shown == part) return;
  body.outdated = false;
  body.shown = part;
  const double left = 1 - part;
  for (const Piece& piece : body.pieces) {
    const Field& field = piece.field();
    const std::uint32_t blocks = (field.vertex_count + 7) / 8;
    Array<float>&coefficients = body.coefficients, &out = body.field_values;
    coefficients.resize(4 * std::size_t(field.k));
    out.resize(24 * std::size_t(blocks));
    const PieceState& state = piece.state;
    const Vector3d now = meanOf(field, piece.z());
    const Vector3d before = meanOf(field, {state.z_before.data()->data(), Eigen::Index(field.k), 3});
    const Vector3d center = left * before + part * now;
    const Matrix3d onward = turnBy(part * state.turn), back = turnBy(-left * state.turn);
    for (const bool moving : {false, true}) {
      for (std::uint32_t j = 0; j < field.k; ++j) {
        const double one = oneOf(field, j);
        const Vector3d row = moving ? Vector3d(left * state.v_before[j] + part * state.v[j])
                                    : Vector3d(left * (onward * (state.z_before[j] - one * before)) +
                                               part * (back * (state.z[j] - one * now)));
        for (std::uint32_t c = 0; c < 3; ++c) coefficients[4 * j + c] = float(row[int(c)]);
      }
      kernels().field_values({field.k, blocks, field.values, coefficients.data(), out.data()});
      Array<Vec3>& to = moving ? body.v : body.x;
      for (std::uint32_t i = 0; i < field.vertex_count; ++i) {
        for (std::size_t c = 0; c < 3; ++c) {
          const float value = out[24 * (i / 8) + 8 * c + i % 8];
          to[field.first_vertex + i][c] = moving ? value : float(double(value) + center[int(c)]);
        }
      }
    }
  }
  // What rides along rigidly keeps its shape.
  for (const formats::AttachedPart& rider : body.package().parts()) {
    if (rider.cluster != formats::kNone) stiffen(body, body.package().clusters()[rider.cluster]);
  }
  // What is held is drawn where it is held: springs leave the local give to the vertex itself.
  for (const Pin& pin : body.pins) {
    body.x[pin.vertex] = asArray(Vector3(float(left) * asVector(pin.before) + float(part) * asVector(pin.at)));
  }
  for (const PinSet& set : body.pin_sets) {
    const RigidTransform at = between(set.before, set.at, part);
    for (const PinnedVertex& vertex : set.vertices) {
      const auto to = asVector(body.x[vertex.vertex]);
      const Vector3 place = placeOf(at, vertex.local).cast<float>();
      body.x[vertex.vertex] = asArray(to + vertex.weight * (place - to));
    }
  }
}

void project(Body& body) {
  for (Piece& piece : body.pieces) {
    const Field& field = piece.field();
    PieceState& state = piece.state;
    resizeState(piece);
    Vector3d center = Vector3d::Zero();
    double mass = 0;
    for (std::uint32_t i = 0; i < field.vertex_count; ++i) {
      const double m = double(body.vertices()[field.first_vertex + i].mass);
      center += m * asVector(body.x[field.first_vertex + i]).cast<double>();
      mass += m;
    }
    center /= mass;
    for (const bool moving : {false, true}) {
      Array<Vector3d>& to = moving ? state.v : state.z;
      std::fill(to.begin(), to.end(), Vector3d::Zero());
      if (field.driven > 0) {
        // The pin sets prescribe these.
        for (std::uint32_t j = 0; j < field.driven && !moving; ++j) {
          for (const PinSet& set : body.pin_sets) {
            if (set.source != field.functions[j].pin_set) continue;
            const std::uint32_t monomial = field.functions[j].monomial;
            for (std::size_t c = 0; c < 3; ++c) {
              to[j][int(c)] = double(monomial == 0 ? set.at.position[c] : set.at.rotation[3 * c + monomial - 1]);
            }
            if (monomial == 0) to[j] -= center;
          }
        }
      }
      // The functions are orthonormal but for rounding: a second round takes what the first has left.
      for (int round = 0; round < 2; ++round) {
        for (std::uint32_t i = 0; i < field.vertex_count; ++i) {
          const std::uint32_t vertex = field.first_vertex + i;
          Vector3d left = asVector(moving ? body.v[vertex] : body.x[vertex]).cast<double>();
          if (!left.allFinite()) continue;
          if (!moving) left -= center;
          body.residuals[vertex] = left;
          for (std::uint32_t j = 0; j < field.k; ++j) {
            body.residuals[vertex] -= double(field.valueAt(i, j)) * to[j];
          }
        }
        for (std::uint32_t i = 0; i < field.vertex_count; ++i) {
          const std::uint32_t vertex = field.first_vertex + i;
          const Vector3d weighed = double(body.vertices()[vertex].mass) * body.residuals[vertex];
          for (std::uint32_t j = field.driven; j < field.k; ++j) to[j] += double(field.valueAt(i, j)) * weighed;
        }
      }
      if (moving) continue;
      for (std::uint32_t j = 0; j < field.k; ++j) to[j] += oneOf(field, j) * center;
    }
    standStill(state);
    state.elastic = -1;
    state.budget = -1;
    state.touching.clear();
  }
  body.outdated = true;
}

bool chooseFields(Body& body) {
  bool changed = false;
  for (Piece& piece : body.pieces) {
    bool held = piece.fixed != nullptr;
    if (held) {
      for (std::uint32_t j = 0; j < piece.fixed->driven; ++j) {
        const std::uint32_t source = piece.fixed->functions[j].pin_set;
        held = held && std::any_of(body.pin_sets.begin(), body.pin_sets.end(),
                                   [source](const PinSet& set) { return set.source == source; });
      }
    }
    piece.springs_firm = -1;
    piece.system.h = 0;
    if (held == piece.state.held) continue;
    const Field& before = piece.field();
    piece.state.held = held;
    movePlasticity(before, piece.field(), piece.state.plastic);
    invertPlasticity(piece.state.plastic, piece.rest_change);
    changed = true;
  }
  if (changed) updateFibres(body);
  return changed;
}

double kineticEnergy(const Body& body) {
  double energy = 0;
  for (const Piece& piece : body.pieces) {
    for (const Vector3d& row : piece.state.v) energy += 0.5 * row.squaredNorm();
  }
  return energy;
}

double elasticEnergy(Body& body, PieceScratch& scratch) {
  double energy = 0;
  for (Piece& piece : body.pieces) {
    const Field& field = piece.field();
    MinimizeScratch& s = scratch.minimize;
    scratch.reserve(piece);
    const Vector3d center = meanOf(field, std::as_const(piece).z());
    Objective objective;
    objective.field = &field;
    objective.h = 1;
    objective.stiffness = body.settings.stiffness_scale * body.settings.stiffness_scale;
    objective.scratch = &s;
    setMaterial(piece, objective);
    s.contacts.clear();
    std::fill_n(s.d.begin(), 4 * field.k, 0.0F);
    objective.setFrame({piece.state.z.data(), field.k}, center, restCenterOf(field),
                       rotationOf(field, std::as_const(piece).z(), center));
    energy += objective.elastic(s.d.data(), s.next_gradient.data(), true);
  }
  return energy;
}

namespace {

/// Points so close to another box are looked at, diagonals.
constexpr double kBoxMargin = 2e-3;

std::uint32_t rootOf(Array<std::uint32_t>& parent, std::uint32_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

void addBox(const Body& body, std::uint32_t body_index, std::uint32_t piece_index, const Vector3d& gravity, double h,
            TogetherScratch& scratch) {
  const Piece& piece = body.pieces[piece_index];
  const Field& field = piece.field();
  if (field.points.empty()) return;
  const std::uint32_t blocks = std::uint32_t((field.points.size() + 7) / 8);
  const Vector3d center = meanOf(field, piece.z());
  if (scratch.points.size() < 8 * std::size_t(blocks)) scratch.points.resize(8 * std::size_t(blocks));
  PieceBox box = {body_index, piece_index, {}, {}};
  const double margin = kBoxMargin * double(body.package().info().diagonal);
  for (int axis = 0; axis < 3; ++axis) {
    float low = 1e30F, high = -1e30F;
    for (const bool later : {false, true}) {
      std::array<float, 1024> along;
      for (std::uint32_t j = 0; j < field.k; ++j) {
        const double one = oneOf(field, j);
        double x = piece.state.z[j][axis] - one * center[axis];
        if (later) x += h * (piece.state.v[j][axis] + one * h * gravity[axis]);
        along[j] = float(x);
      }
      kernels().field_heights({field.k, blocks, field.point_values, along.data(), scratch.points.data()});
      for (std::size_t p = 0; p < field.points.size(); ++p) {
        low = std::min(low, scratch.points[p]);
        high = std::max(high, scratch.points[p]);
      }
    }
    box.low[std::size_t(axis)] = center[axis] + double(low) - margin;
    box.high[std::size_t(axis)] = center[axis] + double(high) + margin;
  }
  scratch.boxes.push_back(box);
}

bool mayTouch(const BodySettings& a, const BodySettings& b) {
  return (a.layers & b.touches) != 0 && (b.layers & a.touches) != 0;
}

/// Order of floats as that of their bits.
std::uint64_t sortable(float value) {
  std::uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  return (bits & 0x80000000U) != 0 ? ~bits : bits | 0x80000000U;
}

/// The pieces of an island, minimized as one.
class Island {
 public:
  Island(std::span<const std::uint32_t> members, OwningArray<PieceStep>& steps, std::span<const TouchingPiece> seen,
         std::span<const FoundTouch> found, TogetherScratch& scratch, JobSystem* jobs)
      : members_(members), steps_(steps), seen_(seen), found_(found), scratch_(scratch), jobs_(jobs) {}

  void run(double h, const WorldSettings& settings) {
    gather();
    solve(settings.iterations);
    bool leaning = false;
    for (const std::uint32_t m : members_) leaning = leaning || steps_[m].isSupported();
    for (std::size_t i = 0; i < members_.size(); ++i) {
      MinimizeScratch& own = steps_[members_[i]].scratch();
      const std::uint32_t size = 4 * steps_[members_[i]].field().k;
      std::copy_n(scratch_.vectors.d.data() + first_[i], size, own.d.data());
      std::copy_n(scratch_.vectors.gradient.data() + first_[i], size, own.gradient.data());
      steps_[members_[i]].finishTogether(leaning);
    }
    if (!leaning) keepMomentum(h, settings);
    remember();
  }

 private:
  std::size_t placeOf(std::uint32_t member) const {
    return std::size_t(std::lower_bound(members_.begin(), members_.end(), member) - members_.begin());
  }

  void gather() {
    std::uint32_t size = 0;
    for (const std::uint32_t m : members_) {
      first_.push_back(size);
      size += 4 * steps_[m].field().k;
      objectives_.push_back(&steps_[m].objective());
      systems_.push_back(&steps_[m].system());
    }
    for (const FoundTouch& found : found_) {
      Touch& touch = touches_.add();
      touch = found.touch;
      touch.phi_a = scratch_.found.rows.data() + found.row_a;
      touch.phi_b = scratch_.found.rows.data() + found.row_b;
      touch.a = std::uint32_t(placeOf(found.touch.a));
      touch.b = std::uint32_t(placeOf(found.touch.b));
    }
    minimand_.pieces = {objectives_.data(), objectives_.size()};
    minimand_.systems = {systems_.data(), systems_.size()};
    minimand_.first = {first_.data(), first_.size()};
    minimand_.size = size;
    minimand_.touches = {touches_.data(), touches_.size()};
    minimand_.vectors = &scratch_.vectors;
    values_.resize(members_.size());
    minimand_.values = {values_.data(), values_.size()};
    minimand_.jobs = jobs_;
    scratch_.vectors.reserveVectors(size);
    // Rows by piece: each touch is one of both its sides.
    rows_.reserve(2 * touches_.size());
    for (std::size_t i = 0; i < members_.size(); ++i) {
      const std::size_t begin = rows_.size();
      for (const Touch& touch : touches_) {
        if (touch.a == i) rows_.push_back({touch.phi_a, touch.kappa, keyOf(touch)});
        if (touch.b == i) rows_.push_back({touch.phi_b, touch.kappa, ~keyOf(touch)});
      }
      steps_[members_[i]].prepareTogether({rows_.data() + begin, rows_.size() - begin});
      std::copy_n(steps_[members_[i]].scratch().base.data(), 4 * steps_[members_[i]].field().k,
                  scratch_.vectors.base.data() + first_[i]);
    }
  }

  std::uint32_t keyOf(const Touch& touch) const {
    const TouchMemory& memory = found_[std::size_t(&touch - touches_.data())].memory;
    return memory.point ^ (memory.body_a * 2654435761U) ^ (memory.body_b * 2246822519U);
  }

  /// From the prediction, from where all were, or from where those were that touched already: the lowest of these.
  void solve(std::uint32_t iterations) {
    MinimizeScratch& s = scratch_.vectors;
    const std::uint32_t size = minimand_.size;
    std::fill_n(s.d.begin(), size, 0.0F);
    minimand_.press(s.d.data());
    Objective::Value value = minimand_.at(s.d.data(), s.gradient.data(), true);
    int chosen = 0;
    for (int start = 1; start < 3; ++start) {
      bool differs = start == 1;
      for (std::size_t i = 0; i < members_.size(); ++i) {
        float* const next = s.next.data() + first_[i];
        if (start == 1 || steps_[members_[i]].leaned()) {
          steps_[members_[i]].oldPlace(next);
        } else {
          std::fill_n(next, 4 * steps_[members_[i]].field().k, 0.0F);
          differs = true;
        }
      }
      if (!differs) break;
      minimand_.press(s.next.data());
      const Objective::Value other = minimand_.at(s.next.data(), s.next_gradient.data(), false);
      if (!(other.total < value.total)) continue;
      chosen = start;
      value = other;
      std::copy_n(s.next.data(), size, s.d.data());
      std::copy_n(s.next_gradient.data(), size, s.gradient.data());
    }
    minimand_.press(s.d.data());
    if (chosen != 2) value = minimand_.at(s.d.data(), s.gradient.data(), false);
    minimize(minimand_, 2 * iterations, value);
  }

  /// What minimizing has lost of the motion as a whole is put back: all forces were between the pieces.
  void keepMomentum(double h, const WorldSettings& settings) {
    double mass = 0;
    Vector3d astray = Vector3d::Zero(), lacking = astray, before = astray, moving = astray, center = astray,
             now = astray;
    for (const std::uint32_t m : members_) {
      const PieceStep::Whole w = steps_[m].whole();
      mass += w.mass;
      astray += w.mass * (w.predicted - w.after);
      lacking += w.mass * (w.velocity_predicted - w.velocity);
      before += w.mass * w.before;
      moving += w.mass * w.velocity_before;
    }
    for (const std::uint32_t m : members_) {
      steps_[m].add(astray / mass, lacking / mass, Vector3d::Zero(), Vector3d::Zero());
    }
    before /= mass;
    moving /= mass;
    for (const std::uint32_t m : members_) {
      const PieceStep::Whole w = steps_[m].whole();
      center += w.mass / mass * w.after;
      now += w.mass / mass * w.velocity;
    }
    Vector3d wanted = Vector3d::Zero(), found = wanted;
    Matrix3d inertia = Matrix3d::Zero();
    for (const std::uint32_t m : members_) {
      const PieceStep::Whole w = steps_[m].whole();
      wanted += w.spin_before + w.mass * Vector3d(w.before - before).cross(Vector3d(w.velocity_before - moving));
      found += w.spin + w.mass * Vector3d(w.after - center).cross(Vector3d(w.velocity - now));
      const Vector3d arm = w.after - center;
      inertia += w.inertia + w.mass * (arm.squaredNorm() * Matrix3d::Identity() - arm * arm.transpose());
    }
    wanted *= std::exp(-double(settings.damping) * h);
    const Vector3d omega = solved(inertia, wanted - found);
    for (const std::uint32_t m : members_) steps_[m].add(Vector3d::Zero(), Vector3d::Zero(), omega, center);
  }

  void remember() {
    for (std::size_t i = 0; i < touches_.size(); ++i) {
      const FoundTouch& found = found_[i];
      TouchMemory memory;
      if (rememberTouch(found, seen_[found.touch.a], seen_[found.touch.b],
                        scratch_.vectors.d.data() + first_[touches_[i].a],
                        scratch_.vectors.d.data() + first_[touches_[i].b],
                        {scratch_.found.rows.data(), scratch_.found.rows.size()}, memory)) {
        scratch_.next_touching.push_back(memory);
      }
    }
  }

  std::span<const std::uint32_t> members_;
  OwningArray<PieceStep>& steps_;
  std::span<const TouchingPiece> seen_;
  std::span<const FoundTouch> found_;
  TogetherScratch& scratch_;
  Array<std::uint32_t> first_;
  Array<Objective*> objectives_;
  Array<SystemFactor*> systems_;
  Array<Touch> touches_;
  Array<TouchRow> rows_;
  Array<Objective::Value> values_;
  JobSystem* jobs_;
  Minimand minimand_;
};

}  // namespace

void findPairs(const BodyList& bodies, const WorldSettings& settings, double seconds, TogetherScratch& scratch) {
  scratch.boxes.clear();
  scratch.pairs.clear();
  scratch.order.clear();
  scratch.busy.resize(bodies.size());
  std::fill(scratch.busy.begin(), scratch.busy.end(), std::uint8_t{0});
  if (!settings.collisions || bodies.size() < 2) return;
  const Vector3d gravity = asVector(settings.gravity).cast<double>();
  for (std::uint32_t b = 0; b < bodies.size(); ++b) {
    for (std::uint32_t p = 0; p < bodies[b]->pieces.size(); ++p) addBox(*bodies[b], b, p, gravity, seconds, scratch);
  }
  const auto& boxes = scratch.boxes;
  if (boxes.empty()) return;
  // Sorted by their lower ends along x, in floats about the first: equal ones in their order.
  const double origin = boxes[0].low[0];
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    scratch.order.push_back(sortable(float(boxes[i].low[0] - origin)) << 32 | i);
  }
  sortAscending({scratch.order.data(), scratch.order.size()});
  for (std::size_t n = 0; n < scratch.order.size(); ++n) {
    const PieceBox& a = boxes[std::uint32_t(scratch.order[n])];
    const double tie = 1e-6 * (std::abs(a.high[0] - origin) + std::abs(a.low[0] - origin));
    for (std::size_t m = n + 1; m < scratch.order.size(); ++m) {
      const PieceBox& b = boxes[std::uint32_t(scratch.order[m])];
      if (b.low[0] > a.high[0] + tie) break;
      if (a.body == b.body || !mayTouch(bodies[a.body]->settings, bodies[b.body]->settings)) continue;
      bool meet = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        meet = meet && a.low[axis] <= b.high[axis] && b.low[axis] <= a.high[axis];
      }
      if (!meet) continue;
      const std::uint32_t i = std::uint32_t(scratch.order[n]), j = std::uint32_t(scratch.order[m]);
      scratch.pairs.push_back(std::uint64_t(std::min(i, j)) << 32 | std::max(i, j));
      scratch.busy[a.body] = scratch.busy[b.body] = 1;
    }
  }
  sortAscending({scratch.pairs.data(), scratch.pairs.size()});
}

void stepTogether(BodyList& bodies, const StepWorld& world, double seconds, TogetherScratch& scratch, JobSystem* jobs) {
  const WorldSettings& settings = world.settings;
  scratch.next_touching.clear();
  scratch.found.touches.clear();
  scratch.found.rows.clear();
  // One step for each piece of a busy body, in the order of boxes.
  OwningArray<PieceStep> steps(scratch.touching.memory());
  Array<TouchingPiece> seen(scratch.touching.memory());
  scratch.places.resize(scratch.boxes.size());
  std::size_t before = 0, points = 0, count = 0;
  for (const PieceBox& box : scratch.boxes) {
    if (scratch.busy[box.body] == 0) continue;
    const Field& field = bodies[box.body]->pieces[box.piece].field();
    before += 4 * field.k;
    points += pointFloats(field);
    if (scratch.pieces.size() <= count) scratch.pieces.emplace_back(scratch.touching.memory());
    scratch.pieces[count++].reserve(bodies[box.body]->pieces[box.piece]);
  }
  scratch.before.resize(before);
  scratch.points.resize(points);
  before = points = 0;
  for (std::size_t i = 0; i < scratch.boxes.size(); ++i) {
    const PieceBox& box = scratch.boxes[i];
    if (scratch.busy[box.body] == 0) continue;
    Body& body = *bodies[box.body];
    Piece& piece = body.pieces[box.piece];
    scratch.places[i] = std::uint32_t(steps.size());
    PieceStep& step = steps.emplace_back(body, piece, world, seconds, scratch.pieces[steps.size()]);
    step.begin();
    step.useEuler();
    const std::size_t k = piece.field().k;
    TouchingPiece& sees = seen.add();
    sees = step.touchingPiece({scratch.before.data() + before, 4 * k});
    before += 4 * k;
    placePoints(sees, {scratch.points.data() + points, pointFloats(piece.field())});
    points += pointFloats(piece.field());
  }
  scratch.parent.resize(steps.size());
  for (std::uint32_t i = 0; i < steps.size(); ++i) scratch.parent[i] = i;
  for (const std::uint64_t pair : scratch.pairs) {
    const std::uint32_t a = scratch.places[pair >> 32], b = scratch.places[std::uint32_t(pair)];
    const std::size_t count_before = scratch.found.touches.size();
    const std::span<const TouchMemory> known(scratch.touching.data(), scratch.touching.size());
    findTouches(seen[a], seen[b], a, b, seconds, known, scratch.found);
    findTouches(seen[b], seen[a], b, a, seconds, known, scratch.found);
    if (scratch.found.touches.size() > count_before) {
      const std::uint32_t root_a = rootOf(scratch.parent, a), root_b = rootOf(scratch.parent, b);
      scratch.parent[std::max(root_a, root_b)] = std::min(root_a, root_b);
    }
  }
  // By island, members and touches in their order.
  Array<std::uint64_t> members(scratch.touching.memory()), touches(scratch.touching.memory());
  for (std::uint32_t i = 0; i < steps.size(); ++i) {
    members.push_back(std::uint64_t(rootOf(scratch.parent, i)) << 32 | i);
  }
  for (std::uint32_t t = 0; t < scratch.found.touches.size(); ++t) {
    touches.push_back(std::uint64_t(rootOf(scratch.parent, scratch.found.touches[t].touch.a)) << 32 | t);
  }
  sortAscending({members.data(), members.size()});
  sortAscending({touches.data(), touches.size()});
  std::size_t t = 0;
  for (std::size_t m = 0; m < members.size();) {
    const std::uint64_t root = members[m] >> 32;
    Array<std::uint32_t> ids(scratch.touching.memory());
    Array<FoundTouch> own(scratch.touching.memory());
    for (; m < members.size() && members[m] >> 32 == root; ++m) ids.push_back(std::uint32_t(members[m]));
    for (; t < touches.size() && touches[t] >> 32 == root; ++t) {
      own.push_back(scratch.found.touches[std::uint32_t(touches[t])]);
    }
    if (own.empty()) {
      steps[ids[0]].finishAlone();
      continue;
    }
    for (const std::uint32_t id : ids) steps[id].setTogether();
    Island({ids.data(), ids.size()}, steps, {seen.data(), seen.size()}, {own.data(), own.size()}, scratch, jobs)
        .run(seconds, settings);
  }
  for (std::size_t i = 0; i < scratch.boxes.size(); ++i) {
    const PieceBox& box = scratch.boxes[i];
    if (scratch.busy[box.body] == 0) continue;
    Body& body = *bodies[box.body];
    body.outdated = true;
    if (box.piece == 0) body.repaired = 0;
    Piece& piece = body.pieces[box.piece];
    if (isUsable(piece)) continue;
    restPiece(body, piece);
    body.repaired += piece.field().vertex_count;
  }
  std::sort(scratch.next_touching.begin(), scratch.next_touching.end(),
            [](const TouchMemory& x, const TouchMemory& y) { return touchOrder(x) < touchOrder(y); });
  scratch.touching.swap(scratch.next_touching);
}

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#include "runtime/step/piece_step.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "runtime/geometry/rotation.h"
#include "runtime/interact/pin_sets.h"
#include "runtime/solver/plasticity.h"
#include "runtime/solver/springs.h"

namespace sinew::internal {
namespace {

/// Turns of more than this, rad, are taken in parts, three rounds of the midpoint each: what those leave is of fourth
/// order in the part. A two-step formula does not reach across them (docs/method.md).
constexpr double kLargeTurn = 0.1;
/// Bounded work: a turn of a revolution, beyond which no step of a second looks like one.
constexpr double kMostParts = 64;
/// Steps whose lengths differ by more than this factor do not continue a two-step formula.
constexpr double kUnlike = 2.0;

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
}

class PieceStep {
 public:
  PieceStep(Body& body, Piece& piece, const WorldSettings& settings, double seconds, PieceScratch& scratch)
      : body_(body),
        piece_(piece),
        field_(piece.field()),
        settings_(settings),
        h_(seconds),
        scratch_(scratch),
        s_(scratch.minimize),
        k_(field_.k),
        stiffness_(body.settings.stiffness_scale * body.settings.stiffness_scale),
        gravity_(asVector(settings.gravity).cast<double>()) {}

  void run() {
    s_.reserve(field_, kMostContacts);
    springs_ = hasSprings(body_, piece_);
    grounded_ = settings_.ground.enabled && !field_.points.empty();
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
    solve();
    settle();
  }

 private:
  ConstCoefficientMap y() const { return {s_.prediction.data()->data(), Eigen::Index(k_), 3}; }
  PlaneStep planeStep() const {
    return {&settings_.ground, h_, double(body_.package().info().diagonal), field_.mass * gravity_.norm(), stiffness_};
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
    const bool supported = springs_ || !piece_.state.touching.empty();
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
    s_.contacts.clear();
    if (grounded_) {
      objective_.friction = settings_.ground.friction;
      objective_.normal = asVector(settings_.ground.normal);
      findContacts(piece_, planeStep(), y(), center_, {scratch_.heights.data(), scratch_.heights.size()}, s_);
    }
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
    auto known = piece_.state.touching.begin();
    const auto end = piece_.state.touching.end();
    return std::all_of(s_.contacts.begin(), s_.contacts.end(), [&](const Contact& contact) {
      while (known != end && known->point < contact.point) ++known;
      return !(contact.gap < 0) || (known != end && known->point == contact.point);
    });
  }

  void solve() {
    useRestSystem(objective_, piece_.system);
    const ConstCoefficientMap now = std::as_const(piece_).z();
    objective_.setFrame({s_.prediction.data(), k_}, center_, restCenterOf(field_),
                        rotationOf(field_, now, meanOf(field_, now)));
    std::fill_n(s_.d.begin(), 4 * k_, 0.0F);
    std::fill_n(s_.next.begin(), 4 * field_.driven, 0.0F);
    if (grounded_) objective_.press(s_.d.data());
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
    state.touching.clear();
    if (grounded_) rememberContacts(piece_, planeStep(), y(), center_, s_);
    // A two-step formula does not reach across contacts: it would gain energy where they come and go.
    state.h_before = touched || !state.touching.empty() ? 0 : h_;
    // A contact may have stopped the piece and not touch any more.
    const bool free = field_.driven == 0 && !springs_ && s_.contacts.empty() && !touched;
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
  const double h_;
  PieceScratch& scratch_;
  MinimizeScratch& s_;
  const std::uint32_t k_;
  const float stiffness_;
  const Vector3d gravity_;
  bool springs_ = false, grounded_ = false, two_step_ = false;
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
    const std::size_t points = (field->points.size() + 7) / 8 * 16;
    if (heights.size() < points) heights.resize(points);
  }
}

void stepPieces(Body& body, const WorldSettings& settings, double seconds, PieceScratch& scratch) {
  body.repaired = 0;
  for (Piece& piece : body.pieces) {
    PieceStep(body, piece, settings, seconds, scratch).run();
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

}  // namespace sinew::internal

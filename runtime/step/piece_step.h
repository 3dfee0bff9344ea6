// SPDX-License-Identifier: MIT
//
// One step of a piece: predict, solve, settle (docs/method.md §3).
#pragma once

#include "runtime/contact/contacts.h"
#include "runtime/contact/touch.h"
#include "runtime/solver/cluster_solver.h"
#include "runtime/solver/minimize.h"
#include "runtime/solver/springs.h"
#include "runtime/world/body.h"

namespace sinew::internal {

/// Memory that stepping one piece takes, lent to it.
struct PieceScratch {
  explicit PieceScratch(std::pmr::memory_resource* memory) : minimize(memory), contacts(memory) {}
  void reserve(const Piece& piece);

  MinimizeScratch minimize;
  ContactScratch contacts;
};

/// The rigid motion of a piece: centre, velocity of the centre, angular velocity.
struct Rigid {
  Vector3d center = Vector3d::Zero(), velocity = Vector3d::Zero(), omega = Vector3d::Zero();
};

/// The step of a piece: begin() up to where it is a minimization, then its end, alone or together with what it touches.
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
        gravity_(double(body.settings.gravity_scale) * asVector(world.settings.gravity).cast<double>()) {}

  void run();

  void begin();

  /// The end of a step that touches nothing else.
  void finishAlone();
  void setTogether() { together_ = true; }

  /// The same near other pieces: a two-step formula does not reach across contacts.
  void useEuler();

  /// The piece as other pieces touch it. \param before room for the coefficients before the step, k x 4.
  TouchingPiece touchingPiece(std::span<float> before) const;

  Objective& objective() { return objective_; }
  SystemFactor& system() { return piece_.system; }
  /// Of this step, none yet.
  Pairs& startPairs() {
    piece_.state.pairs.start(4 * k_);
    return piece_.state.pairs;
  }
  MinimizeScratch& scratch() { return s_; }
  const Field& field() const { return field_; }
  /// It stands as if it were rock: a part of an island that does not move.
  bool stands() const { return body_.activity != Activity::active; }
  bool isSupported() const { return stands() || springs_ || field_.driven > 0 || !s_.contacts.empty(); }
  /// What the shape stores before the step, J; negative: not known.
  double stored() const { return piece_.state.elastic; }
  bool leaned() const { return piece_.state.leaning || !piece_.state.touching.empty(); }
  /// The body's, or the world's, 1/s.
  double supportDamping() const;

  /// Takes the memory that prepareTogether() needs for so many rows.
  void reserveSystem(std::size_t rows);
  /// The objective with its touches: its first matrix and its frame.
  void prepareTogether(std::span<TouchRow> rows);
  /// Where it was, moved along with its pin sets, from the prediction, in the frame of the piece. \param d k x 4.
  void oldPlace(float* d) const;
  /// The end of a step whose offset and gradient are in scratch(). \param leaning on something that is held. \param
  /// elastic energy there, J
  void finishTogether(bool leaning, double elastic);

  /// Mass, centre and motion as a whole: before the step, as predicted, and after it.
  struct Whole {
    double mass;
    Vector3d before, velocity_before, spin_before, predicted, velocity_predicted, after, velocity, spin;
    Matrix3d inertia;
  };
  Whole whole() const;
  /// Moved as a whole: by a way, and by a motion about a point.
  void add(const Vector3d& way, const Vector3d& velocity, const Vector3d& omega, const Vector3d& about);

 private:
  ConstCoefficientMap y() const { return {s_.prediction.data()->data(), Eigen::Index(k_), 3}; }
  std::span<const Collider* const> nearby() const;
  const Collider& colliderOf(const ColliderTouch& touch) const;
  ContactStep contactStep() const;
  /// What gravity alone adds to the prediction of what nothing drives, m; 0 where nothing takes it back.
  Vector3d fall() const;
  SpringStep springStep() const {
    return {h_, field_.mass * gravity_.norm(), stiffness_, frame_, moved_, ahead_, center_};
  }

  /// begin() of what stands.
  void stand();
  /// What pins hold decays as it rings on them.
  void dampOnHolds();

  /// Forces at points become generalized ones. \return whether there are any.
  bool findForces();
  /// The air's drag as springs to where the wind leads, c / h each.
  void addDrag();
  /// Takes drag's momentum where nothing holds the piece.
  void takeDrag();
  double keptOfTurns() const;

  /// The rigid motion: of the pin sets where the field holds the piece, else of its mass. \param center of that
  void findMotion(const Vector3d& center);

  bool mayContinue() const;

  Vector3d targetOf(std::uint32_t j) const;

  /// y, the predicted velocity, and what the inertia is about: BDF2 or implicit Euler, in a frame that turns with the
  /// piece.
  void predict();

  /// Centrifugal forces of what pin sets turn. \pre prediction and predicted velocity are arms and speeds in their
  /// frame.
  void addCentrifugal();

  void addForces();

  void setBase();

  /// The frame of the objective, and the turn that counts there.
  void setFrame();

  void findObjective();
  void findExternal();
  void findSprings();

  /// The old shape's coefficient, moved along with its pin sets.
  Vector3d oldPlaceOf(std::uint32_t j) const;
  /// The old shape's coefficient as the rigid motion of the step takes it. \param center to where it takes the centre.
  Vector3d movedAlong(std::uint32_t j, const Vector3d& center) const;

  /// Offsets from the old place in place of the prediction: stiff springs of what is at rest pull by the
  /// difference of where it is from where it should be, which floats hold only where both are near.
  void rebase();

  /// A way in the world becomes a coefficient's offset.
  void setOffset(float* d, std::uint32_t j, const Vector3d& way) const;

  bool touches() const;

  /// Where its motion takes it without its fall, from the prediction. \param d k x 4.
  void placeAlong(float* d) const;
  /// Whether a turn taken linearly from the old place would stretch the shape, and takes it farther than it falls: then
  /// what it lies on does not end the turn within the step.
  bool turnsFar() const;

  /// At the end of the last step.
  bool touched(const Contact& contact) const;
  /// Whether all that push at the prediction touched at the end of the last step.
  bool touchesAsBefore() const;

  /// The last step's pairs, of the second derivative.
  Pairs& carriedPairs();

  void setOldPlace();
  void solve();

  void settle();

  /// Deformation beyond the yield stays: the shape stores less then.
  void becomePermanent();

  /// The rigid motion that minimizing, in floats, has lost is put back: a minimum has the prediction's centre.
  void keepMomentum(CoefficientMap& z, CoefficientMap& v) const;

  /// Where the centre of mass of what is free comes to.
  Vector3d centerAfter() const;

  Vector3d angularMomentumBefore() const;

  /// A free piece never has more energy than when something last acted on it.
  void keepEnergy(const CoefficientMap& z, CoefficientMap& v, bool free);

  /// Restitution of what is free (docs/method.md §4). \param first of Body::touches that are this piece's. \param
  /// before energy that it stored, J.
  void rebound(CoefficientMap& v, std::size_t first, double before);

  void react();

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
  Vector3d dragged_ = Vector3d::Zero();  ///< way of the centre by the air, m
  bool springs_ = false, two_step_ = false, together_ = false;
  bool forced_ = false;  ///< forces at points or the air act: scratch.forces
  Vector3d forced_mean_ = Vector3d::Zero(), twist_ = Vector3d::Zero();  ///< their acceleration, m/s^2, and torque, N m
  Rigid rigid_;
  Matrix3d frame_ = Matrix3d::Identity();    ///< of the piece when the step begins
  Matrix3d ahead_ = Matrix3d::Identity();    ///< the same turned as the prediction is: that of the objective
  Vector3d moved_ = Vector3d::Zero();        ///< of the rest shape, with that frame
  Matrix3d turn_ = Matrix3d::Identity();     ///< of a rigid body in this step
  Vector3d omega_after_ = Vector3d::Zero();  ///< its angular velocity then, rad/s
  Vector3d momentum_ = Vector3d::Zero();     ///< angular, of what no pin set drives, after it, kg m^2/s
  double effective_h_ = 0;
  Vector3d center_ = Vector3d::Zero();  ///< that floats are relative to
  Vector3d rigid_velocity_ = Vector3d::Zero(), rigid_omega_ = Vector3d::Zero();
  Objective objective_;
  Objective::Value value_;
};

/// Whether a piece's state can be stepped: finite and not lost.
bool isUsable(const Piece& piece);

/// Permanent shapes and tensions: a piece's energy depends on these beside its coefficients.
void setMaterial(const Piece& piece, Objective& objective);

/// Advances all pieces of a body by one step, at whose end its pins and pin sets are where `at` says.
void stepPieces(Body& body, const StepWorld& world, double seconds, PieceScratch& scratch);

}  // namespace sinew::internal

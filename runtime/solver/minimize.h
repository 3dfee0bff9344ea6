// SPDX-License-Identifier: MIT
//
// One implicit step of a piece as a minimization (docs/method.md): the inertia about a prediction, the elastic energy
// at samples, springs of pins and picks, and contacts, all functions of the same coefficients.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "runtime/kernels/kernels.h"
#include "runtime/memory/array.h"
#include "runtime/solver/pairs.h"
#include "runtime/solver/piece.h"
#include "runtime/solver/rigid_coupling.h"
#include "runtime/solver/system.h"
#include "runtime/solver/touch_lanes.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// A push along a normal, held by friction across it: of a contact and of a touch alike.
struct Push {
  Eigen::Vector3f normal;  ///< unit, away from what pushes
  float gap;               ///< height above its floor at the prediction, m
  float floor;             ///< height that it is pushed to, m: see TouchingPoint
  Eigen::Vector3f slide;   ///< way across the normal from where friction holds it, at the prediction, m
  float kappa;             ///< N/m, damping included
  Eigen::Vector3f lag;     ///< part of the way pressed in and slid before the step, which its damping pulls to, m
  float firm;              ///< the same in the matrix; 0 where it does not count
  float friction;          ///< Coulomb coefficient
  float pressed;           ///< N, that friction sees
  Eigen::Vector3f way;     ///< from the prediction to where its point was last evaluated, m
};

/// Height above its floor at its way, m: it pushes where this is negative.
inline float gapOf(const Push& push) { return push.gap + push.normal.dot(push.way); }

/// \param pull of a spring that never slips, N. \param most friction's bound, N.
inline float heldAcross(float pull, float most) { return pull > most ? most / pull : 1; }
/// Part of kappa by which friction, under its present load, holds a push across the normal from where the prediction
/// has it: 1 where it sticks, else the chord of its energy's derivative (reweighted least squares, Holland and Welsch
/// 1977).
inline float heldAcross(const Push& push) {
  return heldAcross(push.kappa * push.slide.norm(), push.friction * push.pressed);
}

/// The energy's derivative by the way of a push's point, the force on what pushes, and the energy itself.
struct PushForce {
  Eigen::Vector3f pull = Eigen::Vector3f::Zero();  ///< N
  double energy = 0;                               ///< J
};
/// At the way of the push; none above its floor.
PushForce pushForce(const Push& push);

/// Adds a dashpot beside the spring of a push (Kelvin, Voigt): kappa u + c du/dt, u how far it is pressed in and slid,
/// is by implicit Euler (kappa + c / h) (u - lag), lag = c / (h kappa + c) u_before. \param c N s/m. \param before u
/// before the step, m.
void damp(Push& push, double c, double h, const Eigen::Vector3f& before);

/// A point that a collider may push out over a plane. Its compliance is the local one that a field of few functions
/// lacks: 1 / (E a).
struct Contact : Push {
  std::uint32_t point;     ///< TouchingPoint::point
  std::uint32_t collider;  ///< its number among those of the step
  Vector3d at;             ///< where it meets the collider, at the prediction, m
  Eigen::Vector3f rest;    ///< rest place of its row, m
  std::uint32_t touch;     ///< in ContactScratch::touches, of a collider's point
  float speed;             ///< m/s at which it came, where it did not touch before; else 0
  const float* phi;        ///< its row, k
  bool carries = true;     ///< the coarse level has it: see RigidCoupling::make()
};

/// Two points that push each other apart, out of b. A pull on one pulls the other back. Of one piece (a = b) the row of
/// a is the difference of theirs.
struct Touch : Push {
  std::uint32_t a, b;  ///< pieces
};

/// What first matrices know of a touch.
struct TouchLink {
  std::uint32_t a, b;   ///< pieces of a Minimand
  std::uint32_t slot;   ///< in TouchLanes
  float kappa, firm;    ///< Push
  bool carries = true;  ///< the coarse level has it: see RigidCoupling::make()
};

/// A Touch as one of its pieces has it.
struct TouchRow {
  const float* phi;
  float firm;           ///< Push::firm
  std::uint32_t key;    ///< of what touches: rows of one key are alike from step to step
  std::uint32_t touch;  ///< Minimand::touches
  float sign;           ///< of its force on the piece
  /// 1 and the arm of its point about the centre of the piece, at rest, m; of two points of one piece their difference.
  Eigen::Vector4f moments;
};

/// Memory of a minimization, for one piece after the other. Arrays of coefficients are k x 4 floats.
struct MinimizeScratch {
  explicit MinimizeScratch(std::pmr::memory_resource* memory);
  /// Grows to what a field needs with so many contacts.
  void reserve(const Field& field, std::size_t contacts);
  /// The same of what minimize() takes for so many floats of coefficients.
  void reserveVectors(std::size_t size);

  Array<float> base;    ///< the prediction, relative to its centre, in the world
  Array<float> offset;  ///< from there to the base
  Array<float> shape;   ///< the prediction relative to its centre, less the rest shape, in the frame of the piece
  Array<float> x, d, old, next, gradient, next_gradient, direction, residual, springs;
  Pairs pairs;          ///< of pieces together
  RigidCoupling rigid;  ///< of these, or of one piece that slides
  Array<float> lanes, parts, quaternions;
  Array<float> squeezed;
  Array<float> samples;  ///< of stiffnessAt()
  Array<double> holds;   ///< of makeHolds()
  Array<Contact> contacts;
  Array<float> rows;  ///< phi of the contacts
  Array<Vector3d> prediction, predicted_velocity, external;
  Array<Vector3d> forces;           ///< at points, on each coefficient, N
  Array<float> spinning, tumbling;  ///< of Objective::turning(): arms, and what turns the piece as a whole
};

/// The step's objective, relative to its value at the prediction but for the elastic energy. Offsets, gradients and
/// matrices are in the frame of the piece; places, ways and pulls of points in the world.
struct Objective {
  const Field* field = nullptr;
  double h = 0;                        ///< of the inertia: the step, or 2/3 of it, s
  float stiffness = 1;                 ///< factor on the moduli
  const float* rest_change = nullptr;  ///< Piece::rest_change, or null
  const Piece* fibres = nullptr;       ///< whose fibres, fibre_pull and fibre_energy count, or null
  bool has_springs = false;            ///< scratch.springs and scratch.residual count
  const float* holds = nullptr;        ///< Holds::by_function, or null
  Eigen::Matrix3f holds_rotation = Eigen::Matrix3f::Identity();  ///< of their frame in that of the piece
  bool has_offset = false;  ///< scratch.offset counts: the base is not where inertia alone would lead
  Eigen::Matrix3f rotation = Eigen::Matrix3f::Identity();  ///< of the piece
  /// Angular momentum of what turns freely, in that frame, kg m^2/s; 0: it does not count.
  Vector3d momentum = Vector3d::Zero();
  bool renewed = false;            ///< the first matrix is that of the shape where the minimization is
  bool renews = false;             ///< it is about to be made
  const float* system = nullptr;   ///< factor of the first matrix (solver/system.h); null: the modes of the rest shape
  std::span<TouchRow> touch_rows;  ///< of what couples it to other pieces
  MinimizeScratch* scratch = nullptr;

  struct Value {
    double total = 0, elastic = 0;
  };
  /// \param d offset from the prediction, k x 4. \param gradient may be null. \param mark finds how far squeezed
  /// samples lean on the piece's rotation.
  Value at(const float* d, float* gradient, bool mark) const;
  /// Coefficients less those of the rest shape. \param[out] x k x 4
  void placeAt(const float* d, float* x) const;
  /// Way in the world of a point with this row, m.
  Eigen::Vector3f wayOf(const float* row, const float* d) const;
  /// Second derivative of the elastic energy at d, made positive: 3 n rows of `stride` floats.
  void stiffnessAt(const float* d, float* matrix) const;
  /// The elastic energy, that of fibres among it, and its gradient, at the driven functions as well.
  double elastic(const float* d, float* gradient, bool mark) const;
  /// Makes scratch.shape and the start of the search for rotations. \param x coefficients. \param center of them.
  /// \param turned the frame: a rotation to the digits of doubles.
  void setFrame(std::span<const Vector3d> x, const Vector3d& center, const Matrix3d& turned);
  /// All of it but the elastic energy; adds to the gradient where that is not null.
  double besideElastic(const float* d, float* gradient) const;
  /// The springs' and contacts' part of it.
  double external(const float* d, float* gradient) const;
  /// Energy of the turn, 1/2 L . I^-1 L (docs/method.md §3): its derivatives are the centrifugal forces, and a piece
  /// that draws in pays for what its turn gains. Their torque, which tumbles it, is in the prediction already.
  double turning(const float* d, float* gradient) const;
  /// Gives it an angular momentum, kg m^2/s, in the world, if at this angular velocity centrifugal forces are more than
  /// what floats round. \pre setFrame()
  void spin(const Vector3d& angular, const Vector3d& velocity);
  /// Holds' part of it, beyond their pull at the prediction.
  double held(const float* d, float* gradient) const;
  /// Friction's bound follows the load at the last evaluation: corrects the gradient there. \return change of the
  /// value.
  double rub(float* gradient) const;
  /// Normal forces of the contacts at d become what friction sees.
  void press(const float* d) const;
  /// The first matrix's inverse times g, in place.
  void precondition(float* g) const;
  /// A direction's energy in contacts that the first matrix has but that do not push where last evaluated:
  /// sum of kappa |phi direction|^2, J. \param carrying of those that the coarse level has.
  double heldByContacts(const float* direction, bool carrying = false) const;
  /// Squared length of the way that the whole goes by its gradient and inertia alone, to be compared with settled2():
  /// of what contacts push a tenth of that way counts. 0 where anything holds it.
  double fallen2(const float* gradient) const;
  /// By a contact, where last evaluated.
  bool isPushed() const;
  /// Squared length below which a direction changes nothing, or is what floats round. \param way2 squared length of the
  /// way from the prediction.
  double settled2(double way2) const;
  /// Squared angular frequency above most elastic modes: what floats round of a shape pulls as if it were this stiff.
  double roughStiffness() const;
};

/// Pieces that are minimized together, and what couples them.
struct Minimand {
  std::span<Objective* const> pieces;
  std::span<SystemFactor* const> systems;
  std::span<const std::uint32_t> first;  ///< of each piece's coefficients in the vectors, floats
  std::uint32_t size = 0;                ///< of the vectors, floats
  std::span<TouchLink> touches;
  TouchLanes* lanes = nullptr;         ///< where they are evaluated; null: there are none
  MinimizeScratch* vectors = nullptr;  ///< base, d, next, gradient, next_gradient and direction count
  std::span<Objective::Value> values;  ///< of the pieces at the last at(); not of one piece alone
  std::span<double> elastic;           ///< of these where the minimization has come to, J
  JobSystem* jobs = nullptr;           ///< that shares the work; null: none
  std::span<Pairs* const> own_pairs;   ///< of each piece (takeOwn()); none of one piece alone
  RigidCoupling* rigid = nullptr;      ///< what precondition() knows of the touches; null: nothing
  /// The loads under which friction holds are about those of the end: `rigid` holds what slides along its normal alone.
  bool knows_loads = true;
  std::span<const std::uint32_t> order;  ///< of the pieces in `rigid`, first the ones that hang or lie on others

  Objective::Value at(const float* d, float* gradient, bool mark) const;
  /// The minimization has come to where the last at() was.
  void comeTo() const;
  /// All of it but the elastic energy.
  double besideElastic(const float* d) const;
  /// Friction takes the load at d.
  void press(const float* d) const;
  /// Objective::rub() of all, and of the touches.
  double rub(float* gradient) const;
  /// The inverses of the pieces' second derivatives, as first matrices and own pairs have them, and what couples them
  /// times g, in place; 0 where pins drive.
  void precondition(float* g) const;
  /// Pairs of each piece with the others where they are: the change of its gradient along its own part of a step, to
  /// which a touch adds kappa of what pushes. They meet what the pieces' first matrices do not know of them; pairs of
  /// all together meet what is between them (partitioned secant updates, Griewank and Toint 1982).
  /// \param from, to, gradient, next_gradient as in Pairs::take(), the last before rub().
  void takeOwn(const float* from, const float* to, const float* gradient, const float* next_gradient) const;
  bool hasFriction() const;
  /// Objective::heldByContacts() of all, and of the touches; of those that `rigid` frees by what that has.
  double heldByContacts(const float* direction) const;
  /// The largest squared length of a piece's part of a direction, times what changes nothing of it at d: a light piece
  /// is to settle as well as a heavy one.
  double unsettled2(const float* direction, const float* d) const;
  /// The same of Objective::fallen2(), of a piece alone or of those that nothing pushes.
  double fallen2(const float* gradient, const float* d) const;
  /// Whether a touch pushed where last evaluated.
  bool pushes(const TouchLink& touch) const { return lanes->gap(touch.slot) < 0; }
  bool pushes(const TouchRow& row) const { return pushes(touches[row.touch]); }
  /// Matrices become those of the shape at d: where contacts and touches count that are near but do not push there if
  /// `pushing_only`, which then count no more; else of the pieces along whose part of `direction` the slope has turned
  /// round. Their pairs end. \return whether there are any that were not made there already
  bool renew(const float* d, const float* next_gradient, const float* direction, bool pushing_only) const;

 private:
  /// Objective::settled2() of a piece at d.
  double settled2(std::uint32_t piece, const float* d) const;
  bool isAlone() const { return pieces.size() == 1 && touches.empty(); }
};

/// L-BFGS about the step's matrix, with an energy check, from the offset in scratch.d, whose value is known. Where the
/// matrix is no guide that of the shape at hand takes its place. \param pairs of vectors of this length; any that are
/// there already are used. \return the value at the offset that scratch.d
/// then holds, whose gradient scratch.gradient holds.
Objective::Value minimize(Minimand& minimand, Pairs& pairs, std::uint32_t iterations, Objective::Value start);
/// The same of one piece.
Objective::Value minimize(Objective& objective, SystemFactor& system, Pairs& pairs, std::uint32_t iterations,
                          Objective::Value start);

/// Whether a contact of a piece alone would slide (heldAcross()) under the load that it has.
bool maySlide(const Objective& objective);
/// Where a piece comes to from an offset as if it were rigid, under the loads that its contacts have. \param gradient
/// there. \param[out] to not d.
void slide(Objective& objective, const float* d, const float* gradient, float* to);

/// Whether minimize() would stop at once at an offset with this gradient.
bool isSettled(const Objective& objective, const float* d, const float* gradient);

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// A piece of a body that moves in a field: its state, and constants and scratch beside it. Pieces share nothing.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <memory_resource>

#include "runtime/memory/array.h"
#include "runtime/solver/field.h"
#include "runtime/solver/pairs.h"
#include "runtime/solver/system.h"

namespace sinew::internal {

/// k x 3, one function's coefficients a row.
using Coefficients = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
using CoefficientMap = Eigen::Map<Coefficients>;
using ConstCoefficientMap = Eigen::Map<const Coefficients>;

/// A contact point that touched a collider when the last step ended, in the coordinates of the collider (the ground's
/// are the world's).
struct TouchingPoint {
  std::uint32_t point;           ///< of the field; kColliderPoint and more: of the collider
  std::uint32_t collider;        ///< ColliderId
  float floor;                   ///< height over the plane that it is pushed to: 0, or below where it started inside, m
  float depth;                   ///< below that floor, m
  std::array<double, 3> anchor;  ///< where friction holds it, m; of a collider's point in the piece at rest
  std::array<double, 3> normal;  ///< of the plane, unit; of a collider's point the way out of the piece at rest
};
/// The first of the colliders' points.
inline constexpr std::uint32_t kColliderPoint = 1U << 31;

/// The state of a piece: its further motion depends on nothing else, and this is saved.
struct PieceState {
  explicit PieceState(std::pmr::memory_resource* memory)
      : z(memory),
        v(memory),
        z_before(memory),
        v_before(memory),
        z_rest(memory),
        touching(memory),
        plastic(memory),
        pairs(kPairs, memory) {}

  static constexpr std::uint32_t kPairs = 8;
  static constexpr std::size_t kVectors = 5;  ///< of vectors()

  bool held = false;                   ///< which of the piece's fields it moves in
  Array<Vector3d> z, v;                ///< coefficients of position (metres, world) and velocity
  Array<Vector3d> z_before, v_before;  ///< one step earlier
  Array<Vector3d> z_rest;              ///< where it was when Body::still was last 0
  /// A value for each function, as many as z.
  std::array<Array<Vector3d>*, kVectors> vectors() { return {&z, &v, &z_before, &v_before, &z_rest}; }
  std::array<const Array<Vector3d>*, kVectors> vectors() const { return {&z, &v, &z_before, &v_before, &z_rest}; }
  double h_before = 0;                ///< length of the last step, s; 0: z_before says nothing, as where it touched
  Vector3d turn = Vector3d::Zero();   ///< that the frame made in the last step, rad
  Vector3d omega = Vector3d::Zero();  ///< angular velocity when it began, rad/s
  double elastic = -1;                ///< energy that the shape stores, J; negative: not known
  bool leaning = false;               ///< on other pieces, of which one is held
  bool stays = false;                 ///< its old shape was a lower place to start from than the prediction
  bool rests = false;                 ///< and the end of the step
  Array<TouchingPoint> touching;      ///< by collider, then by point
  Array<float> plastic;               ///< the samples' rest shapes (solver/plasticity.h); empty where none may change
  /// Of the last step, its inertia of a length pairs_h, s; none where h_before is 0.
  Pairs pairs;
  double pairs_h = 0;
  /// Of an impact that goes on: the impulse that restitution returns, N s, and the energy that has been lost, J.
  Vector3d rebound = Vector3d::Zero();
  double lost = 0;
  void endImpact() {
    rebound.setZero();
    lost = 0;
  }
  double budget = -1;  ///< bound on a free piece's energy about its centre, J; negative: its present energy
};

/// Modes of a piece on its holds, the lowest, of which the damping is that of the settings. Of the first the functions'
/// own decay lacks nearly all, of the last a third to a half (docs/decisions/0038-balance.md).
inline constexpr std::uint32_t kHeldModes = 12;

/// Holds of a piece at run time where its field knows what it lacks (solver/holds.h), in a frame of their own. All
/// of it belongs to moduli of factor 1.
struct Holds {
  explicit Holds(std::pmr::memory_resource* memory)
      : sets(memory), by_function(memory), by_hold(memory), modes(memory), lacking(memory) {}

  /// A pin set among them. Its points p are at X of the rest shape, which lies about as the set does when turned, and
  /// is e off; sums and means are weighed.
  struct Set {
    std::uint32_t number = 0;  ///< of the body's
    double weight = 0;
    Vector3d local_mean = Vector3d::Zero(), rest_mean = Vector3d::Zero();
    Matrix3d moment = Matrix3d::Zero();      ///< of p and X about their means
    double spread = 0;                       ///< of X
    Matrix3d turned = Matrix3d::Identity();  ///< e = X - X mean - turned (p - p mean)
  };

  std::size_t scratch = 0;   ///< numbers that making them takes
  std::uint32_t count = 0;   ///< of held points; 0: none, or the field does not know
  std::uint32_t single = 0;  ///< those of no set
  float stiffness = 0;       ///< factor on the moduli that they were made with
  Array<Set> sets;           ///< by their numbers, ascending
  // Pulls of offsets b = Phi w + l (HoldWays): 3 k rows of the functions, 12 of each set, its sum and its moments
  // about the mean of p, and r of the residual modes.
  Array<float> by_function;  ///< of w: field.stride columns; the first 3 k rows are Phi^T S Phi, symmetric
  Array<float> by_hold;      ///< of l: 12 columns a set, three a point of no set, one of all e; rounded up to eight
  /// The lowest modes in which the piece rings so, 3 k numbers each, and what the functions' decay lacks of theirs, 1/s
  /// at critical damping (solver/held_modes.h).
  Array<double> modes, lacking;
};

/// By how much the functions are off where a piece is held, in the frame of its holds (solver/holds.h).
struct HoldWays {
  explicit HoldWays(std::pmr::memory_resource* memory) : of_functions(memory), of_holds(memory) {}
  Array<double> of_functions;  ///< w, field.stride
  Array<float> of_holds;       ///< l, in the columns of Holds::by_hold
};

/// A piece: its fields, its state, and the factor of its springs that steps of one length share.
struct Piece {
  Piece(const Field* free_field, const Field* held_field, std::pmr::memory_resource* memory)
      : free(free_field),
        fixed(held_field),
        state(memory),
        rest_change(memory),
        fibres(memory),
        fibre_pull(memory),
        springs(memory),
        row(memory),
        holds(memory),
        ways(memory),
        reach_free(memory),
        reach_fixed(memory),
        system(memory) {}

  const Field& field() const { return state.held ? *fixed : *free; }
  const Array<float>& reach() const { return state.held ? reach_fixed : reach_free; }
  CoefficientMap z() { return {state.z.data()->data(), Eigen::Index(state.z.size()), 3}; }
  CoefficientMap v() { return {state.v.data()->data(), Eigen::Index(state.v.size()), 3}; }
  ConstCoefficientMap z() const { return {state.z.data()->data(), Eigen::Index(state.z.size()), 3}; }
  ConstCoefficientMap v() const { return {state.v.data()->data(), Eigen::Index(state.v.size()), 3}; }

  const Field* free;
  const Field* fixed;  ///< null where the package has none
  PieceState state;

  Array<float> rest_change;     ///< of state.plastic, as the energy wants it
  Array<float> fibres;          ///< k x k, J: 1/2 sum S_ij z_i . z_j is the energy of active fibres; empty: none is
  Array<float> fibre_pull;      ///< k x 4: S times the rest shape, in the frame of the piece
  double fibre_energy = 0;      ///< at rest, J
  bool fibres_changed = false;  ///< they are to be made anew

  Array<double> springs;     ///< k x k: sum kappa phi phi^T of pins and picks
  double springs_firm = -1;  ///< kappa of pins that they were made with, N/m; negative: nor are holds made
  Array<double> row;         ///< scratch, k
  Holds holds;
  HoldWays ways;                                 ///< of this step
  Matrix3d holds_turned = Matrix3d::Identity();  ///< frame of the holds in this step
  Array<float> reach_free, reach_fixed;          ///< findReach() of the fields
  Eigen::AlignedBox3d box;                       ///< around its surface, world; of a body that is asleep
  SystemFactor system;
};

}  // namespace sinew::internal

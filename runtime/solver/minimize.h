// SPDX-License-Identifier: MIT
//
// One implicit step of a piece as a minimization (docs/method.md): the inertia about a prediction, the elastic energy
// at samples, springs of pins and picks, and contacts with a plane, all functions of the same coefficients.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "runtime/kernels/kernels.h"
#include "runtime/memory/array.h"
#include "runtime/solver/piece.h"
#include "runtime/solver/system.h"

namespace sinew::internal {

/// A point that a plane may push. Its compliance is the local one that a field of few functions lacks: 1 / (E a).
struct Contact {
  std::uint32_t point;    ///< of the field
  float gap;              ///< height above its floor at the prediction, m
  float floor;            ///< height over the plane that it is pushed to, m: see TouchingPoint
  Eigen::Vector3f slide;  ///< way along the plane from where friction holds it, at the prediction, m
  float kappa;            ///< N/m
  float pressed;          ///< N, that friction sees
  const float* phi;       ///< its row, k
};

/// Memory of a minimization, for one piece after the other. Arrays of coefficients are k x 4 floats.
struct MinimizeScratch {
  explicit MinimizeScratch(std::pmr::memory_resource* memory);
  /// Grows to what a field needs with so many contacts.
  void reserve(const Field& field, std::size_t contacts);

  Array<float> base;    ///< the prediction, relative to its centre
  Array<float> offset;  ///< from there to the base
  Array<float> shape;   ///< the same in the frame of the piece, less the rest shape
  Array<float> x, d, old, next, gradient, next_gradient, direction, residual, springs;
  Array<float> pairs;  ///< five of s and y each
  Array<float> lanes, parts, quaternions;
  Array<float> squeezed;
  Array<float> samples;  ///< of stiffnessAt()
  Array<Contact> contacts;
  Array<float> rows;  ///< phi of the contacts
  Array<Vector3d> prediction, predicted_velocity, external;
};

/// The step's objective, relative to its value at the prediction but for the elastic energy.
struct Objective {
  const Field* field = nullptr;
  double h = 0;                        ///< of the inertia: the step, or 2/3 of it, s
  float stiffness = 1;                 ///< factor on the moduli
  const float* rest_change = nullptr;  ///< Piece::rest_change, or null
  std::span<const float> tensions;     ///< Piece::tensions
  bool has_springs = false;            ///< scratch.springs and scratch.residual count
  bool has_offset = false;             ///< scratch.offset counts: the base is not where inertia alone would lead
  float friction = 0;                  ///< Coulomb coefficient
  Eigen::Vector3f normal = {0, 1, 0};  ///< of the plane
  float rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< of the piece, column-major
  const float* system = nullptr;  ///< factor of the first matrix (solver/system.h); null: the modes of the rest shape
  MinimizeScratch* scratch = nullptr;

  struct Value {
    double total = 0, elastic = 0;
  };
  /// \param d offset from the prediction, k x 4. \param mark finds how far squeezed samples lean on the piece's
  /// rotation.
  Value at(const float* d, float* gradient, bool mark) const;
  /// Coefficients in the frame of the piece, less those of the rest shape, into scratch.x.
  void toFrame(const float* d) const;
  /// Second derivative of the elastic energy at d, made positive, in the frame of the piece: 3 n rows of `stride`
  /// floats.
  void stiffnessAt(const float* d, float* matrix) const;
  /// The elastic energy, that of fibres among it, and its gradient, at the driven functions as well.
  double elastic(const float* d, float* gradient, bool mark) const;
  /// Makes scratch.shape and the start of the search for rotations. \param x coefficients. \param center,
  /// rest_center of them and of the rest shape. \param turned the frame: a rotation to the digits of doubles.
  void setFrame(std::span<const Vector3d> x, const Vector3d& center, const Vector3d& rest_center,
                const Matrix3d& turned);
  /// All of it but the elastic energy; adds to the gradient where that is not null.
  double besideElastic(const float* d, float* gradient) const;
  /// What springs and contacts add of it, alone.
  double external(const float* d, float* gradient) const;
  /// What active fibres add of the elastic energy. \param local coefficients as toFrame() makes them.
  double fibres(const float* local, float* gradient) const;
  /// Normal forces of the contacts at d become what friction sees.
  void press(const float* d) const;
  /// The first matrix's inverse times g, in place.
  void precondition(float* g) const;
  /// Squared angular frequency above most elastic modes: what floats round of a shape pulls as if it were this stiff.
  double roughStiffness() const;
};

/// L-BFGS(5) about the step's matrix, with an energy check, from the offset in scratch.d, whose value is known. Where
/// the matrix is no guide that of the shape at hand takes its place. \return the value at the offset that scratch.d
/// then holds, whose gradient scratch.gradient holds.
Objective::Value minimize(Objective& objective, SystemFactor& system, std::uint32_t iterations, Objective::Value start);

/// Whether minimize() would stop at once at an offset with this gradient.
bool isSettled(const Objective& objective, const float* d, const float* gradient);

}  // namespace sinew::internal

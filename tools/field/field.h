// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace sinew::tools {

/// What is averaged to a strain (docs/method.md).
enum class FieldElement {
  tetrahedra,  ///< linear tetrahedra: too stiff in bending and near a Poisson's ratio of 0.5
  edges,       ///< the deformation gradient is averaged over the tetrahedra around each edge
};

/// A spring between a vertex that is not held and where a pin set would hold it.
struct FieldTether {
  std::uint32_t vertex = 0, held = 0;  ///< into FieldInput::positions and held
  double strength = 0;                 ///< N/m; relative as Young's moduli are
  double absolute = 0;                 ///< N/m, added to it
};

/// A piece of a soft body: one connected part of the physical mesh. Nothing is kept of it.
struct FieldInput {
  std::span<const Eigen::Vector3d> positions;                ///< n rest positions, metres
  std::span<const std::array<std::uint32_t, 4>> tetrahedra;  ///< t, of these vertices; either orientation
  std::span<const double> masses;                            ///< n, kg, > 0
  std::span<const double> young;                             ///< t, Pa (relative where lowest_hz is given), > 0
  std::span<const double> poisson;                           ///< t, 0..0.499
  std::span<const std::vector<std::uint32_t>> held;          ///< vertices of each pin set, disjoint; may be empty
  std::span<const FieldTether> tethers;                      ///< on vertices in no pin set; may be empty
  std::span<const Eigen::VectorXd> loads;  ///< forces, 3n (x y z by vertex), N; functions are added for their answers
  /// Of each load: how far it is pulled the other way in the poses that samples are chosen by, as work over force (a
  /// fibre's: its shortening). May be empty.
  std::span<const double> reaches;
};

struct FieldOptions {
  std::uint32_t functions = 40;                ///< k of the free space, interior functions of the held one, 4..1000
  double samples_per_function = 2;             ///< energy samples by function, 1..; fewer see less of large bends
  std::uint32_t residual_modes = 0;            ///< of the free space, at most
  double lowest_hz = 0;                        ///< > 0: young is scaled until the free piece's lowest mode rings so, Hz
  FieldElement element = FieldElement::edges;  ///< above 10,000 vertices tetrahedra are taken
};

/// A point of the elastic energy sum V Psi(F), F = sum_j z_j grad phi_j^T.
struct FieldSample {
  Eigen::Vector3d at;          ///< rest position, metres
  double volume = 0;           ///< weight, m^3, > 0
  double mu = 0, lambda = 0;   ///< Lame's parameters, Pa
  Eigen::MatrixX3d gradients;  ///< k x 3: d phi_j / dX there, corrected (decision 30), 1/m
  std::uint32_t patch = 0;     ///< which strain it is: a number that the tetrahedra decide
};

/// Scalar functions phi_j on the vertices of a piece: x(X) = sum_j phi_j(X) z_j.
struct FieldSpace {
  Eigen::MatrixXd values;      ///< n x k: phi_j at the vertices, 1/sqrt(kg); driven ones first
  Eigen::VectorXd stiffness;   ///< k: w_j = phi_j^T K_s phi_j, 1/s^2; 0 for driven functions
  Eigen::VectorXd damping_hz;  ///< k: how fast a function's motion decays, see FieldFunction
  Eigen::VectorXd one;         ///< k: values * one = 1
  Eigen::MatrixX3d rest;       ///< k x 3: values * rest = X
  std::uint32_t driven_count = 0;
  std::vector<std::uint32_t> pin_set;   ///< of each driven function: index into FieldInput::held
  std::vector<std::uint32_t> monomial;  ///< of each driven function: on its pin set it is 1, X, Y, Z; on others 0
  std::vector<FieldSample> samples;
  Eigen::VectorXd
      compliance;           ///< f . u of each load f and the piece's answer u, J; empty in a free space beside a held
  Eigen::MatrixXd tethers;  ///< k x k, N/m: 1/2 tr(z^T tethers z) is the energy of the tethers; empty without
  Eigen::MatrixXd residual_modes;   ///< 3n x r, x y z by vertex, (m/N)^1/2: see field/residual.h; none in a held space
  Eigen::VectorXd residual_locals;  ///< n, m/N
  double young_scale = 1;           ///< what young was multiplied with; mu, lambda and stiffness have it already
  double lowest_hz = 0;             ///< of the lowest elastic mode of the piece (held: with its pins fixed); 0: none
  /// Error of static answers to loads on 8 places against all elements, of their rms displacement; gravity_error where
  /// that is larger.
  double static_error = 0;
  double gravity_error = 0;     ///< the same of gravity, largest of three directions; 0 in a free space
  double least_eigenvalue = 1;  ///< of the sampled rest stiffness against the full one, rigid motions left out
};

struct Fields {
  FieldSpace free;
  std::optional<FieldSpace> held;  ///< where a pin set has vertices
};

/// Makes the function spaces of a piece (docs/method.md): the free one from its lowest elastic modes and answers to
/// loads all over its surface, split by axis; the held one from modes with the pin sets fixed.
/// Deterministic for any number of threads. values^T M values = 1 and values^T K_s values = diag(stiffness) for
/// functions that are not driven, K_s = sum V (2 mu + lambda) grad grad^T over all elements; driven ones are orthogonal
/// to them under M. k may be less than asked for where the piece has fewer vertices or is flat. Flat tetrahedra are
/// left out.
Fields makeFields(const FieldInput& input, const FieldOptions& options);

/// Fields of other materials, loads and tethers on the functions and samples of `before`: what moves is the same, how
/// it resists is new. In a fraction of the time, and less exact: functions are not those that the new materials would
/// have, there are no residual modes, errors are those measured before.
/// @param input with the positions, tetrahedra, masses and held vertices that `before` was made from
Fields reweighed(const Fields& before, const FieldInput& input, const FieldOptions& options);

namespace field {
/// The rest Hessian of the samples, without tethers and driven functions: 3 f x 3 f for f functions, unknown 3 j +
/// axis.
Eigen::MatrixXd sampledStiffness(const FieldSpace& space);
}  // namespace field

}  // namespace sinew::tools

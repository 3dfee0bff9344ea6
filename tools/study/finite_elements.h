// SPDX-License-Identifier: GPL-3.0-or-later
//
// What an elastic solid does, to measure the runtime against: finite elements on tetrahedra, in double precision. It
// shares nothing with the runtime but the tetrahedra.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace sinew::tools {

/// A solid of tetrahedra (positive volume) at rest, with the prescribed places of its held vertices.
struct ElasticSolid {
  std::vector<Eigen::Vector3d> rest;  ///< metres
  std::vector<std::array<std::uint32_t, 4>> tetrahedra;
  std::vector<std::optional<Eigen::Vector3d>>
      prescribed;  ///< per vertex: where it is held, metres; nothing: it is free
};

/// Cuts every tetrahedron into eight; those of tetrahedron t are 8 t .. 8 t + 7, the old vertices keep their numbers. A
/// new vertex is held, midway, where both ends of its edge are.
/// \param shape on return one more position for each new vertex: midway, too. May be null.
ElasticSolid refined(const ElasticSolid& solid, std::vector<Eigen::Vector3d>* shape);

struct Equilibrium {
  std::vector<Eigen::Vector3d> positions;  ///< metres, one a vertex
  double residual = 0;                     ///< largest change in the last iteration, of the largest displacement
  int iterations = 0;
  /// The energy's second derivative is positive there: a rest that lasts, no ridge between two. False where it was not
  /// asked (equilibrium() without a load; systems too large for a factorization).
  bool stable = false;
};

/// Rest of a solid of corotated linear elasticity: least energy sum V (mu |F - R|² + lambda/2 tr²(RᵀF - 1)), F the
/// deformation gradient of a tetrahedron, R its rotation; nothing else acts on it, so Young's modulus does not matter.
/// Newton's iteration with the rotations held in the derivative (stiffness warping), each solved by conjugate
/// gradients. \param start positions to begin with; empty: at rest. \param poisson -1 < nu < 0.5. \param tolerance of
/// the residual. Some vertices must be prescribed.
Equilibrium equilibrium(const ElasticSolid& solid, std::vector<Eigen::Vector3d> start, double poisson,
                        double tolerance);

/// An isotropic material.
struct ElasticMaterial {
  double young = 1;      ///< Young's modulus, Pa, > 0
  double poisson = 0.3;  ///< Poisson's ratio, -1 < nu < 0.5
};

/// What a solid is made of and what pulls at it.
struct ElasticLoad {
  std::vector<ElasticMaterial> materials;  ///< one for all tetrahedra, or one each
  std::vector<Eigen::Vector3d> forces;     ///< N, one a vertex (gravity: m g); empty: none
};

/// Rest of the same solid under forces: least energy sum V (mu |F - R|² + lambda/2 tr²(RᵀF - 1)) - sum f.x. Newton's
/// iteration with the whole derivative, that of the rotations too (its eigenvalues: Smith, de Goes, Kim 2019, "Analytic
/// eigensystems for isotropic distortion energies"); where that is not positive, with the negative eigenvalues of each
/// tetrahedron at 0. A line search makes every step go down, so that it converges for large deflections.
/// \param start positions to begin with; empty: at rest. Of several rests the one downhill of it is found. What is
/// prescribed moves in one go: large motions want steps, each started from the one before.
/// \param tolerance of the residual. Some vertices must be prescribed such that nothing can move without strain.
Equilibrium equilibrium(const ElasticSolid& solid, const ElasticLoad& load, const std::vector<Eigen::Vector3d>& start,
                        double tolerance);

/// Frequency of the lowest mode of a solid that is held at rest where it is prescribed, Hz, by inverse iteration.
/// \param masses kg, one a vertex, > 0.
double lowestFrequency(const ElasticSolid& solid, const std::vector<ElasticMaterial>& materials,
                       const std::vector<double>& masses);

/// Volume of a solid's tetrahedra at rest by vertex, a quarter each, m³.
std::vector<double> nodalVolumes(const ElasticSolid& solid);

/// A point of a solid that was refined: where it went. \param coarse the solid before. \param refinements how often.
/// \param weights of the coarse tetrahedron's vertices, sum 1. \param positions of the refined solid's vertices.
Eigen::Vector3d deformedPoint(const ElasticSolid& coarse, const ElasticSolid& fine, int refinements,
                              std::uint32_t tetrahedron, const Eigen::Vector4d& weights,
                              const std::vector<Eigen::Vector3d>& positions);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// An elastic solid to measure the runtime against: finite elements on tetrahedra, in double precision. It
// shares nothing with the runtime but the tetrahedra.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "tools/study/elastic_solid.h"

namespace sinew::tools {

struct Equilibrium {
  std::vector<Eigen::Vector3d> positions;  ///< metres, one a node
  double residual = 0;                     ///< largest change in the last iteration, of the largest displacement
  int iterations = 0;
  /// The energy's second derivative is positive there: a rest that lasts, no ridge between two. False where it was not
  /// asked (equilibrium() without a load).
  bool stable = false;
  double strength = 1;  ///< what the forces were multiplied by, for an ElasticTarget
};

/// Rest of a solid of corotated linear elasticity: least energy sum V (mu |F - R|² + lambda/2 tr²(RᵀF - 1)), F the
/// deformation gradient of a tetrahedron, R its rotation; nothing else acts on it, so Young's modulus does not matter.
/// Newton's iteration with the rotations held in the derivative (stiffness warping), each solved by conjugate
/// gradients. \param solid linear. \param start positions to begin with; empty: at rest. \param poisson -1 < nu < 0.5.
/// \param tolerance of the residual. Some vertices must be prescribed.
Equilibrium equilibrium(const ElasticSolid& solid, std::vector<Eigen::Vector3d> start, double poisson,
                        double tolerance);

/// An isotropic material.
struct ElasticMaterial {
  double young = 1;      ///< Young's modulus, Pa, > 0
  double poisson = 0.3;  ///< Poisson's ratio, -1 < nu < 0.5
};

/// A solid's materials and the forces on it.
struct ElasticLoad {
  std::vector<ElasticMaterial> materials;  ///< one for all tetrahedra, or one each
  std::vector<Eigen::Vector3d> forces;     ///< N, one a node (gravity: nodalMasses() g); empty: none
};

/// How far a load shall move a solid.
struct ElasticTarget {
  std::vector<std::uint32_t> nodes;
  double rms = 0;  ///< displacement of those, metres, > 0
};

/// Rest of the same solid under forces: least energy sum V (mu |F - R|² + lambda/2 tr²(RᵀF - 1)) - sum f.x, in
/// quadratic tetrahedra by Keast's rule of degree 2 (4 points of V/4), exact where F varies and R does not. Newton's
/// iteration with the whole derivative, that of the rotations too (its eigenvalues: Smith, de Goes, Kim 2019, "Analytic
/// eigensystems for isotropic distortion energies"); where that is not positive, with the negative eigenvalues of each
/// point at 0. A line search makes every step go down, so that it converges for large deflections. \param start
/// positions to begin with; empty: at rest. Of several rests the one downhill of it is found. Prescribed nodes move
/// in one go: large motions want steps, each started from the one before. \param tolerance of the residual. Some nodes
/// must be prescribed such that nothing can move without strain. \param target forces become as strong as move the
/// solid so far: by Equilibrium::strength. May be null.
Equilibrium equilibrium(const ElasticSolid& solid, const ElasticLoad& load, const std::vector<Eigen::Vector3d>& start,
                        double tolerance, const ElasticTarget* target = nullptr);

/// Energy (J), its gradient (N, by node; 0 where prescribed) and second derivative (N/m, 3 rows and columns a free
/// node, in their order) of a loaded solid, as equilibrium() has them.
struct ElasticState {
  double energy = 0;
  std::vector<Eigen::Vector3d> gradient;
  Eigen::MatrixXd hessian;
};
ElasticState elasticState(const ElasticSolid& solid, const ElasticLoad& load,
                          const std::vector<Eigen::Vector3d>& positions);

/// Frequency of the lowest mode of a solid that is held at rest where it is prescribed, Hz, by inverse iteration.
/// \param solid linear. \param masses kg, one a vertex, > 0.
double lowestFrequency(const ElasticSolid& solid, const std::vector<ElasticMaterial>& materials,
                       const std::vector<double>& masses);

}  // namespace sinew::tools

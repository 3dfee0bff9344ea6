// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tools/field/elastic.h"

namespace sinew::tools::field {

/// The rest Hessian in a space of scalar functions: dimension 3k, function by function, axis by axis.
/// @param functions f x k, on nodes
MatrixXd reducedStiffness(const Elastic& elastic, const MatrixXd& functions);

/// A k x l matrix for x, y, z alike: 3k x 3l.
MatrixXd byAxes(const MatrixXd& m);

/// Functions of a piece, and what acts on it besides its elasticity.
struct Space {
  MatrixXd functions;     ///< f x k on nodes
  MatrixXd orthonormal;   ///< k x r: combinations that are orthonormal under the masses
  MatrixXd dual;          ///< k x r: products of all functions with those, under the masses
  VectorXd one;           ///< k: the coefficients of 1
  Eigen::MatrixX3d rest;  ///< k x 3: those of the rest shape
  Index driven = 0;       ///< the first so many functions are prescribed
  MatrixXd tethers;       ///< k x k, N/m; empty without
  MatrixXd loads;         ///< 3(k - driven) x c, N
  VectorXd reaches;       ///< c, against the loads: see FieldInput; empty without
};

/// Patches with weights and slopes of their own.
struct Samples {
  std::vector<std::size_t> patch;
  std::vector<double> volume;   ///< m^3, > 0
  MatrixXd gradients;           ///< 3 by sample x k, 1/m
  double least_eigenvalue = 1;  ///< of their rest Hessian against that of all patches, rigid motions left out
};

/// Chooses patches and weights that give the energy of the whole piece to displacements in a space (An, Kim, James
/// 2008, "Optimizing cubature for efficient integration of subspace deformations"), and corrects their gradients.
/// @param wanted so many; all patches where there are not more
Samples chooseSamples(const Elastic& elastic, const Space& space, std::size_t wanted);

}  // namespace sinew::tools::field

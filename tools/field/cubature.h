// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tools/field/elastic.h"

namespace sinew::tools::field {

/// The rest Hessian in a space of scalar functions: dimension 3k, function by function, axis by axis.
/// @param functions f x k, on nodes
MatrixXd reducedStiffness(const Elastic& elastic, const MatrixXd& functions);

/// What acts on a space besides its elasticity.
struct Acting {
  MatrixXd tethers;  ///< k x k, N/m; empty without
  MatrixXd loads;    ///< 3(k - driven) x c, forces that surely act: their displacements are to be right
};

struct Cubature {
  std::vector<std::size_t> patch;  ///< ascending
  std::vector<double> volume;      ///< m^3, > 0
  double least_eigenvalue = 1;     ///< of its rest Hessian against that of all patches, rigid motions left out
};

/// Chooses patches and weights that give the energy of the whole piece to displacements in a space.
/// @param functions f x k on nodes
/// @param orthonormal k x r: combinations of the functions that are orthonormal under the masses
/// @param rest k x 3: the functions' coefficients of the rest shape
/// @param driven the first so many functions are prescribed
/// @param wanted so many, more where the least eigenvalue asks for it
Cubature chooseSamples(const Elastic& elastic, const MatrixXd& functions, const MatrixXd& orthonormal,
                       const Eigen::MatrixX3d& rest, Index driven, const Acting& acting, std::size_t wanted);

}  // namespace sinew::tools::field

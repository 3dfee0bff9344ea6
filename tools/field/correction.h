// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tools/field/cubature.h"

namespace sinew::tools::field {

/// Changes the samples' gradients, as little as it takes, until their rest Hessian is that of all patches: each sample
/// shows a little of what moves elsewhere. These are more numbers than the Hessian has, so that few samples are enough.
/// Affine displacements keep their gradients.
/// @param white 3k x d: displacements in which the rest Hessian of all patches is 1
void correct(const Elastic& elastic, const Space& space, const MatrixXd& white, Samples& samples);

}  // namespace sinew::tools::field

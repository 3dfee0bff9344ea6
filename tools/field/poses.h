// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "tools/field/cubature.h"

namespace sinew::tools::field {

/// Where the piece goes when each load alone pulls the other way as far as it reaches, and half as far: displacements,
/// k x 3 each.
/// @param samples some that stand for the piece
std::vector<MatrixXd> findPoses(const Elastic& elastic, const Space& space, const Samples& samples);

/// What the stress of a patch is beyond that of small displacements, Pa: first Piola-Kirchhoff, of the corotated
/// energy.
/// @param gradient F
Eigen::Matrix3d stressBeyondLinear(const Patch& patch, const Eigen::Matrix3d& gradient);

}  // namespace sinew::tools::field

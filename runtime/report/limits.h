// SPDX-License-Identifier: MIT
//
// Bounds on the deformation of a cluster, before goals are taken from it (docs/report.md §3).
#pragma once

#include <Eigen/Core>
#include <span>

#include "sinew/formats/package.h"

namespace sinew::internal {

/// A / |det A|^(1/3): volume preservation (Müller et al. 2005, linear deformations), by the absolute value, so that
/// a mirrored A stays mirrored (Henriques 2006, 4.2.1). A itself where |det A| is next to 0.
Eigen::Matrix3f volumeKept(const Eigen::Matrix3f& a);

/// Each row at most `longest` long (Henriques 2006, 4.1.2, method 1).
Eigen::Matrix3f rowsLimited(const Eigen::Matrix3f& a, float longest);

/// Each principal stretch within bounds, by a singular value decomposition whose factors are rotations: a reflection
/// shows as a negative last stretch.
Eigen::Matrix3f stretchesLimited(const Eigen::Matrix3f& a, float least, float largest);

/// The gamma in 0..1 of A <- gamma A + (1 - gamma) R that a cluster's limit asks for: |A|^2 at most norm_max (Henriques
/// 2006, 4.1.2, methods 2 and 3), the soft bound (4.1.3), or a curve's response. 1 where nothing is to be done, and for
/// limits that do not blend.
float blendOf(const formats::ClusterMechanics& mechanics, std::span<const formats::CurvePoint> curve,
              const Eigen::Matrix3f& a, const Eigen::Matrix3f& r);

}  // namespace sinew::internal

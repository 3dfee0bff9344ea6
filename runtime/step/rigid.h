// SPDX-License-Identifier: MIT
//
// A piece as a whole: centre, momentum, inertia and rotation from its coefficients alone (docs/method.md §1).
#pragma once

#include <Eigen/Core>

#include "runtime/solver/piece.h"

namespace sinew::internal {

/// Rotation by an angle vector, rad.
Matrix3d turnBy(const Vector3d& angle);

/// sum m x over the mass: exact where the field is orthonormal, the free one.
Vector3d meanOf(const Field& field, const ConstCoefficientMap& z);
/// About a centre that moves with `velocity`, kg m^2/s.
Vector3d angularMomentum(const Field& field, const ConstCoefficientMap& z, const ConstCoefficientMap& v,
                         const Vector3d& center, const Vector3d& velocity);
/// About `center`, kg m^2; never singular where there is mass off it.
Matrix3d inertiaOf(const Field& field, const ConstCoefficientMap& z, const Vector3d& center);
/// a^-1 b, or 0 where that is no number.
Vector3d solved(const Matrix3d& a, const Vector3d& b);
/// The rotation that the piece has as a whole, to the digits of doubles.
Matrix3d rotationOf(const Field& field, const ConstCoefficientMap& z, const Vector3d& center);

}  // namespace sinew::internal

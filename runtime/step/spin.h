// SPDX-License-Identifier: MIT
//
// Parts that spin faster than passes can follow (docs/method.md §5).
#pragma once

#include <Eigen/Core>

#include "runtime/step/motion.h"

namespace sinew::internal {

/// The most that a free part turns in a pass, radians. Beyond it prediction flings vertices away from the axis, and
/// what the match then makes of the part has little to do with the way it was turned.
inline constexpr double kMostTurn = 0.5;

/// Splits the angular momentum of a free part about its centre into what it turns with in the next pass and what is set
/// aside. Turned about the axis of the whole, the part keeps the energy of its spin as well: half L I^-1 L does not
/// change then. It turns no faster about that axis than L / I there, so that turning has no energy that L has not.
/// \param solver inertia of the part. \param angular all of it: what its vertices have and what is aside.
/// \param[out] aside zero where the part turns by less than kMostTurn. \return angular velocity to turn with, rad/s.
Eigen::Vector3d setSpinAside(const RigidMotionSolver& solver, const Eigen::Vector3d& angular, double pass_seconds,
                             Eigen::Vector3d& aside);

}  // namespace sinew::internal

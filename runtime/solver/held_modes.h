// SPDX-License-Identifier: MIT
//
// The modes in which a piece rings on what holds it at run time. Its functions decay as the free piece's modes do, and
// a mode on holds is mostly a turn of the whole, which does not: what its own decay lacks is taken here
// (docs/method.md §3, Damping).
#pragma once

#include "runtime/solver/holds.h"

namespace sinew::internal {

/// Numbers that findHeldModes() needs.
std::size_t scratchOfHeldModes(const Field& field);

/// Finds Holds::modes and Holds::lacking of holds that have been made. \pre both are reserved
void findHeldModes(const Field& field, Holds& holds, double* scratch);

/// Holds as they go through a step.
struct HoldsMotion {
  RigidPlace before, after;
  double h;  ///< s
};

/// Lets velocities against the holds decay for a step by what their modes lack. \param ratio to critical
/// damping, times the root of the factor on the moduli
void dampOnHolds(const Field& field, const Holds& holds, const HoldsMotion& motion, double ratio, CoefficientMap v);

}  // namespace sinew::internal

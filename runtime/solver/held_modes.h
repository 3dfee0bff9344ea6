// SPDX-License-Identifier: MIT
//
// The modes in which a piece rings on what holds it at run time. Its functions decay as the free piece's modes do, and
// a mode on holds is mostly a turn of the whole, which does not: what its own decay lacks is taken here
// (docs/method.md §3, Damping).
#pragma once

#include <array>
#include <cmath>

#include "runtime/solver/holds.h"

namespace sinew::internal {

/// Of the matrix of findHeldModes(), numbers, and of its other scratch.
std::size_t matrixOfHeldModes(const Field& field);
std::size_t scratchOfHeldModes(const Field& field);

/// Finds Holds::modes and Holds::lacking of holds that have been made. \param[in,out] matrix the lower triangle of
/// Phi^T S Phi, columns strideOf(3 k) apart: in the digits of floats a firm hold would stiffen what it leaves open.
/// \pre both are reserved
void findHeldModes(const Field& field, Holds& holds, double* matrix, double* scratch);

/// Holds as they go through a step.
struct HoldsMotion {
  RigidPlace before, after;
  double h;  ///< s
};

/// Calls visit(j, lost) with what velocities against the holds lose in a step by what their modes lack. \param ratio to
/// critical damping, times the root of the factor on the moduli
template <class Visit>
void lostOnHolds(const Field& field, const Holds& holds, const HoldsMotion& motion, double ratio,
                 const ConstCoefficientMap& v, const Visit& visit) {
  if (holds.lacking.empty() || !(ratio > 0)) return;
  const Matrix3d turning = (motion.after.turned - motion.before.turned) / motion.h;
  const Vector3d moving = (motion.after.moved - motion.before.moved) / motion.h;
  const auto modeOf = [&](std::uint32_t m, std::uint32_t j) {
    return Eigen::Map<const Vector3d>(holds.modes.data() + 3 * (std::size_t(field.k) * m + j));
  };
  std::array<double, kHeldModes> amplitudes{};
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const Vector3d led = turning * field.restOf(j) + field.oneOf(j) * moving;
    const Vector3d local = motion.after.turned.transpose() * (v.row(j).transpose() - led);
    for (std::uint32_t m = 0; m < kHeldModes; ++m) amplitudes[m] += local.dot(modeOf(m, j));
  }
  for (std::uint32_t m = 0; m < kHeldModes; ++m) amplitudes[m] *= 1 - std::exp(-ratio * holds.lacking[m] * motion.h);
  for (std::uint32_t j = 0; j < field.k; ++j) {
    Vector3d lost = Vector3d::Zero();
    for (std::uint32_t m = 0; m < kHeldModes; ++m) lost += amplitudes[m] * modeOf(m, j);
    visit(j, Vector3d(motion.after.turned * lost));
  }
}

}  // namespace sinew::internal

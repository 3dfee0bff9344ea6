// SPDX-License-Identifier: MIT
//
// The matrix of a step: inertia, a stiffness, springs and contacts, in the frame of the piece (docs/method.md §3).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "runtime/memory/array.h"

namespace sinew::internal {

struct Objective;

/// The Cholesky factor of that matrix, and the step it was made for. Springs and contacts pull alike in all directions,
/// so it turns with the piece; holds do not.
struct SystemFactor {
  explicit SystemFactor(std::pmr::memory_resource* memory) : factor(memory), points(memory) {}
  /// A contact among it.
  struct Point {
    std::uint32_t point;
    float firm;                      ///< N/m
    std::array<float, 3> rest = {};  ///< of a contact, m: that with a collider's own point may be another one
  };

  Array<float> factor;                                       ///< 3 n rows of `stride` floats; the lower triangle
  Array<Point> points;                                       ///< contacts among it, then touches by their keys
  Eigen::Matrix3f holds_turn = Eigen::Matrix3f::Identity();  ///< of the frame of holds among it
  double h = 0;  ///< of the inertia, s; 0: not that of the rest shape with these springs
};

/// The rest shape's stiffness: through its modes, or where springs or contacts act a factor, made anew where they or
/// the step's length have changed.
void useRestSystem(Objective& objective, SystemFactor& system);

/// The stiffness of the shape at an offset (k x 4) from the prediction, for this step.
void useSystemAt(Objective& objective, SystemFactor& system, const float* offset);

}  // namespace sinew::internal

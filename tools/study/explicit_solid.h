// SPDX-License-Identifier: GPL-3.0-or-later
//
// The reference over time: finite elements by central differences, in steps so short that time adds no error that
// counts. No system is solved, so a hundred thousand points are affordable.
#pragma once

#include <functional>

#include "tools/study/motion.h"

namespace sinew::tools {

enum class ElasticLaw : std::uint8_t {
  corotated,    ///< mu |F - R|² + lambda/2 tr²(RᵀF - 1)
  determinant,  ///< the runtime's: mu |F - R|² + lambda/2 g²(det F), g as in docs/method.md §3
  neo_hookean,  ///< stable neo-Hookean (Smith, de Goes, Kim 2018), of the same linear elasticity
};

struct ExplicitOptions {
  ElasticLaw law = ElasticLaw::corotated;
  /// Tetrahedra of 10 nodes and 4 points of quadrature, which do not lock as linear ones do; else of 4 nodes.
  bool quadratic = true;
  double step_share = 0.45;  ///< of the longest stable step: 2 / the highest frequency, by power iteration
  double most_work = 1e300;  ///< ExplicitRun::work beyond which nothing is played
  /// Pressure of the ground for a depth, of the mean Young's modulus over the body's diagonal: a stress s presses the
  /// surface in by s / (E penalty) diagonals.
  double penalty = 100;
};

struct ExplicitRun {
  Motion motion;
  double step_seconds = 0;
  std::uint32_t tetrahedra = 0;
  double work = 0;  ///< points of quadrature times steps
};

/// Plays the scene with all threads. The ground pushes at MotionBody::points: by their area times the penalty times
/// their depth, and as much for each length that they slide, up to Coulomb's bound. \param progress called with 0..1.
ExplicitRun playSolid(const MotionBody& body, const MotionScene& scene, const ExplicitOptions& options,
                      const std::function<void(double)>& progress);

}  // namespace sinew::tools

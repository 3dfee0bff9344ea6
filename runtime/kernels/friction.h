// SPDX-License-Identifier: MIT
//
// The law of friction (docs/method.md §4), on lanes or on a number.
#pragma once

#include "runtime/kernels/lanes.h"

namespace sinew::internal::SINEW_KERNELS {

/// Friction that holds like a spring up to Coulomb's bound under a load.
template <class F>
struct RubOf {
  F scale;   ///< pull for a unit of slide, N/m
  F energy;  ///< J
};
template <class F>
SINEW_INLINE RubOf<F> rubOf(F kappa, F friction, F slide, F load) {
  const F most = friction * load, half = splat<F>(0.5F);
  const auto sticks = kappa * slide <= most;
  return {select(sticks, kappa, most / slide),
          select(sticks, half * kappa * slide * slide, most * (slide - half * (most / kappa)))};
}

}  // namespace sinew::internal::SINEW_KERNELS

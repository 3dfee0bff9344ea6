// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "runtime/kernels/kernels.h"

namespace sinew::tools {

/// The kernels compiled with fused multiply-add for AVX-512, which the runtime does not use: its results do not depend
/// on the instruction set. Null where this processor or build lacks them.
const internal::Kernels* fusedKernels();

}  // namespace sinew::tools

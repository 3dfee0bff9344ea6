// SPDX-License-Identifier: MIT
#define SINEW_KERNELS kernels_avx2
#include "runtime/kernels/table.h"

namespace sinew::internal {
extern const Kernels kAVX2;
const Kernels kAVX2 = kernels_avx2::tableNamed("avx2");
}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#define SINEW_KERNELS kernels_avx512
#include "runtime/kernels/table.h"

namespace sinew::internal {
extern const Kernels kAVX512;
const Kernels kAVX512 = kernels_avx512::tableNamed("avx512");
}  // namespace sinew::internal

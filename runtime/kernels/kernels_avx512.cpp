// SPDX-License-Identifier: MIT
#define SINEW_KERNELS kernels_avx512
#if defined(SINEW_AVX2_KERNELS)
#define SINEW_NARROW_KERNELS kernels_avx2
#endif
#include "runtime/kernels/table.h"

namespace sinew::internal {
extern const Kernels kAVX512;
const Kernels kAVX512 = kernels_avx512::tableNamed("avx512");
}  // namespace sinew::internal

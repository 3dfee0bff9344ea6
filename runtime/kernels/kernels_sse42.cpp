// SPDX-License-Identifier: MIT
#define SINEW_KERNELS kernels_sse42
#include "runtime/kernels/table.h"

namespace sinew::internal {
extern const Kernels kSSE42;
const Kernels kSSE42 = kernels_sse42::tableNamed("sse42");
}  // namespace sinew::internal

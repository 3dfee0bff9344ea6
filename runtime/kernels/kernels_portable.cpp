// SPDX-License-Identifier: MIT
#define SINEW_KERNELS kernels_portable
#include "runtime/kernels/table.h"

namespace sinew::internal {
extern const Kernels kPORTABLE;
const Kernels kPORTABLE = kernels_portable::tableNamed("portable");
}  // namespace sinew::internal

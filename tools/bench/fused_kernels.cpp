// SPDX-License-Identifier: GPL-3.0-or-later
//
// The runtime's kernels once more with multiplications and additions fused where the compiler likes: what results that
// do not depend on the instruction set cost. Compiled for the widest set that has such instructions.
#define SINEW_KERNELS kernels_fused
#include "tools/bench/fused_kernels.h"
#include "runtime/kernels/table.h"

namespace sinew::tools {

const internal::Kernels* fusedKernels() {
#if defined(__AVX512F__)
  static constexpr internal::Kernels kTable = internal::kernels_fused::tableNamed("fused");
  __builtin_cpu_init();
  const bool runs = __builtin_cpu_supports("fma") != 0 && internal::kernelsNamed("avx512") != nullptr;
  return runs ? &kTable : nullptr;
#else
  return nullptr;
#endif
}

}  // namespace sinew::tools

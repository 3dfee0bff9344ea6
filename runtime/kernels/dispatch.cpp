// SPDX-License-Identifier: MIT
#include <array>
#include <cstdlib>
#include <cstring>

#include "runtime/kernels/kernels.h"

namespace sinew::internal {

#if defined(SINEW_X86_KERNELS)
extern const Kernels kSSE42, kAVX2, kAVX512;

namespace {

struct Candidate {
  const Kernels* table;
  bool runs;
};

// Widest first.
std::array<Candidate, 3> candidates() {
  __builtin_cpu_init();
  const bool avx512 = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512vl") != 0 &&
                      __builtin_cpu_supports("avx512bw") != 0 && __builtin_cpu_supports("avx512dq") != 0;
  return {{{&kAVX512, avx512},
           {&kAVX2, __builtin_cpu_supports("avx2") != 0},
           {&kSSE42, __builtin_cpu_supports("sse4.2") != 0}}};
}

}  // namespace
#else
extern const Kernels kPORTABLE;

namespace {

struct Candidate {
  const Kernels* table;
  bool runs;
};

std::array<Candidate, 1> candidates() { return {{{&kPORTABLE, true}}}; }

}  // namespace
#endif

const Kernels* kernelsNamed(const char* name) {
  for (const Candidate& candidate : candidates()) {
    if (candidate.runs && std::strcmp(candidate.table->name, name) == 0) return candidate.table;
  }
  return nullptr;
}

const Kernels& kernels() {
  static const Kernels* const chosen = [] {
    if (const char* wanted = std::getenv("SINEW_INSTRUCTION_SET")) {
      if (const Kernels* table = kernelsNamed(wanted)) return table;
    }
    for (const Candidate& candidate : candidates()) {
      if (candidate.runs) return candidate.table;
    }
    return candidates().back().table;
  }();
  return *chosen;
}

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>

#include "runtime/kernels/kernels.h"

namespace sinew::internal {

extern const Kernels kSSE42, kAVX2, kAVX512, kPORTABLE;  // those that are built

namespace {

struct Candidate {
  const Kernels* table;
  bool runs;
};

// Widest first.
auto candidates() {
#if defined(SINEW_PORTABLE_KERNELS)
  return std::array<Candidate, 1>{{{&kPORTABLE, true}}};
#else
  __builtin_cpu_init();
  return std::array {
#if defined(SINEW_AVX512_KERNELS)
    Candidate{&kAVX512, __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512vl") != 0 &&
                            __builtin_cpu_supports("avx512bw") != 0 && __builtin_cpu_supports("avx512dq") != 0},
#endif
#if defined(SINEW_AVX2_KERNELS)
        Candidate{&kAVX2, __builtin_cpu_supports("avx2") != 0},
#endif
#if defined(SINEW_SSE42_KERNELS)
        Candidate{&kSSE42, __builtin_cpu_supports("sse4.2") != 0},
#endif
  };
#endif
}

}  // namespace

const Kernels* kernelsNamed(const char* name) {
  for (const Candidate& candidate : candidates()) {
    if (candidate.runs && std::strcmp(candidate.table->name, name) == 0) return candidate.table;
  }
  return nullptr;
}

bool kernelsRun() {
  const auto all = candidates();
  return std::any_of(all.begin(), all.end(), [](const Candidate& candidate) { return candidate.runs; });
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

// SPDX-License-Identifier: MIT
#if !defined(SINEW_PORTABLE_KERNELS)
#include <cpuid.h>
#endif

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>

#include "runtime/kernels/kernels.h"

namespace sinew::internal {

extern const Kernels kSSE42, kAVX2, kAVX512, kPORTABLE;  // if they are built

namespace {

struct Candidate {
  const Kernels* table;
  bool runs;
};

#if !defined(SINEW_PORTABLE_KERNELS)
// In place of __builtin_cpu_supports(), which brings five kilobytes of tables along.
struct Processor {
  bool sse42 = false, avx2 = false, avx512 = false;

  Processor() {
    unsigned eax, ebx, ecx, edx;
    if (__get_cpuid(1, &eax, &ebx, &ecx, &edx) == 0) return;
    sse42 = (ecx & bit_SSE4_2) != 0;
    if ((ecx & bit_OSXSAVE) == 0) return;
    // The registers that the system saves.
    unsigned saved, high;
    __asm__("xgetbv" : "=a"(saved), "=d"(high) : "c"(0));
    constexpr unsigned kUpTo256 = 0x06, kUpTo512 = 0xe6,
                       kAvx512 = bit_AVX512F | bit_AVX512VL | bit_AVX512BW | bit_AVX512DQ;
    if ((saved & kUpTo256) != kUpTo256 || __get_cpuid_count(7, 0, &eax, &ebx, &ecx, &edx) == 0) return;
    avx2 = (ebx & bit_AVX2) != 0;
    avx512 = (ebx & kAvx512) == kAvx512 && (saved & kUpTo512) == kUpTo512;
  }
};
#endif

// Widest first.
auto candidates() {
#if defined(SINEW_PORTABLE_KERNELS)
  return std::array<Candidate, 1>{{{&kPORTABLE, true}}};
#else
  const Processor processor;
  return std::array {
#if defined(SINEW_AVX512_KERNELS)
    Candidate{&kAVX512, processor.avx512},
#endif
#if defined(SINEW_AVX2_KERNELS)
        Candidate{&kAVX2, processor.avx2},
#endif
#if defined(SINEW_SSE42_KERNELS)
        Candidate{&kSSE42, processor.sse42},
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

// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/machine.h"

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#if defined(__x86_64__) && defined(__GNUC__)
#define SINEW_BENCH_X86 1
#include <immintrin.h>
#else
#define SINEW_BENCH_X86 0
#endif

namespace sinew::tools {
namespace {

#if SINEW_BENCH_X86
#define SINEW_TARGET(text) __attribute__((target(text)))
#else
#define SINEW_TARGET(text)
#endif

using Float4 = float __attribute__((vector_size(16)));
using Float8 = float __attribute__((vector_size(32)));
using Float16 = float __attribute__((vector_size(64)));

// Enough independent chains for a latency of 4 to 5 cycles on two units.
constexpr int kChains = 12;
constexpr unsigned kRounds = 2000;

// x = x * a + b on every chain.
#define SINEW_FMA_LOOP(F, SPLAT, FMA)                                      \
  F x[kChains];                                                            \
  for (int i = 0; i < kChains; ++i) x[i] = SPLAT(seed + float(i));         \
  const F a = SPLAT(0.999F * seed), b = SPLAT(0.001F * seed);              \
  for (unsigned n = 0; n < kRounds; ++n) {                                 \
    _Pragma("GCC unroll 12") for (int i = 0; i < kChains; ++i) x[i] = FMA; \
  }                                                                        \
  float sum = 0;                                                           \
  for (int i = 0; i < kChains; ++i) sum += x[i][0];                        \
  return sum

#if SINEW_BENCH_X86
SINEW_TARGET("avx512f") float fma512(float seed) {
  SINEW_FMA_LOOP(__m512, _mm512_set1_ps, _mm512_fmadd_ps(x[i], a, b));
}
SINEW_TARGET("avx512f") float plain512(float seed) {
  SINEW_FMA_LOOP(__m512, _mm512_set1_ps, _mm512_add_ps(_mm512_mul_ps(x[i], a), b));
}
SINEW_TARGET("avx2,fma") float fma256(float seed) {
  SINEW_FMA_LOOP(__m256, _mm256_set1_ps, _mm256_fmadd_ps(x[i], a, b));
}
SINEW_TARGET("avx2") float plain256(float seed) {
  SINEW_FMA_LOOP(__m256, _mm256_set1_ps, _mm256_add_ps(_mm256_mul_ps(x[i], a), b));
}
SINEW_TARGET("avx2,fma") float fma128(float seed) { SINEW_FMA_LOOP(__m128, _mm_set1_ps, _mm_fmadd_ps(x[i], a, b)); }
SINEW_TARGET("avx2") float plain128(float seed) {
  SINEW_FMA_LOOP(__m128, _mm_set1_ps, _mm_add_ps(_mm_mul_ps(x[i], a), b));
}
#endif
float fmaCompiler(float seed) { SINEW_FMA_LOOP(Float4, Float4{} +, x[i] * a + b); }

#define SINEW_COPY_LOOP(F)                                      \
  const std::size_t step = 4 * sizeof(F);                       \
  for (std::size_t i = 0; i + step <= bytes; i += step) {       \
    F x0, x1, x2, x3;                                           \
    __builtin_memcpy(&x0, from + i, sizeof(F));                 \
    __builtin_memcpy(&x1, from + i + sizeof(F), sizeof(F));     \
    __builtin_memcpy(&x2, from + i + 2 * sizeof(F), sizeof(F)); \
    __builtin_memcpy(&x3, from + i + 3 * sizeof(F), sizeof(F)); \
    __builtin_memcpy(to + i, &x0, sizeof(F));                   \
    __builtin_memcpy(to + i + sizeof(F), &x1, sizeof(F));       \
    __builtin_memcpy(to + i + 2 * sizeof(F), &x2, sizeof(F));   \
    __builtin_memcpy(to + i + 3 * sizeof(F), &x3, sizeof(F));   \
    keepAlive(to);                                              \
  }                                                             \
  static_cast<void>(0)

#if SINEW_BENCH_X86
SINEW_TARGET("avx512f") void copy512(char* to, const char* from, std::size_t bytes) { SINEW_COPY_LOOP(Float16); }
SINEW_TARGET("avx2") void copy256(char* to, const char* from, std::size_t bytes) { SINEW_COPY_LOOP(Float8); }
#endif
void copyCompiler(char* to, const char* from, std::size_t bytes) { SINEW_COPY_LOOP(Float4); }

struct Width {
  const char* name;
  unsigned bits;
  float (*fma)(float);
  float (*plain)(float);
  void (*copy)(char*, const char*, std::size_t);
};

// Those the processor has, widest first.
std::vector<Width> widths() {
  std::vector<Width> found;
#if SINEW_BENCH_X86
  __builtin_cpu_init();
  const bool fma = __builtin_cpu_supports("fma") != 0;
  if (fma && __builtin_cpu_supports("avx512f") != 0) found.push_back({"avx512", 512, fma512, plain512, copy512});
  if (fma && __builtin_cpu_supports("avx2") != 0) {
    found.push_back({"avx2", 256, fma256, plain256, copy256});
    found.push_back({"avx2", 128, fma128, plain128, copyCompiler});
  }
#endif
  if (found.empty()) found.push_back({"compiler", 128, fmaCompiler, fmaCompiler, copyCompiler});
  return found;
}

double flopsPerCall(unsigned bits) { return 2.0 * kRounds * kChains * bits / 32; }

struct FreeDeleter {
  void operator()(char* p) const { std::free(p); }
};
using Buffer = std::unique_ptr<char, FreeDeleter>;

Buffer makeBuffer(std::size_t bytes) {
  Buffer buffer(static_cast<char*>(std::aligned_alloc(4096, (bytes + 4095) / 4096 * 4096)));
  if (!buffer) throw std::bad_alloc();
  std::memset(buffer.get(), 1, bytes);
  return buffer;
}

// Seconds of `calls` calls of work(thread) on each of `threads` threads that start together: the wall's, or the mean
// CPU time of a thread, which leaves out what other programs took.
template <class Work>
double together(unsigned threads, unsigned calls, ClockKind clock, const Work& work) {
  std::atomic<unsigned> waiting{threads};
  std::vector<double> begin(threads), end(threads);
  const auto run = [&](unsigned thread) {
    work(thread);  // warms up
    --waiting;
    while (waiting.load() != 0) {
    }
    begin[thread] = clockSeconds(clock);
    for (unsigned i = 0; i < calls; ++i) work(thread);
    end[thread] = clockSeconds(clock);
  };
  std::vector<std::thread> others;
  for (unsigned t = 1; t < threads; ++t) others.emplace_back(run, t);
  run(0);
  for (std::thread& other : others) other.join();
  if (clock == ClockKind::wall) {
    return *std::max_element(end.begin(), end.end()) - *std::min_element(begin.begin(), begin.end());
  }
  double sum = 0;
  for (unsigned t = 0; t < threads; ++t) sum += end[t] - begin[t];
  return sum / threads;
}

std::string processorName() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("model name")) return line.substr(std::min(line.size(), line.find(':') + 2));
  }
  return {};
}

}  // namespace

double MachineLimits::bandwidth(std::size_t working_set_bytes) const {
  for (const CopyBandwidth& copy : copies) {
    if (copy.bytes >= working_set_bytes) return copy.one_thread;
  }
  return copies.empty() ? 0 : copies.back().one_thread;
}

MachineLimits measureMachine(bool quick) {
  MachineLimits limits;
  limits.processor = processorName();
  limits.processors = std::thread::hardware_concurrency();
  const TimingOptions options{quick ? 1e-4 : 3e-4, quick ? 1e-3 : 5e-3, ClockKind::thread_cpu};
  const std::vector<Width> all = widths();
  limits.instruction_set = all.front().name;
  // Seconds of a call on two threads at once.
  const auto on_two = [&](const auto& work, double one_call_seconds) {
    const unsigned calls = unsigned(std::clamp((quick ? 5e-4 : 2e-3) / one_call_seconds, 1.0, 1e7));
    std::vector<double> seconds;
    for (int i = 0; i < 5; ++i) seconds.push_back(together(2, calls, ClockKind::thread_cpu, work) / calls);
    return quantile(seconds, 0.5);
  };

  Width fastest = all.front();
  for (const Width& width : all) {
    const auto flops_of = [&](float (*loop)(float)) {
      const auto call = [&] {
        const float x = loop(1);
        keepAlive(&x);
      };
      return flopsPerCall(width.bits) / measure({call}, options).seconds;
    };
    limits.widths.push_back({width.bits, flops_of(width.fma), flops_of(width.plain)});
    if (limits.widths.back().fma > 1.02 * limits.fma_flops) {
      limits.fma_flops = limits.widths.back().fma;
      limits.fma_bits = width.bits;
      fastest = width;
    }
  }
  const auto fma_work = [&](unsigned) {
    const float x = fastest.fma(1);
    keepAlive(&x);
  };
  const double flops = flopsPerCall(fastest.bits);
  limits.fma_two_threads = 2 * flops / on_two(fma_work, flops / limits.fma_flops);

  using CopyFunction = void (*)(char*, const char*, std::size_t);
  std::vector<CopyFunction> ways = {
      [](char* to, const char* from, std::size_t bytes) { std::memcpy(to, from, bytes); }};
  for (const Width& width : all) {
    if (width.bits >= 256 || all.size() == 1) ways.push_back(width.copy);
  }
  std::vector<std::size_t> sizes = {16, 32, 256, 768, 4096, 16384};  // KiB
  sizes.push_back(quick ? 65536 : 131072);
  const Buffer first = makeBuffer(sizes.back() * 1024), second = makeBuffer(sizes.back() * 1024);
  for (const std::size_t size : sizes) {
    CopyBandwidth copy;
    copy.bytes = size * 1024;
    const std::size_t half = copy.bytes / 2;
    CopyFunction best = nullptr;
    for (const CopyFunction how : ways) {
      const auto call = [&] { how(first.get() + half, first.get(), half); };
      const double rate = double(copy.bytes) / measure({call}, options).seconds;
      if (rate <= copy.one_thread) continue;
      copy.one_thread = rate;
      best = how;
    }
    const auto both = [&](unsigned thread) {
      char* base = thread == 0 ? first.get() : second.get();
      best(base + half, base, half);
    };
    copy.two_threads = 2 * double(copy.bytes) / on_two(both, double(copy.bytes) / copy.one_thread);
    limits.copies.push_back(copy);
  }
  return limits;
}

double measureSecondCore() {
  static const Width width = widths().front();
  const auto work = [&](unsigned) {
    const float x = width.fma(1);
    keepAlive(&x);
  };
  constexpr unsigned kCalls = 100;
  const double one = together(1, kCalls, ClockKind::wall, work);
  return 2 * one / together(2, kCalls, ClockKind::wall, work);
}

}  // namespace sinew::tools

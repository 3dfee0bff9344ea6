// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

namespace sinew::tools {

/// Seconds of one call, from several samples.
struct Timing {
  double seconds = 0;  ///< median of the samples
  double spread = 0;   ///< half the distance of the quartiles, of the median
  unsigned samples = 0;
};

/// Two calls sampled in turn, so that whatever else the machine does falls on both.
struct TimingPair {
  Timing first, second;
  double ratio = 0;   ///< median of second / first over neighbouring samples
  double spread = 0;  ///< half the distance of the quartiles of that ratio, of the ratio
};

/// Which clock. Of one thread's work its own CPU time: being put aside for other programs then costs nothing. Of
/// several threads the wall's.
enum class ClockKind { thread_cpu, wall };

/// How long to measure. A sample repeats the call until it lasts `sample_seconds`; samples are taken until `seconds`
/// are over, and on, up to four times as long, while the spread is above 2 %. At least 7, at most 201.
struct TimingOptions {
  double sample_seconds = 2e-3;
  double seconds = 0.15;
  ClockKind clock = ClockKind::thread_cpu;
};

/// `call` is timed; `prepare` (may be empty) runs before each sample, untimed. With `prepare`, a sample is
/// `calls_per_sample` calls, or as many as `sample_seconds` need where that is 0.
struct TimedCall {
  std::function<void()> call;
  std::function<void()> prepare = {};
  unsigned calls_per_sample = 0;
};

/// The same of functions that time themselves: each returns the seconds of its call in one sample.
Timing measureSamples(const std::function<double()>& sample, const TimingOptions& options);
TimingPair measureSamplePairs(const std::function<double()>& first, const std::function<double()>& second,
                              const TimingOptions& options);

Timing measure(const TimedCall& timed, const TimingOptions& options);
TimingPair measurePair(const TimedCall& first, const TimedCall& second, const TimingOptions& options);

/// Seconds of a clock that only differences are taken of.
double clockSeconds(ClockKind clock);

/// Quantile 0..1 of a copy of the values; 0 of none.
double quantile(std::vector<double> values, double part);

/// Keeps the compiler from dropping what `p` points to.
inline void keepAlive(const void* p) {
#if defined(__GNUC__)
  asm volatile("" : : "r"(p) : "memory");
#else
  static const void* volatile sink;
  sink = p;
#endif
}

}  // namespace sinew::tools

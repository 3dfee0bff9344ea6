// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/timing.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>

namespace sinew::tools {
namespace {

constexpr unsigned kLeastSamples = 7;
constexpr unsigned kMostSamples = 201;
constexpr double kSteadySpread = 0.02;

// Seconds of one call in one sample.
double sampleOf(const TimedCall& timed, unsigned calls, ClockKind clock) {
  if (timed.prepare) timed.prepare();
  const double before = clockSeconds(clock);
  for (unsigned i = 0; i < calls; ++i) timed.call();
  return (clockSeconds(clock) - before) / calls;
}

unsigned callsFor(const TimedCall& timed, const TimingOptions& options) {
  if (timed.calls_per_sample > 0) {
    sampleOf(timed, timed.calls_per_sample, options.clock);  // warms up
    return timed.calls_per_sample;
  }
  unsigned calls = 1;
  for (;;) {
    const double seconds = sampleOf(timed, calls, options.clock) * calls;
    if (seconds >= 0.5 * options.sample_seconds) {
      return unsigned(std::clamp(calls * options.sample_seconds / seconds, 1.0, 1e8));
    }
    if (calls > 50'000'000) return calls;
    calls = unsigned(calls * std::clamp(options.sample_seconds / std::max(seconds, 1e-9), 2.0, 100.0));
  }
}

double spreadOf(const std::vector<double>& values, double median) {
  return median > 0 ? 0.5 * (quantile(values, 0.75) - quantile(values, 0.25)) / median : 0;
}

Timing timingOf(const std::vector<double>& samples) {
  const double median = quantile(samples, 0.5);
  return {median, spreadOf(samples, median), unsigned(samples.size())};
}

// Calls take() until the samples, whose spread it returns, are enough.
template <class Take>
void repeat(const TimingOptions& options, const Take& take) {
  const double begin = clockSeconds(ClockKind::wall);
  for (unsigned n = 1; n <= kMostSamples; ++n) {
    const double spread = take();
    const double passed = clockSeconds(ClockKind::wall) - begin;
    if (n >= kLeastSamples && passed > options.seconds && (spread < kSteadySpread || passed > 4 * options.seconds))
      return;
  }
}

}  // namespace

double clockSeconds(ClockKind clock) {
#if defined(CLOCK_THREAD_CPUTIME_ID)
  if (clock == ClockKind::thread_cpu) {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
  }
#endif
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const double at = part * double(values.size() - 1);
  const std::size_t low = std::size_t(at);
  const std::size_t high = std::min(low + 1, values.size() - 1);
  return values[low] + (at - double(low)) * (values[high] - values[low]);
}

Timing measureSamples(const std::function<double()>& sample, const TimingOptions& options) {
  std::vector<double> samples;
  repeat(options, [&] {
    samples.push_back(sample());
    return timingOf(samples).spread;
  });
  return timingOf(samples);
}

TimingPair measureSamplePairs(const std::function<double()>& first, const std::function<double()>& second,
                              const TimingOptions& options) {
  std::vector<double> a, b, ratios;
  repeat(options, [&] {
    a.push_back(first());
    b.push_back(second());
    ratios.push_back(b.back() / a.back());
    return spreadOf(ratios, quantile(ratios, 0.5));
  });
  TimingPair pair{timingOf(a), timingOf(b), quantile(ratios, 0.5), 0};
  pair.spread = spreadOf(ratios, pair.ratio);
  return pair;
}

Timing measure(const TimedCall& timed, const TimingOptions& options) {
  const unsigned calls = callsFor(timed, options);
  return measureSamples([&] { return sampleOf(timed, calls, options.clock); }, options);
}

TimingPair measurePair(const TimedCall& first, const TimedCall& second, const TimingOptions& options) {
  const unsigned first_calls = callsFor(first, options);
  const unsigned second_calls = callsFor(second, options);
  return measureSamplePairs([&] { return sampleOf(first, first_calls, options.clock); },
                            [&] { return sampleOf(second, second_calls, options.clock); }, options);
}

}  // namespace sinew::tools

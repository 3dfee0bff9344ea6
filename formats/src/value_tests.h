// SPDX-License-Identifier: MIT
//
// Tests on the values of sections.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "refusal.h"
#include "sinew/formats/sections.h"

namespace sinew::formats {

/// How far sums of rounded weights may lie from 1.
inline constexpr double kSumTolerance = 1e-3;

// Nonzero: bad, as is NaN. Branch-free (| and & instead of || and &&), so that loops over them vectorize.
inline unsigned beyond(float value, float most = kMostNumber) { return unsigned(!(std::fabs(value) <= most)); }
template <std::size_t kCount>
unsigned beyond(const std::array<float, kCount>& values, float most = kMostNumber) {
  unsigned bad = 0;
  for (const float value : values) bad |= beyond(value, most);
  return bad;
}
inline unsigned notPositive(float value, float most) { return unsigned(!(value > 0.0F)) | unsigned(!(value <= most)); }
inline unsigned negativeOrBeyond(float value, float most = kMostNumber) {
  return unsigned(!(value >= 0.0F)) | unsigned(!(value <= most));
}
inline unsigned outside(float value, float low, float high) {
  return unsigned(!(value >= low)) | unsigned(!(value <= high));
}
inline unsigned outsideUnit(float value) { return outside(value, 0, 1); }

inline constexpr std::size_t kAllGood = std::numeric_limits<std::size_t>::max();

/// Index of the first item that `bad` (branch-free, nonzero = bad) rejects, or kAllGood.
template <class T, class Bad>
std::size_t firstBad(std::span<const T> items, Bad bad) {
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (bad(items[i]) != 0) return i;
  }
  return kAllGood;
}

/// True when `bad` rejects no item; otherwise sets the reason.
template <class T, class Bad>
bool check(Refusal& refuse, std::uint32_t id, std::span<const T> items, const char* what, Bad bad) {
  const std::size_t index = firstBad(items, bad);
  return index == kAllGood || refuse(id, index, what);
}

/// One of the runs that tile a list of ascending numbers below `limit`. \param end of the run before, and after.
bool checkRun(Refusal& refuse, std::uint32_t id, std::size_t i, std::uint32_t first, std::uint32_t count,
              std::span<const std::uint32_t> list, std::size_t limit, std::uint64_t& end);

}  // namespace sinew::formats

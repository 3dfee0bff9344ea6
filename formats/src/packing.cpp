// SPDX-License-Identifier: MIT
#include "packing.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "sinew/formats/sections.h"

namespace sinew::formats {
namespace {

// Exponents of blocks: every number of one is a normal float or 0.
constexpr int kLeastExponent = -111, kMostExponent = 127;

template <class T>
T take(const std::byte*& from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  from += sizeof value;
  return value;
}

template <class T>
void put(std::byte*& to, T value) {
  std::memcpy(to, &value, sizeof value);
  to += sizeof value;
}

constexpr std::uint32_t noneOf(std::uint32_t width) { return (1U << (8 * width)) - 1; }

// 2^(exponent - 15).
float unitOf(int exponent) { return std::bit_cast<float>(std::uint32_t(exponent - 15 + 127) << 23); }

int exponentOf(const float* numbers, std::size_t count) {
  float largest = 0;
  for (std::size_t i = 0; i < count; ++i) largest = std::max(largest, std::fabs(numbers[i]));
  return largest > 0 ? std::clamp(std::ilogb(largest) + 1, kLeastExponent, kMostExponent) : kLeastExponent;
}

}  // namespace

std::uint32_t packedWidth(const Packing& packing, std::uint32_t element_bytes) {
  if (element_bytes == packing.bytes(2)) return 2;
  return element_bytes == packing.bytes(3) ? 3 : 0;
}

bool unpack(const Packing& packing, std::uint32_t width, std::span<const std::byte> packed, std::byte* plain) {
  const std::byte* from = packed.data();
  const std::byte* const end = from + packed.size();
  bool good = true;
  while (from != end) {
    for (std::uint32_t i = 0; i < packing.indices; ++i) {
      std::uint32_t index = 0;
      std::memcpy(&index, from, width);
      from += width;
      put(plain, index == noneOf(width) ? kNone : index);
    }
    std::memcpy(plain, from, packing.plain * 4U);
    plain += packing.plain * 4U;
    from += packing.plain * 4U;
    if (packing.block == 0) continue;
    const int exponent = take<std::int16_t>(from);
    good = good && exponent >= kLeastExponent && exponent <= kMostExponent;
    const float unit = unitOf(std::clamp(exponent, kLeastExponent, kMostExponent));
    for (std::uint32_t i = 0; i < packing.block; ++i) put(plain, float(take<std::int16_t>(from)) * unit);
  }
  return good;
}

std::vector<std::byte> pack(const Packing& packing, std::span<const std::byte> plain, std::uint32_t& width) {
  const std::size_t words = std::size_t{packing.indices} + packing.plain + packing.block;
  const std::size_t count = plain.size() / (4 * words);
  std::uint32_t largest = 0;
  for (std::size_t e = 0; e < count; ++e) {
    for (std::size_t i = 0; i < packing.indices; ++i) {
      std::uint32_t index;
      std::memcpy(&index, plain.data() + 4 * (e * words + i), 4);
      if (index != kNone) largest = std::max(largest, index);
    }
  }
  width = largest < noneOf(2) ? 2 : 3;
  if (largest >= noneOf(3)) return {};
  std::vector<std::byte> packed(count * packing.bytes(width));
  const std::byte* from = plain.data();
  std::byte* to = packed.data();
  for (std::size_t e = 0; e < count; ++e) {
    for (std::uint32_t i = 0; i < packing.indices; ++i) {
      const auto index = take<std::uint32_t>(from);  // kNone's low bytes are the narrow none
      std::memcpy(to, &index, width);
      to += width;
    }
    std::memcpy(to, from, packing.plain * 4U);
    to += packing.plain * 4U;
    from += packing.plain * 4U;
    if (packing.block == 0) continue;
    float numbers[8];
    std::memcpy(numbers, from, packing.block * 4U);
    from += packing.block * 4U;
    const int exponent = exponentOf(numbers, packing.block);
    put(to, std::int16_t(exponent));
    for (std::uint32_t i = 0; i < packing.block; ++i) {
      const double q = std::nearbyint(std::ldexp(double(numbers[i]), 15 - exponent));
      put(to, std::int16_t(std::clamp(q, -32767.0, 32767.0)));
    }
  }
  return packed;
}

}  // namespace sinew::formats

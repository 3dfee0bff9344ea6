// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace sinew::formats {

/// XXH3-64 with seed 0 and the default secret: the checksum of every part of a package.
/// \param bytes any number of bytes, any alignment.
[[nodiscard]] std::uint64_t checksum(std::span<const std::byte> bytes);

/// The checksum of two runs of bytes as if they followed each other.
[[nodiscard]] std::uint64_t checksum(std::span<const std::byte> first, std::span<const std::byte> second);

}  // namespace sinew::formats

// SPDX-License-Identifier: MIT
//
// Elements of packed sections (docs/package-format.md, "Packed sections").
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "section_rules.h"

namespace sinew::formats {

/// Bytes of an index in packed elements of this size: 2 or 3, without indices 2; 0 where no element has this size.
std::uint32_t packedWidth(const Packing& packing, std::uint32_t element_bytes);

/// Elements as the format's records hold them. \param packed a whole number of elements of packing.bytes(width).
/// \param[out] plain 4 bytes for each index and number. \return false where a block's exponent is none.
bool unpack(const Packing& packing, std::uint32_t width, std::span<const std::byte> packed, std::byte* plain);

/// The reverse, each number of a block within 2^-15 of the block's largest. \param[out] width of an index.
/// \return the packed elements; empty where indices need more than 3 bytes.
std::vector<std::byte> pack(const Packing& packing, std::span<const std::byte> plain, std::uint32_t& width);

}  // namespace sinew::formats

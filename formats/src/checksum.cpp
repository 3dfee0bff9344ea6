// SPDX-License-Identifier: MIT
#include "sinew/formats/checksum.h"

// The only file that includes xxHash; inlined, so that nothing has to be linked.
#define XXH_INLINE_ALL
#define XXH_NO_INLINE_HINTS 1  // a third smaller and no slower
#include <xxhash.h>

namespace sinew::formats {

// The same value as in one go, whose code is not needed then.
std::uint64_t checksum(std::span<const std::byte> bytes) { return checksum(bytes, {}); }

std::uint64_t checksum(std::span<const std::byte> first, std::span<const std::byte> second) {
  XXH3_state_t state;
  XXH3_64bits_reset(&state);
  XXH3_64bits_update(&state, first.data(), first.size());
  XXH3_64bits_update(&state, second.data(), second.size());
  return XXH3_64bits_digest(&state);
}

}  // namespace sinew::formats

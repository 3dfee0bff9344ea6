// SPDX-License-Identifier: MIT
#include "value_tests.h"

namespace sinew::formats {

bool checkRun(Refusal& refuse, std::uint32_t id, std::size_t i, std::uint32_t first, std::uint32_t count,
              std::span<const std::uint32_t> list, std::size_t limit, std::uint64_t& end) {
  if (first != end || count > list.size() - end) {
    return refuse(id, i, "does not start where the one before ends, or reaches beyond the list of vertices");
  }
  std::uint64_t lowest = 0;
  for (const std::uint32_t v : list.subspan(first, count)) {
    if (v < lowest || v >= limit) return refuse(id, i, "its vertices are not ascending, or do not exist");
    lowest = std::uint64_t{v} + 1;
  }
  end += count;
  return true;
}

}  // namespace sinew::formats

// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <functional>

namespace sinew::geometry {

/// Runs body(begin, end) over pieces of [0, count), each of at most `grain` elements, possibly on several threads at
/// once, and returns when all are done. Everything in this folder writes by index only, so results are the same for any
/// implementation. The caller passes in its own (tools: TBB).
using ParallelFor = std::function<void(std::size_t count, std::size_t grain,
                                       const std::function<void(std::size_t, std::size_t)>& body)>;

/// One piece, on the calling thread.
inline void serialFor(std::size_t count, std::size_t /*grain*/,
                      const std::function<void(std::size_t, std::size_t)>& body) {
  if (count > 0) body(0, count);
}

}  // namespace sinew::geometry

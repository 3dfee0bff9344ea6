// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "sinew/runtime/settings.h"

namespace sinew::tools {

/// The runtime's loops on TBB, with a given number of threads.
class TbbJobs final : public JobSystem {
 public:
  explicit TbbJobs(unsigned threads) : arena_(int(threads)) {}
  void parallelFor(std::uint32_t count, std::uint32_t grain,
                   const std::function<void(std::uint32_t, std::uint32_t)>& body) override {
    arena_.execute([&] {
      tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, count, grain),
                        [&](const auto& range) { body(range.begin(), range.end()); });
    });
  }

 private:
  tbb::task_arena arena_;
};

}  // namespace sinew::tools

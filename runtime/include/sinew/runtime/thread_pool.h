// SPDX-License-Identifier: MIT
#pragma once

#include <memory>

#include "sinew/runtime/export.h"
#include "sinew/runtime/settings.h"

namespace sinew {

/// A job system for programs that have none of their own: a fixed set of threads that share each loop.
/// Guarantee: a world's state does not depend on the number of threads, bit for bit.
class SINEW_API ThreadPool final : public JobSystem {
 public:
  /// Never fails: if the system lacks threads or memory the pool has fewer, at least the caller's; threads() tells.
  /// \param threads that work on a loop, the caller's included; 0 = one for each core.
  explicit ThreadPool(std::uint32_t threads = 0) noexcept;
  ~ThreadPool() override;
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  std::uint32_t threads() const;
  std::uint32_t concurrency() const override { return threads(); }

  /// One loop at a time is shared. A loop that is started meanwhile, by another thread or from inside `body`, runs in
  /// its caller's thread alone.
  void parallelFor(std::uint32_t count, std::uint32_t grain,
                   const std::function<void(std::uint32_t begin, std::uint32_t end)>& body) override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew

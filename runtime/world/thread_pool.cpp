// SPDX-License-Identifier: MIT
#include "sinew/runtime/thread_pool.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace sinew {
namespace {

// Looks this often for work before a thread goes to sleep: some ten microseconds, longer than a world takes from one
// loop of a step to the next, and far shorter than a frame. A sleeping thread costs about five microseconds to wake.
constexpr int kSpins = 1000;

void pause() {
#if defined(__SSE2__)
  _mm_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

template <class Ready>
bool spinUntil(int spins, const Ready& ready) {
  for (int i = 0; i < spins; ++i) {
    if (ready()) return true;
    pause();
  }
  return ready();
}

}  // namespace

struct ThreadPool::Impl {
  // The rest of one thread's share of the loop: its first index in the high half, its end in the low half. The
  // owner takes from the front, finished threads help from the back. Shares are the same in every loop of one length,
  // so a thread finds in its cache what it wrote in the loop before.
  struct alignas(64) Share {
    std::atomic<std::uint64_t> left{0};
  };

  std::atomic<bool> taken{false};  // by the caller of a loop
  // The caller's fields, read by helpers. The number of the loop that is running is odd while it is open.
  alignas(64) std::atomic<std::uint32_t> loop{0};
  std::uint32_t grain = 1;
  const std::function<void(std::uint32_t, std::uint32_t)>* body = nullptr;
  // Helpers' fields: two writes each a loop, since a line that two cores write costs a tenth of a microsecond a time.
  alignas(64) std::atomic<std::uint32_t> inside{0};    // helpers that look at the fields above
  std::atomic<std::uint32_t> done{0};                  // indices of the loop that are finished
  alignas(64) std::atomic<std::uint32_t> sleepers{0};  // helpers that wait on `work`
  std::unique_ptr<Share[]> shares;                     // one a thread, the caller's first

  std::mutex mutex;
  std::condition_variable work;
  std::vector<std::thread> threads;
  std::atomic<bool> stop{false};
  int spins = kSpins;

  static std::uint64_t packed(std::uint32_t begin, std::uint32_t end) { return (std::uint64_t(begin) << 32) | end; }
  std::uint32_t threadCount() const { return std::uint32_t(threads.size()) + 1; }

  // Works on a share until nothing of it is left; returns how many indices that were.
  std::uint32_t runShare(Share& share, bool own) {
    std::uint32_t finished = 0;
    std::uint64_t left = share.left.load(std::memory_order_acquire);
    for (;;) {
      const std::uint32_t begin = std::uint32_t(left >> 32), end = std::uint32_t(left);
      if (begin >= end) return finished;
      const std::uint32_t size = std::min(grain, end - begin);
      const std::uint64_t rest = own ? packed(begin + size, end) : packed(begin, end - size);
      if (!share.left.compare_exchange_weak(left, rest, std::memory_order_acq_rel)) continue;
      const std::uint32_t first = own ? begin : end - size;
      (*body)(first, first + size);
      finished += size;
      left = share.left.load(std::memory_order_acquire);
    }
  }
  std::uint32_t runShares(std::uint32_t thread) {
    const std::uint32_t count = threadCount();
    std::uint32_t finished = 0;
    for (std::uint32_t i = 0; i < count; ++i) finished += runShare(shares[(thread + i) % count], i == 0);
    return finished;
  }

  void helper(std::uint32_t thread) {
    std::uint32_t seen = 0;
    const auto ready = [&] {
      const std::uint32_t number = loop.load(std::memory_order_seq_cst);
      return stop.load(std::memory_order_acquire) || (number % 2 == 1 && number != seen);
    };
    for (;;) {
      if (!spinUntil(spins, ready)) {
        std::unique_lock lock(mutex);
        sleepers.fetch_add(1, std::memory_order_seq_cst);
        work.wait(lock, ready);
        sleepers.fetch_sub(1, std::memory_order_seq_cst);
      }
      if (stop.load(std::memory_order_acquire)) return;
      // The caller closes a loop (even number) before it changes the fields, and waits until nobody is inside.
      inside.fetch_add(1, std::memory_order_seq_cst);
      const std::uint32_t number = loop.load(std::memory_order_seq_cst);
      if (number % 2 == 1) {
        seen = number;
        done.fetch_add(runShares(thread), std::memory_order_acq_rel);
      }
      inside.fetch_sub(1, std::memory_order_seq_cst);
    }
  }
};

[[gnu::cold]] ThreadPool::ThreadPool(std::uint32_t threads) noexcept {
  const std::uint32_t cores = std::max(1U, std::thread::hardware_concurrency());
  if (threads == 0) threads = cores;
  try {
    auto impl = std::make_unique<Impl>();
    impl->shares = std::make_unique<Impl::Share[]>(threads);
    impl->threads.reserve(threads - 1);
    // Where there are more threads than cores, spinning only keeps the others from working.
    if (threads > cores) impl->spins = 1;
    impl_ = std::move(impl);
    for (std::uint32_t i = 1; i < threads; ++i) {
      impl_->threads.emplace_back([pool = impl_.get(), i] { pool->helper(i); });
    }
  } catch (...) {  // NOLINT(bugprone-empty-catch): as many threads as there are by now
  }
}

[[gnu::cold]] ThreadPool::~ThreadPool() {
  if (impl_ == nullptr) return;
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->stop = true;
  }
  impl_->work.notify_all();
  for (std::thread& thread : impl_->threads) thread.join();
}

std::uint32_t ThreadPool::threads() const { return impl_ == nullptr ? 1 : impl_->threadCount(); }

void ThreadPool::parallelFor(std::uint32_t count, std::uint32_t grain,
                             const std::function<void(std::uint32_t, std::uint32_t)>& body) {
  grain = std::max(1U, grain);
  if (count <= grain || threads() == 1 || impl_->taken.exchange(true, std::memory_order_acquire)) {
    if (count > 0) body(0, count);
    return;
  }
  Impl& pool = *impl_;
  const std::uint32_t all = threads();
  pool.grain = std::max(grain, count / (all * 8));  // a few ranges a thread balance the load
  pool.body = &body;
  pool.done.store(0, std::memory_order_relaxed);
  for (std::uint32_t i = 0; i < all; ++i) {
    const auto border = [&](std::uint32_t of) { return std::uint32_t(std::uint64_t(count) * of / all); };
    pool.shares[i].left.store(Impl::packed(border(i), border(i + 1)), std::memory_order_relaxed);
  }
  const std::uint32_t number = pool.loop.load(std::memory_order_relaxed) + 1;
  pool.loop.store(number, std::memory_order_seq_cst);
  if (pool.sleepers.load(std::memory_order_seq_cst) > 0) {
    { const std::lock_guard lock(pool.mutex); }  // a helper between its last look and its sleep hears the call
    pool.work.notify_all();
  }
  const std::uint32_t for_helpers = count - pool.runShares(0);
  const auto finished = [&] { return pool.done.load(std::memory_order_acquire) == for_helpers; };
  while (!spinUntil(pool.spins, finished)) std::this_thread::yield();
  pool.loop.store(number + 1, std::memory_order_seq_cst);
  while (pool.inside.load(std::memory_order_seq_cst) != 0) {
    if (pool.spins <= 1) std::this_thread::yield();
    pause();
  }
  pool.taken.store(false, std::memory_order_release);
}

}  // namespace sinew

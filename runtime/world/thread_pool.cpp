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
  // The loop that is running: its number in the high half, odd while it is open, and its next index in the low half.
  // Both change at once, so a late helper of an old loop never takes a range of a new one.
  alignas(64) std::atomic<std::uint64_t> ticket{0};
  alignas(64) std::atomic<std::uint32_t> done{0};      // indices of the loop that are finished
  alignas(64) std::atomic<std::uint32_t> sleepers{0};  // helpers that wait on `work`
  std::atomic<std::uint32_t> inside{0};                // helpers that look at the fields below
  std::uint32_t count = 0, grain = 1;
  const std::function<void(std::uint32_t, std::uint32_t)>* body = nullptr;

  std::mutex mutex;
  std::condition_variable work;
  std::vector<std::thread> threads;
  std::atomic<bool> stop{false};
  int spins = kSpins;

  static std::uint32_t numberOf(std::uint64_t value) { return std::uint32_t(value >> 32); }

  // Works on loop `number` until no range of it is left.
  void runShare(std::uint32_t number) {
    for (;;) {
      std::uint64_t now = ticket.load(std::memory_order_acquire);
      if (numberOf(now) != number) return;
      const std::uint32_t begin = std::uint32_t(now);
      if (begin >= count) return;
      const std::uint32_t end = begin + std::min(grain, count - begin);
      if (!ticket.compare_exchange_weak(now, (std::uint64_t(number) << 32) | end, std::memory_order_acq_rel)) continue;
      (*body)(begin, end);
      done.fetch_add(end - begin, std::memory_order_acq_rel);
    }
  }

  void helper() {
    std::uint32_t seen = 0;
    const auto ready = [&] {
      const std::uint32_t number = numberOf(ticket.load(std::memory_order_seq_cst));
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
      const std::uint32_t number = numberOf(ticket.load(std::memory_order_seq_cst));
      if (number % 2 == 1) {
        seen = number;
        runShare(number);
      }
      inside.fetch_sub(1, std::memory_order_seq_cst);
    }
  }
};

ThreadPool::ThreadPool(std::uint32_t threads) noexcept {
  const std::uint32_t cores = std::max(1U, std::thread::hardware_concurrency());
  if (threads == 0) threads = cores;
  try {
    impl_ = std::make_unique<Impl>();
    // Where there are more threads than cores, spinning only keeps the others from working.
    if (threads > cores) impl_->spins = 1;
    for (std::uint32_t i = 1; i < threads; ++i) impl_->threads.emplace_back([pool = impl_.get()] { pool->helper(); });
  } catch (...) {  // NOLINT(bugprone-empty-catch): as many threads as there are by now
  }
}

ThreadPool::~ThreadPool() {
  if (impl_ == nullptr) return;
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->stop = true;
  }
  impl_->work.notify_all();
  for (std::thread& thread : impl_->threads) thread.join();
}

std::uint32_t ThreadPool::threads() const { return impl_ == nullptr ? 1 : std::uint32_t(impl_->threads.size()) + 1; }

void ThreadPool::parallelFor(std::uint32_t count, std::uint32_t grain,
                             const std::function<void(std::uint32_t, std::uint32_t)>& body) {
  grain = std::max(1U, grain);
  if (count <= grain || threads() == 1) {
    if (count > 0) body(0, count);
    return;
  }
  Impl& pool = *impl_;
  pool.count = count;
  pool.grain = std::max(grain, count / (threads() * 8));  // a few ranges a thread balance the load
  pool.body = &body;
  pool.done.store(0, std::memory_order_relaxed);
  const std::uint32_t number = Impl::numberOf(pool.ticket.load(std::memory_order_relaxed)) + 1;
  pool.ticket.store(std::uint64_t(number) << 32, std::memory_order_seq_cst);
  if (pool.sleepers.load(std::memory_order_seq_cst) > 0) {
    { const std::lock_guard lock(pool.mutex); }  // a helper between its last look and its sleep hears the call
    pool.work.notify_all();
  }
  pool.runShare(number);
  const auto finished = [&] { return pool.done.load(std::memory_order_acquire) == count; };
  while (!spinUntil(pool.spins, finished)) std::this_thread::yield();
  pool.ticket.store(std::uint64_t(number + 1) << 32, std::memory_order_seq_cst);
  while (pool.inside.load(std::memory_order_seq_cst) != 0) {
    if (pool.spins <= 1) std::this_thread::yield();
    pause();
  }
}

}  // namespace sinew

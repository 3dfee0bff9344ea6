// SPDX-License-Identifier: MIT
#include "sinew/runtime/thread_pool.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

namespace sinew {

struct ThreadPool::Impl {
  std::mutex mutex;
  std::condition_variable work, done;
  std::vector<std::thread> threads;
  std::uint64_t generation = 0;  // of the loop that is running
  std::uint32_t busy = 0;        // helpers still inside it
  bool stop = false;

  std::atomic<std::uint32_t> next{0};
  std::uint32_t count = 0, grain = 1;
  const std::function<void(std::uint32_t, std::uint32_t)>* body = nullptr;

  void runShare() {
    for (;;) {
      const std::uint32_t begin = next.fetch_add(grain);
      if (begin >= count) return;
      (*body)(begin, begin + std::min(grain, count - begin));
    }
  }

  void helper() {
    std::uint64_t seen = 0;
    std::unique_lock lock(mutex);
    for (;;) {
      work.wait(lock, [&] { return stop || generation != seen; });
      if (stop) return;
      seen = generation;
      lock.unlock();
      runShare();
      lock.lock();
      if (--busy == 0) done.notify_one();
    }
  }
};

ThreadPool::ThreadPool(std::uint32_t threads) : impl_(std::make_unique<Impl>()) {
  if (threads == 0) threads = std::max(1U, std::thread::hardware_concurrency());
  for (std::uint32_t i = 1; i < threads; ++i) impl_->threads.emplace_back([this] { impl_->helper(); });
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->stop = true;
  }
  impl_->work.notify_all();
  for (std::thread& thread : impl_->threads) thread.join();
}

std::uint32_t ThreadPool::threads() const { return std::uint32_t(impl_->threads.size()) + 1; }

void ThreadPool::parallelFor(std::uint32_t count, std::uint32_t grain,
                             const std::function<void(std::uint32_t, std::uint32_t)>& body) {
  grain = std::max(1U, grain);
  if (count <= grain || impl_->threads.empty()) {
    if (count > 0) body(0, count);
    return;
  }
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->next = 0;
    impl_->count = count;
    impl_->grain = std::max(grain, count / (threads() * 8));  // a few ranges a thread balance the load
    impl_->body = &body;
    impl_->busy = std::uint32_t(impl_->threads.size());
    ++impl_->generation;
  }
  impl_->work.notify_all();
  impl_->runShare();
  std::unique_lock lock(impl_->mutex);
  impl_->done.wait(lock, [&] { return impl_->busy == 0; });
}

}  // namespace sinew

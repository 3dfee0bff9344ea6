// SPDX-License-Identifier: MIT
#include "runtime/memory/array.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <utility>

namespace sinew::internal {

ArrayBytes::ArrayBytes(std::pmr::memory_resource* memory) noexcept : memory_(memory) {}

void ArrayBytes::exchange(ArrayBytes& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  std::swap(capacity_, other.capacity_);
  std::swap(memory_, other.memory_);
}

std::byte* ArrayBytes::allocate(Element element, std::size_t count) const {
  constexpr std::size_t kMostBytes = std::size_t(-1) / 2;
  if (count > kMostBytes / element.bytes) throw std::bad_alloc();
  return static_cast<std::byte*>(memory_->allocate(count * element.bytes, element.alignment));
}

void ArrayBytes::take(Element element, std::byte* place, std::size_t count) noexcept {
  release(element);
  data_ = place;
  capacity_ = count;
}

void ArrayBytes::reserve(Element element, std::size_t count) {
  if (count <= capacity_) return;
  std::byte* const place = allocate(element, count);
  if (size_ > 0) std::memcpy(place, data_, size_ * element.bytes);
  take(element, place, count);
}

void ArrayBytes::grow(Element element) {
  if (size_ == capacity_) reserve(element, std::max<std::size_t>(1, 2 * size_));
}

void ArrayBytes::resize(Element element, std::size_t count, const void* like) {
  if (count > capacity_) reserve(element, std::max(count, 2 * size_));
  if (count > size_ && like == nullptr) {
    std::memset(data_ + size_ * element.bytes, 0, (count - size_) * element.bytes);
    size_ = count;
  }
  for (; size_ < count; ++size_) std::memcpy(data_ + size_ * element.bytes, like, element.bytes);
  size_ = count;
}

void ArrayBytes::append(Element element, const void* from, std::size_t count) {
  if (size_ + count > capacity_) reserve(element, std::max(size_ + count, 2 * size_));
  if (count > 0) std::memcpy(data_ + size_ * element.bytes, from, count * element.bytes);
  size_ += count;
}

void ArrayBytes::assign(Element element, const void* from, std::size_t count) {
  reserve(element, count);
  clear();
  append(element, from, count);
}

void ArrayBytes::insert(Element element, std::size_t index, const void* value) {
  const std::size_t before = index * element.bytes, behind = (size_ - index) * element.bytes;
  const bool grows = size_ == capacity_;
  const std::size_t count = grows ? std::max<std::size_t>(1, 2 * size_) : capacity_;
  std::byte* const place = grows ? allocate(element, count) : data_;
  // The old memory stays until the value is copied, which may lie in it.
  if (grows && before > 0) std::memcpy(place, data_, before);
  if (behind > 0) std::memmove(place + before + element.bytes, data_ + before, behind);
  std::memcpy(place + before, value, element.bytes);
  if (grows) take(element, place, count);
  ++size_;
}

void ArrayBytes::erase(Element element, std::size_t index) {
  std::byte* const at = data_ + index * element.bytes;
  std::memmove(at, at + element.bytes, (--size_ - index) * element.bytes);
}

void ArrayBytes::release(Element element) noexcept {
  if (data_ != nullptr) memory_->deallocate(data_, capacity_ * element.bytes, element.alignment);
}

void sortAscending(std::span<std::uint64_t> keys) { std::sort(keys.begin(), keys.end()); }

}  // namespace sinew::internal

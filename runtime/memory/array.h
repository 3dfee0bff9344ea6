// SPDX-License-Identifier: MIT
//
// Arrays of plain records. Growth is compiled once, for bytes: std::vector compiles it anew for each type of element, a
// quarter of a kilobyte for each way to grow.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

namespace sinew::internal {

/// The part of arrays that does not depend on the type of element. Sizes are in elements.
class ArrayBytes {
 public:
  ArrayBytes(const ArrayBytes&) = delete;
  ArrayBytes& operator=(const ArrayBytes&) = delete;

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  void clear() { size_ = 0; }
  /// Drops elements from the end. \param count elements that stay, at most size().
  void truncate(std::size_t count) { size_ = count; }
  std::pmr::memory_resource* memory() const { return memory_; }

 protected:
  struct Element {
    std::uint32_t bytes, alignment;
  };

  explicit ArrayBytes(std::pmr::memory_resource* memory) noexcept;
  ArrayBytes(ArrayBytes&& other) noexcept : ArrayBytes(other.memory_) { exchange(other); }
  ~ArrayBytes() = default;

  void exchange(ArrayBytes& other) noexcept;
  void reserve(Element element, std::size_t count);
  /// Makes room for one more.
  void grow(Element element);
  /// \param like new elements are copies of it; null: zeros.
  void resize(Element element, std::size_t count, const void* like);
  void append(Element element, const void* from, std::size_t count);
  void assign(Element element, const void* from, std::size_t count);
  /// \param value behind the last it may be an element.
  void insert(Element element, std::size_t index, const void* value);
  void erase(Element element, std::size_t index);
  void release(Element element) noexcept;

  std::byte* data_ = nullptr;  ///< null without capacity
  std::size_t size_ = 0, capacity_ = 0;
  std::pmr::memory_resource* memory_;

 private:
  std::byte* allocate(Element element, std::size_t count) const;
  void take(Element element, std::byte* place, std::size_t count) noexcept;
};

/// A vector of records that are their bytes: without a destructor, moved and copied as memory is. Its memory goes along
/// where it is moved or swapped.
template <class T>
class Array : public ArrayBytes {
 public:
  /// \param memory where elements live; outlives the array.
  explicit Array(std::pmr::memory_resource* memory = std::pmr::new_delete_resource()) : ArrayBytes(memory) {}
  explicit Array(std::size_t count, std::pmr::memory_resource* memory = std::pmr::new_delete_resource())
      : ArrayBytes(memory) {
    resize(count);
  }
  Array(Array&& other) noexcept : ArrayBytes(static_cast<ArrayBytes&&>(other)) {}
  Array& operator=(Array&& other) noexcept {
    exchange(other);
    return *this;
  }
  ~Array() {
    static_assert(std::is_trivially_destructible_v<T>);
    release(kElement);
  }
  void swap(Array& other) noexcept { exchange(other); }

  T* data() { return reinterpret_cast<T*>(data_); }
  const T* data() const { return reinterpret_cast<const T*>(data_); }
  T* begin() { return data(); }
  const T* begin() const { return data(); }
  T* end() { return data() + size_; }
  const T* end() const { return data() + size_; }
  T& operator[](std::size_t index) { return data()[index]; }
  const T& operator[](std::size_t index) const { return data()[index]; }
  T& back() { return data()[size_ - 1]; }

  /// Throws std::bad_alloc, as all calls that grow do, and leaves the array unchanged.
  void reserve(std::size_t count) { ArrayBytes::reserve(kElement, count); }
  /// New elements are as T{} makes them, vectors and matrices zero.
  void resize(std::size_t count) {
    if constexpr (std::is_trivially_default_constructible_v<T> || requires { T::Zero(); }) {
      ArrayBytes::resize(kElement, count, nullptr);
    } else {
      resize(count, T{});
    }
  }
  /// \param like none of the array's own elements.
  void resize(std::size_t count, const T& like) { ArrayBytes::resize(kElement, count, &like); }
  /// Adds copies of none of its own elements.
  void append(std::span<const T> from) { ArrayBytes::append(kElement, from.data(), from.size()); }
  void assign(std::span<const T> from) { ArrayBytes::assign(kElement, from.data(), from.size()); }
  /// A new last element, as resize() makes it.
  T& add() {
    resize(size_ + 1);
    return back();
  }
  void push_back(const T& value) {
    if (size_ == capacity_) return ArrayBytes::insert(kElement, size_, &value);
    ::new (data_ + size_++ * sizeof(T)) T(value);
  }
  /// Of its own elements `value` may be one before `index`.
  void insert(std::size_t index, const T& value) { ArrayBytes::insert(kElement, index, &value); }
  void erase(std::size_t index) { ArrayBytes::erase(kElement, index); }

 private:
  static constexpr Element kElement = {sizeof(T), alignof(T)};
};

/// The same of elements with a destructor. They too are moved as their bytes when the array grows or closes a gap, so
/// nothing may point into one.
template <class T>
class OwningArray : public ArrayBytes {
 public:
  /// \param memory where elements live; outlives the array.
  explicit OwningArray(std::pmr::memory_resource* memory = std::pmr::new_delete_resource()) : ArrayBytes(memory) {}
  OwningArray(OwningArray&& other) noexcept : ArrayBytes(static_cast<ArrayBytes&&>(other)) {}
  ~OwningArray() {
    clear();
    release(kElement);
  }
  void swap(OwningArray& other) noexcept { exchange(other); }

  T* begin() { return reinterpret_cast<T*>(data_); }
  const T* begin() const { return reinterpret_cast<const T*>(data_); }
  T* end() { return begin() + size_; }
  const T* end() const { return begin() + size_; }
  T& operator[](std::size_t index) { return begin()[index]; }
  const T& operator[](std::size_t index) const { return begin()[index]; }
  T& back() { return begin()[size_ - 1]; }

  void clear() {
    while (size_ > 0) pop_back();
  }
  /// A new last element, made of these arguments. Throws as Array or the element does, and leaves the array unchanged.
  template <class... Arguments>
  T& emplace_back(Arguments&&... arguments) {
    grow(kElement);
    T* const made = new (data_ + size_ * sizeof(T)) T(std::forward<Arguments>(arguments)...);
    ++size_;
    return *made;
  }
  void push_back(T&& value) { insert(size_, std::move(value)); }
  void insert(std::size_t index, T&& value) {
    grow(kElement);
    alignas(T) std::byte moved[sizeof(T)];  // whose bytes become the element's
    new (moved) T(std::move(value));
    ArrayBytes::insert(kElement, index, moved);
  }
  void pop_back() { begin()[--size_].~T(); }
  void erase(std::size_t index) {
    begin()[index].~T();
    ArrayBytes::erase(kElement, index);
  }

 private:
  static constexpr Element kElement = {sizeof(T), alignof(T)};
};

/// Sorts numbers, smallest first: std::sort would compile a kilobyte for each type of element. Records are sorted by
/// keys that hold the place of each in their low half.
void sortAscending(std::span<std::uint64_t> keys);
/// Ordered as the floats are.
inline std::uint32_t sortable(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return (bits & 0x80000000U) != 0 ? ~bits : bits | 0x80000000U;
}

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// Arrays of plain records: what grows, moves and is refused memory.
#include "runtime/memory/array.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <memory_resource>
#include <new>
#include <utility>
#include <vector>

namespace sinew::internal {
namespace {

struct Record {
  std::uint32_t a = 7;
  float b = 0.5F;
};

// Counts what is out, and refuses what is more than it has.
class Counting : public std::pmr::memory_resource {
 public:
  std::size_t out = 0, most = std::size_t(-1);

 private:
  void* do_allocate(std::size_t bytes, std::size_t alignment) override {
    if (out + bytes > most) throw std::bad_alloc();
    void* const place = std::pmr::new_delete_resource()->allocate(bytes, alignment);
    out += bytes;
    return place;
  }
  void do_deallocate(void* place, std::size_t bytes, std::size_t alignment) override {
    out -= bytes;
    std::pmr::new_delete_resource()->deallocate(place, bytes, alignment);
  }
  bool do_is_equal(const memory_resource& other) const noexcept override { return this == &other; }
};

template <class T>
std::vector<T> contentOf(const Array<T>& array) {
  return {array.begin(), array.end()};
}

TEST(Array, DoesAsAVectorDoes) {
  Array<std::uint32_t> array;
  std::vector<std::uint32_t> vector;
  std::uint32_t chance = 1;
  for (int i = 0; i < 5000; ++i) {
    chance = chance * 1664525U + 1013904223U;
    const std::uint32_t what = (chance >> 28) % 8, value = chance >> 8;
    const std::size_t at = vector.empty() ? 0 : value % vector.size();
    if (what < 3) {
      array.push_back(value);
      vector.push_back(value);
    } else if (what < 5) {
      array.insert(at, value);
      vector.insert(vector.begin() + std::ptrdiff_t(at), value);
    } else if (what < 7) {
      if (vector.empty()) continue;
      array.erase(at);
      vector.erase(vector.begin() + std::ptrdiff_t(at));
    } else {
      array.resize(at + 3);
      vector.resize(at + 3);
    }
    ASSERT_EQ(contentOf(array), vector) << "after " << i;
  }
}

TEST(Array, AnElementOfItsOwnIsPushedWhileItGrows) {
  Array<std::uint32_t> array;
  array.push_back(3);
  for (int i = 0; i < 100; ++i) array.push_back(array[0]);
  EXPECT_EQ(std::count(array.begin(), array.end(), 3U), 101);
}

TEST(Array, NewElementsAreAsTheirTypeMakesThem) {
  Array<Record> records(2);
  EXPECT_EQ(records[1].a, 7U);
  EXPECT_EQ(records.add().b, 0.5F);
  Array<std::uint32_t> numbers;
  numbers.push_back(9);
  numbers.clear();
  numbers.resize(3);  // where a nine was
  EXPECT_EQ(contentOf(numbers), std::vector<std::uint32_t>(3, 0));
  Array<Eigen::Vector3f> vectors(2);
  EXPECT_TRUE(vectors[1].isZero(0));
}

TEST(Array, MemoryGoesAlongAndComesBack) {
  Counting first, second;
  {
    Array<Record> one(8, &first), other(3, &second);
    one[0].a = 1;
    one.swap(other);
    EXPECT_EQ(one.size(), 3U);
    EXPECT_EQ(one.memory(), &second);
    Array<Record> moved = std::move(other);
    EXPECT_TRUE(other.empty());
    EXPECT_EQ(moved[0].a, 1U);
    one = std::move(moved);
    EXPECT_EQ(one.size(), 8U);
    EXPECT_EQ(one.memory(), &first);
  }
  EXPECT_EQ(first.out, 0U);
  EXPECT_EQ(second.out, 0U);
}

TEST(Array, StaysAsItWasWhereMemoryIsRefused) {
  Counting memory;
  memory.most = 64;
  {
    Array<std::uint32_t> array(&memory);
    for (std::uint32_t i = 0; i < 4; ++i) array.push_back(i);
    const std::vector<std::uint32_t> before = contentOf(array);
    EXPECT_THROW(array.reserve(1000), std::bad_alloc);
    EXPECT_THROW(array.resize(1000), std::bad_alloc);
    EXPECT_THROW(array.resize(std::size_t(-1) / 4), std::bad_alloc);
    memory.most = memory.out;
    EXPECT_THROW(array.push_back(1), std::bad_alloc);
    EXPECT_THROW(array.insert(0, 1), std::bad_alloc);
    EXPECT_EQ(contentOf(array), before);
  }
  EXPECT_EQ(memory.out, 0U);
}

TEST(Array, AlignsWhatAsksForIt) {
  struct alignas(64) Line {
    float values[16];
  };
  Array<Line> lines;
  for (int i = 0; i < 5; ++i) {
    lines.push_back({});
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(lines.data()) % 64, 0U);
  }
}

// With a destructor, and with memory that only one of them owns.
struct Owner {
  Owner(std::uint32_t first, std::pmr::memory_resource* memory) : numbers(memory) { numbers.push_back(first); }
  Array<std::uint32_t> numbers;
};

std::vector<std::uint32_t> contentOf(const OwningArray<Owner>& array) {
  std::vector<std::uint32_t> result;
  for (const Owner& owner : array) result.push_back(owner.numbers[0]);
  return result;
}

TEST(OwningArray, ElementsComeAndGoWithWhatTheyOwn) {
  Counting memory;
  {
    OwningArray<Owner> array(&memory), other(&memory);
    for (std::uint32_t i = 0; i < 5; ++i) array.emplace_back(i, &memory);
    array.push_back(Owner(5, &memory));
    array.insert(1, Owner(6, &memory));
    array.erase(3);
    EXPECT_EQ(contentOf(array), (std::vector<std::uint32_t>{0, 6, 1, 3, 4, 5}));
    Owner taken = std::move(array[2]);
    array.erase(2);
    array.pop_back();
    EXPECT_EQ(contentOf(array), (std::vector<std::uint32_t>{0, 6, 3, 4}));
    array.insert(2, std::move(taken));
    array.swap(other);
    EXPECT_TRUE(array.empty());
    EXPECT_EQ(contentOf(other), (std::vector<std::uint32_t>{0, 6, 1, 3, 4}));
    other.clear();
    EXPECT_GT(memory.out, 0U);  // its own capacity
  }
  EXPECT_EQ(memory.out, 0U);
}

TEST(OwningArray, StaysAsItWasWhereMemoryIsRefused) {
  Counting memory;
  {
    OwningArray<Owner> array(&memory);
    array.emplace_back(1U, &memory);
    memory.most = memory.out;
    EXPECT_THROW(array.emplace_back(2U, &memory), std::bad_alloc);
    EXPECT_EQ(contentOf(array), std::vector<std::uint32_t>{1});
  }
  EXPECT_EQ(memory.out, 0U);
}

TEST(SortAscending, SortsRecordsByTheirKeys) {
  std::vector<std::uint64_t> keys, sorted;
  std::uint32_t chance = 1;
  for (std::uint64_t i = 0; i < 1000; ++i) {
    chance = chance * 1664525U + 1013904223U;
    keys.push_back((std::uint64_t(chance >> 24) << 32) | i);
  }
  sorted = keys;
  sortAscending(sorted);
  std::stable_sort(keys.begin(), keys.end(), [](auto a, auto b) { return a >> 32 < b >> 32; });
  EXPECT_EQ(sorted, keys);
}

}  // namespace
}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// L-BFGS's view of a second derivative (Nocedal and Wright 2006, algorithm 7.4): the last steps and how the
// gradient changed along each.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory_resource>

#include "runtime/memory/array.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// Sum of products, n a multiple of four: short runs in floats, their sums in double. \param jobs that share it; null:
/// none. No number of threads changes a bit.
double dot(const float* a, const float* b, std::uint32_t n, JobSystem* jobs = nullptr);

/// Pairs of an offset s and the gradient's change y along it, oldest first to go. Vectors are k x 4.
class Pairs {
 public:
  /// \param most pairs that are kept, at most eight
  Pairs(std::uint32_t most, std::pmr::memory_resource* memory) : most_(most), values_(memory) {}

  /// Memory for vectors of so many floats.
  void reserve(std::size_t size) { values_.reserve(2 * most_ * size); }
  /// Without pairs, of vectors of n floats. \pre reserved, or may throw.
  void start(std::uint32_t n);
  void clear() { count_ = 0; }
  std::uint32_t count() const { return count_; }
  std::uint32_t most() const { return most_; }

  /// Goes on in another step of the same length of vectors, of an objective whose second derivative has so much more of
  /// the identity. Pairs along which that is not positive end all.
  void carry(float identity);
  /// Whether there are pairs since start() or carry().
  bool fresh() const { return fresh_; }

  /// The first half of the recursion, from the gradient; then comes the inverse of the first matrix.
  void reduce(float* direction, JobSystem* jobs = nullptr);
  /// The second half.
  void expand(float* direction, JobSystem* jobs = nullptr) const;
  /// \param from, to places. \param gradient, next_gradient there.
  void take(const float* from, const float* to, const float* gradient, const float* next_gradient,
            JobSystem* jobs = nullptr);
  /// take() in two: what the next pair is to be, of the floats from `begin` to `end`, to be changed until keep().
  void propose(const float* from, const float* to, const float* gradient, const float* next_gradient,
               std::uint32_t begin, std::uint32_t end);
  const float* nextOffset() const { return offset(next()); }
  float* nextChange() { return change(next()); }
  void keep();

  /// Bytes of a saved pair of vectors of n floats.
  static std::size_t savedBytes(std::size_t n) { return 2 * n / 4 * 3 * sizeof(float); }
  /// The last `count` of them. \param to count * savedBytes(n)
  void save(std::uint32_t count, std::byte* to) const;
  /// These, fresh. \pre count <= most()
  void restore(std::uint32_t n, std::uint32_t count, const std::byte* from);

 private:
  /// \param products of offset and change, of the offset and of the change with themselves
  void keep(const Eigen::Array3d& products);
  /// One that is not positive ends all.
  void setCurvature(std::uint32_t slot, double curvature);
  std::uint32_t next() const { return (newest_ + 1) % most_; }
  std::uint32_t slot(std::uint32_t age) const { return (newest_ + most_ - age) % most_; }
  float* offset(std::uint32_t slot) { return values_.data() + std::size_t(2 * n_) * slot; }
  float* change(std::uint32_t slot) { return offset(slot) + n_; }
  const float* offset(std::uint32_t slot) const { return values_.data() + std::size_t(2 * n_) * slot; }
  const float* change(std::uint32_t slot) const { return offset(slot) + n_; }

  static constexpr std::uint32_t kRoom = 8;

  std::uint32_t most_, n_ = 0, count_ = 0, newest_ = 0;  // the pairs lie in a ring
  bool fresh_ = false;
  std::array<double, kRoom> curvature_ = {}, along_ = {};
  Array<float> values_;
};

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
#include "runtime/solver/pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "runtime/kernels/kernels.h"
#include "runtime/solver/for_each.h"

namespace sinew::internal {
namespace {

using Four = Eigen::Array4f;

/// Least cosine between a step and the gradient's change that says anything of the curvature.
constexpr double kLeastCosine = 1e-9;
/// Floats that a job takes at least, and jobs at most.
constexpr std::uint32_t kFloatsAJob = 8192, kMostJobs = 256;

/// The sum of sumOf(begin, end) over parts of 0..n, in an order that no thread changes.
template <class SumOf>
auto sumOfParts(JobSystem* jobs, std::uint32_t n, const SumOf& sumOf) {
  const std::uint32_t size = std::max(kFloatsAJob, (n / kMostJobs + 31) / 32 * 32);
  auto sum = sumOf(0U, std::min(n, size));
  if (n <= size) return sum;
  std::array<decltype(sum), kMostJobs> parts;
  const std::uint32_t count = (n - 1) / size;  // but for the first
  forEach(jobs, count, 1, [&](std::uint32_t i) {
    const std::uint32_t begin = size * (i + 1);
    parts[i] = sumOf(begin, std::min(n, begin + size));
  });
  for (std::uint32_t i = 0; i < count; ++i) sum += parts[i];
  return sum;
}

Eigen::Array3d productsOf(const float* a, const float* b, std::uint32_t n) {
  const auto& dot = kernels().dot;
  return {dot(a, b, n), dot(a, a, n), dot(b, b, n)};
}

/// to += factor a. \return its product with another vector
double addThenDot(JobSystem* jobs, float factor, const float* a, float* to, const float* with, std::uint32_t n) {
  return sumOfParts(jobs, n, [&](std::uint32_t begin, std::uint32_t end) {
    return kernels().add_then_dot(factor, a + begin, to + begin, with + begin, end - begin);
  });
}

}  // namespace

double dot(const float* a, const float* b, std::uint32_t n, JobSystem* jobs) {
  return sumOfParts(jobs, n, [&](std::uint32_t begin, std::uint32_t end) {
    return kernels().dot(a + begin, b + begin, end - begin);
  });
}

void Pairs::start(std::uint32_t n) {
  n_ = n;
  count_ = 0;
  fresh_ = false;
  values_.resize(std::size_t(2) * most_ * n);
}

void Pairs::carry(float identity) {
  fresh_ = false;
  if (identity == 0) return;
  for (std::uint32_t age = 0; age < count_; ++age) {
    const std::uint32_t i = slot(age);
    setCurvature(i, addThenDot(nullptr, identity, offset(i), change(i), offset(i), n_));
  }
}

void Pairs::setCurvature(std::uint32_t slot, double curvature) {
  curvature_[slot] = curvature;
  if (!(curvature > 0 && std::isfinite(curvature))) count_ = 0;
}

void Pairs::reduce(float* direction, JobSystem* jobs) {
  double product = count_ > 0 ? dot(offset(slot(0)), direction, n_, jobs) : 0;
  for (std::uint32_t age = 0; age < count_; ++age) {
    const std::uint32_t i = slot(age);
    along_[i] = product / curvature_[i];
    const float* const next = age + 1 < count_ ? offset(slot(age + 1)) : direction;
    product = addThenDot(jobs, float(-along_[i]), change(i), direction, next, n_);
  }
}

void Pairs::expand(float* direction, JobSystem* jobs) const {
  double product = count_ > 0 ? dot(change(slot(count_ - 1)), direction, n_, jobs) : 0;
  for (std::uint32_t age = count_; age-- > 0;) {
    const std::uint32_t i = slot(age);
    const float* const next = age > 0 ? change(slot(age - 1)) : direction;
    product = addThenDot(jobs, float(along_[i] - product / curvature_[i]), offset(i), direction, next, n_);
  }
}

void Pairs::take(const float* from, const float* to, const float* gradient, const float* next_gradient,
                 JobSystem* jobs) {
  keep(sumOfParts(jobs, n_, [&](std::uint32_t begin, std::uint32_t end) {
    propose(from, to, gradient, next_gradient, begin, end);
    return productsOf(nextOffset() + begin, nextChange() + begin, end - begin);
  }));
}

void Pairs::propose(const float* from, const float* to, const float* gradient, const float* next_gradient,
                    std::uint32_t begin, std::uint32_t end) {
  float *const way = offset(next()), *const bend = nextChange();
  for (std::uint32_t j = begin; j < end; j += 4) {
    Four::Map(way + j) = Four::Map(to + j) - Four::Map(from + j);
    Four::Map(bend + j) = Four::Map(next_gradient + j) - Four::Map(gradient + j);
  }
}

void Pairs::keep() { keep(productsOf(nextOffset(), nextChange(), n_)); }

// The oldest one's place is taken, whether the next one is kept or not.
void Pairs::keep(const Eigen::Array3d& products) {
  const std::uint32_t i = next();
  const double curvature = products[0];
  count_ = std::min(count_, most_ - 1);
  if (!(curvature > kLeastCosine * std::sqrt(products[1] * products[2]))) return;
  curvature_[i] = curvature;
  newest_ = i;
  ++count_;
  fresh_ = true;
}

// The oldest first, without the padding.
void Pairs::save(std::uint32_t count, std::byte* to) const {
  for (std::uint32_t age = count; age-- > 0;) {
    const float* const pair = offset(slot(age));
    for (std::uint32_t j = 0; j < 2 * n_; j += 4, to += 3 * sizeof(float)) std::memcpy(to, pair + j, 3 * sizeof(float));
  }
}

void Pairs::restore(std::uint32_t n, std::uint32_t count, const std::byte* from) {
  start(n);
  count_ = count;
  newest_ = count > 0 ? count - 1 : 0;
  fresh_ = count > 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    float* const pair = offset(i);
    for (std::uint32_t j = 0; j < 2 * n_; j += 4, from += 3 * sizeof(float)) {
      std::memcpy(pair + j, from, 3 * sizeof(float));
      pair[j + 3] = 0;
    }
    setCurvature(i, dot(offset(i), change(i), n_));
  }
}

}  // namespace sinew::internal

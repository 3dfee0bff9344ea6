// SPDX-License-Identifier: MIT
#include "runtime/solver/pairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

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

double dotOf(const float* a, const float* b, std::uint32_t n) {
  constexpr std::uint32_t kRun = 32;
  const auto product = [&](std::uint32_t i) { return Four(Four::Map(a + i) * Four::Map(b + i)); };
  Eigen::Array4d total = Eigen::Array4d::Zero();
  std::uint32_t i = 0;
  for (; i + kRun <= n; i += kRun) {
    const Four run = ((product(i) + product(i + 4)) + (product(i + 8) + product(i + 12))) +
                     ((product(i + 16) + product(i + 20)) + (product(i + 24) + product(i + 28)));
    total += run.cast<double>();
  }
  for (; i < n; i += 4) total += product(i).cast<double>();
  return (total[0] + total[1]) + (total[2] + total[3]);
}

Eigen::Array3d productsOf(const float* a, const float* b, std::uint32_t n) {
  return {dotOf(a, b, n), dotOf(a, a, n), dotOf(b, b, n)};
}

void add(float factor, const float* a, float* to, std::uint32_t n) {
  for (std::uint32_t i = 0; i < n; i += 4) Four::Map(to + i) += factor * Four::Map(a + i);
}

/// add(), and then the product with another vector, unless that is null.
double addThenDot(JobSystem* jobs, float factor, const float* a, float* to, const float* with, std::uint32_t n) {
  return sumOfParts(jobs, n, [&](std::uint32_t begin, std::uint32_t end) {
    add(factor, a + begin, to + begin, end - begin);
    return with == nullptr ? 0 : dotOf(with + begin, to + begin, end - begin);
  });
}

}  // namespace

double dot(const float* a, const float* b, std::uint32_t n, JobSystem* jobs) {
  return sumOfParts(jobs, n,
                    [&](std::uint32_t begin, std::uint32_t end) { return dotOf(a + begin, b + begin, end - begin); });
}

void Pairs::start(std::uint32_t n) {
  n_ = n;
  count_ = 0;
  fresh_ = false;
  values_.resize(std::size_t(2) * most_ * n);
}

void Pairs::carry(const Eigen::Matrix3f& turn, float identity) {
  fresh_ = false;
  const auto column = [&turn](int i) { return Four(turn(0, i), turn(1, i), turn(2, i), 0); };
  const Four x = column(0), y = column(1), z = column(2);
  for (std::uint32_t age = 0; age < count_; ++age) {
    const std::uint32_t i = slot(age);
    float* const pair = offset(i);
    for (std::uint32_t j = 0; j < 2 * n_; j += 4) {
      float* const at = pair + j;
      Four::Map(at) = at[0] * x + (at[1] * y + at[2] * z);
    }
    add(identity, offset(i), change(i), n_);
    curvature_[i] = dot(offset(i), change(i), n_);
    if (!(curvature_[i] > 0 && std::isfinite(curvature_[i]))) count_ = 0;
  }
}

void Pairs::reduce(float* direction, JobSystem* jobs) {
  double product = count_ > 0 ? dot(offset(slot(0)), direction, n_, jobs) : 0;
  for (std::uint32_t age = 0; age < count_; ++age) {
    const std::uint32_t i = slot(age);
    along_[i] = product / curvature_[i];
    const float* const next = age + 1 < count_ ? offset(slot(age + 1)) : nullptr;
    product = addThenDot(jobs, float(-along_[i]), change(i), direction, next, n_);
  }
}

void Pairs::expand(float* direction, JobSystem* jobs) const {
  double product = count_ > 0 ? dot(change(slot(count_ - 1)), direction, n_, jobs) : 0;
  for (std::uint32_t age = count_; age-- > 0;) {
    const std::uint32_t i = slot(age);
    const float* const next = age > 0 ? change(slot(age - 1)) : nullptr;
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
  for (std::uint32_t j = begin; j < end; ++j) {
    way[j] = to[j] - from[j];
    bend[j] = next_gradient[j] - gradient[j];
  }
}

void Pairs::keep() { keep(productsOf(nextOffset(), nextChange(), n_)); }

void Pairs::keep(const Eigen::Array3d& products) {
  const std::uint32_t i = next();
  const double curvature = products[0];
  if (!(curvature > kLeastCosine * std::sqrt(products[1] * products[2]))) return;
  curvature_[i] = curvature;
  newest_ = i;
  count_ = std::min(count_ + 1, most_);
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
  }
}

}  // namespace sinew::internal

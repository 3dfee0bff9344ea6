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

/// to += sum of factors[i] vectors[i].
void addAll(JobSystem* jobs, std::uint32_t count, const float* factors, const float* const* vectors, float* to,
            std::uint32_t n) {
  forEach(jobs, (n + kFloatsAJob - 1) / kFloatsAJob, 1, [&](std::uint32_t i) {
    const std::uint32_t begin = kFloatsAJob * i;
    kernels().add_all(count, factors, vectors, to, begin, std::min(n, begin + kFloatsAJob));
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
    const float* const way = offset(slot(age));
    kernels().add_all(1, &identity, &way, change(slot(age)), 0, n_);
  }
  findProducts();
}

void Pairs::findProducts() {
  for (std::uint32_t newer = 0; newer < count_; ++newer) {
    for (std::uint32_t age = newer; age < count_; ++age) {
      products_[slot(age)][slot(newer)] = dot(offset(slot(age)), change(slot(newer)), n_);
    }
  }
  for (std::uint32_t age = 0; age < count_; ++age) {
    const double curvature = products_[slot(age)][slot(age)];
    if (!(curvature > 0 && std::isfinite(curvature))) count_ = 0;
  }
}

Pairs::Products Pairs::productsWith(JobSystem* jobs, const Vectors& vectors, const float* with) const {
  return sumOfParts(jobs, n_, [&](std::uint32_t begin, std::uint32_t end) {
    Products products = Products::Zero();
    for (std::uint32_t i = 0; i < count_; ++i) {
      products[i] = kernels().dot(vectors[i] + begin, with + begin, end - begin);
    }
    return products;
  });
}

void Pairs::reduce(float* direction, JobSystem* jobs) {
  Vectors offsets, changes;
  for (std::uint32_t age = 0; age < count_; ++age) {
    offsets[age] = offset(slot(age));
    changes[age] = change(slot(age));
  }
  const Products products = productsWith(jobs, offsets, direction);
  for (std::uint32_t age = 0; age < count_; ++age) {
    const std::uint32_t i = slot(age);
    double product = products[age];
    for (std::uint32_t newer = 0; newer < age; ++newer) product += double(factors_[newer]) * products_[i][slot(newer)];
    factors_[age] = float(-product / products_[i][i]);
  }
  addAll(jobs, count_, factors_.data(), changes.data(), direction, n_);
}

void Pairs::expand(float* direction, JobSystem* jobs) const {
  Vectors offsets, changes;
  for (std::uint32_t age = 0; age < count_; ++age) {
    offsets[age] = offset(slot(age));
    changes[age] = change(slot(age));
  }
  const Products products = productsWith(jobs, changes, direction);
  std::array<float, kRoom> factors;
  for (std::uint32_t age = count_; age-- > 0;) {
    const std::uint32_t i = slot(age);
    double product = products[age];
    for (std::uint32_t older = age + 1; older < count_; ++older) {
      product += double(factors[older]) * products_[slot(older)][i];
    }
    factors[age] = float(-double(factors_[age]) - product / products_[i][i]);
  }
  addAll(jobs, count_, factors.data(), offsets.data(), direction, n_);
}

void Pairs::take(const float* from, const float* to, const float* gradient, const float* next_gradient,
                 JobSystem* jobs) {
  keep(sumOfParts(jobs, n_, [&](std::uint32_t begin, std::uint32_t end) {
    propose(from, to, gradient, next_gradient, begin, end);
    return nextProducts(begin, end);
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

Pairs::Products Pairs::nextProducts(std::uint32_t begin, std::uint32_t end) const {
  const auto& dot = kernels().dot;
  const std::uint32_t n = end - begin, count = staying();
  const float *const way = offset(next()) + begin, *const bend = change(next()) + begin;
  Products products = Products::Zero();
  for (std::uint32_t age = 0; age < count; ++age) products[age] = dot(offset(slot(age)) + begin, bend, n);
  products[count] = dot(way, bend, n);
  products[count + 1] = dot(way, way, n);
  products[count + 2] = dot(bend, bend, n);
  return products;
}

void Pairs::keep() { keep(nextProducts(0, n_)); }

// The oldest one's place is taken, whether the next one is kept or not.
void Pairs::keep(const Products& products) {
  const std::uint32_t i = next(), count = staying();
  count_ = count;
  if (!(products[count] > kLeastCosine * std::sqrt(products[count + 1] * products[count + 2]))) return;
  for (std::uint32_t age = 0; age < count; ++age) products_[slot(age)][i] = products[age];
  products_[i][i] = products[count];
  newest_ = i;
  count_ = count + 1;
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
  findProducts();
}

}  // namespace sinew::internal

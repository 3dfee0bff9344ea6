// SPDX-License-Identifier: MIT
#include "runtime/solver/pairs.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace sinew::internal {
namespace {

using Four = Eigen::Array4f;

/// Least cosine between a step and the gradient's change that says anything of the curvature.
constexpr double kLeastCosine = 1e-9;

}  // namespace

double dot(const float* a, const float* b, std::uint32_t n) {
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

void add(float factor, const float* a, float* to, std::uint32_t n) {
  for (std::uint32_t i = 0; i < n; i += 4) Four::Map(to + i) += factor * Four::Map(a + i);
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

void Pairs::reduce(float* direction) {
  for (std::uint32_t age = 0; age < count_; ++age) {
    const std::uint32_t i = slot(age);
    along_[i] = dot(offset(i), direction, n_) / curvature_[i];
    add(float(-along_[i]), change(i), direction, n_);
  }
}

void Pairs::expand(float* direction) const {
  for (std::uint32_t age = count_; age-- > 0;) {
    const std::uint32_t i = slot(age);
    const double beta = dot(change(i), direction, n_) / curvature_[i];
    add(float(along_[i] - beta), offset(i), direction, n_);
  }
}

void Pairs::take(const float* from, const float* to, const float* gradient, const float* next_gradient) {
  const std::uint32_t i = (newest_ + 1) % most_;
  float *const way = offset(i), *const bend = change(i);
  for (std::uint32_t j = 0; j < n_; ++j) {
    way[j] = to[j] - from[j];
    bend[j] = next_gradient[j] - gradient[j];
  }
  const double curvature = dot(way, bend, n_);
  if (!(curvature > kLeastCosine * std::sqrt(dot(way, way, n_) * dot(bend, bend, n_)))) return;
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

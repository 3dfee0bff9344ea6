// SPDX-License-Identifier: MIT
//
// Kernels of vectors of coefficients: products and steps (Pairs). For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/lanes.h"
#include "runtime/kernels/shuffles.h"

namespace sinew::internal::SINEW_KERNELS {

/// A sum of products: short runs in floats, their sums in doubles.
struct ProductSum {
  Double4 low = {}, high = {};

  SINEW_INLINE void add(Float8 run) {
    addTo(low, lowHalf(run));
    addTo(high, highHalf(run));
  }
  SINEW_INLINE void add(Float4 run) { addTo(low, run); }
  SINEW_INLINE double total() const {
    const auto at = [](const Double4& sum, std::uint32_t i) {
      double value;
      __builtin_memcpy(&value, reinterpret_cast<const char*>(&sum) + 8 * i, sizeof value);
      return value;
    };
    return ((at(low, 0) + at(high, 0)) + (at(low, 1) + at(high, 1))) +
           ((at(low, 2) + at(high, 2)) + (at(low, 3) + at(high, 3)));
  }
};

/// Sum over n floats, a multiple of four. \param product of eight of them at a place, or of four
template <class Product>
SINEW_INLINE double sumOver(std::uint32_t n, const Product& product) {
  ProductSum sum;
  std::uint32_t i = 0;
  for (; i + 32 <= n; i += 32) {
    const Float8 first = product.template at<Float8>(i), second = product.template at<Float8>(i + 8),
                 third = product.template at<Float8>(i + 16), fourth = product.template at<Float8>(i + 24);
    sum.add((first + second) + (third + fourth));
  }
  for (; i + 8 <= n; i += 8) sum.add(product.template at<Float8>(i));
  if (i < n) sum.add(product.template at<Float4>(i));
  return sum.total();
}

struct ProductOf {
  const float *a, *b;
  template <class F>
  SINEW_INLINE F at(std::uint32_t i) const {
    return load<F>(a + i) * load<F>(b + i);
  }
};

struct SteppedProductOf {
  float factor;
  const float* a;
  float* to;
  const float* with;
  template <class F>
  SINEW_INLINE F at(std::uint32_t i) const {
    const F stepped = load<F>(to + i) + load<F>(a + i) * factor;
    store(to + i, stepped);
    return load<F>(with + i) * stepped;
  }
};

static double dot(const float* a, const float* b, std::uint32_t n) { return sumOver(n, ProductOf{a, b}); }

/// to += factor a. \return its product with another vector, which may be itself
static double addThenDot(float factor, const float* a, float* to, const float* with, std::uint32_t n) {
  return sumOver(n, SteppedProductOf{factor, a, to, with});
}

}  // namespace sinew::internal::SINEW_KERNELS

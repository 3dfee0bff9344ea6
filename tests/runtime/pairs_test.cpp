// SPDX-License-Identifier: MIT
#include "runtime/solver/pairs.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "runtime/kernels/kernels.h"

namespace sinew::internal {
namespace {

constexpr std::uint32_t kRows = 6, kFloats = 4 * kRows, kKept = 3;

using Matrix = Eigen::Matrix<double, 3 * kRows, 3 * kRows>;

std::vector<float> padded(const Eigen::VectorXd& x) {
  std::vector<float> result(kFloats);
  for (std::uint32_t i = 0; i < kRows; ++i) {
    for (std::uint32_t c = 0; c < 3; ++c) result[4 * i + c] = float(x[3 * i + c]);
  }
  return result;
}

Eigen::VectorXd unpadded(const std::vector<float>& x) {
  Eigen::VectorXd result(3 * kRows);
  for (std::uint32_t i = 0; i < kRows; ++i) {
    for (std::uint32_t c = 0; c < 3; ++c) result[3 * i + c] = double(x[4 * i + c]);
  }
  return result;
}

/// A quadratic energy 1/2 x A x, and pairs along random ways in it: more than are kept.
class PairsTest : public testing::Test {
 protected:
  PairsTest() : pairs(kKept, std::pmr::get_default_resource()) {
    const Matrix half = Matrix::NullaryExpr([this] { return normal(random); });
    hessian = half * half.transpose() + Matrix::Identity();
    pairs.reserve(kFloats);
    pairs.start(kFloats);
    for (std::uint32_t i = 0; i < kKept + 2; ++i) {
      const Eigen::VectorXd from = some(), to = some();
      pairs.take(padded(from).data(), padded(to).data(), padded(hessian * from).data(), padded(hessian * to).data());
      last = to - from;
    }
  }

  Eigen::VectorXd some() {
    return Eigen::VectorXd::NullaryExpr(3 * kRows, [this] { return normal(random); });
  }

  /// The inverse of the second derivative times g, as the pairs know it about the identity.
  static Eigen::VectorXd inverse(Pairs& of, const Eigen::VectorXd& g) {
    std::vector<float> direction = padded(g);
    of.reduce(direction.data());
    of.expand(direction.data());
    return unpadded(direction);
  }

  std::mt19937 random{5};
  std::normal_distribution<double> normal;
  Matrix hessian;
  Pairs pairs;
  Eigen::VectorXd last;
};

TEST_F(PairsTest, KnowTheInverseAlongTheLastStep) {
  EXPECT_EQ(pairs.count(), kKept);
  EXPECT_LT((inverse(pairs, hessian * last) - last).norm(), 1e-4 * last.norm());
}

// The same energy in a step of another length.
TEST_F(PairsTest, GoOnWithOtherInertia) {
  pairs.carry(0.4F);
  EXPECT_FALSE(pairs.fresh());
  const Matrix other = hessian + 0.4 * Matrix::Identity();
  EXPECT_LT((inverse(pairs, other * last) - last).norm(), 1e-4 * last.norm());
}

// The place of a pair that says nothing is that of the oldest one, which then counts no more.
TEST_F(PairsTest, ForgetTheOldestWhenTheNextOneIsOfNoUse) {
  const Eigen::VectorXd from = some(), to = some();
  pairs.take(padded(from).data(), padded(to).data(), padded(to).data(), padded(from).data());
  EXPECT_EQ(pairs.count(), kKept - 1);
  EXPECT_LT((inverse(pairs, hessian * last) - last).norm(), 1e-4 * last.norm());
}

// Nocedal and Wright 2006, algorithm 7.4, about the identity.
TEST_F(PairsTest, AreThoseOfTheTwoLoops) {
  Pairs few(2, std::pmr::get_default_resource());
  few.reserve(kFloats);
  few.start(kFloats);
  std::array<Eigen::VectorXd, 2> s, y;
  for (std::size_t i = 0; i < 2; ++i) {
    const Eigen::VectorXd from = some(), to = some();
    few.take(padded(from).data(), padded(to).data(), padded(hessian * from).data(), padded(hessian * to).data());
    s[i] = to - from;
    y[i] = hessian * s[i];
  }
  const Eigen::VectorXd g = some();
  Eigen::VectorXd q = g;
  std::array<double, 2> alpha;
  for (const std::size_t i : {1U, 0U}) {
    alpha[i] = s[i].dot(q) / s[i].dot(y[i]);
    q -= alpha[i] * y[i];
  }
  for (const std::size_t i : {0U, 1U}) q += (alpha[i] - y[i].dot(q) / s[i].dot(y[i])) * s[i];
  EXPECT_LT((inverse(few, g) - q).norm(), 1e-5 * q.norm());
}

TEST_F(PairsTest, EndWhereTheirCurvatureIsNotPositive) {
  pairs.carry(-1e6F);
  EXPECT_EQ(pairs.count(), 0U);
}

TEST_F(PairsTest, AreRestoredBitForBit) {
  std::vector<std::byte> saved(kKept * Pairs::savedBytes(kFloats));
  pairs.save(kKept, saved.data());
  Pairs other(kKept, std::pmr::get_default_resource());
  other.restore(kFloats, kKept, saved.data());
  EXPECT_TRUE(other.fresh());
  pairs.carry(0);
  other.carry(0);
  const Eigen::VectorXd g = some();
  EXPECT_EQ(inverse(other, g), inverse(pairs, g));
}

TEST(Vectors, MultiplyAndStepAlikeForAllInstructionSets) {
  std::mt19937 random(8);
  std::normal_distribution<float> normal;
  const auto some = [&](std::uint32_t n) {
    std::vector<float> numbers(n);
    for (float& each : numbers) each = normal(random);
    return numbers;
  };
  for (std::uint32_t n = 0; n <= 136; n += 4) {
    const std::vector<float> a = some(n), b = some(n), with = some(n);
    double product = 0, stepped = 0, size = 0;
    for (std::uint32_t i = 0; i < n; ++i) {
      product += double(a[i]) * double(b[i]);
      stepped += double(with[i]) * (double(b[i]) + 0.7 * double(a[i]));
      size += std::abs(double(a[i])) + std::abs(double(with[i]));
    }
    std::vector<double> expected;
    for (const char* name : {"portable", "sse42", "avx2", "avx512"}) {
      const Kernels* table = kernelsNamed(name);
      if (table == nullptr) continue;
      std::vector<float> to = b;
      std::vector<double> found = {table->dot(a.data(), b.data(), n),
                                   table->add_then_dot(0.7F, a.data(), to.data(), with.data(), n)};
      EXPECT_NEAR(found[0], product, 1e-6 * size) << n << ' ' << name;
      EXPECT_NEAR(found[1], stepped, 1e-6 * size) << n << ' ' << name;
      for (std::uint32_t i = 0; i < n; ++i) EXPECT_EQ(to[i], b[i] + a[i] * 0.7F) << n << ' ' << name;
      if (expected.empty()) expected = found;
      EXPECT_EQ(found, expected) << n << ' ' << name;
    }
    EXPECT_FALSE(expected.empty());
  }
}

}  // namespace
}  // namespace sinew::internal

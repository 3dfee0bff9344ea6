// SPDX-License-Identifier: MIT
//
// The second derivative of the samples' energy, against differences of its gradient.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
#include <random>

#include "runtime/load/rest_constants.h"
#include "runtime/solver/minimize.h"
#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using internal::Field;
using internal::Objective;

/// A field's elastic energy about its rest shape.
struct Elastic {
  explicit Elastic(const Field& of) : field(of), scratch(std::pmr::get_default_resource()) {
    scratch.reserve(field, 0);
    objective.field = &field;
    objective.scratch = &scratch;
    std::vector<Vector3d> rest;
    for (const formats::FieldFunction& f : field.functions) {
      rest.emplace_back(double(f.rest[0]), double(f.rest[1]), double(f.rest[2]));
    }
    objective.setFrame(rest, field.rest_center, Eigen::Matrix3d::Identity());
  }
  std::uint32_t unknowns() const { return field.unknowns(); }

  /// The matrix by the kernel; symmetric.
  MatrixXd matrixAt(const std::vector<float>& d) {
    std::vector<float> matrix(std::size_t(unknowns()) * field.stride), gradient(4 * std::size_t(field.k));
    objective.elastic(d.data(), gradient.data(), true);
    objective.stiffnessAt(d.data(), matrix.data());
    MatrixXd result(unknowns(), unknowns());
    for (std::uint32_t i = 0; i < unknowns(); ++i) {
      for (std::uint32_t j = 0; j <= i; ++j) {
        result(i, j) = result(j, i) = double(matrix[std::size_t(field.stride) * i + j]);
      }
    }
    return result;
  }

  /// The same by central differences of the gradient.
  MatrixXd differencesAt(const std::vector<float>& d, float way) {
    MatrixXd result(unknowns(), unknowns());
    std::vector<float> there = d, up(4 * std::size_t(field.k)), down(up);
    for (std::uint32_t i = 0; i < unknowns(); ++i) {
      float& moved = there[4 * (field.driven + i / 3) + i % 3];
      const float before = moved;
      moved = before + way;
      objective.elastic(there.data(), up.data(), true);
      moved = before - way;
      objective.elastic(there.data(), down.data(), true);
      moved = before;
      for (std::uint32_t j = 0; j < unknowns(); ++j) {
        const std::size_t at = 4 * (field.driven + j / 3) + j % 3;
        result(j, i) = (double(up[at]) - double(down[at])) / (2 * double(way));
      }
    }
    return result;
  }

  const Field& field;
  internal::MinimizeScratch scratch;
  Objective objective;
};

const Field& freeField(const Asset& asset) { return *internal::fieldOf(asset.constants().fields, 0, false); }

TEST(Stiffness, IsTheSecondDerivativeAtRest) {
  const auto asset = boxAsset({});
  Elastic elastic(freeField(*asset));
  const std::vector<float> rest(4 * std::size_t(elastic.field.k), 0.0F);
  const MatrixXd matrix = elastic.matrixAt(rest), expected = elastic.differencesAt(rest, 1e-4F);
  EXPECT_LT((matrix - expected).norm(), 2e-3 * expected.norm());
}

TEST(Stiffness, IsThatOfThePermanentShape) {
  const auto asset = boxAsset({});
  Elastic elastic(freeField(*asset));
  const Field& field = elastic.field;
  // S = diag(1.5, 1, 0.8) everywhere, and the shape that has it.
  const float longer[3] = {1.5F, 1, 0.8F};
  std::vector<float> change(std::size_t(72) * field.pack_count, 0.0F), shape(4 * std::size_t(field.k), 0.0F);
  for (std::uint32_t pack = 0; pack < field.pack_count; ++pack) {
    for (std::uint32_t c = 0; c < 3; ++c) std::fill_n(change.begin() + 72 * pack + 32 * c, 8, 1 / longer[c] - 1);
  }
  for (std::uint32_t j = 0; j < field.k; ++j) {
    for (std::uint32_t c = 0; c < 3; ++c) shape[4 * j + c] = (longer[c] - 1) * field.functions[j].rest[c];
  }
  elastic.objective.rest_change = change.data();
  const MatrixXd matrix = elastic.matrixAt(shape), expected = elastic.differencesAt(shape, 1e-4F);
  EXPECT_LT((matrix - expected).norm(), 2e-3 * expected.norm());
}

TEST(Stiffness, IsPositiveAndTheSameForAllInstructionSetsInAHeap) {
  const auto asset = boxAsset({});
  Elastic elastic(freeField(*asset));
  const Field& field = elastic.field;
  std::mt19937 random(3);
  std::normal_distribution<float> off(0, 0.5F);
  std::vector<float> d(4 * std::size_t(field.k), 0.0F);
  for (std::uint32_t j = 0; j < field.k; ++j) {
    for (std::uint32_t c = 0; c < 3; ++c) d[4 * j + c] = off(random);
  }
  const MatrixXd matrix = elastic.matrixAt(d);
  const MatrixXd shifted = matrix + 1e-5 * matrix.norm() * MatrixXd::Identity(matrix.rows(), matrix.cols());
  EXPECT_EQ(Eigen::LLT<MatrixXd>(shifted).info(), Eigen::Success);

  internal::FieldStiffnessArguments a = {};
  a.functions = field.k;
  a.pack_count = field.pack_count;
  a.driven = field.driven;
  a.stride = field.stride;
  a.packs = field.packs;
  a.gradients = field.gradients;
  a.stiffness = 1;
  a.coefficients = elastic.scratch.x.data();
  a.squeezed = elastic.scratch.squeezed.data();
  a.limits = field.limits;
  a.scratch = elastic.scratch.samples.data();
  std::vector<float> expected(std::size_t(field.unknowns()) * field.stride, 0.0F);
  a.matrix = expected.data();
  internal::kernels().field_stiffness(a);
  int sets = 0;
  for (const char* name : {"portable", "sse42", "avx2", "avx512"}) {
    const internal::Kernels* table = internal::kernelsNamed(name);
    if (table == nullptr) continue;
    ++sets;
    std::vector<float> found(expected.size(), 0.0F);
    a.matrix = found.data();
    table->field_stiffness(a);
    EXPECT_EQ(found, expected) << name;
  }
  EXPECT_GT(sets, 0);
}

TEST(Factors, SolveAndAreTheSameForAllInstructionSets) {
  std::mt19937 random(9);
  std::normal_distribution<double> number;
  for (const std::uint32_t size : {1U, 3U, 8U, 9U, 36U, 93U}) {
    const std::uint32_t stride = (size + 7) / 8 * 8;
    MatrixXd a = MatrixXd::NullaryExpr(size, size, [&] { return number(random); });
    a = a * a.transpose() + MatrixXd::Identity(size, size);
    const Eigen::VectorXd right = Eigen::VectorXd::NullaryExpr(size, [&] { return number(random); });
    std::vector<float> expected;
    for (const char* name : {"portable", "sse42", "avx2", "avx512"}) {
      const internal::Kernels* table = internal::kernelsNamed(name);
      if (table == nullptr) continue;
      // What is right of the diagonal and behind the vector counts for nothing.
      const float none = std::numeric_limits<float>::quiet_NaN();
      std::vector<float> matrix(std::size_t(size) * stride, none), scratch(stride), x(stride, none);
      for (std::uint32_t i = 0; i < size; ++i) {
        for (std::uint32_t j = 0; j <= i; ++j) matrix[std::size_t(stride) * i + j] = float(a(i, j));
        x[i] = float(right[i]);
      }
      ASSERT_TRUE(table->factorize({size, stride, matrix.data(), scratch.data()}));
      table->solve({size, stride, matrix.data(), x.data()});
      x.resize(size);
      const Eigen::VectorXd found = Eigen::Map<const Eigen::VectorXf>(x.data(), size).cast<double>();
      EXPECT_LT((a * found - right).norm(), 1e-4 * a.norm() * found.norm()) << size << ' ' << name;
      if (expected.empty()) expected = x;
      EXPECT_EQ(x, expected) << size << ' ' << name;
    }
    EXPECT_FALSE(expected.empty());
  }
}

TEST(Products, AreTheSameForAllInstructionSets) {
  std::mt19937 random(5);
  std::normal_distribution<double> number;
  constexpr std::uint32_t kRows = 24, kDepth = 7, kColumns = 9, kApart = 29;
  const auto some = [&](std::size_t count) {
    std::vector<double> numbers(count);
    for (double& each : numbers) each = number(random);
    return numbers;
  };
  const std::vector<double> left = some(kApart * kDepth), right = some(kDepth * kColumns),
                            begin = some(kApart * kColumns);
  std::vector<double> expected = begin;
  for (std::uint32_t column = 0; column < kColumns; ++column) {
    for (std::uint32_t row = 0; row < kRows; ++row) {
      for (std::uint32_t d = 0; d < kDepth; ++d) {
        expected[kApart * column + row] += left[kApart * d + row] * right[kDepth * column + d];
      }
    }
  }
  int sets = 0;
  for (const char* name : {"portable", "sse42", "avx2", "avx512"}) {
    const internal::Kernels* table = internal::kernelsNamed(name);
    if (table == nullptr) continue;
    ++sets;
    std::vector<double> found = begin;
    table->add_product({kRows, kColumns, kDepth, left.data(), right.data(), found.data(), kApart, kApart});
    EXPECT_EQ(found, expected) << name;
  }
  EXPECT_GT(sets, 0);
}

}  // namespace
}  // namespace sinew::test

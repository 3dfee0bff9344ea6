// SPDX-License-Identifier: MIT
//
// Small matrices against Eigen's decompositions.
#include "runtime/geometry/small_matrix.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace sinew::geometry {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

ConstMatrixView viewOf(const MatrixXd& m) { return {m.data(), int(m.rows()), int(m.cols()), 1, int(m.rows())}; }
MatrixView viewOf(MatrixXd& m) { return {m.data(), int(m.rows()), int(m.cols()), 1, int(m.rows())}; }

class Random {
 public:
  double uniform() { return std::uniform_real_distribution<double>(-1, 1)(engine_); }
  MatrixXd matrix(int rows, int columns) {
    return MatrixXd::NullaryExpr(rows, columns, [this](Eigen::Index, Eigen::Index) { return uniform(); });
  }
  MatrixXd rotation(int n) { return Eigen::HouseholderQR<MatrixXd>(matrix(n, n)).householderQ(); }
  MatrixXd withEigenvalues(const VectorXd& values) {
    const MatrixXd q = rotation(int(values.size()));
    const MatrixXd a = q * values.asDiagonal() * q.transpose();
    return 0.5 * (a + a.transpose());
  }

 private:
  std::mt19937 engine_{2024};
};

// Eigenvalues of every kind: spread over 16 decades, multiple, zero, of both signs.
std::vector<VectorXd> spectra(int n, Random& random) {
  std::vector<VectorXd> result = {VectorXd::Zero(n), VectorXd::Ones(n), VectorXd::Unit(n, 0)};
  VectorXd decades(n), pairs(n), any(n);
  for (int i = 0; i < n; ++i) {
    decades[i] = std::pow(10.0, -16.0 * i / n);
    pairs[i] = 1 + i / 2;
    any[i] = random.uniform();
  }
  result.insert(result.end(), {decades, pairs, any});
  return result;
}

TEST(SmallMatrix, PartsAndTransposesAreSeenInPlace) {
  Random random;
  MatrixXd a = random.matrix(7, 5);
  const MatrixView part = viewOf(a).block(2, 1, 4, 3);
  const ConstMatrixView turned = ConstMatrixView(part).transposed(), inner = turned.block(1, 2, 2, 2);
  EXPECT_EQ(part.rows, 4);
  EXPECT_EQ(turned.rows, 3);
  EXPECT_EQ(turned.columns, 4);
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 4; ++i) EXPECT_EQ(&turned(j, i), &a(2 + i, 1 + j));
  }
  EXPECT_EQ(&inner(1, 0), &a(4, 3));
  EXPECT_EQ(inner.transposed().rows, 2);
  SmallMatrix<12> b(3, 4);
  b(2, 3) = 1;
  EXPECT_EQ(&b.block(1, 1, 2, 3)(1, 2), b.data() + 11);
  b.keepColumns(2);
  EXPECT_EQ(b.columns(), 2);
  EXPECT_EQ(b.transposed().rows, 2);
}

TEST(SmallMatrix, EigenvaluesAreEigensAndVectorsAreOrthonormal) {
  Random random;
  for (const int n : {1, 2, 3, 4, 9, 10, 27, 30}) {
    for (const VectorXd& spectrum : spectra(n, random)) {
      for (const double scale : {1e-150, 1.0, 1e150}) {
        const MatrixXd a = scale * random.withEigenvalues(spectrum);
        MatrixXd vectors(n, n);
        VectorXd values(n);
        symmetricEigen(viewOf(a), {values.data(), std::size_t(n)}, viewOf(vectors));
        const Eigen::SelfAdjointEigenSolver<MatrixXd> reference(a / scale);
        const double rounding = 1e-14 * n;
        EXPECT_LT((values / scale - reference.eigenvalues()).cwiseAbs().maxCoeff(), rounding) << n;
        EXPECT_LT((vectors.transpose() * vectors - MatrixXd::Identity(n, n)).cwiseAbs().maxCoeff(), rounding) << n;
        EXPECT_LT((a * vectors - vectors * values.asDiagonal()).cwiseAbs().maxCoeff(), rounding * scale) << n;
      }
    }
  }
}

TEST(SmallMatrix, EigenvaluesOfWhatIsNoNumberEnd) {
  MatrixXd a = MatrixXd::Constant(9, 9, std::numeric_limits<double>::quiet_NaN()), vectors(9, 9);
  VectorXd values(9);
  symmetricEigen(viewOf(a), {values.data(), 9}, viewOf(vectors));
  EXPECT_FALSE(values.allFinite());
}

TEST(SmallMatrix, InverseIsEigens) {
  Random random;
  for (const int n : {1, 3, 10, 30}) {
    const MatrixXd a = random.withEigenvalues(VectorXd::LinSpaced(n, 1e-3, 1));
    MatrixXd inverse = a;
    invertPositive(viewOf(inverse));
    const MatrixXd reference = a.llt().solve(MatrixXd::Identity(n, n));
    EXPECT_LT((inverse - reference).norm(), 1e-12 * reference.norm()) << n;
    EXPECT_EQ(inverse, MatrixXd(inverse.transpose()));
  }
}

TEST(SmallMatrix, PseudoInverseDropsWhatIsBelowTheCutoff) {
  Random random;
  VectorXd spectrum(9);
  spectrum << 1, 0.5, 0.1, 1e-2, 1e-4, 1e-5, 1e-9, 1e-12, 0;
  const MatrixXd a = random.withEigenvalues(spectrum);
  MatrixXd result(9, 9);
  pseudoInverse(viewOf(a), 1e-6, viewOf(result));
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(a);
  VectorXd inverse = VectorXd::Zero(9);
  for (int i = 3; i < 9; ++i) inverse[i] = 1 / solver.eigenvalues()[i];
  const MatrixXd reference = solver.eigenvectors() * inverse.asDiagonal() * solver.eigenvectors().transpose();
  EXPECT_LT((result - reference).norm(), 1e-9 * reference.norm());
  EXPECT_EQ(result, MatrixXd(result.transpose()));
}

TEST(SmallMatrix, ProductsAreEigensForEveryWayToLookAtAMatrix) {
  Random random;
  const MatrixXd a = random.matrix(30, 12), b = random.matrix(9, 12), t = random.matrix(30, 5);
  MatrixXd product = MatrixXd::Ones(9, 30);
  addProduct(viewOf(product), 2, viewOf(b), viewOf(a).transposed());
  EXPECT_LT((product - (MatrixXd::Ones(9, 30) + 2 * b * a.transpose())).norm(), 1e-13);
  MatrixXd part = MatrixXd::Zero(4, 4);
  addProduct(viewOf(part).block(1, 0, 3, 4), 1, viewOf(a).block(5, 2, 3, 6), viewOf(b).block(0, 3, 4, 6).transposed());
  EXPECT_LT((part.bottomRows(3) - a.block(5, 2, 3, 6) * b.block(0, 3, 4, 6).transpose()).norm(), 1e-14);
  EXPECT_EQ(part.row(0).norm(), 0);
  const MatrixXd system = random.withEigenvalues(VectorXd::LinSpaced(30, 1, 2));
  MatrixXd congruence = MatrixXd::Zero(5, 5);
  addCongruence(viewOf(congruence), 3, viewOf(system), viewOf(t));
  EXPECT_LT((congruence - 3 * t.transpose() * system * t).norm(), 1e-12);
}

}  // namespace
}  // namespace sinew::geometry

// SPDX-License-Identifier: MIT
#include "runtime/geometry/rotation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <limits>
#include <random>

#include "runtime/geometry/pseudo_inverse.h"

namespace sinew::geometry {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3f;
using Eigen::Vector3d;

// Umeyama 1991: U diag(1, 1, det U det V) V^T.
Matrix3d referenceRotation(const Matrix3f& a) {
  const Eigen::JacobiSVD<Matrix3d> svd(a.cast<double>(), Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant() < 0 ? -1 : 1;
  return svd.matrixU() * Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

void expectProper(const Matrix3f& r) {
  EXPECT_LT((r * r.transpose() - Matrix3f::Identity()).norm(), 2e-6F);
  EXPECT_NEAR(r.determinant(), 1.0F, 2e-6F);
}

// How much of tr(R^T A) a rotation misses, relative to the size of A: 0 for a nearest one, also where it is not unique.
double missed(const Matrix3f& a, const Matrix3f& r) {
  const Matrix3d wide = a.cast<double>();
  const double best = (referenceRotation(a).transpose() * wide).trace();
  return (best - (r.cast<double>().transpose() * wide).trace()) / wide.norm();
}

class Random {
 public:
  double uniform() { return std::uniform_real_distribution<double>(-1, 1)(engine_); }
  Matrix3d rotation() {
    Eigen::Quaterniond q(uniform(), uniform(), uniform(), uniform());
    return q.normalized().toRotationMatrix();
  }

 private:
  std::mt19937 engine_{12345};
};

Quaternion quaternionOf(const Matrix3d& r) {
  const Eigen::Quaterniond q(r);
  return {float(q.w()), float(q.x()), float(q.y()), float(q.z())};
}

TEST(Rotation, MatchesDoubleSvdAtEveryScaleFromAnyStart) {
  Random random;
  double worst_angle = 0;
  for (const double scale : {1e-30, 1e-15, 1e-6, 1.0, 1e6, 1e15, 1e30}) {
    for (int i = 0; i < 400; ++i) {
      Vector3d sigma(1, 0.02 + 0.98 * std::abs(random.uniform()), 0.02 + 0.98 * std::abs(random.uniform()));
      if (i % 4 == 0) sigma[2] = -0.5 * std::min(std::abs(sigma[1]), std::abs(sigma[2]));  // mirrored, unique
      const Matrix3f a = (scale * random.rotation() * sigma.asDiagonal() * random.rotation().transpose()).cast<float>();
      Quaternion q = quaternionOf(random.rotation());
      nearestRotation(a, q);
      const Matrix3f r = rotationMatrix(q);
      expectProper(r);
      // The rotation is determined to rounding over the smallest gap sigma_2 + sigma_3.
      Vector3d sorted = sigma.cwiseAbs();
      std::sort(sorted.data(), sorted.data() + 3);
      const double gap = sorted[1] + (sigma[2] < 0 ? -sorted[0] : sorted[0]);
      const double angle = (r.cast<double>() - referenceRotation(a)).norm();
      worst_angle = std::max(worst_angle, angle * gap);
      EXPECT_LT(angle * gap, 2e-6) << "scale " << scale << " gap " << gap;
    }
  }
  RecordProperty("worst_angle_times_gap", std::to_string(worst_angle));
}

TEST(Rotation, DoesNotStickHalfATurnAway) {
  for (int axis = 0; axis < 3; ++axis) {
    const Matrix3f half_turn = Eigen::AngleAxisf(3.14159265F, Eigen::Vector3f::Unit(axis)).toRotationMatrix();
    Quaternion q = kIdentityQuaternion;
    nearestRotation(half_turn * Eigen::Vector3f(3, 2, 1).asDiagonal(), q);
    EXPECT_LT((rotationMatrix(q) - half_turn).norm(), 1e-5F);
  }
}

TEST(Rotation, IsProperForSingularMirroredAndCollapsedInput) {
  Random random;
  const Vector3d shapes[] = {{1, 1, 0},     {1, 0, 0},     {0, 0, 0},       {1, 1, -1},   {-1, -1, -1},
                             {1, -1e-7, 0}, {1e-38, 0, 0}, {1, 1e-8, 1e-8}, {1, 1, -1e-9}};
  for (const Vector3d& sigma : shapes) {
    for (int i = 0; i < 100; ++i) {
      const Matrix3f a = (random.rotation() * sigma.asDiagonal() * random.rotation().transpose()).cast<float>();
      Quaternion q = quaternionOf(random.rotation());
      nearestRotation(a, q);
      const Matrix3f r = rotationMatrix(q);
      expectProper(r);
      if (!a.isZero(0)) {
        EXPECT_LT(missed(a, r), 4e-6) << sigma.transpose();
      }
    }
  }
}

TEST(Rotation, KeepsThePreviousOneWhereNothingIsKnown) {
  Random random;
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  Matrix3f with_nan = Matrix3f::Identity(), with_inf = Matrix3f::Identity();
  with_nan(1, 2) = nan;
  with_inf(0, 0) = inf;
  for (const Matrix3f& a : {Matrix3f(Matrix3f::Zero()), with_nan, with_inf}) {
    const Quaternion before = quaternionOf(random.rotation());
    Quaternion q = before;
    nearestRotation(a, q);
    EXPECT_EQ(q, before);
  }
}

TEST(Rotation, StaysContinuousThroughCollapseAndMirroring) {
  // A body flattened through zero into its mirror image must not spin: the nearest rotation to diag(1, 0.8, s) is the
  // identity for s > -0.8.
  Quaternion q = kIdentityQuaternion;
  for (int i = 0; i <= 170; ++i) {
    const float s = 1.0F - 0.01F * float(i);
    nearestRotation(Eigen::Vector3f(1, 0.8F, s).asDiagonal().toDenseMatrix(), q);
    ASSERT_NEAR(std::abs(q[0]), 1.0F, 1e-5F) << s;
  }
}

TEST(PseudoInverse, SatisfiesPenroseAndDropsMissingDirections) {
  Random random;
  for (int rank = 0; rank <= 9; ++rank) {
    Eigen::Matrix<double, 9, 9> moment = Eigen::Matrix<double, 9, 9>::Zero();
    for (int k = 0; k < rank; ++k) {
      Eigen::Matrix<double, 9, 1> v;
      for (int i = 0; i < 9; ++i) v[i] = random.uniform();
      moment += v * v.transpose();
    }
    const auto inverse = pseudoInverse<9>(moment, 1e-10);
    EXPECT_LT((moment * inverse * moment - moment).norm(), 1e-7 * (1 + moment.norm())) << rank;
    EXPECT_NEAR((moment * inverse).trace(), rank, 1e-6);  // a projector onto what is there
  }
}

}  // namespace
}  // namespace sinew::geometry

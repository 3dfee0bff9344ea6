// SPDX-License-Identifier: MIT
//
// Lane functions against references in double that share no code with them: Eigen's SVD, bisection, brute force.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "runtime/kernels/limits.h"
#include "runtime/kernels/svd.h"
#include "runtime/kernels/volume.h"

namespace sinew::internal::SINEW_KERNELS {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

template <class F>
Mat3Of<F> toLanes(const Matrix3d& a) {
  Mat3Of<F> m;
  for (int k = 0; k < 9; ++k) m.m[k] = F{} + F(a.data()[k]);
  return m;
}

template <class F>
Matrix3d toEigen(const Mat3Of<F>& m) {
  Matrix3d a;
  for (int k = 0; k < 9; ++k) a.data()[k] = double(m.m[k]);
  return a;
}

template <class F>
Vector3d toEigen(const Vec3Of<F>& v) {
  return {double(v.x), double(v.y), double(v.z)};
}

Matrix3d properRotation(const Matrix3d& a) {
  const Eigen::JacobiSVD<Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

// Random, singular, mirrored, nearly equal stretches, all of it at scales from 1e-30 to 1e30.
std::vector<Matrix3d> hardMatrices(double smallest_scale, double largest_scale) {
  std::mt19937 engine(11);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> exponent(std::log10(smallest_scale), std::log10(largest_scale));
  const auto random = [&] {
    Matrix3d a;
    for (int k = 0; k < 9; ++k) a.data()[k] = normal(engine);
    return a;
  };
  std::vector<Matrix3d> all = {Matrix3d::Zero(), Matrix3d::Identity(), -Matrix3d::Identity()};
  for (int i = 0; i < 3000; ++i) {
    const Matrix3d u = properRotation(random()), v = properRotation(random());
    Vector3d sigma(std::abs(normal(engine)), std::abs(normal(engine)), normal(engine));
    switch (i % 8) {
      case 0:
        sigma = {1, 1, 1 + 1e-4 * normal(engine)};
        break;
      case 1:
        sigma = {1, 1e-3, 1e-6};
        break;
      case 2:
        sigma = {1, 0, 0};
        break;
      case 3:
        sigma = {1, normal(engine), 0};
        break;
      case 4:
        sigma = {1, 1, -1};
        break;
      case 5:
        sigma = {1e6, 1, -1e-6};
        break;
      default:
        break;
    }
    all.push_back(std::pow(10, exponent(engine)) * (i % 8 == 7 ? random() : u * sigma.asDiagonal() * v.transpose()));
  }
  for (int i = 0; i < 9; ++i) {
    Matrix3d a = Matrix3d::Zero();
    a.data()[i] = i % 2 == 0 ? 1 : -1;
    all.push_back(a);
  }
  return all;
}

template <class F>
void checkSvd(double tolerance) {
  for (const Matrix3d& wanted : hardMatrices(1e-30, 1e30)) {
    const Mat3Of<F> a = toLanes<F>(wanted);
    const Matrix3d exact = toEigen(a);
    const SvdOf<F> svd = rotationSvd(a);
    const Matrix3d u = toEigen(svd.u), v = toEigen(svd.v);
    const Vector3d sigma = toEigen(svd.sigma);
    const double scale = exact.cwiseAbs().maxCoeff();
    ASSERT_LT((u * u.transpose() - Matrix3d::Identity()).norm(), 4 * tolerance) << exact;
    ASSERT_LT((v * v.transpose() - Matrix3d::Identity()).norm(), 4 * tolerance) << exact;
    ASSERT_GT(u.determinant(), 0.9) << exact;
    ASSERT_GT(v.determinant(), 0.9) << exact;
    // Backward error, norm against norm: how large the largest entry is depends on how the matrix happens to be turned.
    ASSERT_LE((u * sigma.asDiagonal() * v.transpose() - exact).norm(), 3 * tolerance * exact.norm()) << exact;
    ASSERT_GE(sigma[0] * (1 + tolerance), sigma[1]);
    ASSERT_GE(sigma[1] * (1 + tolerance), std::abs(sigma[2]) - tolerance * scale);
    const Eigen::JacobiSVD<Matrix3d> reference(exact / (scale > 0 ? scale : 1));
    for (int k = 0; k < 3; ++k) {
      ASSERT_NEAR(std::abs(sigma[k]), scale * reference.singularValues()[k], 4 * tolerance * scale) << exact;
    }
    if (reference.singularValues()[2] > 1e-5) {
      ASSERT_EQ(sigma[2] < 0, (exact / scale).determinant() < 0) << exact;
    }
  }
}

TEST(Svd, AgreesWithEigenInDouble) { checkSvd<double>(2e-15); }
TEST(Svd, AgreesWithEigenInFloat) { checkSvd<float>(4e-7); }

TEST(Svd, LanesAreTheScalarsBitForBit) {
  const std::vector<Matrix3d> all = hardMatrices(1e-20, 1e20);
  for (std::size_t first = 0; first + 8 <= all.size(); first += 8) {
    Mat3Of<Float8> a{};
    for (std::uint32_t i = 0; i < 8; ++i) {
      for (int k = 0; k < 9; ++k) setLane(a.m[k], i, float(all[first + i].data()[k]));
    }
    const SvdOf<Float8> wide = rotationSvd(a);
    for (std::uint32_t i = 0; i < 8; ++i) {
      Mat3Of<float> one;
      for (int k = 0; k < 9; ++k) one.m[k] = lane(a.m[k], i);
      const SvdOf<float> narrow = rotationSvd(one);
      for (int k = 0; k < 9; ++k) {
        ASSERT_EQ(lane(wide.u.m[k], i), narrow.u.m[k]);
        ASSERT_EQ(lane(wide.v.m[k], i), narrow.v.m[k]);
      }
      ASSERT_EQ(lane(wide.sigma.z, i), narrow.sigma.z);
    }
  }
}

TEST(Svd, ANotANumberStaysInItsLane) {
  Mat3Of<Float8> a = identity<Float8>();
  setLane(a.m[4], 3, std::nanf(""));
  const SvdOf<Float8> svd = rotationSvd(a);
  for (std::uint32_t i = 0; i < 8; ++i) {
    if (i == 3) continue;
    EXPECT_EQ(lane(svd.sigma.y, i), 1.0F) << i;
  }
}

// Deformations of a goal: a rotation times stretches 1e-15..1e15, also mirrored.
struct Deformed {
  Matrix3d a, r;
};
std::vector<Deformed> deformations() {
  std::vector<Deformed> all;
  for (const Matrix3d& a : hardMatrices(1e-15, 1e15)) all.push_back({a, properRotation(a)});
  std::mt19937 engine(5);
  std::uniform_real_distribution<double> stretch(0.3, 2.5);
  for (const Deformed& d : std::vector<Deformed>(all.begin(), all.begin() + 2000)) {
    Matrix3d s = Vector3d(stretch(engine), stretch(engine), stretch(engine)).asDiagonal();
    const Matrix3d turn = properRotation(d.a + Matrix3d::Identity());
    all.push_back({d.r * turn * s * turn.transpose(), d.r});
  }
  return all;
}

// gamma in 0..1 with |gamma A + (1 - gamma) R|² = wanted, by bisection.
double gammaByBisection(const Matrix3d& a, const Matrix3d& r, double wanted) {
  if (a.squaredNorm() <= wanted) return 1;
  double low = 0, high = 1;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    ((middle * a + (1 - middle) * r).squaredNorm() < wanted ? low : high) = middle;
  }
  return low;
}

// Largest difference between a limited A and what it should be, over its norm.
template <class F, class Limit, class Reference>
double worstDifference(Limit limit, Reference reference) {
  double worst = 0;
  for (const Deformed& d : deformations()) {
    const Mat3Of<F> a = toLanes<F>(d.a), r = toLanes<F>(d.r);
    const Matrix3d result = toEigen(limit(a, r)), expected = reference(toEigen(a), toEigen(r));
    const double difference = (result - expected).norm() / std::max(1.0, expected.norm());
    EXPECT_TRUE(result.allFinite()) << d.a;
    worst = std::max(worst, difference);
  }
  return worst;
}

TEST(Limits, RowsAreCapped) {
  const auto reference = [](const Matrix3d& a, const Matrix3d& r) {
    Matrix3d local = r.transpose() * a;
    for (int i = 0; i < 3; ++i) local.row(i) *= std::min(1.0, 1.5 / std::max(local.row(i).norm(), 1e-300));
    return Matrix3d(r * local);
  };
  EXPECT_LT(worstDifference<double>([](auto a, auto r) { return limitRows(a, r, 1.5); }, reference), 1e-13);
  EXPECT_LT(worstDifference<float>([](auto a, auto r) { return limitRows(a, r, 1.5F); }, reference), 1e-5);
}

TEST(Limits, FrobeniusSolvesItsQuadratic) {
  const auto reference = [](const Matrix3d& a, const Matrix3d& r) {
    const double gamma = gammaByBisection(a, r, 4);
    return Matrix3d(gamma * a + (1 - gamma) * r);
  };
  EXPECT_LT(worstDifference<double>([](auto a, auto r) { return blend(a, r, gammaFrobenius(a, r, 4.0)); }, reference),
            1e-12);
  EXPECT_LT(worstDifference<float>([](auto a, auto r) { return blend(a, r, gammaFrobenius(a, r, 4.0F)); }, reference),
            1e-5);
}

TEST(Limits, FrobeniusCheapIsTheReportsFormula) {
  const auto reference = [](const Matrix3d& a, const Matrix3d& r) {
    const double gamma = std::min(1.0, 4 / std::max(a.squaredNorm(), 1e-300));
    return Matrix3d(gamma * a + (1 - gamma) * r);
  };
  EXPECT_LT(worstDifference<double>([](auto a, auto r) { return blend(a, r, gammaFrobeniusCheap(a, 4.0)); }, reference),
            1e-13);
  EXPECT_LT(worstDifference<float>([](auto a, auto r) { return blend(a, r, gammaFrobeniusCheap(a, 4.0F)); }, reference),
            3e-6);
}

TEST(Limits, SoftApproachesItsLimit) {
  const auto reference = [](const Matrix3d& a, const Matrix3d& r) {
    const double phi = a.squaredNorm();
    const double gamma = phi <= 3.5 ? 1 : gammaByBisection(a, r, 6 - 3.5 / phi * (6 - 3.5));
    return Matrix3d(gamma * a + (1 - gamma) * r);
  };
  EXPECT_LT(worstDifference<double>([](auto a, auto r) { return blend(a, r, gammaSoft(a, r, 3.5, 6.0)); }, reference),
            1e-12);
  EXPECT_LT(worstDifference<float>([](auto a, auto r) { return blend(a, r, gammaSoft(a, r, 3.5F, 6.0F)); }, reference),
            1e-5);
}

TEST(Limits, PrincipalKeepsStretchesWithinAndNeverMirrors) {
  for (const Deformed& d : deformations()) {
    const SvdOf<double> svd = rotationSvd(toLanes<double>(d.a));
    const Matrix3d limited = toEigen(compose(svd, limitPrincipal(svd, 0.5, 1.5)));
    const Eigen::JacobiSVD<Matrix3d> after(limited), before(d.a);
    const double mirrored = d.a.determinant() < 0 ? -1 : 1;
    if (before.singularValues()[2] < 1e-10 * before.singularValues()[0]) continue;  // the sign is anyone's
    for (int k = 0; k < 3; ++k) {
      const double sigma = before.singularValues()[k] * (k == 2 ? mirrored : 1);
      // Tiny stretches may come out of the SVD with either sign: both end at the lower limit.
      ASSERT_NEAR(after.singularValues()[k], std::clamp(sigma, 0.5, 1.5), 1e-12 + 1e-14 * before.singularValues()[0])
          << d.a;
    }
    ASSERT_GT(limited.determinant(), 0) << d.a;
  }
}

TEST(Limits, TheShortcutIsNeverWrongAndKnowsTheRestShape) {
  int inside = 0;
  for (const Deformed& d : deformations()) {
    const Mat3Of<float> a = toLanes<float>(d.a);
    const Eigen::JacobiSVD<Matrix3d> svd(toEigen(a));
    const bool within =
        svd.singularValues()[2] >= 0.5 && svd.singularValues()[0] <= 1.5 && toEigen(a).determinant() > 0;
    const bool sure = surelyWithin(a, 0.5F, 1.5F);
    ASSERT_TRUE(within || !sure) << d.a;
    inside += sure;
  }
  EXPECT_GT(inside, 100);
  EXPECT_TRUE(surelyWithin(toLanes<float>(Matrix3d::Identity()), 0.5F, 1.5F));
  EXPECT_TRUE(surelyWithin(toLanes<float>(1.1 * Matrix3d::Identity()), 0.9F, 1.2F));
}

TEST(Volume, CubeRootIsExactOverItsRange) {
  for (double x = 1e-7; x < 1e7; x *= 1.37) {
    EXPECT_NEAR(cubeRoot(x) / std::cbrt(x), 1, 1e-15) << x;
    EXPECT_NEAR(double(cubeRoot(float(x))) / std::cbrt(double(float(x))), 1, 3e-7) << x;
  }
}

// A of stretches between 0.4 and 1.8, the moments of a cluster (ratios to 1:100) and what answers to them.
struct Pressed {
  Matrix3d a, moment, cofactors, answer;
  double ease;
};

std::vector<Pressed> pressed() {
  std::vector<Pressed> all;
  std::mt19937 engine(11);
  std::uniform_real_distribution<double> stretch(0.4, 1.8), size(-2, 0), unit(-1, 1);
  const auto turn = [&] {
    return properRotation(Matrix3d::NullaryExpr([&](Eigen::Index, Eigen::Index) { return unit(engine); }));
  };
  for (int i = 0; i < 2000; ++i) {
    Pressed p;
    p.a = turn() * Vector3d(stretch(engine), stretch(engine), stretch(engine)).asDiagonal() * turn();
    const Matrix3d axes = turn();
    p.moment =
        axes *
        Vector3d(std::pow(10, size(engine)), std::pow(10, size(engine)), std::pow(10, size(engine))).asDiagonal() *
        axes.transpose();
    p.cofactors = p.a.determinant() * p.a.inverse().transpose();
    p.answer = p.cofactors * p.moment.inverse();
    p.ease = i % 2 == 0 ? 0.0 : std::pow(10, 2 * unit(engine));
    all.push_back(p);
  }
  return all;
}

TEST(Volume, APressureKeepsItOrGivesWayByItsEase) {
  int at_once = 0;
  for (const Pressed& p : pressed()) {
    const Mat3Of<double> cofactors = cofactor(toLanes<double>(p.a));
    ASSERT_LT((toEigen(cofactors) - p.cofactors).norm(), 1e-12 * p.cofactors.norm());
    const double pressure = volumePressure(toLanes<double>(p.a), cofactors, toLanes<double>(p.answer), p.ease);
    const double before = p.a.determinant(), after = (p.a + pressure * p.answer).determinant();
    // The balance, unless one of the two bounds of a push holds.
    const double most = std::min(1 / p.answer.norm(), p.ease > 0 ? double(kVolumeYield) / p.ease : 1e30);
    if (std::abs(pressure) < most * (1 - 1e-9)) {
      ASSERT_NEAR(after + p.ease * pressure, 1, 1e-6) << p.a;
      at_once += p.ease == 0;
    }
    ASSERT_LE(std::abs(pressure), most * (1 + 1e-12));
    ASSERT_LE(std::abs(after - 1), std::abs(before - 1)) << p.a;
    const float narrow =
        volumePressure(toLanes<float>(p.a), cofactor(toLanes<float>(p.a)), toLanes<float>(p.answer), float(p.ease));
    ASSERT_NEAR(double(narrow) * p.answer.norm(), pressure * p.answer.norm(), 2e-4);
  }
  EXPECT_GT(at_once, 500);
}

TEST(Volume, APressureMovesTheLeastMassNearTheRestShape) {
  std::mt19937 engine(12);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (Pressed p : pressed()) {
    p.a = Matrix3d::Identity() + 0.01 * Matrix3d::NullaryExpr([&](Eigen::Index, Eigen::Index) { return unit(engine); });
    p.cofactors = p.a.determinant() * p.a.inverse().transpose();
    p.answer = p.cofactors * p.moment.inverse();
    const double pressure =
        volumePressure(toLanes<double>(p.a), toLanes<double>(p.cofactors), toLanes<double>(p.answer), 0.0);
    const Matrix3d change = pressure * p.answer;
    ASSERT_NEAR((p.a + change).determinant(), 1, 1e-9);
    const auto moved = [&](const Matrix3d& d) { return (d * p.moment * d.transpose()).trace(); };
    // Another change with the same volume: some other way, then by one factor.
    const Matrix3d other =
        change + change.norm() * Matrix3d::NullaryExpr([&](Eigen::Index, Eigen::Index) { return unit(engine); });
    const Matrix3d there = p.a + other;
    ASSERT_GT(moved(there / std::cbrt(there.determinant()) - p.a), 0.97 * moved(change)) << p.a;
    // Equal moments in all directions: the report's A / cbrt(det A), to first order.
    const double equal =
        volumePressure(toLanes<double>(p.a), toLanes<double>(p.cofactors), toLanes<double>(p.cofactors), 0.0);
    const double off = p.a.determinant() - 1;
    ASSERT_LT((p.a + equal * p.cofactors - p.a / std::cbrt(p.a.determinant())).norm(),
              3 * std::abs(off) * (p.a - Matrix3d::Identity()).norm() + 1e-9);
  }
}

TEST(Volume, APressureLeavesWhatIsBeyondTheGuardAlone) {
  for (const Deformed& d : deformations()) {
    if (!(d.a.squaredNorm() > 30)) continue;
    const Mat3Of<float> a = toLanes<float>(d.a);
    const float pressure = volumePressure(a, cofactor(a), cofactor(a), 0.0F);
    ASSERT_EQ(pressure, 0.0F) << d.a;
  }
}

TEST(Volume, BehindALimitItIsWhatItWasAsFarAsThatIsBetter) {
  EXPECT_EQ(volumeToRestore(0.95, 0.7), 0.95);
  EXPECT_EQ(volumeToRestore(1.05, 0.7), 1);
  EXPECT_EQ(volumeToRestore(0.1, 0.7), 0.7);
  EXPECT_EQ(volumeToRestore(4.0, 3.0), 3);
  EXPECT_EQ(volumeToRestore(1.2, 3.0), 1.2);
}

// The nearest triple in logarithms, by bisection on the common shift of what the bounds leave free.
Vector3d nearestTriple(const Vector3d& sigma, double least, double largest, double volume) {
  double low = -20, high = 20;
  const auto shifted = [&](double t) {
    Vector3d l;
    for (int k = 0; k < 3; ++k) l[k] = std::clamp(std::log(sigma[k]) + t, std::log(least), std::log(largest));
    return l;
  };
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (shifted(middle).sum() < std::log(volume) ? low : high) = middle;
  }
  return shifted(low).array().exp();
}

TEST(Volume, PrincipalFindsTheNearestTriple) {
  std::mt19937 engine(3);
  for (const auto& [least, largest] : {std::pair{0.5, 1.5}, {0.8, 1.05}, {0.1, 3.0}, {0.05, 20.0}, {1.0, 1.5}}) {
    std::uniform_real_distribution<double> stretch(least, largest), fraction(0, 1);
    for (int i = 0; i < 3000; ++i) {
      Vector3d sigma(stretch(engine), stretch(engine), stretch(engine));
      for (int k = 0; k < 3; ++k) {
        const double f = fraction(engine);
        sigma[k] = f < 0.2 ? least : f < 0.4 ? largest : sigma[k];  // corners of the box as well
      }
      // Any volume that the bounds allow; 1 as often.
      const double reach = fraction(engine) < 0.5 ? 0 : fraction(engine);
      const double volume = std::exp(reach * (fraction(engine) < 0.5 ? std::log(least) : std::log(largest)));
      const Vector3d expected = nearestTriple(sigma, least, largest, volume);
      const Vec3Of<double> in{sigma[0], sigma[1], sigma[2]};
      ASSERT_LT((toEigen(volumePrincipal(in, least, largest, volume)) - expected).norm(), 1e-12 * expected.norm())
          << sigma.transpose();
      const Vec3Of<float> narrow{float(sigma[0]), float(sigma[1]), float(sigma[2])};
      const Vector3d result = toEigen(volumePrincipal(narrow, float(least), float(largest), float(volume)));
      ASSERT_LT((result - expected).norm(), 3e-6 * expected.norm()) << sigma.transpose();
      ASSERT_LE(result.maxCoeff(), double(float(largest)));
      ASSERT_GE(result.minCoeff(), double(float(least)));
      // Nothing on the surface of product 1 is nearer: a step along it in any direction goes away.
      const auto distance = [&](const Vector3d& s) { return (s.array().log() - sigma.array().log()).matrix().norm(); };
      for (int trial = 0; trial < 6; ++trial) {
        Vector3d l = expected.array().log();
        const double step = 1e-3 * (fraction(engine) - 0.5);
        l[trial % 3] += step;
        l[(trial + 1) % 3] -= step;
        const Vector3d other = l.array().exp();
        if (other.maxCoeff() > largest || other.minCoeff() < least) continue;
        ASSERT_GE(distance(other), distance(expected) - 1e-12);
      }
    }
  }
}

}  // namespace
}  // namespace sinew::internal::SINEW_KERNELS

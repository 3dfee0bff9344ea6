// SPDX-License-Identifier: GPL-3.0-or-later
//
// The finite elements that the runtime is measured against, by what elasticity says.
#include "tools/study/finite_elements.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "tools/study/packages.h"
#include "tools/study/sparse_cholesky.h"

namespace sinew::tools {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

ElasticSolid boxSolid(std::array<int, 3> cells, std::array<double, 3> size) {
  BoxBody box;
  box.cells = cells;
  box.size = size;
  const auto asset = boxPackage(box, {});
  ElasticSolid solid;
  for (const auto& v : asset->package().physicalVertices()) {
    solid.rest.emplace_back(double(v.rest_position[0]), double(v.rest_position[1]), double(v.rest_position[2]));
  }
  for (const auto& t : asset->package().tetrahedra()) {
    solid.tetrahedra.push_back({t.vertex[0], t.vertex[1], t.vertex[2], t.vertex[3]});
  }
  solid.prescribed.resize(solid.rest.size());
  return solid;
}

double volumeOf(const ElasticSolid& solid, double* least) {
  double sum = 0;
  *least = 1e30;
  for (const auto& [a, b, c, d] : solid.tetrahedra) {
    const Vector3d &o = solid.rest[a], &x = solid.rest[b], &y = solid.rest[c], &z = solid.rest[d];
    const double six = (x - o).dot((y - o).cross(z - o));
    sum += six / 6;
    *least = std::min(*least, six / 6);
  }
  return sum;
}

// A uniform deformation is an equilibrium, however large its turn: the inside follows the outside exactly.
TEST(FiniteElements, AUniformDeformationOfTheBoundaryFillsTheInside) {
  ElasticSolid solid = boxSolid({4, 4, 4}, {1, 1, 1});
  const Matrix3d map =
      Eigen::AngleAxisd(1.2, Vector3d(1, 2, 3).normalized()).toRotationMatrix() * Vector3d(1.2, 0.9, 1.05).asDiagonal();
  std::size_t inside = 0;
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.rest[v].cwiseAbs().maxCoeff() > 0.499)
      solid.prescribed[v] = map * solid.rest[v];
    else
      ++inside;
  }
  ASSERT_EQ(inside, 27U);
  const Equilibrium result = equilibrium(solid, {}, 0.3, 1e-10);
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    EXPECT_LT((result.positions[v] - map * solid.rest[v]).norm(), 1e-8);
  }
}

// A long bar, stretched at its ends: in its middle, far from them, it thins by Poisson's ratio.
TEST(FiniteElements, AStretchedBarThinsByPoissonsRatio) {
  for (const double poisson : {0.0, 0.3, 0.45}) {
    ElasticSolid solid = boxSolid({24, 4, 4}, {6, 1, 1});
    for (std::size_t v = 0; v < solid.rest.size(); ++v) {
      const Vector3d& x = solid.rest[v];
      if (std::abs(x[0]) > 2.999) solid.prescribed[v] = Vector3d(x[0] * 1.001, x[1], x[2]);
    }
    const Equilibrium result = equilibrium(solid, {}, poisson, 1e-9);
    double along = 0, across = 0;
    for (std::size_t v = 0; v < solid.rest.size(); ++v) {
      const Vector3d& x = solid.rest[v];
      const Vector3d moved = result.positions[v] - x;
      if (std::abs(std::abs(x[0]) - 0.5) < 1e-3) along += moved[0] / x[0];
      if (std::abs(x[0]) < 1e-3) across += moved[1] * x[1];
    }
    double squares = 0, count = 0;
    for (const Vector3d& x : solid.rest) {
      if (std::abs(x[0]) < 1e-3) squares += x[1] * x[1];
      if (std::abs(std::abs(x[0]) - 0.5) < 1e-3) ++count;
    }
    EXPECT_NEAR(-(across / squares) / (along / count), poisson, 0.01);
  }
}

TEST(FiniteElements, RefinementKeepsTheSolidAndWhatHoldsIt) {
  ElasticSolid solid = boxSolid({2, 3, 2}, {1, 1, 1});
  const Vector3d shift(0.1, 0, 0.2);
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.rest[v][1] < -0.499) solid.prescribed[v] = solid.rest[v] + shift;
  }
  std::vector<Vector3d> shape = solid.rest;
  for (Vector3d& x : shape) x *= 3;
  const ElasticSolid fine = refined(refined(solid, &shape), &shape);
  double least = 0, fine_least = 0;
  EXPECT_NEAR(volumeOf(fine, &fine_least), volumeOf(solid, &least), 1e-12);
  EXPECT_NEAR(fine_least, least / 64, 1e-12);
  ASSERT_EQ(fine.tetrahedra.size(), 64 * solid.tetrahedra.size());
  ASSERT_EQ(shape.size(), fine.rest.size());
  for (std::size_t v = 0; v < fine.rest.size(); ++v) {
    EXPECT_LT((shape[v] - 3 * fine.rest[v]).norm(), 1e-12);
    ASSERT_EQ(fine.prescribed[v].has_value(), fine.rest[v][1] < -0.499);
    EXPECT_LT((fine.prescribed[v].value_or(fine.rest[v] + shift) - fine.rest[v] - shift).norm(), 1e-12);
  }
  const Eigen::Vector4d weights(0.1, 0.2, 0.3, 0.4);
  for (std::uint32_t t = 0; t < solid.tetrahedra.size(); ++t) {
    Vector3d point = Vector3d::Zero();
    for (int k = 0; k < 4; ++k) point += weights[k] * solid.rest[solid.tetrahedra[t][std::size_t(k)]];
    EXPECT_LT((deformedPoint(solid, fine, 2, t, weights, shape) - 3 * point).norm(), 1e-12);
  }
}

// Refined, a solid gives way: what it stores under the same displacements goes down, and the answer settles.
TEST(FiniteElements, TheAnswerSettlesAsElementsShrink) {
  ElasticSolid coarse = boxSolid({4, 2, 2}, {2, 1, 1});
  std::uint32_t corner = 0;
  for (std::uint32_t v = 0; v < coarse.rest.size(); ++v) {
    const Vector3d& x = coarse.rest[v];
    if (x[0] < -0.999) coarse.prescribed[v] = x;
    if (x[0] > 0.999) coarse.prescribed[v] = x + Vector3d(0, 0.3, 0);
    if ((x - Vector3d(0, 0.5, 0.5)).norm() < 1e-3) corner = v;
  }
  std::vector<Vector3d> shape = equilibrium(coarse, {}, 0.3, 1e-8).positions;
  std::vector<Vector3d> at = {shape[corner]};
  ElasticSolid solid = coarse;
  for (int level = 0; level < 3; ++level) {
    solid = refined(solid, &shape);
    shape = equilibrium(solid, std::move(shape), 0.3, 1e-8).positions;
    at.push_back(shape[corner]);
  }
  EXPECT_LT((at[2] - at[1]).norm(), 0.6 * (at[1] - at[0]).norm());
  EXPECT_LT((at[3] - at[2]).norm(), 0.6 * (at[2] - at[1]).norm());
}

// A clamped beam of 1 x 0.2 x 0.2 m under its weight against Timoshenko's; nu 0, so that the wall's hold of the section
// changes nothing. Linear tetrahedra are too stiff by a part that goes with the square of their size: refined once it
// is 5 %, and what is left without it is less than 2 %.
TEST(FiniteElements, ABeamSagsUnderItsWeightAsTimoshenkoSays) {
  constexpr double kYoung = 1e8, kDensity = 1000, kGravity = 9.81;
  ElasticSolid solid = boxSolid({24, 5, 5}, {1, 0.2, 0.2});
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.rest[v][0] < -0.499) solid.prescribed[v] = solid.rest[v];
  }
  std::vector<double> sags, frequencies;
  for (int level = 0; level < 2; ++level) {
    if (level > 0) solid = refined(solid, nullptr);
    ElasticLoad load{{{kYoung, 0}}, {}};
    std::vector<double> masses = nodalVolumes(solid);
    for (double& m : masses) {
      m *= kDensity;
      load.forces.emplace_back(0, -kGravity * m, 0);
    }
    const Equilibrium rest = equilibrium(solid, load, {}, 1e-9);
    EXPECT_TRUE(rest.stable);
    EXPECT_LT(rest.residual, 1e-9);
    double sag = 0, count = 0;
    for (std::size_t v = 0; v < solid.rest.size(); ++v) {
      if (solid.rest[v][0] < 0.499) continue;
      sag -= rest.positions[v][1] - solid.rest[v][1];
      ++count;
    }
    sags.push_back(sag / count);
    frequencies.push_back(lowestFrequency(solid, load.materials, masses));
  }
  const auto withoutError = [](const std::vector<double>& two) { return two[1] + (two[1] - two[0]) / 3; };
  const double area = 0.04, inertia = std::pow(0.2, 4) / 12, weight = kDensity * kGravity * area;
  const double sag = weight / (8 * kYoung * inertia) + weight / (2 * 5.0 / 6 * (0.5 * kYoung) * area);
  EXPECT_NEAR(sags[1], sag, 0.05 * sag);
  EXPECT_NEAR(withoutError(sags), sag, 0.02 * sag);
  // Bernoulli's frequency, of a beam that does not shear, is 2 to 3 % higher than Timoshenko's.
  const double slender = 1.8751 * 1.8751 / (2 * std::numbers::pi) * std::sqrt(kYoung * inertia / (kDensity * area));
  EXPECT_NEAR(withoutError(frequencies), 0.975 * slender, 0.015 * slender);
}

// What hangs by its upper face under its weight is longer by rho g L² / 2 E: nu 0, so it is uniform across.
TEST(FiniteElements, AHungBoxIsLongerByItsWeight) {
  ElasticSolid solid = boxSolid({4, 4, 4}, {1, 1, 1});
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.rest[v][1] > 0.499) solid.prescribed[v] = solid.rest[v];
  }
  ElasticLoad load{{{1e6, 0}}, {}};
  for (const double volume : nodalVolumes(solid)) load.forces.emplace_back(0, -9810 * volume, 0);
  const Equilibrium rest = equilibrium(solid, load, {}, 1e-10);
  EXPECT_TRUE(rest.stable);
  double longer = 0, count = 0;
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.rest[v][1] > -0.499) continue;
    longer -= rest.positions[v][1] - solid.rest[v][1];
    ++count;
  }
  EXPECT_NEAR(longer / count, 9810 / 2e6, 0.01 * 9810 / 2e6);
}

// Far beyond what is small: the same rest from two starts, and one that lasts.
TEST(FiniteElements, ALongBarBentFarComesToOneRest) {
  ElasticSolid solid = boxSolid({16, 2, 2}, {4, 0.4, 0.4});
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.rest[v][0] < -1.999) solid.prescribed[v] = solid.rest[v];
  }
  ElasticLoad load{{{2e5, 0.3}}, {}};
  for (const double volume : nodalVolumes(solid)) load.forces.emplace_back(0, -9810 * volume / 4, 0);
  const Equilibrium once = equilibrium(solid, load, {}, 1e-9);
  EXPECT_LT(once.residual, 1e-9);
  EXPECT_TRUE(once.stable);
  ElasticLoad half = load;
  for (Vector3d& f : half.forces) f *= 0.5;
  const Equilibrium twice = equilibrium(solid, load, equilibrium(solid, half, {}, 1e-6).positions, 1e-9);
  double furthest = 0, apart = 0;
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    furthest = std::max(furthest, (once.positions[v] - solid.rest[v]).norm());
    apart = std::max(apart, (once.positions[v] - twice.positions[v]).norm());
  }
  EXPECT_GT(furthest, 1.0);
  EXPECT_LT(apart, 1e-6);
}

// A distorted mesh between walls that are stretched and turned: every node goes with them.
TEST(QuadraticElements, AUniformDeformationOfTheBoundaryFillsTheInside) {
  ElasticSolid solid = boxSolid({4, 4, 4}, {1, 1, 1});
  const Matrix3d map =
      Eigen::AngleAxisd(1.2, Vector3d(1, 2, 3).normalized()).toRotationMatrix() * Vector3d(1.2, 0.9, 1.05).asDiagonal();
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    Vector3d& x = solid.rest[v];
    if (x.cwiseAbs().maxCoeff() > 0.499) {
      solid.prescribed[v] = map * x;
    } else {
      x += 0.05 * Vector3d(std::sin(7.0 * double(v)), std::sin(11.0 * double(v)), std::sin(13.0 * double(v)));
    }
  }
  double least = 0;
  EXPECT_NEAR(volumeOf(solid, &least), 1, 1e-6);
  ASSERT_GT(least, 0);
  const ElasticSolid whole = quadratic(solid, nullptr);
  const Equilibrium result = equilibrium(whole, ElasticLoad{{{1e5, 0.3}}, {}}, {}, 1e-10);
  EXPECT_TRUE(result.stable);
  std::size_t inside = 0;
  for (std::size_t v = 0; v < whole.rest.size(); ++v) {
    if (!whole.prescribed[v]) ++inside;
    EXPECT_LT((result.positions[v] - map * whole.rest[v]).norm(), 1e-8);
  }
  EXPECT_GT(inside, 100U);
}

// Of a bent, sheared and turned solid; the second derivative is symmetric, too.
TEST(QuadraticElements, DerivativesAreThoseOfDifferences) {
  const ElasticSolid solid = [&] {
    ElasticSolid box = boxSolid({1, 1, 1}, {1, 0.8, 1.1});
    box.prescribed[0] = box.rest[0];
    return quadratic(box, nullptr);
  }();
  ElasticLoad load{{{2.0, 0.3}}, std::vector<Vector3d>(solid.rest.size(), Vector3d(0.1, -0.2, 0.3))};
  std::vector<Vector3d> x = solid.rest;
  const Matrix3d turn = Eigen::AngleAxisd(2, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  for (std::size_t v = 0; v < x.size(); ++v) {
    const auto i = double(v);
    x[v] = turn * (x[v] + Vector3d(0.3 * x[v][1] * x[v][1], 0.4 * x[v][0], 0)) +
           0.05 * Vector3d(std::sin(3 * i), std::sin(5 * i), std::sin(8 * i));
  }
  const ElasticState state = elasticState(solid, load, x);
  EXPECT_LT((state.hessian - state.hessian.transpose()).cwiseAbs().maxCoeff(), 1e-14);
  constexpr double kStep = 1e-5;
  Eigen::Index column = 0;
  for (std::size_t v = 0; v < x.size(); ++v) {
    if (solid.prescribed[v]) continue;
    for (int axis = 0; axis < 3; ++axis, ++column) {
      std::vector<Vector3d> more = x, less = x;
      more[v][axis] += kStep;
      less[v][axis] -= kStep;
      const ElasticState up = elasticState(solid, load, more), down = elasticState(solid, load, less);
      EXPECT_NEAR((up.energy - down.energy) / (2 * kStep), state.gradient[v][axis], 1e-7);
      Eigen::Index row = 0;
      for (std::size_t w = 0; w < x.size(); ++w) {
        if (solid.prescribed[w]) continue;
        const Vector3d change = (up.gradient[w] - down.gradient[w]) / (2 * kStep);
        EXPECT_LT((change - state.hessian.block<3, 1>(row, column)).norm(), 1e-6);
        row += 3;
      }
    }
  }
}

// Its answer, uniform across and quadratic along, is among its functions.
TEST(QuadraticElements, AHungBoxIsLongerByItsWeight) {
  ElasticSolid solid = boxSolid({2, 2, 2}, {1, 1, 1});
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.rest[v][1] > 0.499) solid.prescribed[v] = solid.rest[v];
  }
  std::vector<double> masses = nodalVolumes(solid);
  for (double& m : masses) m *= 1000;
  const ElasticSolid whole = quadratic(solid, nullptr);
  const std::vector<double> weights = nodalMasses(whole, masses);
  ElasticLoad load{{{1e9, 0}}, {}};
  double sum = 0;
  for (const double m : weights) {
    sum += m;
    load.forces.emplace_back(0, -9.81 * m, 0);
  }
  EXPECT_NEAR(sum, 1000, 1e-9);
  EXPECT_LT(weights[0], 0);
  const Equilibrium rest = equilibrium(whole, load, {}, 1e-12);
  for (std::size_t v = 0; v < whole.rest.size(); ++v) {
    const double below = 0.5 - whole.rest[v][1], longer = 9810 / 1e9 * (below - 0.5 * below * below);
    EXPECT_NEAR(whole.rest[v][1] - rest.positions[v][1], longer, 1e-5 * longer + 1e-15);
  }
}

// A density that is not uniform: the sum stays, and the moments of what is linear between vertices.
TEST(QuadraticElements, WeightsAreIntegralsOfTheDensity) {
  const ElasticSolid solid = boxSolid({1, 1, 1}, {1, 1, 1});
  const ElasticSolid whole = quadratic(solid, nullptr);
  const std::vector<double> volumes = nodalVolumes(solid);
  std::vector<double> masses;
  for (std::size_t v = 0; v < volumes.size(); ++v) masses.push_back(volumes[v] * (2 + solid.rest[v][0]));
  const std::vector<double> weights = nodalMasses(whole, masses);
  double sum = 0, first = 0, second = 0;
  for (std::size_t v = 0; v < weights.size(); ++v) {
    sum += weights[v];
    first += weights[v] * whole.rest[v][0];
    second += weights[v] * whole.rest[v][0] * whole.rest[v][0];
  }
  EXPECT_NEAR(sum, 2, 1e-7);  // of 2 + x over -1/2..1/2, times 1, x, x²
  EXPECT_NEAR(first, 1.0 / 12, 1e-7);
  EXPECT_NEAR(second, 2.0 / 12, 1e-7);
}

struct Bar {
  ElasticSolid solid;
  std::vector<double> masses;
};

// A clamped bar of a density of 1000 and a square section. \param across cells. \param along cells.
Bar clampedBar(int along, int across, double length, double side) {
  Bar bar{boxSolid({along, across, across}, {length, side, side}), {}};
  for (std::size_t v = 0; v < bar.solid.rest.size(); ++v) {
    if (bar.solid.rest[v][0] < -0.499 * length) bar.solid.prescribed[v] = bar.solid.rest[v];
  }
  bar.masses = nodalVolumes(bar.solid);
  for (double& m : bar.masses) m *= 1000;
  return bar;
}

// How far its end goes down. \param refinements into eight.
double sagOf(Bar bar, int refinements, bool as_quadratic, double young, double gravity) {
  for (int i = 0; i < refinements; ++i) {
    bar.solid = refined(bar.solid, nullptr);
    bar.masses = nodalVolumes(bar.solid);
    for (double& m : bar.masses) m *= 1000;
  }
  const auto vertices = bar.solid.rest.size();
  if (as_quadratic) bar.solid = quadratic(bar.solid, nullptr);
  ElasticLoad load{{{young, 0}}, {}};
  for (const double m : nodalMasses(bar.solid, bar.masses)) load.forces.emplace_back(0, -gravity * m, 0);
  const Equilibrium rest = equilibrium(bar.solid, load, {}, 1e-9);
  EXPECT_TRUE(rest.stable);
  EXPECT_LT(rest.residual, 1e-9);
  double end = -1e300, sag = 0, count = 0;
  for (const Vector3d& x : bar.solid.rest) end = std::max(end, x[0]);
  for (std::size_t v = 0; v < vertices; ++v) {
    if (bar.solid.rest[v][0] < end - 1e-6) continue;
    sag -= rest.positions[v][1] - bar.solid.rest[v][1];
    ++count;
  }
  return sag / count;
}

// One or two cells through the thickness, where linear tetrahedra lock; nu 0, as above.
TEST(QuadraticElements, ACoarseSlenderBeamSagsAsTimoshenkoSays) {
  constexpr double kYoung = 1e9, kSide = 0.1, kGravity = 1;
  const double area = kSide * kSide, inertia = area * area / 12, weight = 1000 * kGravity * area;
  const double sag = weight / (8 * kYoung * inertia) + weight / (2 * 5.0 / 6 * (0.5 * kYoung) * area);
  for (const int across : {1, 2}) {
    const Bar bar = clampedBar(10 * across, across, 1, kSide);
    const double linear = sagOf(bar, 0, false, kYoung, kGravity) / sag,
                 whole = sagOf(bar, 0, true, kYoung, kGravity) / sag;
    std::printf("%d across: linear %.4f, quadratic %.4f of Timoshenko's sag\n", across, linear, whole);
    EXPECT_NEAR(whole, 1, 0.02);
    EXPECT_LT(linear, across == 1 ? 0.5 : 0.8);
  }
}

// Sag of the end of a thin clamped beam of length 1 under its weight w a length: Euler's elastica, E I theta'' =
// -w (1 - s) cos theta, theta(0) = theta'(1) = 0, by shooting. \param load w / E I
double elasticaSag(double load) {
  constexpr int kSteps = 2000;
  constexpr double h = 1.0 / kSteps;
  double sag = 0;
  const auto bendAtEnd = [&](double bend) {
    double theta = 0;
    sag = 0;
    for (int i = 0; i < kSteps; ++i) {  // midpoint rule
      const double s = h * i, half_theta = theta + 0.5 * h * bend;
      const double half_bend = bend - 0.5 * h * load * (1 - s) * std::cos(theta);
      sag += h * std::sin(half_theta);
      theta += h * half_bend;
      bend -= h * load * (1 - s - 0.5 * h) * std::cos(half_theta);
    }
    return bend;
  };
  double low = 0, high = load;
  for (int i = 0; i < 60; ++i) (bendAtEnd(0.5 * (low + high)) < 0 ? low : high) = 0.5 * (low + high);
  return sag;
}

// A table of large deflections, one cell through the thickness.
TEST(QuadraticElements, LargeDeflectionsAreThoseOfTheElastica) {
  constexpr double kSide = 0.05;
  EXPECT_NEAR(elasticaSag(0.01), 0.01 / 8, 1e-6);  // as of small ones
  const Bar bar = clampedBar(20, 1, 1, kSide);
  double last = 0;
  for (const double load : {0.5, 1.0, 2.0, 4.0, 8.0, 16.0}) {
    const double young = 12 * 1000 / (load * kSide * kSide), wanted = elasticaSag(load);
    const double sag = sagOf(bar, 0, true, young, 1);
    std::printf("w L^3 / E I = %4.1f: quadratic %.4f, elastica %.4f, small deflections %.4f\n", load, sag, wanted,
                load / 8);
    EXPECT_NEAR(sag, wanted, 0.01 * wanted);
    EXPECT_GT(sag, last);
    last = sag;
  }
  EXPECT_GT(last, 0.7);
}

// Bent so far that its end hangs: one cell through the thickness against three times as fine.
TEST(QuadraticElements, ACoarseBeamBentFarIsNearItsLimit) {
  constexpr double kYoung = 2e6, kGravity = 20;
  const double coarse = sagOf(clampedBar(10, 1, 1, 0.1), 0, true, kYoung, kGravity);
  const double fine = sagOf(clampedBar(30, 3, 1, 0.1), 0, true, kYoung, kGravity);
  const double linear = sagOf(clampedBar(10, 1, 1, 0.1), 0, false, kYoung, kGravity);
  std::printf("bent far: linear %.4f, quadratic %.4f, finer %.4f m\n", linear, coarse, fine);
  EXPECT_GT(fine, 0.5);
  EXPECT_NEAR(coarse, fine, 0.01 * fine);
  EXPECT_LT(linear, 0.8 * fine);
}

// Softer than linear tetrahedra cut into eight, and into eight again; those come towards it.
TEST(QuadraticElements, LinearOnesCutIntoEightComeTowardsThem) {
  const Bar bar = clampedBar(8, 2, 1, 0.25);
  std::vector<double> linear, whole;
  for (int level = 0; level < 3; ++level) linear.push_back(sagOf(bar, level, false, 1e6, 2));
  for (int level = 0; level < 2; ++level) whole.push_back(sagOf(bar, level, true, 1e6, 2));
  std::printf("linear, cut 0, 1, 2 times: %.5f %.5f %.5f; quadratic, 0, 1: %.5f %.5f m\n", linear[0], linear[1],
              linear[2], whole[0], whole[1]);
  EXPECT_LT(linear[0], linear[1]);
  EXPECT_LT(linear[1], linear[2]);
  EXPECT_GT(whole[0], linear[2]);
  EXPECT_NEAR(whole[0], whole[1], 0.005 * whole[1]);
}

// Forces as strong as asked: what they do is what the same forces do by themselves.
TEST(QuadraticElements, ATargetIsMetByStrongerForces) {
  const Bar bar = clampedBar(8, 2, 1, 0.25);
  const ElasticSolid solid = quadratic(bar.solid, nullptr);
  ElasticLoad load{{{1e6, 0.3}}, {}};
  for (const double m : nodalMasses(solid, bar.masses)) load.forces.emplace_back(0, -m, 0);
  ElasticTarget target{{}, 0.2};
  for (std::uint32_t v = 0; v < bar.solid.rest.size(); ++v) {
    if (!solid.prescribed[v]) target.nodes.push_back(v);
  }
  const Equilibrium found = equilibrium(solid, load, {}, 1e-9, &target);
  double square = 0;
  for (const std::uint32_t v : target.nodes) square += (found.positions[v] - solid.rest[v]).squaredNorm();
  EXPECT_NEAR(std::sqrt(square / double(target.nodes.size())), 0.2, 1e-6);
  EXPECT_GT(found.strength, 1.5);
  for (Vector3d& f : load.forces) f *= found.strength;
  const Equilibrium again = equilibrium(solid, load, {}, 1e-9);
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    EXPECT_LT((again.positions[v] - found.positions[v]).norm(), 1e-7);
  }
}

// Random blocks between near points, against a dense factor.
TEST(SparseCholesky, SolvesAsADenseFactorDoes) {
  BlockPattern pattern;
  std::vector<Matrix3d> blocks;
  Eigen::MatrixXd dense;
  const ElasticSolid box = boxSolid({6, 3, 3}, {2, 1, 1});
  const auto count = std::uint32_t(box.rest.size());
  dense.setZero(3 * count, 3 * count);
  double seed = 0;
  for (std::uint32_t c = 0; c < count; ++c) {
    for (std::uint32_t r = c; r < count; ++r) {
      if ((box.rest[r] - box.rest[c]).norm() > 0.5) continue;
      Matrix3d block;
      for (double& number : block.reshaped()) number = std::sin(seed += 1.7);
      if (r == c) block = (block + block.transpose() + 60 * Matrix3d::Identity()).eval();
      pattern.row.push_back(r);
      blocks.push_back(block);
      dense.block<3, 3>(3 * r, 3 * c) = block;
      dense.block<3, 3>(3 * c, 3 * r) = block.transpose();
    }
    pattern.first.push_back(pattern.row.size());
  }
  Eigen::MatrixXd right(3 * count, 2);
  for (double& number : right.reshaped()) number = std::sin(seed += 1.7);
  SparseCholesky solver(pattern);
  ASSERT_TRUE(solver.factorize(blocks));
  const Eigen::MatrixXd found = solver.solve(right);
  EXPECT_LT((dense * found - right).cwiseAbs().maxCoeff(), 1e-12);
  // Another matrix of the pattern, which is not positive, and the first one again.
  std::vector<Matrix3d> other = blocks;
  other[pattern.first[count / 2]](1, 1) = -1;
  EXPECT_FALSE(solver.factorize(other));
  ASSERT_TRUE(solver.factorize(blocks));
  EXPECT_EQ(solver.solve(right), found);
}

// Without forces it is what equilibrium() without a load finds.
TEST(FiniteElements, BothSolversFindTheSameRest) {
  ElasticSolid solid = boxSolid({4, 3, 3}, {2, 1, 1});
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    const Vector3d& x = solid.rest[v];
    if (x[0] < -0.999) solid.prescribed[v] = x;
    if (x[0] > 0.999) solid.prescribed[v] = Eigen::AngleAxisd(0.5, Vector3d::UnitX()) * x + Vector3d(0.1, 0.2, 0);
  }
  const std::vector<Vector3d> one = equilibrium(solid, {}, 0.3, 1e-10).positions;
  const std::vector<Vector3d> other = equilibrium(solid, ElasticLoad{{{1e5, 0.3}}, {}}, {}, 1e-10).positions;
  for (std::size_t v = 0; v < one.size(); ++v) EXPECT_LT((one[v] - other[v]).norm(), 1e-8);
}

}  // namespace
}  // namespace sinew::tools

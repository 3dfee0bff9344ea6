// SPDX-License-Identifier: GPL-3.0-or-later
//
// The parts of `sinew bench` that can be wrong without anybody noticing: the bodies it measures, the references, the
// bounds.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "tools/bench/answers.h"
#include "tools/bench/bounds.h"
#include "tools/bench/lattice.h"
#include "tools/bench/timing.h"

namespace sinew::tools {
namespace {

TEST(Lattice, HasTheSizesAskedForAndFields) {
  LatticeOptions options;
  options.points = {8, 9, 5};
  options.boxes = {2, 3, 1};
  options.memberships = 2;
  options.visual_vertices = 1000;
  const LatticeBody body = makeLattice(options);
  EXPECT_EQ(body.vertices, 360U);
  EXPECT_EQ(body.clusters, 6U);
  EXPECT_NEAR(body.membershipsPerVertex(), 2, 0.3);
  EXPECT_EQ(body.asset->package().visualPositions().size(), 1000U);
  EXPECT_EQ(body.asset->package().tetrahedra().size(), 7U * 8U * 4U * 5U);
  ASSERT_EQ(body.asset->package().fields().size(), 1U);
  EXPECT_EQ(body.asset->package().fields()[0].function_count, 32U);
}

TEST(Answers, AreHalfAsLargeOfWhatIsTwiceAsStiff) {
  LatticeOptions options;
  options.points = {9, 7, 5};
  options.visual_vertices = 400;
  const LatticeBody body = makeLattice(options);
  const Answers answers(body.asset->package());
  EXPECT_LT(answers.errorOf(body.asset->package()), 1e-12);
  LatticeOptions stiffer = options;
  for (double* hz : {&stiffer.stretch_hz, &stiffer.bend_hz, &stiffer.twist_hz}) *hz *= std::sqrt(2.0);
  EXPECT_NEAR(answers.errorOf(makeLattice(stiffer).asset->package()), 0.5, 1e-3);
}

TEST(Answers, CompareMeshesByWhatIsDrawn) {
  LatticeOptions options;
  options.points = {13, 9, 7};
  options.visual_vertices = 400;
  const Answers answers(makeLattice(options).asset->package());
  double before = 1;
  for (const std::uint32_t points : {3U, 5U, 7U}) {
    LatticeOptions coarser = options;
    coarser.points = {points + points / 2, points, points - points / 4};
    coarser.boxes = {1, 1, 1};
    const double error = answers.errorOf(makeLattice(coarser).asset->package());
    std::printf("%u points along y: off by %.3f\n", points, error);
    EXPECT_LT(error, before);
    before = error;
  }
  LatticeOptions other = options;
  other.visual_vertices = 300;
  EXPECT_TRUE(std::isinf(answers.errorOf(makeLattice(other).asset->package())));
}

TEST(Lattice, VisualVerticesLieWithinTheirTetrahedra) {
  LatticeOptions options;
  options.points = {6, 7, 5};
  options.boxes = {2, 2, 2};
  options.visual_vertices = 500;
  const LatticeBody body = makeLattice(options);
  const formats::PackageView& package = body.asset->package();
  for (std::size_t i = 0; i < 500; ++i) {
    const auto& attachment = package.barycentric()[i];
    const auto& corners = package.tetrahedra()[attachment.tetrahedron].vertex;
    const std::array<float, 4> weights = {attachment.weight[0], attachment.weight[1], attachment.weight[2],
                                          1 - attachment.weight[0] - attachment.weight[1] - attachment.weight[2]};
    for (std::size_t k = 0; k < 3; ++k) {
      float x = 0;
      for (std::size_t c = 0; c < 4; ++c) x += weights[c] * package.physicalVertices()[corners[c]].rest_position[k];
      EXPECT_NEAR(x, package.visualPositions()[i][k], 1e-6F);
    }
    for (const float weight : weights) EXPECT_GE(weight, -1e-5F);
  }
}

TEST(Lattice, ClustersWithoutOverlapHaveWholeBoxes) {
  LatticeOptions options;
  options.points = {16, 8, 4};
  options.boxes = {4, 2, 2};
  options.memberships = 1;
  const LatticeBody body = makeLattice(options);
  EXPECT_EQ(body.memberships, body.vertices);
  for (const formats::Cluster& cluster : body.asset->package().clusters()) EXPECT_EQ(cluster.member_count, 32U);
}

TEST(Bounds, TheSlowerOfArithmeticAndTrafficDecides) {
  MachineLimits machine;
  machine.fma_flops = 100e9;
  machine.copies = {{1000, 200e9, 0}, {100'000, 50e9, 0}};
  EXPECT_DOUBLE_EQ(boundSeconds({100, 10}, machine, 500), 1e-9);
  EXPECT_DOUBLE_EQ(boundSeconds({1, 400}, machine, 1000), 2e-9);
  EXPECT_DOUBLE_EQ(boundSeconds({1, 400}, machine, 1001), 8e-9);
  EXPECT_DOUBLE_EQ(boundSeconds({1, 400}, machine, 1'000'000), 8e-9);  // beyond what was measured: the last
}

TEST(Timing, Quantiles) {
  EXPECT_DOUBLE_EQ(quantile({3, 1, 2}, 0.5), 2);
  EXPECT_DOUBLE_EQ(quantile({4, 1, 2, 3}, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(quantile({1, 2}, 0.25), 1.25);
  EXPECT_DOUBLE_EQ(quantile({}, 0.5), 0);
}

TEST(Timing, PairsAreComparedSampleBySample) {
  // Both slow down threefold half way, as on a machine that others use: the ratio does not see it.
  int first = 0, second = 0;
  const TimingPair pair =
      measureSamplePairs([&] { return ++first > 4 ? 3.0 : 1.0; }, [&] { return ++second > 4 ? 6.0 : 2.0; }, {0, 0});
  EXPECT_GE(pair.first.samples, 7U);
  EXPECT_EQ(first, second);
  EXPECT_DOUBLE_EQ(pair.ratio, 2);
  EXPECT_DOUBLE_EQ(pair.spread, 0);
}

}  // namespace
}  // namespace sinew::tools

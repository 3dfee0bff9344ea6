// SPDX-License-Identifier: GPL-3.0-or-later
//
// The parts of `sinew bench` that can be wrong without anybody noticing: the bodies it measures, the references, the
// bounds.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "tests/benchmarks/eigen_reference.h"
#include "tools/bench/bounds.h"
#include "tools/bench/lattice.h"
#include "tools/bench/timing.h"

namespace sinew::tools {
namespace {

TEST(Lattice, HasTheSizesAskedFor) {
  LatticeOptions options;
  options.points = {20, 25, 10};
  options.boxes = {4, 8, 2};
  options.visual_vertices = 1000;
  const LatticeBody body = makeLattice(options);
  EXPECT_EQ(body.vertices, 5000U);
  EXPECT_EQ(body.clusters, 64U);
  EXPECT_NEAR(body.membershipsPerVertex(), 2.5, 0.1);
  EXPECT_EQ(body.asset->package().visualPositions().size(), 1000U);
  EXPECT_EQ(body.asset->package().tetrahedra().size(), 19U * 24U * 9U * 5U);
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

// The reference on a body that is only turned and moved: whatever the stiffness, each goal is the turned vertex.
template <int N>
void expectRigidMotionIsKept(formats::ClusterMode mode) {
  LatticeOptions options;
  options.points = {9, 8, 7};
  options.boxes = {2, 2, 2};
  options.mode = mode;
  const LatticeBody body = makeLattice(options);
  const Eigen::Matrix3f turn = Eigen::AngleAxisf(2.5F, Eigen::Vector3f(1, -2, 0.5F).normalized()).toRotationMatrix();
  std::vector<Vec3> y, goals(body.vertices);
  for (const formats::PhysicalVertex& vertex : body.asset->package().physicalVertices()) {
    const Eigen::Vector3f x =
        turn * Eigen::Map<const Eigen::Vector3f>(vertex.rest_position.data()) + Eigen::Vector3f(1, 2, 3);
    y.push_back({x[0], x[1], x[2]});
  }
  for (const auto method : {benchmarks::RotationMethod::polar, benchmarks::RotationMethod::svd}) {
    for (const float kept : {0.0F, 0.5F, 1.0F}) {
      benchmarks::EigenReference<N> reference(body.asset->package(), kept);
      reference.match(y, goals, method);
      for (std::size_t v = 0; v < y.size(); ++v) {
        for (std::size_t k = 0; k < 3; ++k) ASSERT_NEAR(goals[v][k], y[v][k], 1e-5F);
      }
    }
  }
}
TEST(EigenReference, LinearKeepsRigidMotion) { expectRigidMotionIsKept<3>(formats::ClusterMode::linear); }
TEST(EigenReference, QuadraticKeepsRigidMotion) { expectRigidMotionIsKept<9>(formats::ClusterMode::quadratic); }

// A linear map of the whole body is what linear clusters that keep all of a deformation give back, whatever the
// overlaps; a rigid one is not.
TEST(EigenReference, LinearKeepsAffineMaps) {
  LatticeOptions options;
  options.points = {9, 8, 7};
  options.boxes = {2, 2, 2};
  options.mode = formats::ClusterMode::linear;
  const LatticeBody body = makeLattice(options);
  Eigen::Matrix3f map;
  map << 1.2F, 0.1F, 0, -0.1F, 0.9F, 0.2F, 0.05F, 0, 1.1F;
  std::vector<Vec3> y, goals(body.vertices);
  for (const formats::PhysicalVertex& vertex : body.asset->package().physicalVertices()) {
    const Eigen::Vector3f x = map * Eigen::Map<const Eigen::Vector3f>(vertex.rest_position.data());
    y.push_back({x[0], x[1], x[2]});
  }
  const auto farthest = [&](float kept) {
    benchmarks::EigenReference<3> reference(body.asset->package(), kept);
    reference.match(y, goals);
    float distance = 0;
    for (std::size_t v = 0; v < y.size(); ++v) {
      for (std::size_t k = 0; k < 3; ++k) distance = std::max(distance, std::abs(goals[v][k] - y[v][k]));
    }
    return distance;
  };
  EXPECT_LT(farthest(1), 1e-5F);
  EXPECT_GT(farthest(0), 1e-2F);
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

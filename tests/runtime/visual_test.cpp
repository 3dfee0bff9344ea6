// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using formats::ClusterMode;

struct Visual {
  std::vector<Vec3> positions, normals;
};

Visual visualOf(const World& world, BodyId body) {
  Visual v;
  const std::size_t count = world.asset(body).package().visualPositions().size();
  v.positions.resize(count);
  v.normals.resize(count);
  world.visualVertices(body, {v.positions[0].data(), 12, std::uint32_t(count)},
                       {v.normals[0].data(), 12, std::uint32_t(count)});
  return v;
}

TEST(Visual, RestShapeIsReproduced) {
  for (const bool cluster_attachment : {false, true}) {
    for (const ClusterMode mode : {ClusterMode::rigid, ClusterMode::linear, ClusterMode::quadratic}) {
      BoxOptions box;
      box.mode = mode;
      box.clusters = {2, 2, 1};
      box.cluster_attachment = cluster_attachment;
      World world(weightless());
      const BodyId body = *world.addBody(boxAsset(box));
      const auto& package = world.asset(body).package();
      const Visual v = visualOf(world, body);
      for (std::size_t i = 0; i < v.positions.size(); ++i) {
        const double error = (wide(v.positions[i]) - wide(package.visualPositions()[i])).norm();
        ASSERT_LT(error, 1e-6 * double(package.info().diagonal));
        ASSERT_LT((wide(v.normals[i]) - wide(package.visualNormals()[i])).norm(), 1e-5);
      }
    }
  }
}

TEST(Visual, NormalsFollowAffineMapsByTheCofactor) {
  Matrix3d shear;
  shear << 1.3, 0.4, 0, 0, 0.7, 0.1, 0.2, 0, 1.1;
  const Matrix3d turn = Eigen::AngleAxisd(0.9, Vector3d(1, -1, 2).normalized()).toRotationMatrix();
  for (const bool cluster_attachment : {false, true}) {
    for (const ClusterMode mode : {ClusterMode::linear, ClusterMode::quadratic}) {
      for (const Matrix3d& map : {Matrix3d(turn), Matrix3d(turn * shear)}) {
        BoxOptions box;
        box.mode = mode;
        box.clusters = {2, 2, 1};
        box.cluster_attachment = cluster_attachment;
        World world(weightless());
        const BodyId body = *world.addBody(boxAsset(box));
        const auto& package = world.asset(body).package();
        std::vector<Vec3> x;
        for (const Vec3& p : world.positions(body)) {
          const Vector3d moved = map * wide(p) + Vector3d(1, 2, 3);
          x.push_back({float(moved[0]), float(moved[1]), float(moved[2])});
        }
        world.setState(body, x, {});
        const Visual v = visualOf(world, body);
        const Matrix3d cofactor = map.determinant() * map.inverse().transpose();
        for (std::size_t i = 0; i < v.normals.size(); ++i) {
          const Vector3d expected = (cofactor * wide(package.visualNormals()[i])).normalized();
          ASSERT_LT((wide(v.normals[i]) - expected).norm(), 1e-4);
          const Vector3d place = map * wide(package.visualPositions()[i]) + Vector3d(1, 2, 3);
          ASSERT_LT((wide(v.positions[i]) - place).norm(), 1e-5);
        }
      }
    }
  }
}

// y += k x² about z: the exact deformation gradient is known at each vertex. \return the largest error of a normal.
double bentNormalError(ClusterMode mode, std::uint32_t fineness) {
  BoxOptions box;
  box.cells = {10 * fineness, 3 * fineness, 3 * fineness};
  box.size = {2, 0.3F, 0.3F};
  box.mode = mode;
  World world(weightless());
  const BodyId body = *world.addBody(boxAsset(box));
  const auto& package = world.asset(body).package();
  const double k = 0.3;
  std::vector<Vec3> x;
  for (const Vec3& p : world.positions(body)) x.push_back({p[0], p[1] + float(k) * p[0] * p[0], p[2]});
  world.setState(body, x, {});
  const Visual v = visualOf(world, body);
  double largest = 0;
  for (std::size_t i = 0; i < v.normals.size(); ++i) {
    Matrix3d gradient = Matrix3d::Identity();
    gradient(1, 0) = 2 * k * double(package.visualPositions()[i][0]);
    const Vector3d expected = (gradient.inverse().transpose() * wide(package.visualNormals()[i])).normalized();
    largest = std::max(largest, (wide(v.normals[i]) - expected).norm());
  }
  return largest;
}

TEST(Visual, NormalsOfABentBeamTurnWithTheBend) {
  // Normals at the ends turn by 0.6 rad. Tetrahedra have one gradient each: at most half a cell (0.1 m) away from a
  // vertex, where it differs by 2 k 0.1; what moves the beam, one linear cluster or a quadratic one, does not matter.
  for (const ClusterMode mode : {ClusterMode::linear, ClusterMode::quadratic}) {
    const double coarse = bentNormalError(mode, 1), fine = bentNormalError(mode, 2);
    EXPECT_LT(coarse, 0.06);
    EXPECT_LT(fine, 0.6 * coarse);  // first order
  }
}

TEST(Visual, WritesOnlyWhatItIsAskedTo) {
  World world(weightless());
  const BodyId body = *world.addBody(boxAsset({}));
  const auto& package = world.asset(body).package();
  // Interleaved position, normal and two floats of the caller's; only the first five vertices.
  std::vector<float> buffer(8 * 10, -7.0F);
  world.visualVertices(body, {buffer.data(), 32, 5}, {buffer.data() + 3, 32, 5});
  for (std::size_t i = 0; i < 10; ++i) {
    for (std::size_t k = 0; k < 8; ++k) {
      const float value = buffer[8 * i + k];
      if (i >= 5 || k >= 6) {
        EXPECT_EQ(value, -7.0F);
      } else if (k < 3) {
        EXPECT_FLOAT_EQ(value, package.visualPositions()[i][k]);
      } else {
        EXPECT_NEAR(value, package.visualNormals()[i][k - 3], 1e-5F);
      }
    }
  }
  world.visualVertices(body, {}, {});
}

TEST(Visual, NormalsAreUnitInTheWorstStates) {
  for (const bool cluster_attachment : {false, true}) {
    BoxOptions box;
    box.clusters = {2, 2, 2};
    box.cluster_attachment = cluster_attachment;
    World world(weightless());
    const BodyId body = *world.addBody(boxAsset(box));
    std::vector<Vec3> x(world.positions(body).size(), Vec3{1, 1, 1});
    world.setState(body, x, {});
    for (int i = 0; i < 3; ++i) {
      for (const Vec3& n : visualOf(world, body).normals) ASSERT_NEAR(wide(n).norm(), 1, 1e-5);
      world.step(1.0F / 60);
    }
  }
}

}  // namespace
}  // namespace sinew::test

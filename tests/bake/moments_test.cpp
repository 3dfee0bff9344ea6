// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/moments.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "tests/bake/box_mesh.h"

namespace sinew::tools {
namespace {

std::vector<formats::PhysicalVertex> verticesOf(const PhysicalMesh& mesh) {
  std::vector<formats::PhysicalVertex> vertices;
  for (const auto& x : mesh.positions) {
    vertices.push_back({{float(x[0]), float(x[1]), float(x[2])}, 1.0F + float(vertices.size() % 3)});
  }
  return vertices;
}

TEST(Moments, SharesAndMassesAddUp) {
  const PhysicalMesh mesh = latticeMesh({10, 4, 4}, 0.1);
  const auto vertices = verticesOf(mesh);
  std::vector<Finding> findings;
  ClusterOptions options;
  options.grid = {3, 2, 1};
  const auto constants = clusterConstants(gridClusters(mesh, options, findings), vertices, options, findings);
  std::vector<double> share(vertices.size(), 0);
  double cluster_mass = 0;
  for (const auto& cluster : constants.clusters) {
    double mu = 0;
    for (std::uint32_t m = 0; m < cluster.member_count; ++m) {
      const auto& member = constants.memberships[cluster.first_member + m];
      mu += double(member.mu);
      share[member.vertex] += double(member.share);
    }
    EXPECT_NEAR(mu, 1, 1e-5);
    cluster_mass += double(cluster.mass);
  }
  for (double s : share) EXPECT_NEAR(s, 1, 1e-5);
  double mass = 0;
  for (const auto& v : vertices) mass += double(v.mass);
  EXPECT_NEAR(cluster_mass, mass, 1e-4 * mass);  // mu_ic = m_i w_ic / W_i hands every gram out once
}

TEST(Moments, TheQuadraticInverseInvertsItsMoment) {
  const PhysicalMesh mesh = latticeMesh({5, 4, 4}, 0.1);
  const auto vertices = verticesOf(mesh);
  std::vector<Finding> findings;
  ClusterOptions options;
  options.grid = {1, 1, 1};
  const auto constants = clusterConstants(gridClusters(mesh, options, findings), vertices, options, findings);
  ASSERT_EQ(constants.clusters.size(), 1U);
  const formats::Cluster& cluster = constants.clusters[0];
  ASSERT_EQ(cluster.mode, formats::ClusterMode::quadratic);
  Eigen::Matrix<double, 9, 9> moment = Eigen::Matrix<double, 9, 9>::Zero();
  Eigen::Matrix<double, 9, 1> mean = Eigen::Matrix<double, 9, 1>::Zero();
  for (const auto& member : constants.memberships) {
    Eigen::Matrix<double, 9, 1> q;
    for (int k = 0; k < 3; ++k) {
      q[k] = double(vertices[member.vertex].rest_position[std::size_t(k)] - cluster.rest_center[std::size_t(k)]) /
             double(cluster.radius);
    }
    q.tail<6>() << q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0];
    moment += double(member.mu) * q * q.transpose();
    mean += double(member.mu) * q;
  }
  moment -= mean * mean.transpose();
  Eigen::Matrix<double, 9, 9> inverse;
  std::size_t at = 0;
  for (int row = 0; row < 9; ++row) {
    for (int column = 0; column <= row; ++column) {
      inverse(row, column) = inverse(column, row) = double(constants.quadratic_moments[0].a_qq[at++]);
    }
  }
  EXPECT_LT((inverse * moment - Eigen::Matrix<double, 9, 9>::Identity()).norm(), 1e-3);
}

TEST(Moments, AFlatClusterBecomesRigidAndIsNamed) {
  std::vector<formats::PhysicalVertex> vertices;
  ClusterSource sheet;
  sheet.name = "sheet";
  sheet.mode = formats::ClusterMode::quadratic;
  for (int x = 0; x < 5; ++x) {
    for (int z = 0; z < 5; ++z) {
      sheet.vertices.push_back(std::uint32_t(vertices.size()));
      sheet.weights.push_back(1);
      vertices.push_back({{float(x), 0.0F, float(z)}, 1.0F});
    }
  }
  std::vector<Finding> findings;
  const auto constants = clusterConstants(std::vector{sheet}, vertices, {}, findings);
  EXPECT_EQ(constants.clusters[0].mode, formats::ClusterMode::rigid);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_NE(findings[0].place.find("sheet"), std::string::npos);
}

// On the six corners of a prism x², y² and x y are linear functions of x and y; on the eight of a box x y is none, and
// x² is constant. As quadratic clusters prisms shook themselves to pieces on the ground.
TEST(Moments, APrismIsMadeLinearAndABoxIsNot) {
  for (const int corners : {3, 4}) {
    std::vector<formats::PhysicalVertex> vertices;
    ClusterSource cell;
    cell.name = "cell";
    cell.mode = formats::ClusterMode::quadratic;
    for (int i = 0; i < 2 * corners; ++i) {
      cell.vertices.push_back(std::uint32_t(i));
      cell.weights.push_back(1);
      const int corner = i % corners;
      vertices.push_back({{corner == 1 || corner == 3 ? 1.0F : 0.0F, corner >= 2 ? 0.8F : 0.0F, float(i / corners)},
                          1.0F + 0.3F * float(corner)});
    }
    std::vector<Finding> findings;
    const auto constants = clusterConstants(std::vector{cell}, vertices, {}, findings);
    EXPECT_EQ(constants.clusters[0].mode,
              corners == 3 ? formats::ClusterMode::linear : formats::ClusterMode::quadratic);
    EXPECT_EQ(findings.size(), corners == 3 ? 1U : 0U);
  }
}

}  // namespace
}  // namespace sinew::tools

// SPDX-License-Identifier: MIT
//
// One pass of the runtime against a reference written differently: in double, with the normal equations of the fit
// solved from the members, the rotation by SVD, and no shared code but the package's bytes.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <numbers>
#include <random>

#include "sinew/runtime/world.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using formats::ClusterMode;

Vector3d toVector(const Vec3& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

VectorXd basis(const Vector3d& q, ClusterMode mode) {
  if (mode != ClusterMode::quadratic) return q;
  VectorXd b(9);
  b << q, q.cwiseProduct(q), q[0] * q[1], q[1] * q[2], q[2] * q[0];
  return b;
}

// The rigid motion from the rest shape that is nearest to positions x.
struct Pose {
  Vector3d center, rest_center;
  Matrix3d rotation;
  Vector3d at(const Vector3d& rest) const { return center + rotation * (rest - rest_center); }
};

Pose bestPose(const formats::PackageContent& content, const std::vector<Vector3d>& x) {
  Pose pose{Vector3d::Zero(), Vector3d::Zero(), Matrix3d::Zero()};
  double mass = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double m = double(content.physical_vertices[i].mass);
    mass += m;
    pose.center += m * x[i];
    pose.rest_center += m * toVector(content.physical_vertices[i].rest_position);
  }
  pose.center /= mass;
  pose.rest_center /= mass;
  Matrix3d moment = Matrix3d::Zero();
  for (std::size_t i = 0; i < x.size(); ++i) {
    const auto& vertex = content.physical_vertices[i];
    moment +=
        double(vertex.mass) * (x[i] - pose.center) * (toVector(vertex.rest_position) - pose.rest_center).transpose();
  }
  const Eigen::JacobiSVD<Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  pose.rotation = svd.matrixU() * Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  return pose;
}

// Positions after one pass of length h from positions x at rest, no gravity.
std::vector<Vector3d> referencePass(const formats::PackageContent& content, const std::vector<Vector3d>& x, double h) {
  std::vector<Vector3d> moved(x.size(), Vector3d::Zero());
  double part_mass = 0, part_second = 0;
  Vector3d part_first = Vector3d::Zero();
  for (const auto& vertex : content.physical_vertices) {
    part_mass += double(vertex.mass);
    part_first += double(vertex.mass) * toVector(vertex.rest_position);
    part_second += double(vertex.mass) * toVector(vertex.rest_position).squaredNorm();
  }
  const double part_gyration = std::sqrt(part_second / part_mass - (part_first / part_mass).squaredNorm());

  const Pose part = bestPose(content, x);
  for (const formats::Cluster& cluster : content.clusters) {
    const std::size_t n = cluster.member_count;
    MatrixXd b(n, cluster.mode == ClusterMode::quadratic ? 9 : 3), p(n, 3);
    VectorXd mu(n);
    Vector3d center = Vector3d::Zero(), rest_center = Vector3d::Zero();
    for (std::size_t k = 0; k < n; ++k) {
      const auto& member = content.memberships[cluster.first_member + k];
      const auto& vertex = content.physical_vertices[member.vertex];
      mu[Eigen::Index(k)] = double(vertex.mass) * double(member.share);
      center += mu[Eigen::Index(k)] * x[member.vertex];
      rest_center += mu[Eigen::Index(k)] * toVector(vertex.rest_position);
    }
    const double mass = mu.sum();
    center /= mass;
    rest_center /= mass;
    const double radius = double(cluster.radius);
    double gyration = 0;
    for (std::size_t k = 0; k < n; ++k) {
      const auto& member = content.memberships[cluster.first_member + k];
      const Vector3d q = (toVector(content.physical_vertices[member.vertex].rest_position) - rest_center) / radius;
      b.row(Eigen::Index(k)) = basis(q, cluster.mode).transpose();
      p.row(Eigen::Index(k)) = (x[member.vertex] - center).transpose() / radius;
      gyration += mu[Eigen::Index(k)] / mass * q.squaredNorm();
    }
    b.rowwise() -= (mu.transpose() * b / mass).eval().row(0);
    const Matrix3d a_pq = p.transpose() * mu.asDiagonal() * b.leftCols(3);
    const Eigen::JacobiSVD<Matrix3d> svd(a_pq, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    const Matrix3d r = svd.matrixU() * Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();

    // u = p - R q, fitted by u ~ b G with the elastic penalty of each class of modes: (B^T mu B + K) G = B^T mu u.
    const MatrixXd rigid = b.leftCols(3) * r.transpose();
    MatrixXd goal = rigid;
    if (cluster.mode != ClusterMode::rigid) {
      MatrixXd system = b.transpose() * mu.asDiagonal() * b;
      const MatrixXd rhs = b.transpose() * mu.asDiagonal() * (p - rigid);
      const double scale = std::max(1.0, part_gyration / (radius * std::sqrt(gyration)));
      const double hz[3] = {double(cluster.stretch_hz), double(cluster.bend_hz), double(cluster.twist_hz)};
      const auto omega_h = [&](Eigen::Index k) {
        if (content.mechanics.empty()) return 2 * std::numbers::pi * hz[k / 3] * scale * h;
        const double beta = double(content.mechanics[0].per_step_beta[std::size_t(k / 3)]);
        return std::sqrt((1 - beta) / beta);  // the part beta of a deformation stays, whatever h
      };
      for (Eigen::Index j = 0; j < b.cols(); ++j) {
        for (Eigen::Index k = 0; k < b.cols(); ++k) system(j, k) *= 1 + omega_h(j) * omega_h(k);
      }
      goal += b * system.ldlt().solve(rhs);
    }
    // Different frequencies leave a torque Σ mu p x goal; the goals are turned until it vanishes.
    for (int iteration = 0; iteration < 100; ++iteration) {
      Vector3d torque = Vector3d::Zero();
      Matrix3d inertia = Matrix3d::Zero();
      for (Eigen::Index k = 0; k < p.rows(); ++k) {
        const Vector3d at = p.row(k), to = goal.row(k);
        torque += mu[k] * at.cross(to);
        inertia += mu[k] * (at.dot(to) * Matrix3d::Identity() - 0.5 * (to * at.transpose() + at * to.transpose()));
      }
      const Vector3d turn = -inertia.inverse() * torque;
      if (turn.norm() < 1e-14) break;
      goal = (goal * Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix().transpose()).eval();
    }
    // Rigid clusters together are one rigid body.
    if (cluster.mode == ClusterMode::rigid && content.clusters.size() > 1) {
      for (std::size_t k = 0; k < n; ++k) {
        const auto& vertex = content.physical_vertices[content.memberships[cluster.first_member + k].vertex];
        goal.row(Eigen::Index(k)) = (part.at(toVector(vertex.rest_position)) - center).transpose() / radius;
      }
    }
    for (std::size_t k = 0; k < n; ++k) {
      const auto& member = content.memberships[cluster.first_member + k];
      const double alpha = 1 - std::pow(1 - double(cluster.alpha), h * 60);
      moved[member.vertex] +=
          double(member.share) * alpha * (center + radius * goal.row(Eigen::Index(k)).transpose() - x[member.vertex]);
    }
  }
  for (std::size_t i = 0; i < x.size(); ++i) moved[i] += x[i];
  return moved;
}

std::vector<Vec3> perturbed(const formats::PackageContent& content, double amount, unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> noise(-amount, amount);
  const Matrix3d turn = Eigen::AngleAxisd(1.1, Vector3d(1, 2, -0.5).normalized()).toRotationMatrix();
  Matrix3d shear;
  shear << 1.1, 0.2, 0, 0.1, 0.9, -0.1, 0, 0.15, 1.05;
  std::vector<Vec3> x;
  for (const auto& vertex : content.physical_vertices) {
    Vector3d position = toVector(vertex.rest_position);
    position[1] += 0.2 * position[0] * position[0];  // a bend
    position = turn * (shear * position) + Vector3d(noise(engine), noise(engine), noise(engine)) + Vector3d(3, -2, 1);
    x.push_back({float(position[0]), float(position[1]), float(position[2])});
  }
  return x;
}

struct Case {
  ClusterMode mode;
  std::array<std::uint32_t, 3> clusters;
  float alpha, stretch, bend, twist;
  std::array<float, 3> per_step = {};  // beta of each class, in place of the frequencies
};

class OnePass : public testing::TestWithParam<Case> {};

TEST_P(OnePass, AgreesWithTheDoubleReference) {
  const Case& c = GetParam();
  BoxOptions box;
  box.cells = {6, 4, 4};
  box.size = {1.5, 1.0, 0.8};
  box.mode = c.mode;
  box.clusters = c.clusters;
  box.alpha = c.alpha;
  box.stretch_hz = c.stretch;
  box.bend_hz = c.bend;
  box.twist_hz = c.twist;
  formats::PackageContent content = boxContent(box);
  if (c.per_step[0] > 0) {
    formats::ClusterMechanics mechanics = formats::kPlainMechanics;
    mechanics.stiffness = formats::StiffnessModel::per_step;
    std::copy(c.per_step.begin(), c.per_step.end(), mechanics.per_step_beta.begin());
    content.mechanics.assign(content.clusters.size(), mechanics);
  }
  for (const float h : {1.0F / 60, 1.0F / 480}) {
    WorldSettings settings;
    settings.gravity = {0, 0, 0};
    settings.iterations = 1;
    World world(settings);
    const BodyId body = *world.addBody(makeAsset(content));
    const std::vector<Vec3> start = perturbed(content, 0.05, 7);
    std::vector<Vector3d> wide;
    for (const Vec3& x : start) wide.push_back(toVector(x));
    world.setState(body, start, {});
    world.step(h);
    const std::vector<Vector3d> expected = referencePass(content, wide, double(h));
    double worst = 0;
    for (std::size_t i = 0; i < start.size(); ++i) {
      worst = std::max(worst, (toVector(world.positions(body)[i]) - expected[i]).norm());
    }
    EXPECT_LT(worst, 5e-6 * double(content.info.diagonal)) << "h = " << h;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Modes, OnePass,
    testing::Values(
        Case{ClusterMode::rigid, {1, 1, 1}, 1, 5, 3, 3}, Case{ClusterMode::rigid, {3, 2, 2}, 0.7F, 5, 3, 3},
        Case{ClusterMode::linear, {1, 1, 1}, 1, 5, 3, 3}, Case{ClusterMode::linear, {3, 2, 2}, 0.7F, 5, 3, 3},
        Case{ClusterMode::linear, {2, 1, 1}, 1, 0, 3, 3}, Case{ClusterMode::quadratic, {1, 1, 1}, 1, 5, 5, 5},
        Case{ClusterMode::quadratic, {1, 1, 1}, 1, 5, 3, 2}, Case{ClusterMode::quadratic, {3, 1, 1}, 0.9F, 8, 2, 20},
        Case{ClusterMode::quadratic, {2, 2, 1}, 1, 4, 4, 4}, Case{ClusterMode::quadratic, {3, 1, 1}, 1, 4, 4, 4},
        Case{ClusterMode::quadratic, {1, 1, 1}, 1, 8, 2, 20}, Case{ClusterMode::quadratic, {3, 1, 1}, 1, 8, 2, 20},
        Case{ClusterMode::quadratic, {2, 2, 1}, 1, 8, 2, 20},
        Case{ClusterMode::linear, {3, 2, 2}, 0.7F, 5, 3, 3, {0.6F, 0.6F, 0.6F}},
        Case{ClusterMode::quadratic, {1, 1, 1}, 1, 5, 5, 5, {0.9F, 0.5F, 0.2F}},
        Case{ClusterMode::quadratic, {3, 1, 1}, 1, 5, 5, 5, {0.3F, 0.8F, 0.95F}}));

TEST(Stiffness, ReturnHasTheAuthoredFrequencyAtAnySmallStep) {
  // A stretched free cluster rings at its frequency: time from largest stretch to the first crossing is 1 / (4 f).
  for (const float h : {1.0F / 240, 1.0F / 960}) {
    BoxOptions box;
    box.stretch_hz = 2;
    WorldSettings settings;
    settings.gravity = {0, 0, 0};
    settings.iterations = 1;
    settings.damping = settings.deformation_damping_ratio = settings.support_damping = 0;
    World world(settings);
    const BodyId body = *world.addBody(boxAsset(box));
    std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
    const float top = x.back()[0];
    for (Vec3& p : x) p[0] *= 1.2F;
    world.setState(body, x, {});
    double time = 0;
    while (world.positions(body).back()[0] > top && time < 2) {
      world.step(h);
      time += double(h);
    }
    EXPECT_NEAR(time, 1.0 / 8, 1.0 / 8 * 0.02 + 6 * double(h) * 0.5) << h;
  }
}

}  // namespace
}  // namespace sinew::test

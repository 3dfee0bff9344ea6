// SPDX-License-Identifier: MIT
//
// What CMEC adds to a cluster: elastic modes, limits, volume, damping, plasticity, activation, stiffness of vertices.
#include "runtime/clusters/mechanics.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <vector>

#include "sinew/runtime/world.h"
#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using formats::ClusterMechanics;
using formats::ClusterMode;
using formats::kPlainMechanics;
using formats::LimitMethod;
using formats::StiffnessModel;
using formats::VolumeMethod;

// Strain energy of displacements u = G q~ over a cluster, differentiated by hand at each vertex: Σ mu / density of
// mu |sym|² 2 ... over mass and radius², the Hessian in the entries of G (3 x 9, column by column).
MatrixXd energyByQuadrature(const formats::PackageContent& content, double young, double poisson) {
  const double lambda = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), mu = young / (2 * (1 + poisson));
  const formats::Cluster& cluster = content.clusters[0];
  MatrixXd hessian = MatrixXd::Zero(27, 27);
  for (const auto& member : content.memberships) {
    const Vector3d q = (wide(content.physical_vertices[member.vertex].rest_position) - wide(cluster.rest_center)) /
                       double(cluster.radius);
    Eigen::Matrix<double, 9, 3> gradient;
    gradient.topRows<3>().setIdentity();
    gradient.bottomRows<6>() << 2 * q[0], 0, 0, 0, 2 * q[1], 0, 0, 0, 2 * q[2], q[1], q[0], 0, 0, q[2], q[1], q[2], 0,
        q[0];
    const auto strain_of = [&](int entry) {
      Eigen::Matrix<double, 3, 9> g = Eigen::Matrix<double, 3, 9>::Zero();
      g.data()[entry] = 1;
      const Matrix3d d = g * gradient;
      return Matrix3d(0.5 * (d + d.transpose()));
    };
    for (int i = 0; i < 27; ++i) {
      const Matrix3d a = strain_of(i);
      for (int j = 0; j < 27; ++j) {
        const Matrix3d b = strain_of(j);
        hessian(i, j) += double(member.mu) * (2 * mu * (a.array() * b.array()).sum() + lambda * a.trace() * b.trace());
      }
    }
  }
  return hessian / (1000 * double(cluster.radius) * double(cluster.radius));
}

formats::PackageContent withMechanics(const BoxOptions& box, const ClusterMechanics& mechanics) {
  formats::PackageContent content = boxContent(box);
  content.mechanics.assign(content.clusters.size(), mechanics);
  return content;
}

ClusterMechanics elastic(float young, float poisson) {
  ClusterMechanics m = kPlainMechanics;
  m.stiffness = StiffnessModel::elastic;
  m.young = young;
  m.poisson = poisson;
  return m;
}

TEST(Algebra, SharedFunctionsDoAsEigen) {
  using namespace internal;
  const Matrix3 a = Matrix3::Random();
  const Columns<9> f = Columns<9>::Random();
  EXPECT_EQ(widened(a), a.cast<double>());
  EXPECT_EQ(widened(f), f.cast<double>());
  EXPECT_EQ(narrowed(widened(f)), f);
  const Eigen::Matrix3d left = Eigen::Matrix3d::Random();
  EXPECT_LT((left * widened(f) - left.lazyProduct(f.cast<double>())).norm(), 1e-14);
  EXPECT_EQ(asMatrix({1, 2, 3, 4, 5, 6, 7, 8, 9}), (Matrix3() << 1, 2, 3, 4, 5, 6, 7, 8, 9).finished());
  const Vector3 q = Vector3::Random();
  const Eigen::Matrix<double, 9, 1> wide = monomials(q.cast<double>());
  EXPECT_LT((wide - monomials<9>(q).cast<double>()).norm(), 1e-6);
}

TEST(Elastic, TheImplicitStepIsThatOfTheSolid) {
  BoxOptions box;
  box.cells = {5, 3, 3};
  box.size = {1, 0.4, 0.3};
  box.mode = ClusterMode::quadratic;
  for (const auto& [young, poisson] : {std::pair{1e5F, 0.3F}, {1e6F, 0.0F}, {3e4F, 0.499F}}) {
    const formats::PackageContent content = withMechanics(box, elastic(young, poisson));
    const auto asset = makeAsset(content);
    const internal::ElasticModes modes = internal::elasticModes(asset->package(), 0);
    // (M x 1 + h² K) g = deviation, solved directly.
    MatrixXd moment = MatrixXd::Zero(9, 9);
    VectorXd mean = VectorXd::Zero(9);
    const auto monomial = [&](std::uint32_t v) {
      const Vector3d q = (wide(content.physical_vertices[v].rest_position) - wide(content.clusters[0].rest_center)) /
                         double(content.clusters[0].radius);
      VectorXd b(9);
      b << q, q.cwiseProduct(q), q[0] * q[1], q[1] * q[2], q[2] * q[0];
      return b;
    };
    for (const auto& member : content.memberships) mean += double(member.mu) * monomial(member.vertex);
    for (const auto& member : content.memberships) {
      const VectorXd b = monomial(member.vertex) - mean;
      moment += double(member.mu) * b * b.transpose();
    }
    const MatrixXd energy = energyByQuadrature(content, double(young), double(poisson));
    for (const double h : {1e-5, 1e-3, 1.0 / 60, 1.0}) {
      MatrixXd system = h * h * energy;
      for (int i = 0; i < 9; ++i) {
        for (int j = 0; j < 9; ++j) {
          for (int axis = 0; axis < 3; ++axis) system(3 * i + axis, 3 * j + axis) += moment(i, j);
        }
      }
      VectorXd deviation(27);
      for (int k = 0; k < 27; ++k) deviation[k] = std::sin(1.7 * k + 0.3) * 0.05;
      const VectorXd expected = system.ldlt().solve(deviation);
      const Eigen::Matrix<double, 27, 27> v = modes.vectors.cast<double>();
      VectorXd amplitude = v.transpose() * deviation;
      for (int k = 0; k < 27; ++k) amplitude[k] /= 1 + h * h * double(modes.omega2[k]);
      const VectorXd result = v * amplitude;
      EXPECT_LT((result - expected).norm(), 1e-4 * expected.norm())
          << "E " << young << ", nu " << poisson << ", h " << h;
    }
  }
}

TEST(Elastic, SixMotionsAreFreeAndNothingIsNegative) {
  BoxOptions box;
  box.mode = ClusterMode::quadratic;
  for (const float young : {0.0F, 1.0F, 1e12F}) {
    const auto asset = makeAsset(withMechanics(box, elastic(young, 0.45F)));
    const internal::ElasticModes modes = internal::elasticModes(asset->package(), 0);
    int free_modes = 0;
    for (int k = 0; k < 27; ++k) {
      EXPECT_GE(modes.omega2[k], 0);
      EXPECT_TRUE(std::isfinite(modes.omega2[k]));
      free_modes += modes.omega2[k] == 0;
    }
    EXPECT_EQ(free_modes, young > 0 ? 3 : 27);  // the three turns; translation is not among the modes
  }
}

TEST(Elastic, DegenerateClustersKeepTheirDirections) {
  // One, two, three vertices, a line, a plane: finite, and rigid where they have no extent.
  for (const auto& cells : {std::array<std::uint32_t, 3>{4, 4, 4}, {1, 1, 1}}) {
    for (int flat = 0; flat < 4; ++flat) {
      BoxOptions box;
      box.cells = cells;
      box.mode = flat % 2 == 0 ? ClusterMode::linear : ClusterMode::quadratic;
      formats::PackageContent content = boxContent(box);
      std::vector<double> weights(content.memberships.size(), 1.0);
      for (std::size_t k = 0; k < weights.size(); ++k) {
        const auto& x = content.physical_vertices[content.memberships[k].vertex].rest_position;
        if ((flat >= 1 && x[0] > -0.4F) || (flat >= 3 && x[1] > -0.4F)) weights[k] = 1e-30;
      }
      computeClusterConstants(content, weights);
      content.mechanics.assign(1, elastic(1e5F, 0.3F));
      World world(weightless());
      const BodyId body = *world.addBody(makeAsset(content));
      std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
      for (Vec3& p : x) p[0] += 0.1F * p[1];
      world.setState(body, x, {});
      run(world, 1);
      EXPECT_TRUE(allFinite(world, body));
    }
  }
}

TEST(Elastic, ABarRingsAtTheFrequencyOfItsModulus) {
  // The first stretch of a linear cluster with nu = 0: u = a x has the energy 1/2 E V a² and the mass moment m sum x².
  BoxOptions box;
  box.cells = {8, 2, 2};
  box.size = {1, 0.2, 0.2};
  const formats::PackageContent content = withMechanics(box, elastic(1e5F, 0.0F));
  double second = 0;
  for (const auto& v : content.physical_vertices) second += double(v.mass) * std::pow(double(v.rest_position[0]), 2);
  const double frequency = std::sqrt(1e5 * 0.04 / second) / (2 * std::numbers::pi);
  WorldSettings settings = weightless();
  settings.damping = settings.deformation_damping_ratio = 0;
  World world(settings);
  const BodyId body = *world.addBody(makeAsset(content));
  std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
  const float end = x.back()[0];
  for (Vec3& p : x) p[0] *= 1.1F;
  world.setState(body, x, {});
  const float h = 1.0F / 2000;
  double time = 0;
  while (world.positions(body).back()[0] > end && time < 2) {
    world.step(h);
    time += double(h);
  }
  EXPECT_NEAR(time, 0.25 / frequency, 0.03 * 0.25 / frequency);
}

struct FreeCase {
  StiffnessModel stiffness;
  LimitMethod limit;
  VolumeMethod volume;
  bool plastic, active;
};

TEST(Momentum, AFreeBodyKeepsItUnderEverything) {
  for (const ClusterMode mode : {ClusterMode::linear, ClusterMode::quadratic}) {
    for (const FreeCase& c :
         {FreeCase{StiffnessModel::elastic, LimitMethod::none, VolumeMethod::none, false, false},
          FreeCase{StiffnessModel::per_step, LimitMethod::rows, VolumeMethod::cube_root, false, true},
          FreeCase{StiffnessModel::frequency, LimitMethod::frobenius, VolumeMethod::none, true, true},
          FreeCase{StiffnessModel::elastic, LimitMethod::frobenius_cheap, VolumeMethod::principal, true, false},
          FreeCase{StiffnessModel::frequency, LimitMethod::soft, VolumeMethod::principal, false, true},
          FreeCase{StiffnessModel::elastic, LimitMethod::curve, VolumeMethod::cube_root, true, true},
          FreeCase{StiffnessModel::frequency, LimitMethod::principal, VolumeMethod::principal, true, true}}) {
      BoxOptions box;
      box.cells = {8, 3, 3};
      box.size = {1, 0.4, 0.4};
      box.clusters = {3, 1, 1};
      box.mode = mode;
      ClusterMechanics m = kPlainMechanics;
      m.stiffness = c.stiffness;
      m.per_step_beta = {0.9F, 0.8F, 0.9F};
      m.limit = c.limit;
      m.volume = c.volume;
      m.stretch_max = 1.2F;
      m.stretch_min = 0.8F;
      m.norm_max = 3.2F;
      m.norm_limit = 3.6F;
      m.damping = 3;
      if (c.plastic) {
        m.plastic_yield = 0.05F;
        m.plastic_creep = 5;
      }
      if (c.active) {
        m.fibre = {0.6F, 0.8F, 0};
        m.channel = 0;
        m.contraction = 0.4F;
      }
      formats::PackageContent content = boxContent(box);
      if (c.limit == LimitMethod::curve) {
        content.curve_points = {{3.1F, 3.1F}, {4, 3.3F}, {10, 3.4F}};
        m.curve_point_count = 3;
      }
      content.channels = {{content.addText("flex")}};
      content.mechanics.assign(content.clusters.size(), m);
      WorldSettings settings = weightless();
      settings.damping = 0;
      World world(settings);
      const BodyId body = *world.addBody(makeAsset(content));
      std::vector<Vec3> x, v;
      for (const Vec3& p : world.positions(body)) {
        x.push_back({1.3F * p[0] + 0.1F * p[1], p[1] + 0.2F * p[0] * p[0], 0.9F * p[2]});
        v.push_back({1 + 2 * p[1], -2 * p[0] + p[2], 0.5F - p[1] + 3 * p[0] * p[1]});
      }
      world.setState(body, x, v);
      const Motion before = motionOf(world, body);
      for (int step = 0; step < 120; ++step) {
        if (c.active) {
          EXPECT_TRUE(world.setActivation(body, "flex", 0.5F + 0.5F * std::sin(0.2F * float(step))));
        }
        world.step(1.0F / 60);
      }
      const Motion after = motionOf(world, body);
      const std::string name = "mode " + std::to_string(int(mode)) + " stiffness " + std::to_string(int(c.stiffness)) +
                               " limit " + std::to_string(int(c.limit)) + " volume " + std::to_string(int(c.volume));
      EXPECT_TRUE(allFinite(world, body)) << name;
      EXPECT_LT((after.momentum - before.momentum).norm(), 1e-5 * before.momentum.norm()) << name;
      EXPECT_LT((after.angular - before.angular).norm(), 1e-4 * before.angular.norm()) << name;
    }
  }
}

TEST(Damping, OfAClusterStopsItsRingingAndNotItsFlight) {
  for (const StiffnessModel model : {StiffnessModel::frequency, StiffnessModel::elastic}) {
    const auto wobble = [&](float damping) {
      BoxOptions box;
      box.stretch_hz = 2;
      ClusterMechanics m = elastic(3e4F, 0.2F);
      m.stiffness = model;
      m.damping = damping;
      WorldSettings settings = weightless();
      settings.damping = settings.deformation_damping_ratio = 0;
      World world(settings);
      const BodyId body = *world.addBody(makeAsset(withMechanics(box, m)));
      std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
      for (Vec3& p : x) p[0] *= 1.2F;
      const std::vector<Vec3> v(x.size(), Vec3{1, 0, 0});
      world.setState(body, x, v);
      run(world, 0.5, 1.0F / 240);
      double most = 0;
      for (int step = 0; step < 120; ++step) {
        world.step(1.0F / 240);
        const Motion motion = motionOf(world, body);
        EXPECT_NEAR(motion.momentum[0], motion.mass, 1e-4 * motion.mass);
        most = std::max(most, motion.kinetic / motion.mass - 0.5);
      }
      return most;
    };
    // v is x0 w0² / wd exp(-d t / 2) sin(wd t): of the energy (w0 / wd)² exp(-d t), with d = 8/s and w0 = 2 pi 2 Hz
    // 0.0204 after half a second. A tenth more for what passes of 1/960 s take of the undamped one.
    const double undamped = wobble(0), damped = wobble(8);
    EXPECT_GT(undamped, 1e-3);
    EXPECT_LT(damped, 1.1 * 0.0204 * undamped);
    EXPECT_GT(damped, 0.9 * std::exp(-8 * 0.75) * undamped);  // the next peak is at most half a period on
  }
}

TEST(Damping, OfDeformationsIsARatioOfCritical) {
  const auto wobble = [&](float ratio) {
    BoxOptions box;
    box.stretch_hz = 2;
    WorldSettings settings = weightless();
    settings.damping = 0;
    settings.deformation_damping_ratio = ratio;
    World world(settings);
    const BodyId body = *world.addBody(boxAsset(box));
    std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
    for (Vec3& p : x) p[0] *= 1.2F;
    world.setState(body, x, {});
    run(world, 0.5, 1.0F / 240);
    double most = 0;
    for (int step = 0; step < 120; ++step) {
      world.step(1.0F / 240);
      most = std::max(most, motionOf(world, body).kinetic);
    }
    return most;
  };
  // As above with d = 2 zeta w0: after half a second, and at the next peak.
  const double undamped = wobble(0), w0 = 2 * std::numbers::pi * 2;
  for (const double zeta : {0.05, 0.1, 0.25}) {
    const double damped = wobble(float(zeta));
    EXPECT_LT(damped, 1.1 / (1 - zeta * zeta) * std::exp(-2 * zeta * w0 * 0.5) * undamped) << zeta;
    EXPECT_GT(damped, 0.9 * std::exp(-2 * zeta * w0 * 0.75) * undamped) << zeta;
  }
}

TEST(Plasticity, AStretchBeyondTheYieldStaysAndABelowOneReturns) {
  for (const ClusterMode mode : {ClusterMode::linear, ClusterMode::quadratic}) {
    const auto left = [&](float stretch, float limit) {
      BoxOptions box;
      box.mode = mode;
      box.stretch_hz = box.bend_hz = box.twist_hz = 1;
      ClusterMechanics m = kPlainMechanics;
      m.plastic_yield = 0.15F;
      m.plastic_creep = 20;
      m.plastic_limit = limit;
      World world(weightless());
      const BodyId body = *world.addBody(makeAsset(withMechanics(box, m)));
      std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
      const float rest = x.back()[0] - x.front()[0];
      for (Vec3& p : x) p = {p[0] * stretch, p[1] / std::sqrt(stretch), p[2] / std::sqrt(stretch)};
      world.setState(body, x, {});
      run(world, 10);
      EXPECT_LT(rmsSpeed(world, body), 1e-3);
      // At rest the body has the shape that has become permanent.
      const Mat3 shape = world.clusterRestShape(body, 0);
      const float length = world.positions(body).back()[0] - world.positions(body).front()[0];
      EXPECT_NEAR(shape[0], length / rest, 2e-3);
      EXPECT_NEAR(shape[0] * shape[4] * shape[8], 1, 1e-4);
      return double(world.positions(body).back()[0] - world.positions(body).front()[0]) / double(rest);
    };
    EXPECT_NEAR(left(1.08F, 10), 1, 1e-3);  // elastic: |S - 1| = 0.1
    const double stays = left(1.6F, 10);    // |S - 1| = 0.7: what is above the yield flows
    EXPECT_GT(stays, 1.1);
    EXPECT_LT(stays, 1.6);
    // Less far: limited, 1.6 would swing back far enough to flow the other way.
    const double limited = left(1.3F, 0.1F);
    EXPECT_GT(limited, 1.02);
    EXPECT_LT(limited, 1.12);
  }
}

TEST(Activation, AFibreContractsAtConstantVolume) {
  for (const ClusterMode mode : {ClusterMode::linear, ClusterMode::quadratic}) {
    for (const StiffnessModel model : {StiffnessModel::frequency, StiffnessModel::elastic}) {
      BoxOptions box;
      box.mode = mode;
      ClusterMechanics m = elastic(1e5F, 0.3F);
      m.stiffness = model;
      m.fibre = {1, 0, 0};
      m.channel = 0;
      m.contraction = 0.5F;
      formats::PackageContent content = withMechanics(box, m);
      content.channels = {{content.addText("biceps")}};
      World world(weightless());
      const BodyId body = *world.addBody(makeAsset(content));
      EXPECT_FALSE(world.setActivation(body, 1U, 1));
      EXPECT_FALSE(world.setActivation(body, "triceps", 1));
      const auto length = [&](std::size_t axis) {
        return double(world.positions(body).back()[axis] - world.positions(body).front()[axis]);
      };
      for (const float active : {0.5F, 1.0F, 0.0F}) {
        ASSERT_TRUE(world.setActivation(body, "biceps", active));
        run(world, 4);
        const double along = 1 - 0.5 * double(active), across = 1 / std::sqrt(along);
        EXPECT_NEAR(length(0), along, 2e-3) << active;
        EXPECT_NEAR(length(1), across, 2e-3) << active;
        EXPECT_NEAR(length(0) * length(1) * length(2), 1, 5e-3) << active;
        const Mat3 shape = world.clusterRestShape(body, 0);
        EXPECT_NEAR(shape[0], along, 1e-6) << active;
        EXPECT_NEAR(shape[4], across, 1e-6) << active;
        EXPECT_NEAR(shape[1], 0, 1e-6) << active;
      }
    }
  }
}

TEST(VertexStiffness, ScalesHowFarAVertexFollows) {
  BoxOptions box;
  box.mode = ClusterMode::rigid;
  formats::PackageContent content = boxContent(box);
  content.vertex_stiffness.assign(content.physical_vertices.size(), 1.0F);
  const std::uint32_t soft = 7;
  content.vertex_stiffness[soft] = 0.25F;
  WorldSettings settings = weightless();
  settings.iterations = 1;
  World world(settings);
  const BodyId body = *world.addBody(makeAsset(content));
  std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
  x[soft][1] += 0.1F;
  x[20][1] += 0.1F;
  world.setState(body, x, {});
  world.step(1.0F / 60);
  const auto moved = [&](std::uint32_t i) { return double(x[i][1] - world.positions(body)[i][1]); };
  EXPECT_NEAR(moved(soft) / moved(20), 0.25, 0.02);
  // Its lag is no force on the body: a free part gets back what a pass may not change. Of the angular momentum a part
  // in two thousand is lost over two seconds of a deforming body (docs/method.md §9), the linear one stays.
  std::vector<Vec3> v;
  for (const Vec3& p : x) v.push_back({1 + p[1], -p[0], 0.5F});
  world.setState(body, x, v);
  const Motion before = motionOf(world, body);
  world.settings().damping = 0;
  run(world, 2);
  const Motion after = motionOf(world, body);
  EXPECT_LT((after.momentum - before.momentum).norm(), 1e-5 * before.momentum.norm());
  EXPECT_LT((after.angular - before.angular).norm(), 1e-3 * before.angular.norm());
}

TEST(Curve, AnswersBetweenItsPoints) {
  const std::vector<formats::CurvePoint> curve = {{4, 4}, {8, 5}, {16, 6}};
  EXPECT_EQ(internal::curveResponse(curve, 3.5F), 3.5F);
  EXPECT_EQ(internal::curveResponse(curve, 4), 4);
  EXPECT_FLOAT_EQ(internal::curveResponse(curve, 6), 4.5F);
  EXPECT_FLOAT_EQ(internal::curveResponse(curve, 12), 5.5F);
  EXPECT_EQ(internal::curveResponse(curve, 1e30F), 6);
}

TEST(Curve, IsWhatAClusterMayStretchTo) {
  BoxOptions box;
  box.stretch_hz = 0.01F;  // hardly pulls back by itself
  ClusterMechanics m = kPlainMechanics;
  m.limit = LimitMethod::curve;
  m.curve_point_count = 3;
  formats::PackageContent content = withMechanics(box, m);
  content.curve_points = {{4, 4}, {8, 5}, {16, 6}};
  const auto asset = makeAsset(content);
  for (const auto& [stretch, squared] : {std::pair{1.2F, 3.44F}, {2.0F, 4.5F}, {2.4F, 4.94F}, {2.9F, 5.301F}}) {
    World world(weightless());
    world.settings().iterations = 1;
    const BodyId body = *world.addBody(asset);
    std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end());
    for (Vec3& p : x) p[0] *= stretch;
    world.setState(body, x, {});
    world.step(1.0F / 60);
    Vec3 center;
    Mat3 linear;
    world.clusterFrame(body, 0, center, linear);
    float norm2 = 0;
    for (const float entry : linear) norm2 += entry * entry;
    EXPECT_NEAR(norm2, squared, 1e-3F) << stretch;
  }
}

}  // namespace
}  // namespace sinew::test

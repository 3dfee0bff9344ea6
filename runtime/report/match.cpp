// SPDX-License-Identifier: MIT
#include "runtime/report/match.h"

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "runtime/geometry/pseudo_inverse.h"
#include "runtime/geometry/symmetric_eigen.h"
#include "runtime/report/limits.h"

namespace sinew::internal {
namespace {

using Square9d = Eigen::Matrix<double, 9, 9>;

// The length of step that a frequency means its beta for, s: the sources' beta acts per step.
constexpr float kUsualStep = 1.0F / 60;
// A pinned vertex of "infinite mass" weighs so many times its cluster (4.3.2).
constexpr float kInfinite = 1e3F;
// A spread of moments that counts as none, beside the largest.
constexpr float kFlat = 1e-4F;

const formats::ClusterMechanics& mechanicsOf(const Body& body, std::uint32_t cluster) {
  const auto mechanics = body.package().mechanics();
  return mechanics.empty() ? formats::kPlainMechanics : mechanics[cluster];
}

// beta of a mode of frequency f: what an implicit step of kUsualStep keeps of a deformation.
float betaOf(float omega) { return 1 / (1 + omega * omega * kUsualStep * kUsualStep); }

// The coordinates that a cluster has: 9 of a quadratic one, else 3.
int columnsOf(const formats::Cluster& cluster) { return cluster.mode == formats::ClusterMode::quadratic ? 9 : 3; }

// Moments with pinned vertices of great mass: about a centre that they pull along.
struct Moments {
  Vector3 center = Vector3::Zero();
  Columns<9> pq = Columns<9>::Zero();        // A_pq
  Columns<9> rest = Columns<9>::Zero();      // M, what A_pq is at rest
  Monomials<9> mean = Monomials<9>::Zero();  // of q~, which the pinned ones move
  Square<9> a_qq = Square<9>::Zero();
};

Moments momentsOf(const Body& body, std::uint32_t index, const ClusterConstants& constants,
                  std::span<const std::uint32_t> held) {
  const formats::Cluster& cluster = body.package().clusters()[index];
  const auto members = body.package().memberships().subspan(cluster.first_member, cluster.member_count);
  const auto weightOf = [&](const formats::Membership& member) {
    const std::uint32_t set = held[member.vertex];
    const bool infinite = set != 0 && body.pin_sets[set - 1].method == PinMethod::infinite_mass;
    return infinite ? kInfinite : 0.0F;
  };
  float total = 1;
  for (const formats::Membership& member : members) total += weightOf(member);
  const Vector3 reference = asVector(body.x[members[0].vertex]);
  Moments m;
  Square9d qq = Square9d::Zero();
  for (const formats::Membership& member : members) {
    const float mu = (member.mu + weightOf(member)) / total;
    const Vec3& rest_position = body.vertices()[member.vertex].rest_position;
    const Monomials<9> q = restCoordinates(body, index, rest_position);
    const Vector3 arm = asVector(body.x[member.vertex]) - reference;
    m.center += mu * arm;
    m.mean += mu * q;
    m.pq += (mu / cluster.radius * arm) * q.transpose();
    if (total > 1) qq += (mu * q * q.transpose()).cast<double>();
  }
  m.pq -= m.center / cluster.radius * m.mean.transpose();
  m.center += reference;
  if (total == 1) {
    m.rest = body.asset->clusterConstants()[index].moment;
    m.a_qq = constants.a_qq;
    return m;
  }
  qq -= (m.mean * m.mean.transpose()).cast<double>();
  const int n = columnsOf(cluster);
  qq.bottomRows(9 - n).setZero();
  qq.rightCols(9 - n).setZero();
  m.rest = qq.topRows<3>().cast<float>();
  m.a_qq = geometry::pseudoInverse<9>(qq).cast<float>();
  return m;
}

// Matrix constraints (4.3.3) for any pinned vertices: of all transforms whose goals of these are their places, centre
// included, the one that moves the cluster's mass least; the least squares where there is none.
void constrain(const Body& body, std::uint32_t index, const ClusterConstants& constants,
               std::span<const std::uint32_t> held, Goal& goal) {
  const formats::Cluster& cluster = body.package().clusters()[index];
  // In the functions (1, T q~), which the mass tells apart: T^2 = A_qq.
  Eigen::Matrix<double, 10, 10> squares = Eigen::Matrix<double, 10, 10>::Zero();
  Eigen::Matrix<double, 3, 10> off = Eigen::Matrix<double, 3, 10>::Zero();
  bool any = false;
  for (const formats::Membership& member :
       body.package().memberships().subspan(cluster.first_member, cluster.member_count)) {
    const std::uint32_t set = held[member.vertex];
    if (set == 0 || body.pin_sets[set - 1].method != PinMethod::matrix) continue;
    any = true;
    const Monomials<9> q = restCoordinates(body, index, body.vertices()[member.vertex].rest_position);
    const Vector3 lacking = (asVector(body.x[member.vertex]) - goal.center) / cluster.radius - goal.f.lazyProduct(q);
    Eigen::Matrix<double, 10, 1> b;
    b << 1, constants.root_a_qq.lazyProduct(q).cast<double>();
    squares += b * b.transpose();
    off += lacking.cast<double>() * b.transpose();
  }
  if (!any) return;
  const geometry::SymmetricEigen solver = geometry::symmetricEigen(squares);
  Eigen::Matrix<double, 10, 1> inverse = Eigen::Matrix<double, 10, 1>::Zero();
  for (int k = 0; k < 10; ++k) {
    if (solver.values[k] > geometry::kMomentCutoff * solver.values[9]) {
      inverse[k] = 1 / solver.values[k];
    }
  }
  const auto& v = solver.vectors;
  const Eigen::Matrix<float, 3, 10> change = (off * v * inverse.asDiagonal() * v.transpose()).cast<float>();
  goal.center += cluster.radius * change.col(0);
  goal.f += change.rightCols<9>().lazyProduct(constants.root_a_qq);
}

}  // namespace

Monomials<9> restCoordinates(const Body& body, std::uint32_t cluster, const Vec3& rest_position) {
  return monomials<9>(restOffset(body.package().clusters()[cluster], asVector(rest_position))) -
         body.asset->clusterConstants()[cluster].mean;
}

ClusterConstants makeConstants(const Body& body, std::uint32_t index) {
  const formats::PackageView& package = body.package();
  const formats::Cluster& cluster = package.clusters()[index];
  const formats::ClusterMechanics& mechanics = mechanicsOf(body, index);
  const float scale = body.settings.stiffness_scale;
  ClusterConstants constants;
  constants.a_qq = momentInverse(package, cluster);
  const geometry::SymmetricEigen solver = geometry::symmetricEigen(constants.a_qq.cast<double>());
  constants.root_a_qq =
      (solver.vectors * solver.values.cwiseMax(0).cwiseSqrt().asDiagonal() * solver.vectors.transpose()).cast<float>();
  const Matrix3 spread = body.asset->clusterConstants()[index].moment.leftCols<3>();
  constants.encloses_volume = spread.determinant() > kFlat * std::pow(spread.trace() / 3, 3.0F);
  if (mechanics.stiffness == formats::StiffnessModel::per_step) {
    constants.beta = mechanics.per_step_beta;
    constants.alpha = cluster.alpha;
  } else if (mechanics.stiffness == formats::StiffnessModel::elastic) {
    // The stretch of a body of the cluster's size and density: omega^2 = E / (rho r^2).
    const float density = package.info().density > 0 ? package.info().density : 1000.0F;
    constants.beta.fill(betaOf(scale * std::sqrt(mechanics.young / density) / cluster.radius));
  } else {
    const float hz[3] = {cluster.stretch_hz, cluster.bend_hz, cluster.twist_hz};
    for (std::size_t k = 0; k < 3; ++k) {
      const float omega = 2 * std::numbers::pi_v<float> * hz[k] * scale;
      constants.beta[k] = std::isnan(omega) ? 1 : betaOf(omega);  // stiff without limit times no stiffness
    }
  }
  return constants;
}

Goal match(const Body& body, std::uint32_t index, const ClusterConstants& constants,
           std::span<const std::uint32_t> held, geometry::Quaternion& rotation) {
  const formats::Cluster& cluster = body.package().clusters()[index];
  const formats::ClusterMechanics& mechanics = mechanicsOf(body, index);
  const Moments m = momentsOf(body, index, constants, held);
  Goal goal;
  geometry::nearestRotation(m.pq.leftCols<3>(), rotation);
  const Matrix3 r = geometry::rotationMatrix(rotation);
  goal.center = m.center;
  goal.f.leftCols<3>() = r;
  if (cluster.mode != formats::ClusterMode::rigid) {
    // A~ = A_pq A_qq; R in directions that the rest shape lacks (Müller et al. 2005, quadratic deformations).
    Columns<9> pq = m.pq;
    if (cluster.mode == formats::ClusterMode::linear) pq.rightCols<6>().setZero();
    Columns<9> a = goal.f + (pq - r * m.rest).lazyProduct(m.a_qq).eval();
    Matrix3 linear = a.leftCols<3>();
    if (mechanics.volume != formats::VolumeMethod::none && constants.encloses_volume) linear = volumeKept(linear);
    if (mechanics.limit == formats::LimitMethod::rows) linear = rowsLimited(linear, mechanics.stretch_max);
    if (mechanics.limit == formats::LimitMethod::principal) {
      linear = stretchesLimited(linear, mechanics.stretch_min, mechanics.stretch_max);
    }
    const auto curve = body.package().curvePoints().subspan(mechanics.first_curve_point, mechanics.curve_point_count);
    const float gamma = blendOf(mechanics, curve, linear, r);
    // F = beta A~ + (1 - beta) R~ by class of modes, gamma as a factor on beta (3.1, 4.1.2).
    goal.f.leftCols<3>() += gamma * constants.beta[0] * (linear - r);
    goal.f.middleCols<3>(3) = gamma * constants.beta[1] * a.middleCols<3>(3);
    goal.f.rightCols<3>() = gamma * constants.beta[2] * a.rightCols<3>();
  }
  // g = c + r F (q~ - mean): the mean is where the centre is.
  goal.center -= cluster.radius * goal.f.lazyProduct(m.mean);
  constrain(body, index, constants, held, goal);
  return goal;
}

}  // namespace sinew::internal

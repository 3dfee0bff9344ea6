// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/body_measure.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/clusters/goal.h"
#include "runtime/clusters/stiffness.h"
#include "runtime/geometry/tet_mesh.h"

namespace sinew::tools {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d nearestRotation(const Matrix3d& a) {
  const double scale = a.cwiseAbs().maxCoeff();
  if (!(scale > 0) || !std::isfinite(scale)) return Matrix3d::Identity();
  const Eigen::JacobiSVD<Matrix3d> svd(a / scale, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
}

// No direction mirrored, or stretched or squashed past the runtime's guard (docs/method.md eq. 10).
Matrix3d clampedStretch(const Matrix3d& f) {
  constexpr double kLeast = double(internal::kLeastStretch), kLargest = double(internal::kLargestStretch);
  const Eigen::JacobiSVD<Matrix3d> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d u = svd.matrixU(), v = svd.matrixV();
  Vector3d sigma = svd.singularValues();
  if (u.determinant() * v.determinant() < 0) {
    u.col(2) = -u.col(2);
    sigma[2] = -sigma[2];
  }
  return u * sigma.cwiseMax(kLeast).cwiseMin(kLargest).asDiagonal() * v.transpose();
}

// Angular velocity of a body with second moments about its centre; axes without inertia do not turn.
Vector3d angularVelocity(const Matrix3d& second, const Vector3d& angular) {
  const Matrix3d inertia = second.trace() * Matrix3d::Identity() - second;
  const double scale = inertia.cwiseAbs().maxCoeff();
  Vector3d omega = Vector3d::Zero();
  if (!(scale > 0) || !std::isfinite(scale)) return omega;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(inertia / scale);
  for (int k = 0; k < 3; ++k) {
    if (solver.eigenvalues()[k] < 1e-6) continue;
    const Vector3d axis = solver.eigenvectors().col(k);
    omega += axis * axis.dot(angular) / (scale * solver.eigenvalues()[k]);
  }
  return omega;
}

std::vector<Vector3d> widePositions(const World& world, BodyId body) {
  std::vector<Vector3d> x;
  for (const Vec3& p : world.positions(body)) x.push_back(wide(p));
  return x;
}

}  // namespace

Vector3d cornerOf(const World& world, BodyId body, std::uint32_t visual_vertex) {
  const formats::PackageView& package = world.asset(body).package();
  const formats::BarycentricAttachment& attachment = package.barycentric()[visual_vertex];
  const auto& corners = package.tetrahedra()[attachment.tetrahedron].vertex;
  const auto x = world.positions(body);
  Vector3d result = wide(x[corners[3]]);
  for (std::size_t k = 0; k < 3; ++k) {
    result += double(attachment.weight[k]) * (wide(x[corners[k]]) - wide(x[corners[3]]));
  }
  return result;
}

double tetrahedraVolume(const World& world, BodyId body) {
  const auto x = world.positions(body);
  double sum = 0;
  for (const formats::Tetrahedron& t : world.asset(body).package().tetrahedra()) {
    sum += geometry::signedVolume6(wide(x[t.vertex[0]]), wide(x[t.vertex[1]]), wide(x[t.vertex[2]]),
                                   wide(x[t.vertex[3]])) /
           6;
  }
  return sum;
}

BodyMeasure::BodyMeasure(const Asset& asset, double stiffness_scale) : asset_(&asset), scale_(stiffness_scale) {
  const formats::PackageView& package = asset.package();
  const auto vertices = package.physicalVertices();
  const auto radius_of = [](const Vector3d& first, double second, double mass) {
    return std::sqrt(std::max(0.0, second / mass - (first / mass).squaredNorm()));
  };
  Vector3d first = Vector3d::Zero();
  double second = 0, mass = 0;
  const Vector3d reference = wide(vertices.front().rest_position);
  double lightest = std::numeric_limits<double>::infinity(), heaviest = 0;
  for (const formats::PhysicalVertex& vertex : vertices) {
    lightest = std::min(lightest, double(vertex.mass));
    heaviest = std::max(heaviest, double(vertex.mass));
    const Vector3d d = wide(vertex.rest_position) - reference;
    mass += double(vertex.mass);
    first += double(vertex.mass) * d;
    second += double(vertex.mass) * d.squaredNorm();
  }
  uneven_ = heaviest > double(internal::kUneven) * lightest;
  const double body_radius = radius_of(first, second, mass);
  for (const formats::Cluster& cluster : package.clusters()) {
    ClusterData data;
    data.columns = cluster.mode == formats::ClusterMode::quadratic ? 9 : 3;
    data.a_qq.setZero();
    data.moment.setZero();
    if (data.columns == 9) {
      std::size_t n = 0;
      for (int row = 0; row < 9; ++row) {
        for (int column = 0; column <= row; ++column) {
          data.a_qq(row, column) = data.a_qq(column, row) =
              double(package.quadraticMoments()[cluster.quadratic].a_qq[n++]);
        }
      }
    } else {
      const auto& a = cluster.a_qq;
      data.a_qq.topLeftCorner<3, 3>() << double(a[0]), double(a[3]), double(a[5]), double(a[3]), double(a[1]),
          double(a[4]), double(a[5]), double(a[4]), double(a[2]);
    }
    Eigen::Matrix<double, 9, 1> mean = Eigen::Matrix<double, 9, 1>::Zero();
    const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
    for (const formats::Membership& member : members) {
      const Vector3d q =
          (wide(vertices[member.vertex].rest_position) - wide(cluster.rest_center)) / double(cluster.radius);
      Eigen::Matrix<double, 9, 1> m;
      m << q, q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0];
      data.monomials.push_back(m);
      mean += double(member.mu) * m;
    }
    double spread = 0;
    for (std::size_t k = 0; k < members.size(); ++k) {
      data.monomials[k] -= mean;
      data.moment += double(members[k].mu) * data.monomials[k].head<3>() * data.monomials[k].transpose();
      spread += double(members[k].mu) * data.monomials[k].head<3>().squaredNorm();
    }
    addRoundingGain(members, data);
    const double radius = double(cluster.radius) * std::sqrt(spread);
    data.size_ratio = radius > 0 ? std::max(1.0, body_radius / radius) : 1.0;
    if (cluster.mode != formats::ClusterMode::rigid) {
      addStiffness(package, std::uint32_t(clusters_.size()), stiffness_scale, data);
    } else {
      data.rigid = true;
      data.a_qq.setZero();
    }
    clusters_.push_back(std::move(data));
  }
}

void BodyMeasure::addStiffness(const formats::PackageView& package, std::uint32_t index, double scale,
                               ClusterData& data) {
  const formats::Cluster& cluster = package.clusters()[index];
  // Frequencies are those of the whole body; a smaller cluster rings higher (docs/method.md §4).
  data.omega = 2 * std::numbers::pi * double(cluster.stretch_hz) * scale * data.size_ratio;
  if (package.mechanics().empty()) return;
  const formats::ClusterMechanics& mechanics = package.mechanics()[index];
  data.limits = internal::goalLimits(package, index);
  data.limited = mechanics.limit != formats::LimitMethod::none;
  const double response = data.a_qq.topLeftCorner<3, 3>().trace();
  if (data.limits.volume != formats::VolumeMethod::none && response > 0) {
    data.volume_response = response;
  }
  if (mechanics.stiffness == formats::StiffnessModel::per_step) {
    data.per_step = true;
    const double beta = double(mechanics.per_step_beta[0]);
    data.stiffness_ratio = (1 - beta) / std::max(beta, 1e-12);
  }
  if (mechanics.stiffness == formats::StiffnessModel::elastic) {
    const internal::ElasticModes elastic = internal::elasticModes(package, index);
    data.modes.resize(27, 27);
    data.modes = elastic.vectors.cast<double>();
    data.mode_omega2 = elastic.omega2.cast<double>() * (scale * scale);
  }
}

double BodyMeasure::omegaOf(const ClusterData& data, double pass_seconds) {
  return data.per_step ? std::sqrt(data.stiffness_ratio) / pass_seconds : data.omega;
}

double BodyMeasure::takenOf(const ClusterData& data, double pass_seconds) {
  if (data.rigid) return 1;
  if (data.modes.cols() > 0) {
    double taken = 0, count = 0;
    for (const double omega2 : data.mode_omega2) {
      const double phase2 = pass_seconds * pass_seconds * omega2;
      taken += phase2 / (1 + phase2);
      count += omega2 > 0 ? 1 : 0;
    }
    return count > 0 ? taken / count : 0;
  }
  const double phase = omegaOf(data, pass_seconds) * pass_seconds;
  return phase * phase / (1 + phase * phase);
}

double BodyMeasure::slowestHz(double pass_seconds) const {
  double slowest = std::numeric_limits<double>::infinity();
  for (const ClusterData& data : clusters_) {
    if (data.rigid) continue;
    if (data.modes.cols() == 0) {
      slowest = std::min(slowest, omegaOf(data, pass_seconds) / (2 * std::numbers::pi * data.size_ratio));
      continue;
    }
    double least = std::numeric_limits<double>::infinity();
    for (const double omega2 : data.mode_omega2) {
      if (omega2 > 0) least = std::min(least, omega2);
    }
    if (data.mode_omega2.maxCoeff() == 0 && !data.modes.isZero(0)) least = 0;
    slowest = std::min(slowest, std::sqrt(least) / (2 * std::numbers::pi * data.size_ratio * data.size_ratio));
  }
  return slowest;
}

double BodyMeasure::fastestOmega(double pass_seconds) const {
  double fastest = 0;
  for (const ClusterData& data : clusters_) {
    if (data.rigid) continue;
    fastest = std::max(fastest,
                       data.modes.cols() == 0 ? omegaOf(data, pass_seconds) : std::sqrt(data.mode_omega2.maxCoeff()));
  }
  return fastest;
}

BodyMeasure::Answer BodyMeasure::answerOf(std::size_t index, const Match& match, double pass_seconds,
                                          Manner manner) const {
  const ClusterData& data = clusters_[index];
  const formats::Cluster& cluster = asset_->package().clusters()[index];
  Answer answer;
  if (data.rigid) return answer;
  const double mass = double(cluster.mass), radius = double(cluster.radius), h2 = pass_seconds * pass_seconds;
  const double phase = omegaOf(data, pass_seconds) * pass_seconds;
  Eigen::VectorXd amplitudes = Eigen::VectorXd::Zero(data.modes.cols());
  Eigen::ArrayXd omega2 = data.mode_omega2.array();
  if (manner.lost && data.modes.cols() > 0) {
    const double taken = takenOf(data, pass_seconds);
    omega2.setConstant(taken / (h2 * std::max(1 - taken, 1e-12)));
  }
  // The answer of the modes to a load on the moments.
  const auto answer_to = [&](const Eigen::Matrix<double, 3, 9>& load,
                             Eigen::VectorXd& amplitude) -> Eigen::Matrix<double, 3, 9> {
    if (data.modes.cols() == 0) return load * data.a_qq / (1 + phase * phase);
    const Eigen::Matrix<double, 3, 9> local = match.rotation.transpose() * load;
    const Eigen::VectorXd loads = data.modes.transpose() * Eigen::Map<const Eigen::Matrix<double, 27, 1>>(local.data());
    amplitude = loads.array() / (1 + h2 * omega2);
    const Eigen::Matrix<double, 27, 1> sum = data.modes * amplitude;
    return match.rotation * Eigen::Map<const Eigen::Matrix<double, 3, 9>>(sum.data());
  };
  answer.deformation = answer_to(match.deviation, amplitudes);
  if (data.volume_response > 0) {
    // c of the energy 1/2 M r² c (det F - 1)², 1/s².
    const double omega = internal::volumeOmega(cluster, data.size_ratio, scale_, pass_seconds);
    const double stiffness = omega * omega / data.volume_response;
    const Matrix3d a = match.rest + answer.deformation.leftCols<3>();
    Eigen::Matrix<double, 3, 9> unit_pressure = Eigen::Matrix<double, 3, 9>::Zero();
    unit_pressure.leftCols<3>() = internal::cofactor(a.cast<float>()).cast<double>();
    Eigen::VectorXd amplitude = Eigen::VectorXd::Zero(data.modes.cols());
    const Eigen::Matrix<double, 3, 9> pushed = answer_to(unit_pressure, amplitude);
    const float ease = float(1 / (h2 * stiffness));
    const double pressure =
        manner.tangled ? 0.0
                       : double(internal::volumePressure(a.cast<float>(), pushed.leftCols<3>().cast<float>(), ease));
    answer.deformation += pressure * pushed;
    amplitudes += pressure * amplitude;
    // Where the pressure does not act it has no energy either, but may get it.
    const double off = internal::volumeEnergy((a + pressure * pushed.leftCols<3>()).determinant());
    (pressure != 0 ? answer.energy : answer.latent) = mass * radius * radius * stiffness * off;
  }
  if (data.modes.cols() > 0) {
    answer.energy += 0.5 * mass * radius * radius * (omega2 * amplitudes.array().square()).sum();
  }
  if (manner.guarded && data.limited) {
    internal::Columns<9> f = answer.deformation.cast<float>();
    f.leftCols<3>() += match.rest.cast<float>();
    const internal::Matrix3 shape = (match.rotation.transpose() * match.rest).cast<float>();
    answer.limited = internal::applyGoalLimits(data.limits, false, internal::guardMargin(float(pass_seconds)),
                                               match.rotation.cast<float>(), &shape, f) != internal::Limited::nothing;
    answer.deformation = f.cast<double>();
    answer.deformation.leftCols<3>() -= match.rest;
  } else if (manner.guarded && (data.modes.cols() > 0 || data.a_qq(0, 0) > 0)) {
    const Matrix3d wanted = match.rest + answer.deformation.leftCols<3>(), held = clampedStretch(wanted);
    answer.limited = (held - wanted).norm() > 1e-6 * wanted.norm();
    answer.deformation.leftCols<3>() = held - match.rest;
  }
  answer.deformation *= radius;
  if (data.modes.cols() == 0) {
    const double omega = omegaOf(data, pass_seconds);
    double sum = 0;
    const auto members = asset_->package().memberships().subspan(cluster.first_member, cluster.member_count);
    for (std::size_t k = 0; k < members.size(); ++k) {
      sum += double(members[k].mu) * (answer.deformation * data.monomials[k]).squaredNorm();
    }
    answer.energy += 0.5 * mass * omega * omega * sum;
  }
  return answer;
}

// A_pq is rounded to 2^-24 of sqrt(M_jj), its product with A_qq and the monomials carries that on.
void BodyMeasure::addRoundingGain(std::span<const formats::Membership> members, const ClusterData& data) {
  Eigen::Matrix<double, 9, 1> spread = Eigen::Matrix<double, 9, 1>::Zero();
  for (std::size_t k = 0; k < members.size(); ++k) {
    spread += double(members[k].mu) * data.monomials[k].cwiseAbs2();
  }
  const Eigen::Matrix<double, 9, 9> noise = spread.cwiseSqrt().asDiagonal() * data.a_qq;
  double gain = 0;
  for (std::size_t k = 0; k < members.size(); ++k) {
    gain += double(members[k].mu) * (noise * data.monomials[k].asDiagonal()).squaredNorm();
  }
  rounding_gain_ = std::max(rounding_gain_, std::sqrt(gain));
}

bool BodyMeasure::finite(const World& world, BodyId body) {
  // A sum of finite numbers below 1e30 is finite; one that is not makes it so.
  double sum = 0;
  for (const Vec3& x : world.positions(body)) sum += double(x[0]) + double(x[1]) + double(x[2]);
  for (const Vec3& v : world.velocities(body)) sum += double(v[0]) + double(v[1]) + double(v[2]);
  return std::isfinite(sum);
}

BodyMotion BodyMeasure::motion(const World& world, BodyId body) const {
  BodyMotion m;
  const auto vertices = asset_->package().physicalVertices();
  const auto x = world.positions(body), v = world.velocities(body);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const double mass = double(vertices[i].mass);
    m.mass += mass;
    m.center += mass * wide(x[i]);
    m.momentum += mass * wide(v[i]);
    m.momentum_scale += mass * wide(v[i]).norm();
    m.reach = std::max(m.reach, wide(x[i]).cwiseAbs().maxCoeff());
    m.fastest = std::max(m.fastest, wide(v[i]).norm());
  }
  m.center /= m.mass;
  const Vector3d mean = m.momentum / m.mass;
  Matrix3d second = Matrix3d::Zero();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const double mass = double(vertices[i].mass);
    const Vector3d d = wide(x[i]) - m.center, u = wide(v[i]) - mean;
    m.angular += mass * d.cross(u);
    m.angular_scale += mass * d.norm() * wide(v[i]).norm();
    m.kinetic += 0.5 * mass * u.squaredNorm();
    second += mass * d * d.transpose();
    m.extent = std::max(m.extent, d.norm());
  }
  const Vector3d omega = angularVelocity(second, m.angular);
  m.spin = omega.norm();
  m.turning_energy = 0.5 * omega.dot(m.angular);
  m.finite = std::isfinite(m.kinetic) && m.center.allFinite();
  return m;
}

double BodyMeasure::restError(const World& world, BodyId body) const {
  const auto vertices = asset_->package().physicalVertices();
  const auto x = world.positions(body);
  double mass = 0;
  Vector3d c = Vector3d::Zero(), c0 = Vector3d::Zero();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    mass += double(vertices[i].mass);
    c += double(vertices[i].mass) * wide(x[i]);
    c0 += double(vertices[i].mass) * wide(vertices[i].rest_position);
  }
  c /= mass;
  c0 /= mass;
  Matrix3d a = Matrix3d::Zero();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    a += double(vertices[i].mass) * (wide(x[i]) - c) * (wide(vertices[i].rest_position) - c0).transpose();
  }
  const Matrix3d r = nearestRotation(a);
  double worst = 0;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    worst = std::max(worst, (wide(x[i]) - c - r * (wide(vertices[i].rest_position) - c0)).norm());
  }
  return worst / double(asset_->package().info().diagonal);
}

BodyMeasure::Match BodyMeasure::match(std::size_t index, std::span<const Vector3d> x, const Matrix3d& shape,
                                      const Matrix3d* rotation) const {
  const formats::PackageView& package = asset_->package();
  const formats::Cluster& cluster = package.clusters()[index];
  const ClusterData& data = clusters_[index];
  const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
  Match result;
  const Vector3d& reference = x[members.front().vertex];
  Vector3d offset = Vector3d::Zero();
  for (const formats::Membership& member : members) {
    offset += double(member.mu) * (x[member.vertex] - reference);
  }
  result.center = reference + offset;
  Eigen::Matrix<double, 3, 9> a = Eigen::Matrix<double, 3, 9>::Zero();
  for (std::size_t k = 0; k < members.size(); ++k) {
    a += double(members[k].mu) * (x[members[k].vertex] - result.center) * data.monomials[k].transpose();
  }
  a /= double(cluster.radius);
  result.rotation = rotation != nullptr ? *rotation : nearestRotation(a.leftCols<3>() * shape.transpose());
  result.rest = result.rotation * shape;
  result.deviation = a - result.rest * data.moment;
  return result;
}

std::vector<Matrix3d> BodyMeasure::shapesOf(const World& world, BodyId body) {
  std::vector<Matrix3d> shapes(world.asset(body).package().clusters().size());
  for (std::size_t c = 0; c < shapes.size(); ++c) {
    const Mat3 shape = world.clusterRestShape(body, std::uint32_t(c));
    shapes[c] = Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(shape.data()).cast<double>();
  }
  return shapes;
}

bool BodyMeasure::isTangled(const World& world, BodyId body, double pass_seconds, bool tangled) const {
  return partPotential(widePositions(world, body), shapesOf(world, body), pass_seconds, tangled).tangled;
}

BodyMeasure::Potential BodyMeasure::potential(const World& world, BodyId body, double pass_seconds,
                                              bool tangled) const {
  const std::vector<Vector3d> x = widePositions(world, body);
  const std::vector<Matrix3d> shapes = shapesOf(world, body);
  Potential result;
  const PartPotential one = partPotential(x, shapes, pass_seconds, tangled);
  const ClusterPotential clusters = clusterPotential(x, shapes, pass_seconds, one, false);
  const double by_cluster = clusters.energy;
  result.limited = clusters.limited;
  result.most = by_cluster + one.weight * std::max(0.0, one.energy - by_cluster);
  result.least = by_cluster + one.least_weight * std::max(0.0, one.energy - by_cluster);
  if (one.any_lost) result.most = std::max(result.most, clusterPotential(x, shapes, pass_seconds, one, true).energy);
  result.most += clusters.latent;
  result.tangled = one.tangled;
  return result;
}

// Whether a cluster has its part looked at: it has lost its orientation, is stiff and torn, or beyond the guard
// (docs/method.md §3, eq. 10).
bool BodyMeasure::isLost(const ClusterData& data, const Match& match, double pass_seconds) const {
  constexpr double kResistance = 0.3, kTorn = double(internal::kTorn);
  constexpr double kLeast = double(internal::kLeastStretch), kLargest = double(internal::kLargestStretch);
  const double margin = double(internal::guardMargin(float(pass_seconds)));
  const Matrix3d rest = data.moment.leftCols<3>();
  if (!(rest.trace() > 0)) return false;
  const Matrix3d linear = match.deviation.leftCols<3>() + match.rest * rest;
  const double largest = data.limited ? std::max(kLargest, double(data.limits.largest)) : kLargest;
  const double kept = 1 - takenOf(data, pass_seconds);
  if (kept < 0.5 && linear.norm() > kTorn * largest * rest.norm()) return true;
  const Matrix3d c = match.rotation.transpose() * linear, s = 0.5 * (c + c.transpose()) - kResistance * rest;
  const Matrix3d resistance = (s.trace() + 1e-3 * rest.trace()) * Matrix3d::Identity() - s;
  if (!(Eigen::SelfAdjointEigenSolver<Matrix3d>(resistance, Eigen::EigenvaluesOnly).eigenvalues()[0] > 0)) return true;
  if (data.rigid || data.modes.cols() > 0) return false;
  const Matrix3d f = match.rest + kept * (match.deviation * data.a_qq).leftCols<3>();
  const Vector3d stretches = Eigen::JacobiSVD<Matrix3d>(f).singularValues();
  return f.determinant() < 0 || stretches[2] < kLeast / margin || stretches[0] > largest * margin;
}

bool BodyMeasure::isStiff(double pass_seconds) const {
  return std::all_of(clusters_.begin(), clusters_.end(), [&](const ClusterData& data) {
    return takenOf(data, pass_seconds) >= 1 - double(internal::kStiffKeeps);
  });
}

// Whether clusters that share a vertex are turned against each other by more than 120 degrees.
bool BodyMeasure::areTangled(std::span<const Match> matches) const {
  const auto turned = [&](std::uint32_t a, std::uint32_t b) {
    const Matrix3d between = matches[a].rotation.transpose() * matches[b].rotation;
    return between.trace() < 0;  // 1 + 2 cos
  };
  std::vector<std::uint32_t> last(asset_->package().physicalVertices().size(), formats::kNone);
  const auto clusters = asset_->package().clusters();
  for (std::uint32_t c = 0; c < clusters.size(); ++c) {
    for (const formats::Membership& member :
         asset_->package().memberships().subspan(clusters[c].first_member, clusters[c].member_count)) {
      std::uint32_t& before = last[member.vertex];
      if (before != formats::kNone && turned(before, c)) return true;
      before = c;
    }
  }
  return false;
}

BodyMeasure::PartPotential BodyMeasure::partPotential(std::span<const Vector3d> x, std::span<const Matrix3d> shapes,
                                                      double pass_seconds, bool tangled) const {
  const formats::PackageView& package = asset_->package();
  const auto clusters = package.clusters();
  double mass = 0;
  Vector3d center = Vector3d::Zero(), rest_center = Vector3d::Zero();
  std::vector<Match> matches;
  const Vector3d& origin = x.front();
  const Vector3d rest_origin = wide(clusters[0].rest_center);
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    matches.push_back(match(c, x, shapes[c], nullptr));
    mass += double(clusters[c].mass);
    center += double(clusters[c].mass) * (matches[c].center - origin);
    rest_center += double(clusters[c].mass) * (wide(clusters[c].rest_center) - rest_origin);
  }
  center = origin + center / mass;
  rest_center = rest_origin + rest_center / mass;
  Matrix3d moment = Matrix3d::Zero();
  const auto moment_of = [&](std::size_t c) -> Matrix3d {
    return matches[c].deviation.leftCols<3>() + matches[c].rest * clusters_[c].moment.leftCols<3>();
  };
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    const double m = double(clusters[c].mass), r2 = std::pow(double(clusters[c].radius), 2);
    moment += m * ((matches[c].center - center) * (wide(clusters[c].rest_center) - rest_center).transpose() +
                   r2 * moment_of(c));
  }
  const Matrix3d rotation = nearestRotation(moment);
  double deviation = 0, spread = 0, own_deviation = 0, own_spread = 0;
  PartPotential result;
  result.rotation = rotation;
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    const bool lost = isLost(clusters_[c], matches[c], pass_seconds);
    result.lost.push_back(lost ? 1 : 0);
    result.any_lost = result.any_lost || lost;
  }
  if (clusters.size() < 2) return result;
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    const double m = double(clusters[c].mass), radius = double(clusters[c].radius);
    const Matrix3d rest_moment = clusters_[c].moment.leftCols<3>();
    const Vector3d arm = wide(clusters[c].rest_center) - rest_center;
    const Vector3d goal = center + rotation * arm;
    spread += m * (arm.squaredNorm() + radius * radius * rest_moment.trace());
    deviation += m * (matches[c].center - goal).squaredNorm();
    if (rest_moment.trace() > 0) {
      deviation += m * radius * radius * (moment_of(c) - rotation * rest_moment).squaredNorm() / rest_moment.trace();
      own_deviation += m * radius * radius * matches[c].deviation.leftCols<3>().squaredNorm() / rest_moment.trace();
      own_spread += m * radius * radius * rest_moment.trace();
    }
    // Of the elastic model what the average mode is moved by: rows count with it too.
    const double taken = takenOf(clusters_[c], pass_seconds);
    const auto members = package.memberships().subspan(clusters[c].first_member, clusters[c].member_count);
    for (std::size_t k = 0; k < members.size(); ++k) {
      const Vector3d g = goal + radius * (rotation * clusters_[c].monomials[k].head<3>());
      result.energy += 0.5 * m * double(members[k].mu) * taken * (x[members[k].vertex] - g).squaredNorm();
    }
  }
  result.energy /= pass_seconds * pass_seconds;
  result.tangled = tangled || areTangled(matches);
  // Matched as one whatever its past: at once where passes are few, masses uneven or all is stiff, far off where a
  // cluster is lost. What is tangled may have gone on to.
  const bool at_once = pass_seconds >= double(internal::kFewPasses) || uneven_ || isStiff(pass_seconds);
  // Bent: no cluster is out of shape.
  const bool bent = own_deviation <= internal::kDistorted * internal::kDistorted * own_spread;
  const auto weight = [&](double far) {  // of what is nowhere off: 0
    return deviation > 0 ? std::max(0.0, 1 - far * far * spread / deviation) : 0.0;
  };
  if (at_once) {
    result.least_weight = weight(internal::kHardlyAstray);
  } else if (result.any_lost && !bent) {
    result.least_weight = weight(internal::kAstray);
  }
  if (at_once || result.tangled) {
    result.weight = weight(internal::kHardlyAstray);
  } else if (!bent) {
    result.weight = weight(internal::kAstray);
  }
  result.tangled = result.tangled && result.weight > 0;
  return result;
}

BodyMeasure::ClusterPotential BodyMeasure::clusterPotential(std::span<const Vector3d> x,
                                                            std::span<const Matrix3d> shapes, double pass_seconds,
                                                            const PartPotential& part, bool part_rotates) const {
  const formats::PackageView& package = asset_->package();
  const auto vertices = package.physicalVertices();
  // y with goals x: a pass starts from there in effect. Richardson's iteration climbs the dual function, whose values
  // are bounds from below; what no goals reach is a spring of about kSearchRounds m / h². What the guard moves is no
  // energy of a cluster: it counts with the first pass alone.
  std::vector<Vector3d> y(x.begin(), x.end()), goal(x.size());
  ClusterPotential result;
  double& bound = result.energy;
  double first = 0;
  for (int iteration = -1; iteration < kSearchRounds; ++iteration) {
    const bool guarded = iteration < 0;
    double elastic = 0, apart = 0;
    std::fill(goal.begin(), goal.end(), Vector3d::Zero());
    for (std::size_t c = 0; c < clusters_.size(); ++c) {
      const ClusterData& data = clusters_[c];
      const formats::Cluster& cluster = package.clusters()[c];
      const bool lost = part_rotates && part.lost[c] != 0;
      const Match m = match(c, y, shapes[c], lost ? &part.rotation : nullptr);
      const Answer answer = answerOf(c, m, pass_seconds, {guarded, part.tangled, lost});
      result.limited = result.limited || answer.limited;
      if (guarded) result.latent += answer.latent;
      elastic += answer.energy;
      Eigen::Matrix<double, 3, 9> f = answer.deformation;
      f.leftCols<3>() += double(cluster.radius) * m.rest;
      const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
      for (std::size_t k = 0; k < members.size(); ++k) {
        const std::size_t i = members[k].vertex;
        const Vector3d g = m.center + f * data.monomials[k];
        goal[i] += double(members[k].share) * g;
        apart += double(members[k].share) * double(vertices[i].mass) * (g - x[i]).squaredNorm();
      }
    }
    double missing = 0, multiplier = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      missing += double(vertices[i].mass) * (x[i] - goal[i]).squaredNorm();
      multiplier += double(vertices[i].mass) * (y[i] - x[i]).dot(x[i] - goal[i]);
      if (!guarded) y[i] += x[i] - goal[i];
    }
    bound = std::max(bound, elastic + (0.5 * apart + multiplier) / (pass_seconds * pass_seconds));
    if (iteration == 0) first = missing;
    if (missing <= 1e-8 * first) break;
  }
  return result;
}

}  // namespace sinew::tools

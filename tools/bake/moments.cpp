// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/moments.h"

#include <algorithm>
#include <cmath>

#include "runtime/geometry/pseudo_inverse.h"
#include "runtime/geometry/rounded.h"
#include "runtime/geometry/symmetric_eigen.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

// Of a centre's coordinates: the mean of vertices in one place is so far from them at most, by rounding.
constexpr double kPointRadius = 1e-12;

// Independent ways to bend and twist, of six, that a quadratic cluster has at least.
constexpr Eigen::Index kLeastBending = 3;

template <class Matrix>
Matrix pseudoInverse(const Matrix& moment, Eigen::Index& rank) {
  const geometry::SymmetricEigen solver = geometry::symmetricEigen(moment);
  const auto& values = solver.values;
  const double cutoff = geometry::kMomentCutoff * values.maxCoeff();
  Matrix inverse = Matrix::Zero();
  rank = 0;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (values[i] <= cutoff) continue;
    inverse += solver.vectors.col(i) * solver.vectors.col(i).transpose() / values[i];
    ++rank;
  }
  return inverse;
}

// Whether hardly any square or product of coordinates is more than a linear function of them on these vertices (of the
// six corners of a prism two are): then one and the same motion is both stretch and bending, with the stiffness and the
// limits of both. Two layers of points alone, whose z² is a function of z, bend well. \param moment of
// (q, quadraticTerms(q)), centred.
bool bendingIsStretch(const Matrix9d& moment) {
  Matrix9d scaled = moment;
  const double largest = moment.diagonal().maxCoeff();
  for (Eigen::Index i = 0; i < 9; ++i) {
    const double own = moment(i, i) > geometry::kMomentCutoff * largest ? 1 / std::sqrt(moment(i, i)) : 0.0;
    scaled.row(i) *= own;
    scaled.col(i) *= own;
  }
  Eigen::Index linear_rank = 0;
  const Eigen::Matrix3d linear = scaled.topLeftCorner<3, 3>();
  const Eigen::Matrix<double, 6, 3> mixed = scaled.bottomLeftCorner<6, 3>();
  const Eigen::Matrix<double, 6, 6> all = scaled.bottomRightCorner<6, 6>();
  const Eigen::Matrix<double, 6, 6> rest = all - mixed * pseudoInverse(linear, linear_rank) * mixed.transpose();
  const auto rank = [](const Eigen::Matrix<double, 6, 6>& m) {
    return (geometry::symmetricEigenvalues(m).array() > geometry::kMomentCutoff).count();
  };
  return rank(rest) < rank(all) && rank(rest) < kLeastBending;
}

Eigen::Matrix<double, 6, 1> quadraticTerms(const Vector3d& q) {
  Eigen::Matrix<double, 6, 1> terms;
  terms << q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0];
  return terms;
}

}  // namespace

ClusterConstants clusterConstants(std::span<const ClusterSource> sources,
                                  std::span<const formats::PhysicalVertex> vertices, const ClusterOptions& options,
                                  std::vector<Finding>& findings) {
  ClusterConstants result;
  std::vector<double> total_weight(vertices.size(), 0);
  for (const ClusterSource& source : sources) {
    if (source.rider != formats::kNone) continue;
    for (std::size_t i = 0; i < source.vertices.size(); ++i) total_weight[source.vertices[i]] += source.weights[i];
  }
  std::vector<std::string> flat;
  std::vector<std::string> poor;
  for (const ClusterSource& source : sources) {
    const ClusterOptions& own = source.options ? *source.options : options;
    const bool rides = source.rider != formats::kNone;
    formats::Cluster cluster{};
    cluster.mode = source.mode;
    cluster.piece = source.piece;
    cluster.first_member = std::uint32_t(result.memberships.size());
    cluster.member_count = std::uint32_t(source.vertices.size());
    cluster.alpha = float(own.alpha);
    cluster.stretch_hz = float(own.stretch_hz);
    cluster.bend_hz = float(own.bend_hz);
    cluster.twist_hz = float(own.twist_hz);
    cluster.quadratic = formats::kNone;

    const auto position = [&](std::size_t i) {
      const auto& x = vertices[source.vertices[i]].rest_position;
      return Vector3d(double(x[0]), double(x[1]), double(x[2]));
    };
    std::vector<double> mu(source.vertices.size());
    double mass = 0;
    Vector3d center = Vector3d::Zero();
    for (std::size_t i = 0; i < mu.size(); ++i) {
      const std::uint32_t v = source.vertices[i];
      mu[i] = double(vertices[v].mass) * source.weights[i] / (rides ? source.weights[i] : total_weight[v]);
      mass += mu[i];
      center += mu[i] * position(i);
    }
    center /= mass;
    double radius = 0;
    for (std::size_t i = 0; i < mu.size(); ++i) {
      mu[i] /= mass;
      radius = std::max(radius, (position(i) - center).norm());
    }
    if (!(radius > kPointRadius * center.norm())) radius = 1;  // vertices in one place: any length does
    cluster.mass = float(mass);
    cluster.radius = float(radius);
    const Vector3d rounded_center = geometry::roundedToFloat(center);
    cluster.rest_center = {float(rounded_center[0]), float(rounded_center[1]), float(rounded_center[2])};

    // About the mean of q, which is not zero where the centre was rounded: matching subtracts the mean of p alone.
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    Vector3d mean_q = Vector3d::Zero();
    Eigen::Matrix<double, 6, 1> mean = Eigen::Matrix<double, 6, 1>::Zero();
    std::vector<Vector3d> q(mu.size());
    for (std::size_t i = 0; i < mu.size(); ++i) {
      q[i] = (position(i) - rounded_center) / double(cluster.radius);
      moment += mu[i] * q[i] * q[i].transpose();
      mean_q += mu[i] * q[i];
      mean += mu[i] * quadraticTerms(q[i]);
    }
    moment -= mean_q * mean_q.transpose();
    Eigen::Index rank = 0;
    const Eigen::Matrix3d inverse = pseudoInverse(moment, rank);
    cluster.a_qq = {float(inverse(0, 0)), float(inverse(1, 1)), float(inverse(2, 2)),
                    float(inverse(0, 1)), float(inverse(1, 2)), float(inverse(2, 0))};
    if (rank < 3 && cluster.mode != formats::ClusterMode::rigid) {
      cluster.mode = formats::ClusterMode::rigid;
      flat.push_back(source.name);
    }
    if (cluster.mode == formats::ClusterMode::quadratic) {
      Matrix9d moment9 = Matrix9d::Zero();
      for (std::size_t i = 0; i < mu.size(); ++i) {
        Vector9d q9;
        q9 << q[i] - mean_q, quadraticTerms(q[i]) - mean;
        moment9 += mu[i] * q9 * q9.transpose();
      }
      const Matrix9d inverse9 = pseudoInverse(moment9, rank);
      if (rank <= 3 || bendingIsStretch(moment9)) {
        cluster.mode = formats::ClusterMode::linear;
        poor.push_back(source.name);
      } else {
        cluster.quadratic = std::uint32_t(result.quadratic_moments.size());
        formats::QuadraticMoment packed{};
        std::size_t at = 0;
        for (Eigen::Index row = 0; row < 9; ++row) {
          for (Eigen::Index column = 0; column <= row; ++column) packed.a_qq[at++] = float(inverse9(row, column));
        }
        result.quadratic_moments.push_back(packed);
      }
    }
    for (std::size_t i = 0; i < mu.size(); ++i) {
      const std::uint32_t v = source.vertices[i];
      result.memberships.push_back({v, float(mu[i]), rides ? 0 : float(source.weights[i] / total_weight[v])});
    }
    if (rides) {
      // Matched to the host, which it does not move; it moves the four, which do not count in the match.
      for (std::uint32_t k = 0; k < 4; ++k) result.memberships.push_back({source.rider + k, 0, 1});
      cluster.member_count += 4;
      cluster.mass = 4 * vertices[source.rider].mass;
    }
    result.clusters.push_back(cluster);
  }
  reportClusters(findings, "cluster-flat", flat, "lie in a plane or on a line and were made rigid",
                 "Use a coarser clusters.grid, or more physical vertices.", Severity::info);
  reportClusters(findings, "cluster-poor", poor, "have too few vertices for bending and were made linear",
                 "Use a coarser clusters.grid, or more physical vertices.", Severity::info);
  return result;
}

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Shape matching as one writes it with Eigen: cluster by cluster, rest offsets and monomials stored once, float,
// docs/method.md eq. 1 to 10. What the runtime's kernels are measured against, and (with the rotation by SVD) what
// their results are compared with. It shares no code with the runtime.
#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "sinew/formats/package.h"

namespace sinew::benchmarks {

/// How the rotation is found: as Müller et al. 2005 do it, in closed form (the fastest of what was tried: the iteration
/// of Müller et al. 2016 took 2.5 times as long on moving clusters), or by a singular value decomposition in double.
enum class RotationMethod { polar, svd };

/// One body's clusters of one kind: N = 3 (rigid, linear) or 9 (quadratic) columns.
template <int N>
class EigenReference {
 public:
  using Vector3 = Eigen::Vector3f;
  using Matrix3 = Eigen::Matrix3f;
  using Columns = Eigen::Matrix<float, 3, N>;
  using Square = Eigen::Matrix<float, N, N>;
  using Monomials = Eigen::Matrix<float, N, 1>;

  /// \param kept the part of a deformation that one pass keeps, beta of eq. 6: 0 makes clusters rigid.
  EigenReference(const formats::PackageView& package, float kept) {
    const std::size_t vertex_count = package.physicalVertices().size();
    sum_.resize(vertex_count);
    for (const formats::Cluster& cluster : package.clusters()) {
      Cluster own;
      own.first = members_.size();
      own.radius = cluster.radius;
      const Vector3 rest_center(cluster.rest_center[0], cluster.rest_center[1], cluster.rest_center[2]);
      Monomials mean = Monomials::Zero();
      const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
      for (const formats::Membership& member : members) {
        const auto& rest = package.physicalVertices()[member.vertex].rest_position;
        const Vector3 q = (Vector3(rest[0], rest[1], rest[2]) - rest_center) / cluster.radius;
        members_.push_back({member.vertex, member.mu, member.share, monomials(q)});
        mean += member.mu * members_.back().q;
      }
      own.end = members_.size();
      Square moment = Square::Zero();
      for (std::size_t i = own.first; i < own.end; ++i) {
        members_[i].q -= mean;
        moment += members_[i].mu * members_[i].q * members_[i].q.transpose();
      }
      own.moment = moment.template topRows<3>();
      own.s = kept * inverse(package, cluster);
      clusters_.push_back(own);
    }
  }

  /// One pass: goals of all clusters for positions `y`, blended into `goals`. Both of the physical vertices, 3 floats
  /// each, metres.
  void match(std::span<const std::array<float, 3>> y, std::span<std::array<float, 3>> goals,
             RotationMethod method = RotationMethod::polar) {
    for (Vector3& sum : sum_) sum.setZero();
    for (const Cluster& cluster : clusters_) {
      Vector3 center = Vector3::Zero();
      for (std::size_t i = cluster.first; i < cluster.end; ++i) {
        center += members_[i].mu * Eigen::Map<const Vector3>(y[members_[i].vertex].data());
      }
      Columns a_pq = Columns::Zero();
      for (std::size_t i = cluster.first; i < cluster.end; ++i) {
        const Vector3 p = members_[i].mu * (Eigen::Map<const Vector3>(y[members_[i].vertex].data()) - center);
        a_pq.noalias() += p * members_[i].q.transpose();
      }
      a_pq /= cluster.radius;
      const Matrix3 r =
          method == RotationMethod::polar ? polar(a_pq.template leftCols<3>()) : svd(a_pq.template leftCols<3>());
      Columns f = (a_pq - r * cluster.moment) * cluster.s;
      f.template leftCols<3>() += r;
      limit(f);
      f *= cluster.radius;
      for (std::size_t i = cluster.first; i < cluster.end; ++i) {
        sum_[members_[i].vertex].noalias() += members_[i].share * (center + f * members_[i].q);
      }
    }
    for (std::size_t v = 0; v < sum_.size(); ++v) Eigen::Map<Vector3>(goals[v].data()) = sum_[v];
  }

 private:
  struct Member {
    std::uint32_t vertex;
    float mu, share;
    Monomials q;  // centred
  };
  struct Cluster {
    std::size_t first = 0, end = 0;
    float radius = 1;
    Columns moment;  // of the rest shape
    Square s;
  };

  static Monomials monomials(const Vector3& q) {
    Monomials result;
    result.template head<3>() = q;
    if constexpr (N == 9) {
      result.template tail<6>() << q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0];
    }
    return result;
  }

  static Square inverse(const formats::PackageView& package, const formats::Cluster& cluster) {
    Square result = Square::Zero();
    if constexpr (N == 9) {
      const auto& packed = package.quadraticMoments()[cluster.quadratic].a_qq;
      std::size_t at = 0;
      for (int row = 0; row < 9; ++row) {
        for (int column = 0; column <= row; ++column) result(row, column) = result(column, row) = packed[at++];
      }
    } else {
      const auto& a = cluster.a_qq;
      result << a[0], a[3], a[5], a[3], a[1], a[4], a[5], a[4], a[2];
    }
    return result;
  }

  // R = A (A^T A)^-1/2 as in Müller et al. 2005, with Eigen's closed form for the eigenvectors; the decomposition where
  // that fails (a mirrored or singular A).
  static Matrix3 polar(const Matrix3& a) {
    Eigen::SelfAdjointEigenSolver<Matrix3> solver;
    solver.computeDirect(a.transpose() * a);
    const Vector3 inverse = solver.eigenvalues().cwiseMax(1e-20F).cwiseSqrt().cwiseInverse();
    const Matrix3 r = a * (solver.eigenvectors() * inverse.asDiagonal() * solver.eigenvectors().transpose());
    return r.determinant() > 0.5F ? r : svd(a);
  }

  static Matrix3 svd(const Matrix3& a) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> decomposition(a.cast<double>(), Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d u = decomposition.matrixU();
    const Eigen::Matrix3d v = decomposition.matrixV();
    if ((u * v.transpose()).determinant() < 0) u.col(2) = -u.col(2);
    return (u * v.transpose()).cast<float>();
  }

  // Clamps stretches to [0.1, 3] where the cheap test does not exclude that they leave it.
  static void limit(Columns& f) {
    const Matrix3 linear = f.template leftCols<3>();
    const float norm2 = linear.squaredNorm();
    if (norm2 <= 9 && linear.determinant() >= 0.05F * norm2) return;
    const Eigen::JacobiSVD<Matrix3> decomposition(linear, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Matrix3 u = decomposition.matrixU(), v = decomposition.matrixV();
    Vector3 sigma = decomposition.singularValues();
    if (u.determinant() < 0) {
      u.col(2) = -u.col(2);
      sigma[2] = -sigma[2];
    }
    if (v.determinant() < 0) {
      v.col(2) = -v.col(2);
      sigma[2] = -sigma[2];
    }
    f.template leftCols<3>() = u * sigma.cwiseMax(0.1F).cwiseMin(3.0F).asDiagonal() * v.transpose();
  }

  std::vector<Cluster> clusters_;
  std::vector<Member> members_;
  std::vector<Vector3> sum_;
};

}  // namespace sinew::benchmarks

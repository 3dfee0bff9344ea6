// SPDX-License-Identifier: GPL-3.0-or-later
//
// What studies measure on a body, in double and independently of the runtime's own match.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "sinew/runtime/world.h"

namespace sinew::tools {

inline Eigen::Vector3d wide(const Vec3& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

/// The corner of a tetrahedron that a visual vertex of a study's surface lies on, metres.
Eigen::Vector3d cornerOf(const World& world, BodyId body, std::uint32_t visual_vertex);
/// Signed volume of a body's tetrahedra as they are, m³.
double tetrahedraVolume(const World& world, BodyId body);

/// Sums over the physical vertices, about the centre of mass.
struct BodyMotion {
  double mass = 0;                                     ///< kg
  Eigen::Vector3d center = Eigen::Vector3d::Zero();    ///< metres
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero();  ///< kg m/s
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();   ///< about the centre, kg m^2/s
  double momentum_scale = 0;                           ///< Σ m |v|: what rounding of the sums is relative to
  double angular_scale = 0;                            ///< Σ m |x - center| |v|
  double kinetic = 0;                                  ///< of the motion about the centre, J
  double spin = 0;                                     ///< angular speed of the rigid part, rad/s
  double least_spin_energy = 0;                        ///< |angular|² over twice the largest moment of inertia, J
  double reach = 0;                                    ///< largest coordinate, metres: what positions are rounded to
  double fastest = 0;                                  ///< largest speed, m/s
  double extent = 0;                                   ///< largest distance from the centre, metres
  bool finite = true;
};

/// Measures one body; holds the constants of its rest shape.
class BodyMeasure {
 public:
  /// \param scale BodySettings::stiffness_scale of the body.
  BodyMeasure(const Asset& asset, double stiffness_scale);

  static bool finite(const World& world, BodyId body);
  BodyMotion motion(const World& world, BodyId body) const;

  /// Largest distance of a vertex from the rest shape, best rigid motion (SVD) removed, in diagonals.
  double restError(const World& world, BodyId body) const;

  /// What matching can turn into motion, J. A pass is an implicit step for this energy: each cluster has positions of
  /// its own for its vertices, with its elastic energy, and a spring of share m / h² ties each to its vertex; of all
  /// such positions whose mean is x those of least energy. (The blended match is the mean of proximal maps, so the
  /// proximal map of their proximal average: Bauschke et al. 2008.) Found from below, by the dual problem. A part that
  /// is matched as one has the energy of that match instead, less what it has where that begins.
  double potential(const World& world, BodyId body, double pass_seconds) const;

  /// The lowest frequency a cluster has, Hz; 0 where one has none; infinite where all are rigid.
  double slowestHz() const { return slowest_hz_; }
  /// By how much the match of a cluster makes the rounding of its moments larger, root mean square over the mass.
  double roundingGain() const { return rounding_gain_; }
  /// The highest angular frequency of a cluster that is not rigid, rad/s.
  double fastestOmega() const { return fastest_omega_; }

 private:
  struct ClusterData {
    int columns = 3;
    bool rigid = false;
    double omega = 0;                    ///< rad/s; 0 for rigid clusters
    Eigen::Matrix<double, 9, 9> a_qq;    ///< upper left 3 x 3 unless quadratic
    Eigen::Matrix<double, 3, 9> moment;  ///< of the rest shape
    std::vector<Eigen::Matrix<double, 9, 1>> monomials;
  };
  struct Match {
    Eigen::Vector3d center;
    Eigen::Matrix3d rotation;
    Eigen::Matrix<double, 3, 9> deviation;  ///< D = A_pq - R M
  };
  struct PartPotential {
    double energy = 0;  ///< J
    double weight = 0;  ///< 0 where the part is not astray
  };
  double clusterPotential(std::span<const Eigen::Vector3d> positions, double pass_seconds) const;
  PartPotential partPotential(std::span<const Eigen::Vector3d> positions, double pass_seconds) const;
  void addRoundingGain(std::span<const formats::Membership> members, const ClusterData& data);
  Match match(std::size_t cluster, std::span<const Eigen::Vector3d> positions) const;

  const Asset* asset_;
  std::vector<ClusterData> clusters_;
  double slowest_hz_ = 0, fastest_omega_ = 0, rounding_gain_ = 1;
  bool uneven_ = false;
};

}  // namespace sinew::tools

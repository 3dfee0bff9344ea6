// SPDX-License-Identifier: GPL-3.0-or-later
//
// What studies measure on a body, in double and independently of the runtime's own match.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "runtime/clusters/mechanics.h"
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
  double turning_energy = 0;                           ///< of turning as one, with this angular momentum, J
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
  /// is matched as one has the energy of that match instead, less what it has where that begins. Between where that
  /// ends and where it begins the past decides: `least` without it, `most` with it.
  struct Potential {
    double least = 0, most = 0;
    bool limited = false;  ///< some cluster is beyond a limit or the guard: what stops it there is no potential
    bool tangled = false;  ///< neighbours are turned against each other, or were and the part is not back yet
  };
  /// Rounds of the search: a distance that no goals reach has that many times the energy of a spring m / h².
  static constexpr int kSearchRounds = 24;
  /// \param tangled what the last call returned of that, false at first.
  Potential potential(const World& world, BodyId body, double pass_seconds, bool tangled) const;
  /// Potential::tangled alone.
  bool isTangled(const World& world, BodyId body, double pass_seconds, bool tangled) const;

  /// The lowest frequency that the body returns with in passes of this length, Hz; 0 where a part of it never does;
  /// infinite where all clusters are rigid. Clusters of StiffnessModel::elastic that are 1/n of the body bend n² slower
  /// together than one does.
  double slowestHz(double pass_seconds) const;
  /// By how much the match of a cluster makes the rounding of its moments larger, root mean square over the mass.
  double roundingGain() const { return rounding_gain_; }
  /// The highest angular frequency of a cluster that is not rigid, rad/s.
  double fastestOmega(double pass_seconds) const;

 private:
  struct ClusterData {
    int columns = 3;
    bool rigid = false;
    double omega = 0;            ///< of StiffnessModel::frequency, rad/s
    double stiffness_ratio = 0;  ///< of StiffnessModel::per_step, (1 - beta) / beta
    double size_ratio = 1;       ///< of the body's radius of gyration to its own, >= 1
    bool per_step = false;
    bool limited = false;  ///< it has limits beyond the guard, or keeps its volume
    internal::GoalLimits limits;
    double volume_response = 0;  ///< trace of the linear A_qq; 0 where the volume is not kept
    /// Of StiffnessModel::elastic, orthonormal in the mass; else no columns.
    Eigen::Matrix<double, 27, Eigen::Dynamic> modes;
    Eigen::VectorXd mode_omega2;         ///< 1/s²
    Eigen::Matrix<double, 9, 9> a_qq;    ///< upper left 3 x 3 unless quadratic
    Eigen::Matrix<double, 3, 9> moment;  ///< of the rest shape
    std::vector<Eigen::Matrix<double, 9, 1>> monomials;
  };
  struct Match {
    Eigen::Vector3d center;
    Eigen::Matrix3d rotation;
    Eigen::Matrix3d rest;                   ///< R S, S what plasticity and activation have made of the rest shape
    Eigen::Matrix<double, 3, 9> deviation;  ///< D = A_pq - R S M
  };
  /// A cluster's elastic answer to a deviation: a deformation in q~, times the radius; and its energy, J.
  struct Answer {
    Eigen::Matrix<double, 3, 9> deformation = Eigen::Matrix<double, 3, 9>::Zero();
    double energy = 0;
    double latent = 0;     ///< of a volume that is lost and not pushed at, J: it will be when there is more of it
    bool limited = false;  ///< a limit or the guard changes the deformation
  };
  static void addStiffness(const formats::PackageView& package, std::uint32_t index, double scale, ClusterData& data);
  /// The part of a deformation that a pass takes, at most 1.
  static double takenOf(const ClusterData& data, double pass_seconds);
  static double omegaOf(const ClusterData& data, double pass_seconds);
  /// How a cluster is matched.
  struct Manner {
    bool guarded = false;  ///< with what limits and the guard change
    bool tangled = false;  ///< its part goes back as one, through itself: without volume and limits
    bool lost = false;     ///< its rotation is its part's: elastic modes answer alike, turns too
  };
  Answer answerOf(std::size_t cluster, const Match& match, double pass_seconds, Manner manner) const;
  struct PartPotential {
    double energy = 0;        ///< J
    double weight = 0;        ///< 0 where the part is not astray
    double least_weight = 0;  ///< the same of a part that is matched as one whatever its past
    bool tangled = false;
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    std::vector<std::uint8_t> lost;  ///< by cluster: isLost()
    bool any_lost = false;
  };
  bool isLost(const ClusterData& data, const Match& match, double pass_seconds) const;
  struct ClusterPotential {
    double energy = 0, latent = 0;  ///< J
    bool limited = false;           ///< some cluster is beyond a limit
  };
  /// \param part_rotates lost clusters take their part's rotation, as they do in a pass; else each its own.
  ClusterPotential clusterPotential(std::span<const Eigen::Vector3d> positions, std::span<const Eigen::Matrix3d> shapes,
                                    double pass_seconds, const PartPotential& part, bool part_rotates) const;
  PartPotential partPotential(std::span<const Eigen::Vector3d> positions, std::span<const Eigen::Matrix3d> shapes,
                              double pass_seconds, bool tangled) const;
  /// World::clusterRestShape() of each cluster.
  static std::vector<Eigen::Matrix3d> shapesOf(const World& world, BodyId body);
  /// Whether all clusters are as good as rigid in passes of this length.
  bool isStiff(double pass_seconds) const;
  bool areTangled(std::span<const Match> matches) const;
  void addRoundingGain(std::span<const formats::Membership> members, const ClusterData& data);
  /// \param shape the rest shape's own deformation, S. \param rotation null: the nearest.
  Match match(std::size_t cluster, std::span<const Eigen::Vector3d> positions, const Eigen::Matrix3d& shape,
              const Eigen::Matrix3d* rotation) const;

  const Asset* asset_;
  double scale_;
  std::vector<ClusterData> clusters_;
  double rounding_gain_ = 1;
  bool uneven_ = false;
};

}  // namespace sinew::tools

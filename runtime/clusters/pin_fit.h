// SPDX-License-Identifier: MIT
//
// The match of a cluster some of whose vertices are pinned: least squares subject to the pins, in the null space of the
// pinned vertices (docs/method.md §10).
#pragma once

#include <array>
#include <cstdint>
#include <memory_resource>
#include <span>

#include "runtime/clusters/frame.h"
#include "runtime/clusters/mechanics.h"
#include "runtime/clusters/stiffness.h"
#include "runtime/load/rest_constants.h"
#include "runtime/memory/array.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// A pinned vertex as a cluster sees it.
struct PinPoint {
  std::uint32_t vertex;
  std::uint32_t set;   ///< index into Body::pin_sets
  std::uint32_t item;  ///< index into its vertices
  float weight;        ///< 0..1; 1 is exact, less is a spring
  float mu;            ///< of its membership
  Vector3 local;       ///< place in the set's transform, metres
};

/// Constants of one pinned cluster for one set of pins and one length of pass. In double: it is small, and stiff.
/// Everything is in the basis (1, T^T q~), in which the mass is the identity: g has a row per basis function and a
/// column per axis, and u = g^T b is the displacement of a goal from c + r R S q over the radius, in the frame R.
class PinFit {
 public:
  using Basis = geometry::SmallMatrix<10>;
  using Square10 = geometry::SmallMatrix<100>;
  using Square30 = geometry::SmallMatrix<900>;
  using Answer = geometry::SmallMatrix<30>;

  /// The points of one set, which move as one: sums are all that a match needs of them, however many they are.
  struct Group {
    std::uint32_t set = 0;                             ///< index into Body::pin_sets
    std::uint32_t count = 0;                           ///< of points
    std::uint32_t exact = 0;                           ///< of those with weight 1
    Vector3 mean = Vector3::Zero();                    ///< of the points' `local`, metres
    Vector3 place = Vector3::Zero();                   ///< of `mean` at the end of the pass, metres
    Eigen::Matrix3d rotation;                          ///< of the set then
    Basis exact_sum, soft_sum;                         ///< Σ b; of soft points Σ k b, k as in springFactor()
    Answer exact_spread, soft_spread;                  ///< Σ b (local - mean)^T, Σ k b (local - mean)^T
    Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();    ///< Σ (local - mean) (q - mean q)^T of the exact ones
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();  ///< Σ (q - mean q) of the exact ones
  };

  /// \param points of this cluster, at least one, by set. \param memory what the fit keeps comes from there.
  [[gnu::cold]] PinFit(const formats::PackageView& package, std::uint32_t cluster, PinMethod method,
                       std::span<const PinPoint> points, std::pmr::memory_resource* memory);
  PinFit(const PinFit&) = delete;
  PinFit& operator=(const PinFit&) = delete;
  ~PinFit() = default;

  std::uint32_t cluster() const { return cluster_; }
  /// \return of points, in all sets.
  std::uint32_t pointCount() const { return point_count_; }
  std::span<const Group> groups() const { return groups_; }
  /// `place` and `rotation` of each are the caller's to set before match().
  std::span<Group> groups() { return groups_; }

  /// Makes what depends on the length of a pass; cheap if that has not changed. Never allocates.
  void prepare(const formats::PackageView& package, const RestConstants& rest, float stiffness_scale,
               float pass_seconds) {
    if (pass_seconds_ != pass_seconds) remake(package, rest, stiffness_scale, pass_seconds);
  }

  /// R, F and the goals' centre, from frame.a_pq and momentCenter(), with the goals of exact points in their places.
  /// Call after updateFrame() of the same frame.
  /// \return whether the guard moved F.
  bool match(const formats::Cluster& cluster, const ClusterRest& rest, const MatchExtras& extras,
             ClusterFrame& frame) const;

  /// c = Σ mu y: frame.center is that of the goals, which the pins move.
  Vector3& momentCenter() { return moment_center_; }
  const Vector3& momentCenter() const { return moment_center_; }

  /// The basis at a rest position.
  Basis basisAt(const formats::Cluster& cluster, const Vector3& rest_position) const;
  /// How the goals answer to an impulse at a point with basis b: (centre, F) move by impulse x these weights / mass.
  /// \param[out] columns of F, over the radius.
  float response(const Basis& b, Monomials<9>& columns) const;

  /// How far a goal with basis b moves along an impulse on itself, x mass.
  float ownResponse(const Basis& b) const;

 private:
  [[gnu::cold]] void remake(const formats::PackageView& package, const RestConstants& rest, float stiffness_scale,
                            float pass_seconds);
  void keepVolume(const Matrix3& shape, Answer& g) const;
  Answer withFreePart(const Answer& held, Answer&& answer) const;
  double springScale() const;
  Eigen::Vector3d centredOffset(const formats::PackageView& package, const PinPoint& point) const;
  Answer answerOf(const Columns<9>& f, const Matrix3& r, const Matrix3& shape, const Eigen::Vector3d& shift) const;
  void write(const formats::Cluster& cluster, const Matrix3& r, const Matrix3& shape, const Answer& g,
             ClusterFrame& frame) const;

  std::uint32_t cluster_;
  PinMethod method_;
  std::uint32_t point_count_;
  std::uint32_t exact_count_ = 0;
  Array<Group> groups_;
  Answer exact_offsets_, soft_offsets_;                   ///< Σ b q^T, Σ k b q^T, of centred q
  Eigen::Vector3d exact_mean_ = Eigen::Vector3d::Zero();  ///< of centred q of the exact points
  Square10 springs_;                                      ///< Σ k b b^T
  ModeBasis basis_;
  using ModeGradient = geometry::SmallMatrix<27>;
  std::array<ModeGradient, 6> strain_points_;           ///< d b / d q (modes x 3) where volume is measured
  Square10 from_points_;                                ///< (C^T C)^+ of the exact points
  Square10 null_space_;                                 ///< N: what the exact points leave free, columns orthonormal
  Square10 free_;                                       ///< N N^T
  Eigen::Vector3d pin_mean_ = Eigen::Vector3d::Zero();  ///< q, of all points
  bool elastic_ = false;
  bool oriented_ = false;  ///< the exact points do not lie on a line: they say how the cluster is turned
  // For one length of pass:
  float pass_seconds_ = 0;
  double beta_ = 0;            ///< of infinite_mass
  Square10 system_, inverse_;  ///< H and N (N^T H N)^-1 N^T
  struct Elastic {
    ModeMatrix energy;         ///< E and nu as baked
    Square30 system, inverse;  ///< the same of elastic clusters, axis by axis
  };
  Array<Elastic> elastic3_;  ///< one, or none: it is large
  Square10 response_;
  Vector3 moment_center_ = Vector3::Zero();
};

}  // namespace sinew::internal

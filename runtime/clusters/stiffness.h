// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory_resource>

#include "runtime/clusters/algebra.h"
#include "runtime/kernels/guard.h"  // guardMargin() is about its bounds
#include "runtime/kernels/layout.h"
#include "runtime/load/rest_constants.h"
#include "runtime/memory/array.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

/// What a cluster's frequencies mean for one length of step (docs/method.md §4).
struct ClusterStiffness {
  float alpha = 1.0F;  ///< alpha_h of eq. 9
  /// What a pass keeps of a stretch or shear: beta_h (eq. 6), or with damping (1 + h d) / (1 + h d + (2 pi f h)²),
  /// since damping pulls towards what was; 0 for a rigid cluster.
  float kept = 0.0F;
  float margin = 1.0F;       ///< guardMargin(); 1 where nothing brings the cluster back
  float volume_ease = 0.0F;  ///< how much the volume gives way to a unit pressure (eq. 18)
  /// The lowest frequency that the body returns with where it is made of such clusters, Hz; 0 = it never does,
  /// infinite = rigid.
  float slowest_hz = std::numeric_limits<float>::infinity();
  bool deforms = false;             ///< false: F = R, s is zero
  bool mixes_classes = false;       ///< S is no multiple of A_qq: classes of modes differ in frequency
  Square<9> s = Square<9>::Zero();  ///< S of eq. 8: F = [R 0] + (A_pq - R M) S; rows and columns 3.. only if quadratic
};

/// A goal is always brought back within its limits and the guard; what is further off than this factor is stopped as
/// well. Without it rounding would stop the return of what has been let through, pass after pass. What is brought back
/// by less becomes a speed, of at most 5 bodies a second.
float guardMargin(float pass_seconds);

/// (2 pi f h)² of the classes of modes (stretch, bend, twist); of per_step (1 - beta) / beta. Infinite where rigid;
/// elastic clusters have none: 0.
std::array<double, 3> classRatios(const formats::PackageView& package, const RestConstants& rest, std::uint32_t cluster,
                                  float stiffness_scale, float step_seconds);

/// The frequency with which a cluster that keeps its volume returns to it, rad/s: high beside what forces at hand ask
/// for, and ten times that of its stretch, so that the volume is the stiffest thing about it.
/// No faster than a pass resolves: beside other clusters, limits or pins a stiffer volume would only store rounding.
/// \param frequency_ratio of the part's radius of gyration to the cluster's, which all frequencies take.
double volumeOmega(const formats::Cluster& cluster, double frequency_ratio, double stiffness_scale,
                   double pass_seconds);

/// What the elastic modes of one cluster keep in a pass: 1 / (1 + h damping + h² omega²). Goes into
/// MechanicsState::kept.
Eigen::Matrix<float, 27, 1> keptModes(const formats::ClusterMechanics& mechanics, const ElasticModes& modes,
                                      float stiffness_scale, float step_seconds);

/// No stiffness at all: F = A shows the positions as they are.
ClusterStiffness freeStiffness(const formats::PackageView& package, std::uint32_t cluster);

ClusterStiffness clusterStiffness(const formats::PackageView& package, const RestConstants& rest, std::uint32_t cluster,
                                  float stiffness_scale, float step_seconds);

/// The same for kernels, with the guard's limits and no volume kept. \param lane 0..7 of the block.
void storeStiffness(const ClusterStiffness& stiffness, std::uint32_t lane, StiffnessBlock& block);

/// The most of a deformation that a cluster which is as good as rigid keeps in a pass.
inline constexpr float kStiffKeeps = 0.01F;

/// The stiffness of all clusters of a package for one length of pass; bodies with the same scale share it.
struct StiffnessSet {
  /// \param scale multiplies all frequencies, 0.. \param memory what it keeps comes from there.
  StiffnessSet(const formats::PackageView& package, float scale, std::pmr::memory_resource* memory);

  /// Computes it for another length of pass; does not allocate after the first time.
  void update(const formats::PackageView& package, const RestConstants& rest, float pass_seconds);

  float scale;
  float step_seconds = 0;  ///< pass length it holds for; 0 = none yet
  Array<ClusterStiffness> clusters;
  Array<StiffnessBlock> blocks;  ///< the same for kernels
  Array<float> slowest_hz;       ///< by part: the lowest of its clusters' that is not 0
  Array<float> own_damping;      ///< by part: the least that its clusters have themselves, 1/s
  Array<std::uint8_t> stiff;     ///< by part: not 0 where no cluster keeps more than kStiffKeeps in a pass
  /// By entry of MechanicsConstants::modes: what a pass keeps of each.
  Array<Eigen::Matrix<float, 27, 1>> kept;
};

}  // namespace sinew::internal

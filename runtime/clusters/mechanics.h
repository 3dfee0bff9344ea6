// SPDX-License-Identifier: MIT
//
// What a cluster's CMEC record adds to its match: elastic modes, stretch limits, volume, plasticity, activation
// (docs/method.md §9).
#pragma once

#include <memory_resource>
#include <span>

#include "runtime/clusters/algebra.h"
#include "runtime/geometry/small_matrix.h"
#include "runtime/memory/array.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

/// The modes that a cluster can deform in, in double: b = T^T q~ with Σ mu b b^T = 1, so directions that the rest shape
/// lacks are left out and what remains is well conditioned. `mean` is that of the uncentred q~.
struct ModeBasis : MomentSums {
  geometry::SmallMatrix<81> t;  ///< T, columns of q~ x modes
};
ModeBasis modeBasis(const formats::PackageView& package, std::uint32_t cluster);

/// Strain energy of an isotropic solid in the modes of a cluster: 3 x modes square, index (axis, mode) = axis * modes +
/// mode, so that 1/2 a^T K a is the energy of the goals G = (a) T^T over the cluster's mass and radius². 1/s².
/// The cluster's vertices are the quadrature (their mu over the density is their volume), so it needs moments only.
using ModeMatrix = geometry::SmallMatrix<729>;
ModeMatrix elasticEnergy(const formats::PackageView& package, std::uint32_t cluster, const ModeBasis& basis);

/// Elastic eigenmodes of a cluster: columns v of `vectors` with (M x 1) v' = ... orthonormal in the mass, so that the
/// implicit step of length h is G = Σ v (v . deviation) / (1 + h² v's omega²). Constants of the asset.
struct ElasticModes {
  Eigen::Matrix<float, 27, 27> vectors = Eigen::Matrix<float, 27, 27>::Zero();  ///< row = column of G * 3 + axis
  Eigen::Matrix<float, 27, 1> omega2 = Eigen::Matrix<float, 27, 1>::Zero();     ///< 1/s², 0 of a turn
};
ElasticModes elasticModes(const formats::PackageView& package, std::uint32_t cluster);

/// Limits and volume of a cluster's goal, as the match applies them; shared by the bodies of an asset.
struct GoalLimits {
  formats::LimitMethod limit = formats::LimitMethod::none;
  formats::VolumeMethod volume = formats::VolumeMethod::none;
  float least = 0, largest = 0;                 ///< principal stretches: authored, or the guard's
  float row = 0, norm_max = 0, norm_limit = 0;  ///< see ClusterMechanics
  std::span<const formats::CurvePoint> curve;
};
GoalLimits goalLimits(const formats::PackageView& package, std::uint32_t cluster);

/// Those of a cluster of a tangled part: the way back may lead through mirrored shapes, so these are not beyond them.
GoalLimits limitsTangled();

/// f(phi) of a response curve: linear between points, constant behind the last, phi before the first.
float curveResponse(std::span<const formats::CurvePoint> curve, float phi);

/// Constants of an asset whose package has CMEC; empty vectors otherwise.
struct MechanicsConstants {
  Array<GoalLimits> limits;       ///< by cluster
  Array<ElasticModes> modes;      ///< of elastic clusters that deform
  Array<std::uint32_t> modes_of;  ///< cluster -> modes, formats::kNone; empty without elastic clusters
  bool changes_shape = false;     ///< some cluster is plastic, or has a fibre that something activates
  bool damps = false;             ///< some cluster has a damping of its own
};
MechanicsConstants makeMechanics(const formats::PackageView& package);

/// The gradient of det A.
Matrix3 cofactor(const Matrix3& a);

/// The pressure that keeps a cluster's volume (eq. 18): F += lambda times the answer of its modes to [cofactor(A) 0].
/// \param a linear block of F. \param answer linear block of that answer. \param ease ClusterStiffness::volume_ease.
float volumePressure(const Matrix3& a, const Matrix3& answer, float ease);

/// The energy that this pressure is the implicit step of, over M r² c (eq. 18). \param volume det A.
double volumeEnergy(double volume);

/// What applyGoalLimits() did to F.
enum class Limited {
  nothing,  ///< F is what it was
  shaped,   ///< a limit or the volume changed it: its torque has to be removed
  stopped,  ///< it was beyond a limit or the guard by more than the margin: the motion of its vertices is stopped
};

/// Limits on the linear block of F (eq. 10), and what the volume method `principal` makes up for behind them; blending
/// limits take the squares and products along, which are zero in a linear cluster. \param margin guardMargin(). \param
/// stiff a pass keeps less than half of a stretch. \param shape the rest shape's own deformation (plasticity,
/// activation), null for none: limits count from it.
Limited applyGoalLimits(const GoalLimits& limits, bool stiff, float margin, const Matrix3& r, const Matrix3* shape,
                        Columns<9>& f);

/// Deformation of the rest shape of one cluster, body state.
struct ShapeState {
  Matrix3 plastic = Matrix3::Identity();  ///< S_p, det 1: what has become permanent
  Matrix3 shape = Matrix3::Identity();    ///< S = (activation) S_p: the rest shape is S q
};

/// State of a body beyond frames; vectors are empty where the package needs none.
struct MechanicsState {
  Array<ShapeState> shapes;    ///< by cluster
  Array<Columns<9>> previous;  ///< by cluster: (R^T F - S) M of the last pass, for damping
  Array<float> activation;     ///< by channel, 0..1

  MechanicsState(const formats::PackageView& package, const MechanicsConstants& constants,
                 std::pmr::memory_resource* memory);
  /// Nothing permanent, nothing activated, at rest.
  void reset();
  /// Nothing permanent, at rest; what is activated stays.
  void forgetShapes(const formats::PackageView& package);
  /// Sets a channel, 0..1, and the shapes of the clusters that it contracts.
  void activate(const formats::PackageView& package, std::uint32_t channel, float value);
  void updateShape(const formats::PackageView& package, std::uint32_t cluster);
};

/// What a cluster's match needs beyond frame and stiffness. Null where there is none of it.
struct MatchExtras {
  const GoalLimits* limits = nullptr;
  const ElasticModes* modes = nullptr;
  const Eigen::Matrix<float, 27, 1>* kept = nullptr;  ///< of `modes`, for the pass
  const Matrix3* shape = nullptr;
  const Columns<9>* previous = nullptr;
  float damping_passes = 0;  ///< damping * pass length
};
/// \param kept by entry of MechanicsConstants::modes.
MatchExtras matchExtras(const MechanicsConstants& constants, const MechanicsState& state,
                        std::span<const Eigen::Matrix<float, 27, 1>> kept, const formats::PackageView& package,
                        std::uint32_t cluster, float pass_seconds);

/// S of an activated fibre: (1 - a c) along it, 1 / sqrt(1 - a c) across. \param activation a, 0..1.
Matrix3 activationStretch(const formats::ClusterMechanics& mechanics, float activation);

/// Lets deformation beyond the yield become permanent (Müller et al. 2005, §5.3) for one pass.
/// \param goal F's linear block. \return whether S_p changed.
bool updatePlasticity(const formats::ClusterMechanics& mechanics, const Matrix3& r, const Matrix3& goal,
                      float pass_seconds, ShapeState& state);

}  // namespace sinew::internal

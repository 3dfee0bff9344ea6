// SPDX-License-Identifier: MIT
#include "runtime/clusters/stiffness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/geometry/small_matrix.h"
#include "runtime/kernels/kernels.h"

namespace sinew::internal {
namespace {

// (2 pi f h)^2 from which on a class of modes counts as rigid: what it keeps is below the rounding of a float.
constexpr double kRigidRatio = 1e9;

constexpr float kSlender = 0.02F;  // least to largest moment: a bar seven times as long as thick
constexpr double kVolumeHz = 100, kVolumeOverStretch = 10;
constexpr double kLargestVolumePhase = 40;  // of its frequency in a pass, radians
constexpr double kAlphaStep = 1.0 / 60;     // h_ref: the step that Cluster::alpha is given for

// (2 pi f h)^2; infinite for a rigid class of modes.
double stiffnessRatio(float frequency_hz, float scale, float step_seconds) {
  if (frequency_hz == 0 || scale == 0) return 0;
  const double phase = 2 * std::numbers::pi * double(frequency_hz) * double(scale) * double(step_seconds);
  return phase * phase;
}

// A_qq times a factor: that of a linear cluster in rows and columns 0..2, that of a quadratic one in all.
void setLinear(const formats::Cluster& cluster, float factor, Square<9>& s) {
  constexpr std::uint8_t kPlace[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) s(row, column) = factor * cluster.a_qq[kPlace[row][column]];
  }
}

void setQuadratic(const formats::QuadraticMoment& packed, float factor, Square<9>& s) {
  std::size_t k = 0;
  for (int row = 0; row < 9; ++row) {
    for (int column = 0; column <= row; ++column) s(row, column) = s(column, row) = factor * packed.a_qq[k++];
  }
}

// S = (M + K)^+ with K = D M D, D = diag(2 pi f h) by class of modes: the implicit step of the energy 1/2 g^T K g.
// Symmetric; A_qq / (1 + (2 pi f h)^2) where all frequencies are equal.
// `damping` (h d) adds d M to the implicit step.
void setCoupled(const Square<9>& moment, const std::array<double, 3>& ratios, double damping, Square<9>& s) {
  geometry::SmallMatrix<81> sum(9, 9);
  double* at = sum.data();
  for (int column = 0; column < 9; ++column) {
    for (int row = 0; row < 9; ++row, ++at) {
      const double a = ratios[std::size_t(row / 3)], b = ratios[std::size_t(column / 3)];
      if (a < kRigidRatio && b < kRigidRatio) *at = double(moment(row, column)) * (1 + damping + std::sqrt(a * b));
    }
  }
  geometry::equilibratedPseudoInverse(sum, 1e-7, sum);
  for (int k = 0; k < 81; ++k) s.data()[k] = float(sum.data()[k]);
}

// Whether a cluster is so thin that its classes of modes cannot be told apart under a load: a wire's bend turns it
// about its own axis, where it has next to no inertia, and contacts then drove it without bound.
bool isSlender(const ClusterRest& rest) {
  geometry::SmallMatrix<9> moment(3, 3), axes(3, 3);
  for (int k = 0; k < 9; ++k) moment.data()[k] = double(rest.moment.data()[k]);
  std::array<double, 3> values;
  geometry::symmetricEigen(moment, values, axes);
  return values[0] < double(kSlender) * values[2];
}

// The lowest frequency of the classes of modes that return at all, Hz; 0 where none does, infinite where all are rigid.
// A piece of 1/n of the part's size that rings so belongs to a part that rings n times lower (eq. 8).
float slowestClass(std::span<const double> ratios, double frequency_ratio, double step_seconds) {
  double slowest = std::numeric_limits<double>::infinity();
  bool any = false;
  for (const double ratio : ratios) {
    if (ratio == 0) continue;
    any = true;
    slowest = std::min(slowest, std::sqrt(ratio) / (2 * std::numbers::pi * step_seconds * frequency_ratio));
  }
  return any ? float(slowest) : 0.0F;
}

// The same of elastic modes. A chain of pieces that are 1/n of the body bends n² slower than one piece does.
float slowestMode(const ElasticModes& modes, double frequency_ratio, double scale) {
  float least = std::numeric_limits<float>::infinity();
  for (const float omega2 : modes.omega2) {
    if (omega2 > 0) least = std::min(least, omega2);
  }
  if (!std::isfinite(least)) return 0;
  return float(scale * std::sqrt(double(least)) / (2 * std::numbers::pi * frequency_ratio * frequency_ratio));
}

}  // namespace

std::array<double, 3> classRatios(const formats::PackageView& package, const RestConstants& rest, std::uint32_t index,
                                  float stiffness_scale, float step_seconds) {
  const formats::Cluster& cluster = package.clusters()[index];
  const formats::ClusterMechanics& mechanics =
      package.mechanics().empty() ? formats::kPlainMechanics : package.mechanics()[index];
  std::array<double, 3> ratios{};
  switch (mechanics.stiffness) {
    case formats::StiffnessModel::elastic:
      break;
    case formats::StiffnessModel::per_step:
      for (std::size_t k = 0; k < 3; ++k) {
        const double beta = double(mechanics.per_step_beta[k]);
        ratios[k] = beta > 0 ? (1 - beta) / beta : std::numeric_limits<double>::infinity();
      }
      break;
    case formats::StiffnessModel::frequency: {
      const float scale = stiffness_scale * rest.clusters[index].frequency_ratio;
      ratios = {stiffnessRatio(cluster.stretch_hz, scale, step_seconds),
                stiffnessRatio(cluster.bend_hz, scale, step_seconds),
                stiffnessRatio(cluster.twist_hz, scale, step_seconds)};
      break;
    }
  }
  if (isSlender(rest.clusters[index])) ratios[1] = ratios[2] = ratios[0];
  return ratios;
}

float guardMargin(float pass_seconds) {
  constexpr float kLeast = 5e-5F, kMost = 1e-3F, kBodiesPerSecond = 5;
  return 1.0F + std::clamp(kBodiesPerSecond * pass_seconds, kLeast, kMost);
}

double volumeOmega(const formats::Cluster& cluster, double frequency_ratio, double stiffness_scale,
                   double pass_seconds) {
  const double hz = std::max(kVolumeHz, kVolumeOverStretch * double(cluster.stretch_hz) * stiffness_scale);
  return std::min(2 * std::numbers::pi * frequency_ratio * hz, kLargestVolumePhase / pass_seconds);
}

Eigen::Matrix<float, 27, 1> keptModes(const formats::ClusterMechanics& mechanics, const ElasticModes& modes,
                                      float stiffness_scale, float step_seconds) {
  const double h = double(step_seconds), scale = double(stiffness_scale);
  const double damped = 1 + h * double(mechanics.damping), per_omega2 = h * h * scale * scale;
  Eigen::Matrix<float, 27, 1> kept;
  for (int k = 0; k < 27; ++k) kept[k] = float(1 / (damped + per_omega2 * double(modes.omega2[k])));
  return kept;
}

ClusterStiffness freeStiffness(const formats::PackageView& package, std::uint32_t index) {
  const formats::Cluster& cluster = package.clusters()[index];
  ClusterStiffness result;
  result.deforms = cluster.mode != formats::ClusterMode::rigid;
  if (cluster.mode == formats::ClusterMode::linear) setLinear(cluster, 1, result.s);
  if (cluster.mode == formats::ClusterMode::quadratic) {
    setQuadratic(package.quadraticMoments()[cluster.quadratic], 1, result.s);
  }
  return result;
}

ClusterStiffness clusterStiffness(const formats::PackageView& package, const RestConstants& rest, std::uint32_t index,
                                  float stiffness_scale, float step_seconds) {
  const formats::Cluster& cluster = package.clusters()[index];
  const formats::ClusterMechanics& mechanics =
      package.mechanics().empty() ? formats::kPlainMechanics : package.mechanics()[index];
  ClusterStiffness result;
  const double missing = 1.0 - std::clamp(double(cluster.alpha), 0.0, 1.0);
  result.alpha = float(1.0 - std::pow(missing, double(step_seconds) / kAlphaStep));
  if (cluster.mode == formats::ClusterMode::rigid) return result;

  const Array<GoalLimits>& limits = rest.mechanics.limits;
  if (!limits.empty() && limits[index].volume != formats::VolumeMethod::none) {
    const double phase = double(step_seconds) * volumeOmega(cluster, double(rest.clusters[index].frequency_ratio),
                                                            double(stiffness_scale), double(step_seconds));
    const ClusterStiffness free = freeStiffness(package, index);
    result.volume_ease = float(double(free.s(0, 0) + (free.s(1, 1) + free.s(2, 2))) / (phase * phase));
  }
  const double damping = double(mechanics.damping) * double(step_seconds);
  const bool quadratic = cluster.mode == formats::ClusterMode::quadratic;
  if (mechanics.stiffness == formats::StiffnessModel::elastic) {
    // What rows count with: the answer averaged over the axes. The match itself asks the modes.
    const ElasticModes& modes = rest.mechanics.modes[rest.mechanics.modes_of[index]];
    const Eigen::Matrix<float, 27, 1> kept = keptModes(mechanics, modes, stiffness_scale, step_seconds);
    // `kept` of what deforms at all: turns, and modes that the cluster lacks, keep everything.
    double sum = 0;
    int deforming = 0;
    for (int k = 0; k < 27; ++k) {
      const float* const mode = modes.vectors.col(k).data();
      for (int j = 0; j < 9; ++j) {
        for (int i = 0; i < 9; ++i) {
          const float* const a = mode + 3 * i;
          const float* const b = mode + 3 * j;
          result.s(i, j) += kept[k] / 3 * (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
        }
      }
      if (modes.omega2[k] > 0) {
        sum += double(kept[k]);
        ++deforming;
      }
    }
    result.kept = modes.vectors.isZero(0) ? 0.0F : 1.0F;  // a single vertex has nothing to keep
    if (deforming > 0) result.kept = float((1 + damping) * sum / deforming);
    result.slowest_hz = slowestMode(modes, double(rest.clusters[index].frequency_ratio), double(stiffness_scale));
    result.deforms = true;
    result.mixes_classes = quadratic || mechanics.poisson > 0;
    return result;
  }

  const std::array<double, 3> ratios = classRatios(package, rest, index, stiffness_scale, step_seconds);
  const float beta = float(1 / (1 + damping + ratios[0]));
  result.kept = float(1 + damping) * beta;
  result.slowest_hz = slowestClass(std::span(ratios).first(quadratic ? 3 : 1),
                                   double(rest.clusters[index].frequency_ratio), double(step_seconds));
  if (!quadratic) {
    result.deforms = beta > 0;
    setLinear(cluster, beta, result.s);
    return result;
  }
  if (ratios[0] == ratios[1] && ratios[1] == ratios[2]) {
    setQuadratic(package.quadraticMoments()[cluster.quadratic], beta, result.s);
  } else {
    setCoupled(rest.full_moments[cluster.quadratic], ratios, damping, result.s);
    result.mixes_classes = true;
  }
  result.deforms = std::any_of(result.s.data(), result.s.data() + 81, [](float value) { return value != 0; });
  return result;
}

StiffnessSet::StiffnessSet(const formats::PackageView& package, float stiffness_scale,
                           std::pmr::memory_resource* memory)
    : scale(stiffness_scale),
      clusters(package.clusters().size(), memory),
      blocks((clusters.size() + 7) / 8, memory),
      slowest_hz(package.bodies().size(), memory),
      own_damping(package.bodies().size(), memory),
      stiff(package.bodies().size(), memory),
      kept(memory) {}

void storeStiffness(const ClusterStiffness& stiffness, std::uint32_t lane, StiffnessBlock& block) {
  int k = 0;
  for (int row = 0; row < 9; ++row) {
    for (int column = 0; column <= row; ++column) block.s[k++][lane] = stiffness.s(row, column);
  }
  block.alpha[lane] = stiffness.alpha;
  block.deforms[lane] = stiffness.deforms ? -1 : 0;
  block.stiff[lane] = stiffness.kept < 0.5F ? -1 : 0;
  block.mixes[lane] = stiffness.mixes_classes ? -1 : 0;
  block.margin[lane] = stiffness.margin;
  block.least[lane] = kLeastStretch;
  block.largest[lane] = kLargestStretch;
  block.keeps_volume[lane] = 0;
  block.volume_ease[lane] = stiffness.volume_ease;
}

void StiffnessSet::update(const formats::PackageView& package, const RestConstants& rest, float pass_seconds) {
  if (step_seconds == pass_seconds) return;
  step_seconds = 0;  // what follows may run out of memory
  kept.resize(rest.mechanics.modes.size());
  for (std::uint32_t c = 0; c < clusters.size(); ++c) {
    clusters[c] = clusterStiffness(package, rest, c, scale, pass_seconds);
    // The margin lets a body return along its limits. One that nothing brings back is stopped by all that they do:
    // what they moved without a stop was a speed, and fed a sheet until it was twice as fast.
    const bool returns = clusters[c].slowest_hz > 0 || clusters[c].volume_ease > 0;
    clusters[c].margin = returns ? guardMargin(pass_seconds) : 1.0F;
    storeStiffness(clusters[c], c % 8, blocks[c / 8]);
    if (rest.mechanics.limits.empty()) continue;
    const GoalLimits& limits = rest.mechanics.limits[c];
    blocks[c / 8].least[c % 8] = limits.least;
    blocks[c / 8].largest[c % 8] = limits.largest;
    blocks[c / 8].keeps_volume[c % 8] = limits.volume != formats::VolumeMethod::none ? -1 : 0;
  }
  for (std::size_t part = 0; part < slowest_hz.size(); ++part) {
    const formats::BodyRange& range = package.bodies()[part];
    float slowest = std::numeric_limits<float>::infinity();
    bool deforms = false;
    stiff[part] = 1;
    for (const ClusterStiffness& one : std::span(clusters).subspan(range.first_cluster, range.cluster_count)) {
      deforms |= std::isfinite(one.slowest_hz);
      if (one.slowest_hz > 0) slowest = std::min(slowest, one.slowest_hz);
      if (one.kept > kStiffKeeps) stiff[part] = 0;
    }
    slowest_hz[part] = deforms && !std::isfinite(slowest) ? 0.0F : slowest;
  }
  for (std::size_t part = 0; part < own_damping.size() && !package.mechanics().empty(); ++part) {
    const formats::BodyRange& range = package.bodies()[part];
    float least = std::numeric_limits<float>::infinity();
    for (const formats::ClusterMechanics& one : package.mechanics().subspan(range.first_cluster, range.cluster_count)) {
      least = std::min(least, one.damping);
    }
    if (std::isfinite(least)) own_damping[part] = least;
  }
  const MechanicsConstants& mechanics = rest.mechanics;
  for (std::uint32_t c = 0; c < mechanics.modes_of.size(); ++c) {
    const std::uint32_t modes = mechanics.modes_of[c];
    if (modes != formats::kNone) {
      kept[modes] = keptModes(package.mechanics()[c], mechanics.modes[modes], scale, pass_seconds);
    }
  }
  step_seconds = pass_seconds;
}

}  // namespace sinew::internal

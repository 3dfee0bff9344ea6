// SPDX-License-Identifier: MIT
#include "runtime/clusters/mechanics.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "runtime/geometry/pseudo_inverse.h"
#include "runtime/kernels/kernels.h"
#include "runtime/kernels/limits.h"
#include "runtime/kernels/volume.h"

namespace sinew::internal {
namespace {

namespace lanes = SINEW_KERNELS;

using Vector9d = Eigen::Matrix<double, 9, 1>;

constexpr double kFallbackDensity = 1000;  // kg/m³, of packages that state neither density nor volume

int columnsOf(const formats::Cluster& cluster) { return cluster.mode == formats::ClusterMode::quadratic ? 9 : 3; }

double densityOf(const formats::BodyInfo& info) {
  if (info.density > 0) return double(info.density);
  return info.physical_volume > 0 ? double(info.total_mass) / double(info.physical_volume) : kFallbackDensity;
}

lanes::Mat3Of<float> toLanes(const Matrix3& a) {
  lanes::Mat3Of<float> result;
  for (int k = 0; k < 9; ++k) result.m[k] = a.data()[k];
  return result;
}

Matrix3 fromLanes(const lanes::Mat3Of<float>& a) { return Eigen::Map<const Matrix3>(a.m); }

// gamma of the limits that blend with R; 1 = no change.
float blendOf(const GoalLimits& limits, const lanes::Mat3Of<float>& a, const lanes::Mat3Of<float>& r) {
  switch (limits.limit) {
    case formats::LimitMethod::frobenius:
      return lanes::gammaFrobenius(a, r, limits.norm_max);
    case formats::LimitMethod::frobenius_cheap:
      return lanes::gammaFrobeniusCheap(a, limits.norm_max);
    case formats::LimitMethod::soft:
      return lanes::gammaSoft(a, r, limits.norm_max, limits.norm_limit);
    case formats::LimitMethod::curve:
      return lanes::gammaToResponse(a, r, curveResponse(limits.curve, lanes::boundedNorm(a)));
    case formats::LimitMethod::none:
    case formats::LimitMethod::rows:
    case formats::LimitMethod::principal:
      break;
  }
  return 1;
}

// Makes a column orthogonal to unit columns and of length 1. \return false where it depends on them, or is zero.
bool makeUnitBeside(geometry::ConstMatrixView units, geometry::MatrixView column) {
  constexpr double kIndependent = 1e-6;
  const auto norm = [&] {
    double sum = 0;
    for (int i = 0; i < column.rows; ++i) sum += column(i, 0) * column(i, 0);
    return std::sqrt(sum);
  };
  const double before = norm();
  for (int k = 0; k < units.columns; ++k) {
    double along = 0;
    for (int i = 0; i < column.rows; ++i) along += units(i, k) * column(i, 0);
    for (int i = 0; i < column.rows; ++i) column(i, 0) -= along * units(i, k);
  }
  const double after = norm();
  const bool independent = after > kIndependent * before;
  for (int i = 0; i < column.rows; ++i) column(i, 0) = independent ? column(i, 0) / after : 0.0;
  return independent;
}

// Moments of the coordinates q~ of a cluster's rest shape. \param[out] sums empty before.
void findMoments(const formats::PackageView& package, std::uint32_t index, MomentSums& sums) {
  const formats::Cluster& cluster = package.clusters()[index];
  for (const formats::Membership& member : package.memberships().subspan(cluster.first_member, cluster.member_count)) {
    const Vector3 q = restOffset(cluster, asVector(package.physicalVertices()[member.vertex].rest_position));
    sums.add(double(member.mu), monomials(q.cast<double>()));
  }
  sums.finish();
}

// Not of a plane or a line. There the cofactor of A knows lengths and areas, which no volume says anything about.
bool enclosesVolume(const formats::PackageView& package, std::uint32_t index) {
  MomentSums sums;
  findMoments(package, index, sums);
  std::array<double, 3> spread;
  Eigen::Matrix3d axes;
  geometry::symmetricEigen(geometry::viewOf(sums.moment).block(0, 0, 3, 3), spread, geometry::viewOf(axes));
  return spread[0] > geometry::kMomentCutoff * spread[2];
}

// A plane or a line lacks directions. Moving along one of those in proportion to a coordinate that it has is a turn,
// and would be one for the energy too if it had the coordinate whose motion completes it: it costs nothing. Charged as
// a shear, two vertices were turned by any limit and drawn to a point.
void freeTurnsOfFlat(const ModeBasis& basis, ModeMatrix& energy) {
  const int n = basis.t.rows(), modes = basis.t.columns(), size = 3 * modes;
  std::array<double, 3> spread;
  Eigen::Matrix3d axes;
  geometry::symmetricEigen(geometry::viewOf(basis.moment).block(0, 0, 3, 3), spread, geometry::viewOf(axes));
  const double least = geometry::kMomentCutoff * spread[2];
  for (int lacking = 0; lacking < 3 && !(spread[std::size_t(lacking)] > least); ++lacking) {
    for (int along = lacking + 1; along < 3; ++along) {
      if (!(spread[std::size_t(along)] > least)) continue;
      const Vector9d moment = basis.moment.leftCols<3>() * axes.col(along);
      geometry::SmallMatrix<9> coordinate(modes, 1);  // in the modes
      geometry::addProduct(coordinate, 1, basis.t.transposed(), geometry::viewOf(moment).block(0, 0, n, 1));
      geometry::SmallMatrix<27> turn(size, 1), cost(size, 1);
      for (int a = 0; a < 3; ++a) {
        geometry::addScaled(turn.block(a * modes, 0, modes, 1),
                            axes(a, lacking) / std::sqrt(spread[std::size_t(along)]), coordinate);
      }
      geometry::addProduct(cost, 1, energy, turn);
      geometry::SmallMatrix<1> own(1, 1);
      geometry::addProduct(own, 1, std::as_const(turn).transposed(), cost);
      geometry::addScaled(cost, -0.5 * own(0, 0), turn);
      geometry::addProduct(energy, -1, turn, std::as_const(cost).transposed());
      geometry::addProduct(energy, -1, cost, std::as_const(turn).transposed());
    }
  }
}

}  // namespace

ModeBasis modeBasis(const formats::PackageView& package, std::uint32_t index) {
  const formats::Cluster& cluster = package.clusters()[index];
  const int n = columnsOf(cluster);
  ModeBasis basis;
  findMoments(package, index, basis);

  // Equilibrated, so that the cut-off means dependence between coordinates and not their size.
  const geometry::ConstMatrixView moment = geometry::viewOf(std::as_const(basis.moment)).block(0, 0, n, n);
  std::array<double, 9> scale, values;
  geometry::equilibration(moment, geometry::kMomentCutoff, scale);
  geometry::SmallMatrix<81> scaled(n, n), vectors(n, n);
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) scaled(i, j) = scale[std::size_t(i)] * moment(i, j) * scale[std::size_t(j)];
  }
  geometry::symmetricEigen(scaled, values, vectors);
  int modes = 0;
  basis.t = geometry::SmallMatrix<81>(n, n);
  for (int k = 0; k < n; ++k) {
    const double value = values[std::size_t(k)];
    if (!(value > geometry::kMomentCutoff * values[std::size_t(n - 1)])) continue;
    for (int i = 0; i < n; ++i) basis.t(i, modes) = scale[std::size_t(i)] * vectors(i, k) / std::sqrt(value);
    ++modes;
  }
  basis.t.keepColumns(modes);
  // Of all ways to write the modes in coordinates that depend on one another, the one that says nothing about
  // directions that the rest shape lacks: there F is to stay R, which limits and volume look at.
  geometry::SmallMatrix<81> lacking(n, n);
  int count = 0;
  for (int k = 0; k < 2 * n && count < n; ++k) {
    const geometry::MatrixView column = lacking.block(0, count, n, 1);
    for (int i = 0; i < n; ++i) {
      column(i, 0) = k < n                                      ? scale[std::size_t(i)] * vectors(i, k)
                     : scale[std::size_t(i)] == 0 && i == k - n ? 1.0
                                                                : 0.0;
    }
    if (k < n && values[std::size_t(k)] > geometry::kMomentCutoff * values[std::size_t(n - 1)]) continue;
    if (makeUnitBeside(lacking.block(0, 0, n, count), column)) ++count;
  }
  lacking.keepColumns(count);
  geometry::SmallMatrix<81> share(count, modes);
  geometry::addProduct(share, 1, std::as_const(lacking).transposed(), basis.t);
  geometry::addProduct(basis.t, -1, lacking, share);
  return basis;
}

ModeMatrix elasticEnergy(const formats::PackageView& package, std::uint32_t index, const ModeBasis& basis) {
  const formats::ClusterMechanics& mechanics = package.mechanics()[index];
  const formats::Cluster& cluster = package.clusters()[index];
  const double young = double(mechanics.young), poisson = double(mechanics.poisson);
  const double lambda = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), mu = young / (2 * (1 + poisson));
  // The gradient of q~ is affine in q: d q~ / d q = Σ_s g_s q^s with q^s = (1, qx, qy, qz), and products of two of
  // those have the moments 1, Σ mu q, Σ mu q q^T.
  double gradient[4][3][9] = {};  // [s][derivative by][of]
  for (int axis = 0; axis < 3; ++axis) {
    const int next = (axis + 1) % 3;
    gradient[0][axis][axis] = 1;
    gradient[1 + axis][axis][3 + axis] = 2;
    gradient[1 + axis][next][6 + axis] = 1;  // d (q_axis q_next) / d q_next
    gradient[1 + next][axis][6 + axis] = 1;
  }
  double affine[4][4];
  for (int s = 0; s < 4; ++s) {
    for (int t = 0; t < 4; ++t) {
      const double a = s > 0 ? basis.mean[s - 1] : 1, b = t > 0 ? basis.mean[t - 1] : 1;
      affine[s][t] = (s > 0 && t > 0 ? basis.moment(s - 1, t - 1) : 0) + a * b;
    }
  }

  // W_ij = ∫ (d_i q~)(d_j q~)^T in the modes; the energy density is mu |sym|² terms of grad u and lambda tr².
  const int n = basis.t.rows(), modes = basis.t.columns();
  // 2 * density = mu Σ_ab (d_b u_a)² + mu Σ_ab d_b u_a d_a u_b + lambda (Σ_a d_a u_a)².
  const double radius = double(cluster.radius);
  const double scale = 0.5 / (densityOf(package.info()) * radius * radius);
  ModeMatrix energy(3 * modes, 3 * modes);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      geometry::SmallMatrix<81> sum(9, 9);
      for (int s = 0; s < 4; ++s) {
        for (int t = 0; t < 4; ++t) {
          for (int k = 0; k < 81; ++k) {
            sum.data()[k] += affine[s][t] * gradient[s][i][k % 9] * gradient[t][j][k / 9];
          }
        }
      }
      geometry::SmallMatrix<81> w(modes, modes);
      geometry::addCongruence(w, scale, std::as_const(sum).block(0, 0, n, n), basis.t);
      // Each block with its transpose, so that the sum is symmetric to the last bit.
      const auto add = [&](int a, int b, double factor) {
        geometry::addScaled(energy.block(a * modes, b * modes, modes, modes), factor, w);
        geometry::addScaled(energy.block(b * modes, a * modes, modes, modes), factor, w.transposed());
      };
      add(j, i, mu);
      add(i, j, lambda);
      if (i == j) {
        for (int a = 0; a < 3; ++a) add(a, a, mu);
      }
    }
  }
  freeTurnsOfFlat(basis, energy);
  return energy;
}

ElasticModes elasticModes(const formats::PackageView& package, std::uint32_t index) {
  ElasticModes result;
  const ModeBasis basis = modeBasis(package, index);
  const ModeMatrix energy = elasticEnergy(package, index, basis);
  const int modes = basis.t.columns(), n = basis.t.rows();
  if (modes == 0) return result;
  // With equal stiffness the modes are those of the energy of 1 Pa, so scaling first keeps E = 0 and 1e12 alike.
  double scale = 0;
  for (int k = 0; k < 3 * modes; ++k) scale = std::max(scale, energy(k, k));
  if (!(scale > 0)) scale = 1;
  ModeMatrix scaled(3 * modes, 3 * modes), vectors(3 * modes, 3 * modes);
  geometry::addScaled(scaled, 1 / scale, energy);
  std::array<double, 27> values;
  geometry::symmetricEigen(scaled, values, vectors);
  const double largest = values[std::size_t(3 * modes - 1)];
  for (int k = 0; k < 3 * modes; ++k) {
    // A turn costs nothing: its eigenvalue is rounding.
    const double value = values[std::size_t(k)];
    result.omega2[k] = value > 1e-10 * largest ? float(std::min(value * scale, 1e30)) : 0.0F;
    for (int axis = 0; axis < 3; ++axis) {
      geometry::SmallMatrix<9> column(n, 1);
      geometry::addProduct(column, 1, basis.t, vectors.block(axis * modes, k, modes, 1));
      for (int j = 0; j < n; ++j) result.vectors(3 * j + axis, k) = float(column(j, 0));
    }
  }
  return result;
}

GoalLimits goalLimits(const formats::PackageView& package, std::uint32_t index) {
  GoalLimits result;
  const formats::ClusterMechanics& m =
      package.mechanics().empty() ? formats::kPlainMechanics : package.mechanics()[index];
  result.limit = m.limit;
  if (m.volume != formats::VolumeMethod::none && enclosesVolume(package, index)) result.volume = m.volume;
  result.least = kLeastStretch;
  result.largest = kLargestStretch;
  result.row = m.stretch_max;
  result.norm_max = m.norm_max;
  result.norm_limit = m.norm_limit;
  if (m.limit == formats::LimitMethod::principal) {
    result.least = m.stretch_min;
    result.largest = m.stretch_max;
  } else if (m.limit == formats::LimitMethod::rows) {
    // What keeps the volume must not stretch again what the rows had cut.
    const bool bounds = result.volume == formats::VolumeMethod::principal;
    result.largest = bounds ? m.stretch_max : std::max(kLargestStretch, std::sqrt(3.0F) * m.stretch_max);
  } else if (m.limit == formats::LimitMethod::soft) {
    result.largest = std::sqrt(m.norm_limit);
  } else if (m.limit == formats::LimitMethod::frobenius) {
    result.largest = std::sqrt(m.norm_max);
  } else if (m.limit == formats::LimitMethod::curve) {
    result.curve = package.curvePoints().subspan(m.first_curve_point, m.curve_point_count);
    result.largest = std::sqrt(result.curve.back().response);
  }
  return result;
}

MechanicsConstants makeMechanics(const formats::PackageView& package) {
  MechanicsConstants result;
  const auto mechanics = package.mechanics();
  for (std::uint32_t c = 0; c < mechanics.size(); ++c) {
    const formats::ClusterMechanics& m = mechanics[c];
    result.limits.push_back(goalLimits(package, c));
    const bool deforms = package.clusters()[c].mode != formats::ClusterMode::rigid;
    if (m.stiffness == formats::StiffnessModel::elastic && deforms) {
      result.modes_of.resize(mechanics.size(), formats::kNone);
      result.modes_of[c] = std::uint32_t(result.modes.size());
      result.modes.push_back(elasticModes(package, c));
    }
    result.changes_shape |= m.plastic_creep > 0 || (m.channel != formats::kNone && m.contraction > 0);
    result.damps |= m.damping > 0;
  }
  return result;
}

MechanicsState::MechanicsState(const formats::PackageView& package, const MechanicsConstants& constants,
                               std::pmr::memory_resource* memory)
    : shapes(memory), previous(memory), activation(memory) {
  const std::size_t clusters = package.clusters().size();
  if (constants.changes_shape) shapes.resize(clusters);
  if (constants.damps) previous.resize(clusters, Columns<9>::Zero());
  activation.resize(package.channels().size());
}

void MechanicsState::forgetShapes(const formats::PackageView& package) {
  std::fill(shapes.begin(), shapes.end(), ShapeState{});
  std::fill(previous.begin(), previous.end(), Columns<9>::Zero());
  for (std::uint32_t c = 0; c < shapes.size(); ++c) updateShape(package, c);
}

void MechanicsState::reset() {
  std::fill(shapes.begin(), shapes.end(), ShapeState{});
  std::fill(previous.begin(), previous.end(), Columns<9>::Zero());
  std::fill(activation.begin(), activation.end(), 0.0F);
}

void MechanicsState::activate(const formats::PackageView& package, std::uint32_t channel, float value) {
  if (activation[channel] == value) return;
  activation[channel] = value;
  for (std::uint32_t c = 0; c < shapes.size(); ++c) {
    if (package.mechanics()[c].channel == channel) updateShape(package, c);
  }
}

void MechanicsState::updateShape(const formats::PackageView& package, std::uint32_t c) {
  const formats::ClusterMechanics& m = package.mechanics()[c];
  const float active = m.channel == formats::kNone ? 0.0F : activation[m.channel];
  shapes[c].shape = active > 0 ? Matrix3(activationStretch(m, active) * shapes[c].plastic) : shapes[c].plastic;
}

MatchExtras matchExtras(const MechanicsConstants& constants, const MechanicsState& state,
                        std::span<const Eigen::Matrix<float, 27, 1>> kept, const formats::PackageView& package,
                        std::uint32_t c, float pass_seconds) {
  MatchExtras extras;
  if (constants.limits.empty()) return extras;
  extras.limits = &constants.limits[c];
  if (!constants.modes_of.empty() && constants.modes_of[c] != formats::kNone) {
    extras.modes = &constants.modes[constants.modes_of[c]];
    extras.kept = &kept[constants.modes_of[c]];
  }
  // A rest shape that is not deformed now is the kernel's own case: the cluster pays nothing.
  if (!state.shapes.empty() && !state.shapes[c].shape.isIdentity(0)) extras.shape = &state.shapes[c].shape;
  if (!state.previous.empty()) {
    extras.previous = &state.previous[c];
    extras.damping_passes = package.mechanics()[c].damping * pass_seconds;
  }
  return extras;
}

float curveResponse(std::span<const formats::CurvePoint> curve, float phi) {
  if (!(phi > curve.front().norm)) return phi;
  for (std::size_t k = 1; k < curve.size(); ++k) {
    if (phi > curve[k].norm) continue;
    const float part = (phi - curve[k - 1].norm) / (curve[k].norm - curve[k - 1].norm);
    return curve[k - 1].response + part * (curve[k].response - curve[k - 1].response);
  }
  return curve.back().response;
}

float volumePressure(const Matrix3& a, const Matrix3& answer, float ease) {
  return lanes::volumePressure(toLanes(a), toLanes(cofactor(a)), toLanes(answer), ease);
}

double volumeEnergy(double volume) {
  constexpr double kYield = double(kVolumeYield);
  const double off = std::abs(volume - 1);
  return off < kYield ? 0.5 * off * off : kYield * (off - 0.5 * kYield);
}

Matrix3 cofactor(const Matrix3& a) { return fromLanes(lanes::cofactor(toLanes(a))); }

GoalLimits limitsTangled() {
  GoalLimits result;
  result.largest = kLargestStretch;
  result.least = -kLargestStretch;
  return result;
}

Limited applyGoalLimits(const GoalLimits& limits, bool stiff, float margin, const Matrix3& r, const Matrix3* shape,
                        Columns<9>& f) {
  Matrix3 a = f.leftCols<3>();
  if (!a.allFinite()) return Limited::nothing;
  if (shape != nullptr) a = a * inverseOf(*shape);
  Limited done = Limited::nothing;
  const Matrix3 start = a;
  const float volume = determinantOf(a);
  float squares_change = 0, squares_belong_to = start.norm();  // a linear block of this norm
  if (limits.limit == formats::LimitMethod::rows) {
    a = fromLanes(lanes::limitRows(toLanes(a), toLanes(r), limits.row));
  } else {
    const float gamma = blendOf(limits, toLanes(a), toLanes(r));
    if (gamma < 1) {
      a = r + gamma * (a - r);
      squares_change = (1 - gamma) * f.rightCols<6>().norm();
      f.rightCols<6>() *= gamma;
      squares_belong_to = a.norm();
    }
  }
  const bool keeps_volume = limits.volume == formats::VolumeMethod::principal;
  const bool lacks_volume = keeps_volume && a != start;
  if (lacks_volume || !lanes::surelyWithin(toLanes(a), limits.least, limits.largest)) {
    lanes::SvdOf<float> svd;
    rotationSvdOfLane(a.data(), svd.u.m, svd.v.m, &svd.sigma.x);
    const float outside_by = stiff ? 1.0F : margin;
    const bool guarded = svd.sigma.z * outside_by < std::min(kLeastStretch, limits.least) ||
                         svd.sigma.x > outside_by * std::max(kLargestStretch, limits.largest);
    const bool inside = guarded && stiff;
    const float least = inside ? std::max(limits.least, kLeastStretch * kStiffGuardMargin) : limits.least;
    const float largest = inside ? std::min(limits.largest, kLargestStretch / kStiffGuardMargin) : limits.largest;
    lanes::Vec3Of<float> sigma = lanes::limitPrincipal(svd, least, largest);
    const bool outside = sigma.x != svd.sigma.x || sigma.y != svd.sigma.y || sigma.z != svd.sigma.z;
    if (guarded) done = Limited::stopped;
    if (keeps_volume) {
      const float held = sigma.x * sigma.y * sigma.z;
      sigma = lanes::volumePrincipal(sigma, least, largest, lanes::volumeToRestore(volume, held));
    }
    if (outside || lacks_volume) a = fromLanes(lanes::compose(svd, sigma));
  }
  // What is beyond a limit is stopped as well: bringing it back is no motion of its own.
  if ((a - start).norm() + squares_change > (margin - 1) * start.norm()) done = Limited::stopped;
  if (done == Limited::stopped) {
    f.rightCols<6>() *= std::min(1.0F, a.norm() / squares_belong_to);  // 1 where that is 0 / 0
    const auto most = (kSquaresKept * f.rightCols<6>().cwiseAbs()).cwiseMax(kMostSquares).eval();
    f.rightCols<6>() = f.rightCols<6>().cwiseMax(-most).cwiseMin(most);
  } else if (a != start) {
    done = Limited::shaped;
  }
  if (a != start) f.leftCols<3>() = shape != nullptr ? Matrix3(a * *shape) : a;
  return done;
}

Matrix3 activationStretch(const formats::ClusterMechanics& mechanics, float activation) {
  const Vector3 fibre = asVector(mechanics.fibre);
  if (fibre.isZero(0)) return Matrix3::Identity();
  const float along = 1.0F - std::clamp(activation, 0.0F, 1.0F) * mechanics.contraction;
  const float across = 1.0F / std::sqrt(along);
  const Matrix3 direction = fibre.normalized() * fibre.normalized().transpose();
  return across * Matrix3::Identity() + (along - across) * direction;
}

bool updatePlasticity(const formats::ClusterMechanics& mechanics, const Matrix3& r, const Matrix3& goal,
                      float pass_seconds, ShapeState& state) {
  if (!(mechanics.plastic_creep > 0) || !goal.allFinite()) return false;
  // S of the match, counted from the rest shape as it is now: R^T F S^-1, made symmetric against rounding.
  const Matrix3 local = r.transpose() * goal * inverseOf(state.shape);
  const Matrix3 deviation = 0.5F * (local + local.transpose()) - Matrix3::Identity();
  if (!(deviation.norm() > mechanics.plastic_yield)) return false;
  const float part = 1.0F - std::exp(-mechanics.plastic_creep * pass_seconds);
  Matrix3 plastic = (Matrix3::Identity() + part * deviation) * state.plastic;
  Matrix3 change = plastic - Matrix3::Identity();
  const float size = change.norm();
  if (size > mechanics.plastic_limit) plastic = Matrix3::Identity() + (mechanics.plastic_limit / size) * change;
  const float det = determinantOf(plastic);
  if (!(det > 1e-3F) || !plastic.allFinite()) return false;
  state.plastic = plastic / std::cbrt(det);
  return true;
}

}  // namespace sinew::internal

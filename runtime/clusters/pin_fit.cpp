// SPDX-License-Identifier: MIT
#include "runtime/clusters/pin_fit.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "runtime/clusters/goal.h"
#include "runtime/geometry/pseudo_inverse.h"

namespace sinew::internal {
namespace {

// Exact points count as dependent where their moment in the orthonormal basis falls below this part of the largest.
constexpr double kPinCutoff = 1e-8;

// Frequency of the spring of a pin of weight 1/2, Hz: w / (1 - w) times this.
constexpr double kPinFrequency = 60;

// A ratio (2 pi f h)² from which on a class of modes counts as rigid.
constexpr double kRigidRatio = 1e9;
// The stiffest elastic mode beside the mass: further up the mass is rounded away, and with it what turns do.
constexpr double kMostOverMass = 1e11;

using geometry::addProduct;
using geometry::addScaled;
using geometry::ConstMatrixView;
using geometry::MatrixView;
using geometry::SmallMatrix;
using geometry::viewOf;
using Vector9d = Eigen::Matrix<double, 9, 1>;

// The spring of a pin of this weight below 1 is this times mu times springScale().
double springFactor(float weight) {
  const double w = double(weight);
  return w / (1 - w) * (w / (1 - w));
}

// A vector of three as a column.
ConstMatrixView columnOf(const Eigen::Vector3d& v) { return viewOf(v); }

// to += scale a b^T with b a vector of three.
void addOuter(MatrixView to, double scale, ConstMatrixView a, const Eigen::Vector3d& b) {
  addProduct(to, scale, a, {b.data(), geometry::MatrixShape{1, 3, 1, 1}});
}

// N (N^T H N)^-1 N^T.
template <int kMost>
SmallMatrix<kMost> inverseWithin(const SmallMatrix<kMost>& n, const SmallMatrix<kMost>& system) {
  SmallMatrix<kMost> inner(n.columns(), n.columns()), result(n.rows(), n.rows());
  geometry::addCongruence(inner, 1, system, n);
  geometry::invertPositive(inner);
  geometry::addCongruence(result, 1, inner, ConstMatrixView(n).transposed());
  return result;
}

// A of q~(q' + s) = A q~'(q') + q~(s). Its first three columns are d q~ / d q at s.
SmallMatrix<81> shiftedMonomials(const Eigen::Vector3d& s) {
  SmallMatrix<81> a(9, 9);
  geometry::addToDiagonal(a, 1);
  for (int axis = 0; axis < 3; ++axis) {
    const int next = (axis + 1) % 3;
    a(3 + axis, axis) = 2 * s[axis];
    a(6 + axis, axis) = s[next];
    a(6 + axis, next) = s[axis];
  }
  return a;
}

}  // namespace

PinFit::PinFit(const formats::PackageView& package, std::uint32_t cluster, PinMethod method,
               std::span<const PinPoint> points, std::pmr::memory_resource* memory)
    : cluster_(cluster),
      method_(method),
      point_count_(std::uint32_t(points.size())),
      groups_(memory),
      basis_(modeBasis(package, cluster)),
      elastic3_(memory) {
  const formats::Cluster& record = package.clusters()[cluster];
  if (record.mode == formats::ClusterMode::rigid) basis_.t = SmallMatrix<81>(3, 0);
  elastic_ = !package.mechanics().empty() && record.mode != formats::ClusterMode::rigid &&
             package.mechanics()[cluster].stiffness == formats::StiffnessModel::elastic;
  const int size = basis_.t.columns() + 1;
  if (elastic_ && method == PinMethod::constrained_fit) {
    elastic3_.resize(1);
    elastic3_[0].energy = elasticEnergy(package, cluster, basis_);
  }
  const std::uint32_t set_count = 1 + std::uint32_t(std::count_if(points.begin() + 1, points.end(), [&](const auto& p) {
                                    return p.set != (&p)[-1].set;
                                  }));
  groups_.resize(set_count);
  exact_offsets_ = soft_offsets_ = Answer(size, 3);
  springs_ = Square10(size, size);
  std::size_t at_group = 0;
  for (const PinPoint& point : points) {
    if (groups_[at_group].count > 0 && groups_[at_group].set != point.set) ++at_group;
    Group& group = groups_[at_group];
    if (group.count == 0) {
      group.set = point.set;
      group.exact_sum = group.soft_sum = Basis(size, 1);
      group.exact_spread = group.soft_spread = Answer(size, 3);
    }
    ++group.count;
    group.mean += point.local;
    const Eigen::Vector3d q = centredOffset(package, point);
    pin_mean_ += (q + basis_.mean.head<3>()) / double(points.size());
    if (point.weight < 1) continue;
    ++group.exact;
    ++exact_count_;
    exact_mean_ += q;
  }
  exact_mean_ /= std::max(1.0, double(exact_count_));
  for (Group& group : groups_) group.mean /= float(group.count);
  Square10 moment(size, size);
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  at_group = 0;
  for (const PinPoint& point : points) {
    if (groups_[at_group].set != point.set) ++at_group;
    Group& group = groups_[at_group];
    const Basis b = basisAt(record, asVector(package.physicalVertices()[point.vertex].rest_position));
    const Eigen::Vector3d q = centredOffset(package, point), local = (point.local - group.mean).cast<double>();
    if (point.weight < 1) {
      const double k = springFactor(point.weight) * double(point.mu);
      addScaled(group.soft_sum, k, b);
      addOuter(group.soft_spread, k, b, local);
      addOuter(soft_offsets_, k, b, q);
      addProduct(springs_, k, b, b.transposed());
      continue;
    }
    const Eigen::Vector3d turned = q - exact_mean_;
    addScaled(group.exact_sum, 1, b);
    addOuter(group.exact_spread, 1, b, local);
    addOuter(exact_offsets_, 1, b, q);
    addProduct(moment, 1, b, b.transposed());
    addOuter(viewOf(group.turn), 1, columnOf(local), turned);
    group.offset += turned;
    addOuter(viewOf(second), 1, columnOf(turned), turned);
  }
  std::array<double, 10> values;
  Square10 vectors(size, size);
  geometry::symmetricEigen(moment, values, vectors);
  from_points_ = free_ = null_space_ = Square10(size, size);
  int free_count = 0;
  for (int k = 0; k < size; ++k) {
    const double value = values[std::size_t(k)];
    const ConstMatrixView vector = vectors.block(0, k, size, 1);
    if (value > 0 && value > kPinCutoff * values[std::size_t(size - 1)]) {
      addProduct(from_points_, 1 / value, vector, vector.transposed());
    } else {
      addScaled(null_space_.block(0, free_count++, size, 1), 1, vector);
    }
  }
  null_space_.keepColumns(free_count);
  addProduct(free_, 1, null_space_, std::as_const(null_space_).transposed());
  // Six points that have the cluster's second moment: the mean of a cubic, which a volume ratio is, but for its
  // skewness.
  std::array<double, 3> spread;
  Eigen::Matrix3d axes;
  geometry::symmetricEigen(viewOf(std::as_const(basis_.moment)).block(0, 0, 3, 3), spread, viewOf(axes));
  for (int k = 0; k < 6; ++k) {
    const double reach = std::sqrt(3 * std::max(spread[std::size_t(k / 2)], 0.0)) * (k % 2 == 0 ? 1 : -1);
    const Eigen::Vector3d q = basis_.mean.head<3>() + reach * axes.col(k / 2);
    const SmallMatrix<81> gradient = shiftedMonomials(q.cast<float>().cast<double>());
    ModeGradient& at = strain_points_[std::size_t(k)];
    at = ModeGradient(size - 1, 3);
    addProduct(at, 1, std::as_const(basis_.t).transposed(), gradient.block(0, 0, basis_.t.rows(), 3));
  }
  if (exact_count_ >= 3) {
    geometry::symmetricEigen(viewOf(std::as_const(second)), spread, viewOf(axes));
    oriented_ = spread[1] > 1e-6 * spread[2];
  }
}

// q of a point about the cluster's mean.
Eigen::Vector3d PinFit::centredOffset(const formats::PackageView& package, const PinPoint& point) const {
  const Vector3 rest = asVector(package.physicalVertices()[point.vertex].rest_position);
  return restOffset(package.clusters()[cluster_], rest).cast<double>() - basis_.mean.head<3>();
}

PinFit::Basis PinFit::basisAt(const formats::Cluster& cluster, const Vector3& rest_position) const {
  const Vector9d monomial = monomials(restOffset(cluster, rest_position).cast<double>()) - basis_.mean;
  const int modes = basis_.t.columns(), n = basis_.t.rows();
  Basis b(modes + 1, 1);
  b(0, 0) = 1;
  addProduct(b.block(1, 0, modes, 1), 1, basis_.t.transposed(), viewOf(monomial).block(0, 0, n, 1));
  return b;
}

void PinFit::remake(const formats::PackageView& package, const RestConstants& rest, float stiffness_scale,
                    float pass_seconds) {
  pass_seconds_ = pass_seconds;
  const double h = double(pass_seconds);
  const int modes = basis_.t.columns(), size = modes + 1;
  const formats::ClusterMechanics& mechanics =
      package.mechanics().empty() ? formats::kPlainMechanics : package.mechanics()[cluster_];
  const double damping = h * double(mechanics.damping);

  // Mass (the identity), damping of the modes, springs of the soft pins; then the return of the modes.
  system_ = Square10(size, size);
  addScaled(system_, springScale(), springs_);
  geometry::addToDiagonal(system_, 1);
  geometry::addToDiagonal(system_.block(1, 1, modes, modes), damping);
  if (elastic_ && method_ == PinMethod::constrained_fit) {
    const ModeMatrix& energy = elastic3_[0].energy;
    double stiffest = 0;
    for (int k = 0; k < 3 * modes; ++k) stiffest = std::max(stiffest, energy(k, k));
    double scale = h * h * double(stiffness_scale) * double(stiffness_scale);
    if (scale * stiffest > kMostOverMass) scale = kMostOverMass / stiffest;
    Square30& system3 = elastic3_[0].system;
    system3 = Square30(3 * size, 3 * size);
    const int free_count = null_space_.columns();
    Square30 null_space3(3 * size, 3 * free_count);
    for (int a = 0; a < 3; ++a) {
      addScaled(system3.block(a * size, a * size, size, size), 1, system_);
      addScaled(null_space3.block(a * size, a * free_count, size, free_count), 1, null_space_);
      for (int b = 0; b < 3; ++b) {
        addScaled(system3.block(a * size + 1, b * size + 1, modes, modes), scale,
                  elastic3_[0].energy.block(a * modes, b * modes, modes, modes));
      }
    }
    elastic3_[0].inverse = inverseWithin(null_space3, system3);
    response_ = Square10(size, size);
    for (int a = 0; a < 3; ++a)
      addScaled(response_, 1.0 / 3, elastic3_[0].inverse.block(a * size, a * size, size, size));
    return;
  }
  std::array<double, 3> ratios = classRatios(package, rest, cluster_, stiffness_scale, pass_seconds);
  for (double& ratio : ratios) ratio = std::min(ratio, kRigidRatio);
  beta_ = 1 / (1 + damping + ratios[0]);
  if (method_ == PinMethod::constrained_fit && modes > 0) {
    // About the pins: q~' of q' = q - (mean of the pins), q~ = A q~' + constant, so that a mode that leaves the pins in
    // place has the frequency of its class. K = D M' D in those, M' with the mean: the pins take the translation.
    const int n = basis_.t.rows();
    const Vector9d offset = basis_.mean - monomials(pin_mean_);
    SmallMatrix<81> moment(9, 9), about(9, 9), energy(9, 9);
    addScaled(moment, 1, viewOf(std::as_const(basis_.moment)));
    addProduct(moment, 1, viewOf(offset), viewOf(offset).transposed());
    geometry::addCongruence(about, 1, moment, shiftedMonomials(-pin_mean_).transposed());
    double* at = about.data();
    for (int j = 0; j < 9; ++j) {
      for (int i = 0; i < 9; ++i, ++at) {
        const bool both = i < n && j < n;
        *at *= both ? std::sqrt(ratios[std::size_t(i / 3)]) * std::sqrt(ratios[std::size_t(j / 3)]) : 0.0;
      }
    }
    geometry::addCongruence(energy, 1, about, shiftedMonomials(pin_mean_).transposed());
    geometry::addCongruence(system_.block(1, 1, modes, modes), 1, std::as_const(energy).block(0, 0, n, n), basis_.t);
  }
  inverse_ = inverseWithin(null_space_, system_);
  response_ = Square10(size, size);
  addScaled(response_, method_ == PinMethod::infinite_mass ? beta_ : 1.0, inverse_);
}

// (2 pi f h)² of kPinFrequency.
double PinFit::springScale() const {
  const double phase = 2 * std::numbers::pi * kPinFrequency * double(pass_seconds_);
  return phase * phase;
}

bool PinFit::match(const formats::Cluster& cluster, const ClusterRest& rest, const MatchExtras& extras,
                   ClusterFrame& frame) const {
  const int modes = basis_.t.columns(), n = basis_.t.rows(), size = modes + 1;
  const Matrix3 shape = extras.shape != nullptr ? *extras.shape : Matrix3(Matrix3::Identity());
  const Eigen::Matrix3d rest_shape = widened(shape);
  // R: what the pins say. Frequencies are about that frame: about a frame that follows the body they would let it sag
  // without end. The energy of elastic modes does not mind turns, and large ones are right only about the body's own.
  if (oriented_ && !elastic_ && method_ != PinMethod::matrix) {
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    for (const Group& group : groups_) {
      const Eigen::Vector3d place = (group.place - moment_center_).cast<double>();
      moment += group.rotation * group.turn;
      addOuter(viewOf(moment), 1, columnOf(place), group.offset);
    }
    moment = moment * rest_shape.transpose() / double(cluster.radius);
    geometry::nearestRotation(Matrix3(moment.cast<float>()), frame.rotation);
  }
  const Matrix3 r = geometry::rotationMatrix(frame.rotation);
  const Eigen::Matrix3d back = widened(r).transpose();

  // Where the pins want their points, and the exact ones' least-norm answer to it.
  // Σ b d^T, d = R^T (place - c) / radius - S q, of the sets' sums.
  Answer wanted(size, 3), load(size, 3);
  const double per_radius = 1 / double(cluster.radius);
  const Eigen::Matrix3d scaled_back = per_radius * back;
  for (const Group& group : groups_) {
    const Eigen::Matrix3d turn = scaled_back * group.rotation;
    const Eigen::Vector3d offset = (group.place - moment_center_).cast<double>(), place = per_radius * (back * offset);
    if (group.exact > 0) {
      addProduct(wanted, 1, group.exact_spread, viewOf(turn).transposed());
      addOuter(wanted, 1, group.exact_sum, place);
    }
    if (group.exact < group.count) {
      addProduct(load, springScale(), group.soft_spread, viewOf(turn).transposed());
      addOuter(load, springScale(), group.soft_sum, place);
    }
  }
  addProduct(wanted, -1, exact_offsets_, viewOf(rest_shape).transposed());
  addProduct(load, -springScale(), soft_offsets_, viewOf(rest_shape).transposed());
  Answer held(size, 3);
  addProduct(held, 1, from_points_, wanted);

  Answer g =
      method_ == PinMethod::matrix ? withFreePart(held, answerOf(frame.f, r, shape, Eigen::Vector3d::Zero())) : held;
  if (method_ != PinMethod::matrix) {
    if (modes > 0) {
      Eigen::Matrix<double, 3, 9> deviation = back * widened(frame.a_pq);
      const Columns<9> at_rest = shape * rest.moment;
      for (int k = 0; k < 27; ++k) {
        double& one = deviation.data()[k];
        one -= double(at_rest.data()[k]);
        if (extras.previous != nullptr) one += double(extras.damping_passes) * double(extras.previous->data()[k]);
      }
      addProduct(load.block(1, 0, modes, 3), 1, basis_.t.transposed(),
                 viewOf(std::as_const(deviation)).block(0, 0, 3, n).transposed());
    }
    if (elastic_ && method_ == PinMethod::constrained_fit) {
      // The three axes together: an answer's columns one below the other.
      const auto flat = [size](auto& answer) {
        return decltype(answer.view()){answer.data(), 3 * size, 1, 1, 3 * size};
      };
      addProduct(flat(load), -1, elastic3_[0].system, flat(std::as_const(held)));
      addProduct(flat(g), 1, elastic3_[0].inverse, flat(std::as_const(load)));
    } else {
      addProduct(load, -1, system_, held);
      addProduct(g, 1, inverse_, load);
      if (method_ == PinMethod::infinite_mass && exact_count_ > 0) {
        addScaled(g, beta_ - 1, g);
        for (int a = 0; a < 3; ++a) g(0, a) += (1 - beta_) * wanted(0, a) / exact_count_;
      }
    }
  }
  const bool deforms = extras.limits != nullptr && modes > 0;
  if (deforms && extras.limits->volume != formats::VolumeMethod::none) keepVolume(shape, g);
  write(cluster, r, shape, g, frame);
  // Limits, then the pins again: they have the last word. Beyond a limit the pins may leave some of the change to come
  // back at every pass, so it is an inelastic stop.
  if (!deforms) return false;
  GoalLimits limits = *extras.limits;
  limits.volume = formats::VolumeMethod::none;
  Columns<9> f = frame.f;
  if (applyGoalLimits(limits, false, guardMargin(pass_seconds_), r, extras.shape, f) == Limited::nothing) return false;
  const Eigen::Vector3d shift(g(0, 0), g(0, 1), g(0, 2));
  write(cluster, r, shape, withFreePart(held, answerOf(f, r, shape, shift)), frame);
  return true;
}

// held + N N^T (answer - held).
PinFit::Answer PinFit::withFreePart(const Answer& held, Answer&& answer) const {
  addScaled(answer, -1, held);
  Answer g = held;
  addProduct(g, 1, free_, answer);
  return g;
}

// What an F is in the basis. \param shift of the goals' centre, over the radius, in the frame R.
PinFit::Answer PinFit::answerOf(const Columns<9>& f, const Matrix3& r, const Matrix3& shape,
                                const Eigen::Vector3d& shift) const {
  const int modes = basis_.t.columns(), n = basis_.t.rows();
  const Eigen::Matrix3d back = widened(r).transpose();
  Eigen::Matrix<double, 3, 9> g = back * widened(f);
  g.leftCols<3>() -= widened(shape);
  SmallMatrix<81> moment(n, modes);
  addProduct(moment, 1, viewOf(basis_.moment).block(0, 0, n, n), basis_.t);
  Answer answer(modes + 1, 3);
  for (int a = 0; a < 3; ++a) answer(0, a) = shift[a];
  addProduct(answer.block(1, 0, modes, 3), 1, std::as_const(moment).transposed(),
             viewOf(std::as_const(g)).block(0, 0, 3, n).transposed());
  return answer;
}

// The free modes move by the least mass-weighted amount that makes the mean volume ratio that of the rest shape:
// Newton's steps along its gradient, which is the force of a pressure. Clamping principal stretches is no such least
// change, and with pins in the way it fed a beam energy until it burst.
void PinFit::keepVolume(const Matrix3& shape, Answer& g) const {
  const int modes = basis_.t.columns(), size = modes + 1;
  const Eigen::Matrix3d rest = widened(shape);
  const double part = 1.0 / double(strain_points_.size());
  for (int step = 0; step < 3; ++step) {
    double ratio = 0;
    Answer gradient(size, 3);
    for (const ModeGradient& at : strain_points_) {
      Eigen::Matrix3d local = rest;
      addProduct(viewOf(local).transposed(), 1, at.transposed(), g.block(1, 0, modes, 3));
      Eigen::Matrix3d cofactor;
      for (int k = 0; k < 3; ++k) cofactor.col(k) = local.col((k + 1) % 3).cross(local.col((k + 2) % 3));
      ratio += part * local.col(0).dot(cofactor.col(0));
      addProduct(gradient.block(1, 0, modes, 3), part, at, viewOf(std::as_const(cofactor)).transposed());
    }
    Answer along(size, 3);
    addProduct(along, 1, free_, gradient);
    double response = 0, norm2 = 0, along2 = 0;
    for (int k = 0; k < 3 * size; ++k) {
      response += along.data()[k] * gradient.data()[k];
      norm2 += gradient.data()[k] * gradient.data()[k];
      along2 += along.data()[k] * along.data()[k];
    }
    if (!(response > 1e-6 * norm2)) return;
    // Far from the wanted volume the gradient says little: never more than a tenth at a time, nor further than the
    // cluster's radius, as where it has collapsed and hardly anything changes the volume.
    const double step_size = std::clamp(rest.determinant() - ratio, -0.1, 0.1) / response;
    const double most = 1 / std::sqrt(along2);
    addScaled(g, std::clamp(step_size, -most, most), along);
  }
}

void PinFit::write(const formats::Cluster& cluster, const Matrix3& r, const Matrix3& shape, const Answer& g,
                   ClusterFrame& frame) const {
  const int modes = basis_.t.columns(), n = basis_.t.rows();
  Eigen::Matrix<double, 3, 9> f = Eigen::Matrix<double, 3, 9>::Zero();
  f.leftCols<3>() = widened(shape);
  addProduct(viewOf(f).block(0, 0, 3, n), 1, g.block(1, 0, modes, 3).transposed(), basis_.t.transposed());
  frame.f = narrowed(widened(r) * f);
  frame.center = moment_center_ + cluster.radius * (r * Vector3(float(g(0, 0)), float(g(0, 1)), float(g(0, 2))));
}

float PinFit::response(const Basis& b, Monomials<9>& columns) const {
  Basis answer(b.rows(), 1);
  addProduct(answer, 1, response_, b);
  SmallMatrix<9> moved(basis_.t.rows(), 1);
  addProduct(moved, 1, basis_.t, std::as_const(answer).block(1, 0, basis_.t.columns(), 1));
  columns.setZero();
  for (int k = 0; k < moved.rows(); ++k) columns[k] = float(moved(k, 0));
  return float(answer(0, 0));
}

float PinFit::ownResponse(const Basis& b) const {
  SmallMatrix<1> result(1, 1);
  geometry::addCongruence(result, 1, response_, b);
  return float(result(0, 0));
}

}  // namespace sinew::internal

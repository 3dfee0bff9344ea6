// SPDX-License-Identifier: MIT
#include "runtime/clusters/pin_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "runtime/clusters/goal.h"

namespace sinew::internal {
namespace {

// Exact points count as dependent where their moment in the orthonormal basis falls below this part of the largest.
constexpr double kPinCutoff = 1e-8;

// Frequency of the spring of a pin of weight 1/2, Hz: w / (1 - w) times this.
constexpr double kPinFrequency = 60;

// A ratio (2 pi f h)² from which on a class of modes counts as rigid.
constexpr double kRigidRatio = 1e9;

PinFit::Basis constant(int size, double first) {
  PinFit::Basis b = PinFit::Basis::Zero(size);
  b[0] = first;
  return b;
}

// N (N^T H N)^-1 N^T.
template <class Matrix>
Matrix inverseWithin(const Matrix& n, const Matrix& system) {
  if (n.cols() == 0) return Matrix::Zero(n.rows(), n.rows());
  const Matrix reduced = n.transpose() * system * n;
  const Matrix identity = Matrix::Identity(n.cols(), n.cols());
  const Matrix inner = reduced.llt().solve(identity);
  return n * inner * n.transpose();
}

// A of q~(q' + s) = A q~'(q') + q~(s).
Eigen::Matrix<double, 9, 9> shiftedMonomials(const Eigen::Vector3d& s) {
  Eigen::Matrix<double, 9, 9> a = Eigen::Matrix<double, 9, 9>::Identity();
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
               std::vector<PinPoint> points)
    : cluster_(cluster), method_(method), points_(std::move(points)), basis_(modeBasis(package, cluster)) {
  const formats::Cluster& record = package.clusters()[cluster];
  if (record.mode == formats::ClusterMode::rigid) basis_.t.resize(3, 0);
  elastic_ = !package.mechanics().empty() && record.mode != formats::ClusterMode::rigid &&
             package.mechanics()[cluster].stiffness == formats::StiffnessModel::elastic;
  if (elastic_) energy_ = elasticEnergy(package, cluster, basis_);
  const int size = int(basis_.t.cols()) + 1;
  Square10 moment = Square10::Zero(size, size);
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  double count = 0;
  for (const PinPoint& point : points_) {
    const Vector3 rest = asVector(package.physicalVertices()[point.vertex].rest_position);
    values_.push_back(basisAt(record, rest));
    offsets_.push_back(restOffset(record, rest) - basis_.mean.head<3>().cast<float>());
    if (point.weight < 1) continue;
    moment += values_.back() * values_.back().transpose();
    const Eigen::Vector3d q = restOffset(record, rest).cast<double>();
    first += q;
    second += q * q.transpose();
    ++count;
  }
  const Eigen::SelfAdjointEigenSolver<Square10> solver(moment);
  from_points_ = Square10::Zero(size, size);
  Eigen::Index free_count = 0;
  null_space_.resize(size, size);
  for (int k = 0; k < size; ++k) {
    const double value = solver.eigenvalues()[k];
    const Square10 outer = solver.eigenvectors().col(k) * solver.eigenvectors().col(k).transpose();
    if (value > 0 && value > kPinCutoff * solver.eigenvalues()[size - 1]) {
      from_points_ += outer / value;
    } else {
      null_space_.col(free_count++) = solver.eigenvectors().col(k);
    }
  }
  null_space_.conservativeResize(size, free_count);
  free_ = null_space_ * null_space_.transpose();
  // Six points that have the cluster's second moment: the mean of a cubic, which a volume ratio is, but for its
  // skewness.
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(Eigen::Matrix3d(basis_.moment.topLeftCorner<3, 3>()));
  for (int k = 0; k < 6; ++k) {
    const double reach = std::sqrt(3 * std::max(axes.eigenvalues()[k / 2], 0.0)) * (k % 2 == 0 ? 1 : -1);
    const Eigen::Vector3d q = basis_.mean.head<3>() + reach * axes.eigenvectors().col(k / 2);
    const Eigen::Matrix<double, 9, 3> gradient = monomialGradient<9>(q.cast<float>()).cast<double>();
    strain_points_.push_back(basis_.t.transpose() * gradient.topRows(basis_.t.rows()));
  }
  for (const Vector3& offset : offsets_) {
    pin_mean_ += (offset.cast<double>() + basis_.mean.head<3>()) / double(offsets_.size());
  }
  if (count >= 3) {
    second = (second / count - first * first.transpose() / (count * count)).eval();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> spread(second, Eigen::EigenvaluesOnly);
    oriented_ = spread.eigenvalues()[1] > 1e-6 * spread.eigenvalues()[2];
  }
}

PinFit::Basis PinFit::basisAt(const formats::Cluster& cluster, const Vector3& rest_position) const {
  const Eigen::Vector3d q = restOffset(cluster, rest_position).cast<double>();
  Eigen::Matrix<double, 9, 1> monomial;
  monomial << q, q.cwiseProduct(q), q[0] * q[1], q[1] * q[2], q[2] * q[0];
  monomial -= basis_.mean;
  Basis b(basis_.t.cols() + 1);
  b[0] = 1;
  b.tail(basis_.t.cols()) = basis_.t.transpose() * monomial.head(basis_.t.rows());
  return b;
}

void PinFit::prepare(const formats::PackageView& package, const RestConstants& rest, float stiffness_scale,
                     float pass_seconds) {
  if (pass_seconds_ == pass_seconds) return;
  pass_seconds_ = pass_seconds;
  const double h = double(pass_seconds);
  const int modes = int(basis_.t.cols()), size = modes + 1;
  const formats::ClusterMechanics& mechanics =
      package.mechanics().empty() ? formats::kPlainMechanics : package.mechanics()[cluster_];
  const double damping = h * double(mechanics.damping);
  Square10 springs = Square10::Zero(size, size);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    springs += springOf(points_[i]) * values_[i] * values_[i].transpose();
  }

  // Mass (the identity), damping of the modes, springs of the soft pins; then the return of the modes.
  system_ = Square10::Identity(size, size) + springs;
  system_.diagonal().tail(modes).array() += damping;
  if (elastic_ && method_ == PinMethod::constrained_fit) {
    const double scale = h * h * double(stiffness_scale) * double(stiffness_scale);
    system3_ = Square30::Zero(3 * size, 3 * size);
    const Eigen::Index free_count = null_space_.cols();
    Square30 null_space3 = Square30::Zero(3 * size, 3 * free_count);
    for (int a = 0; a < 3; ++a) {
      system3_.block(a * size, a * size, size, size) = system_;
      null_space3.block(a * size, a * free_count, size, free_count) = null_space_;
      for (int b = 0; b < 3; ++b) {
        system3_.block(a * size + 1, b * size + 1, modes, modes) +=
            scale * energy_.block(a * modes, b * modes, modes, modes);
      }
    }
    inverse3_ = inverseWithin(null_space3, system3_);
    response_ = Square10::Zero(size, size);
    for (int a = 0; a < 3; ++a) response_ += inverse3_.block(a * size, a * size, size, size) / 3;
    return;
  }
  std::array<double, 3> ratios = classRatios(package, rest, cluster_, stiffness_scale, pass_seconds);
  for (double& ratio : ratios) ratio = std::min(ratio, kRigidRatio);
  beta_ = 1 / (1 + damping + ratios[0]);
  if (method_ == PinMethod::constrained_fit && modes > 0) {
    // About the pins: q~' of q' = q - (mean of the pins), q~ = A q~' + constant, so that a mode that leaves the pins in
    // place has the frequency of its class. K = D M' D in those, M' with the mean: the pins take the translation.
    const int n = int(basis_.t.rows());
    Eigen::Matrix<double, 9, 1> root = Eigen::Matrix<double, 9, 1>::Zero();
    for (int k = 0; k < n; ++k) root[k] = std::sqrt(ratios[std::size_t(k / 3)]);
    Eigen::Matrix<double, 9, 1> at_pins;
    at_pins << pin_mean_, pin_mean_.cwiseProduct(pin_mean_), pin_mean_[0] * pin_mean_[1], pin_mean_[1] * pin_mean_[2],
        pin_mean_[2] * pin_mean_[0];
    const Eigen::Matrix<double, 9, 9> to = shiftedMonomials(pin_mean_), back = shiftedMonomials(-pin_mean_);
    const Eigen::Matrix<double, 9, 1> offset = basis_.mean - at_pins;
    const Eigen::Matrix<double, 9, 9> moment = back * (basis_.moment + offset * offset.transpose()) * back.transpose();
    const Eigen::Matrix<double, 9, 9> about = root.asDiagonal() * moment * root.asDiagonal();
    const Eigen::Matrix<double, 9, 9> energy = to * about * to.transpose();
    system_.bottomRightCorner(modes, modes) += (basis_.t.transpose() * energy.topLeftCorner(n, n) * basis_.t).eval();
  }
  inverse_ = inverseWithin(null_space_, system_);
  response_ = method_ == PinMethod::infinite_mass ? Square10(beta_ * inverse_) : inverse_;
}

double PinFit::springOf(const PinPoint& point) const {
  if (!(point.weight < 1)) return 0;
  const double w = double(point.weight);
  const double phase = 2 * std::numbers::pi * kPinFrequency * (w / (1 - w)) * double(pass_seconds_);
  return phase * phase * double(point.mu);
}

bool PinFit::match(const formats::Cluster& cluster, const ClusterRest& rest, const MatchExtras& extras,
                   ClusterFrame& frame) const {
  const int modes = int(basis_.t.cols()), n = int(basis_.t.rows()), size = modes + 1;
  const Matrix3 shape = extras.shape != nullptr ? *extras.shape : Matrix3(Matrix3::Identity());
  const auto points_at = [&](const PinPoint& point) {
    return Vector3((point.place - moment_center_) / cluster.radius);
  };
  const auto rest_at = [&](std::size_t i) { return restOfPoint(i, shape); };
  // R: what the pins say. Frequencies are about that frame: about a frame that follows the body they would let it sag
  // without end. The energy of elastic modes does not mind turns, and large ones are right only about the body's own.
  if (oriented_ && !elastic_ && method_ != PinMethod::matrix) {
    Matrix3 moment = Matrix3::Zero();
    Vector3 mean = Vector3::Zero(), rest_mean = Vector3::Zero();
    float count = 0;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (points_[i].weight < 1) continue;
      mean += points_at(points_[i]);
      rest_mean += rest_at(i);
      ++count;
    }
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (points_[i].weight < 1) continue;
      moment += (points_at(points_[i]) - mean / count) * (rest_at(i) - rest_mean / count).transpose();
    }
    geometry::nearestRotation(moment, frame.rotation);
  }
  const Matrix3 r = geometry::rotationMatrix(frame.rotation);
  const Eigen::Matrix3d back = r.transpose().cast<double>();

  // Where the pins want their points, and the exact ones' least-norm answer to it.
  Answer wanted = Answer::Zero(size, 3), soft = Answer::Zero(size, 3);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double exact = 0;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Eigen::Vector3d d = back * points_at(points_[i]).cast<double>() - rest_at(i).cast<double>();
    if (points_[i].weight < 1) {
      soft += springOf(points_[i]) * values_[i] * d.transpose();
    } else {
      wanted += values_[i] * d.transpose();
      mean += d;
      ++exact;
    }
  }
  const Answer held = from_points_ * wanted;

  const auto answer_of = [&](const Columns<9>& f, const Eigen::Vector3d& shift) {
    Eigen::Matrix<double, 3, 9> g = back * f.cast<double>();
    g.leftCols<3>() -= shape.cast<double>();
    Answer answer(size, 3);
    answer.row(0) = shift.transpose();
    answer.bottomRows(modes) = (g.leftCols(n) * basis_.moment.topLeftCorner(n, n) * basis_.t).transpose();
    return answer;
  };
  Answer g(size, 3);
  if (method_ == PinMethod::matrix) {
    g = held + free_ * (answer_of(frame.f, Eigen::Vector3d::Zero()) - held);
  } else {
    Answer load = soft;
    if (modes > 0) {
      Eigen::Matrix<double, 3, 9> deviation = back * frame.a_pq.cast<double>() - (shape * rest.moment).cast<double>();
      if (extras.previous != nullptr) {
        deviation += double(extras.damping_passes) * extras.previous->cast<double>();
      }
      load.bottomRows(modes) += (deviation.leftCols(n) * basis_.t).transpose();
    }
    if (elastic_ && method_ == PinMethod::constrained_fit) {
      const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 1>> flat_held(held.data(), 3 * size);
      const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 1>> flat_load(load.data(), 3 * size);
      Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 30, 1> left = flat_load;
      left.noalias() -= system3_ * flat_held;
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 1>> flat(g.data(), 3 * size);
      flat.noalias() = inverse3_ * left;
      g += held;
    } else {
      const Answer left = load - system_ * held;
      g = held + inverse_ * left;
      if (method_ == PinMethod::infinite_mass && exact > 0) {
        g = (beta_ * g + (1 - beta_) * constant(size, 1) * (mean / exact).transpose()).eval();
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
  Columns<3> linear = f.leftCols<3>();
  const bool quadratic = cluster.mode == formats::ClusterMode::quadratic;
  const Limited limited =
      quadratic ? applyGoalLimits<9>(limits, r, extras.shape, f) : applyGoalLimits<3>(limits, r, extras.shape, linear);
  if (limited == Limited::nothing) return false;
  if (!quadratic) f.leftCols<3>() = linear;
  g = (held + free_ * (answer_of(f, g.row(0)) - held)).eval();
  write(cluster, r, shape, g, frame);
  return true;
}

// The free modes move by the least mass-weighted amount that makes the mean volume ratio that of the rest shape:
// Newton's steps along its gradient, which is the force of a pressure. Clamping principal stretches is no such least
// change, and with pins in the way it fed a beam energy until it burst.
void PinFit::keepVolume(const Matrix3& shape, Answer& g) const {
  const int modes = int(basis_.t.cols()), size = modes + 1;
  const Eigen::Matrix3d rest = shape.cast<double>();
  const double part = 1.0 / double(strain_points_.size());
  for (int step = 0; step < 3; ++step) {
    double ratio = 0;
    Answer gradient = Answer::Zero(size, 3);
    for (const ModeGradient& at : strain_points_) {
      const Eigen::Matrix3d local = rest + (at.transpose() * g.bottomRows(modes)).transpose();
      Eigen::Matrix3d cofactor;
      for (int k = 0; k < 3; ++k) cofactor.col(k) = local.col((k + 1) % 3).cross(local.col((k + 2) % 3));
      ratio += part * local.determinant();
      gradient.bottomRows(modes) += part * (cofactor * at.transpose()).transpose();
    }
    const Answer along = free_ * gradient;
    const double response = (along.array() * gradient.array()).sum();
    if (!(response > 1e-6 * gradient.squaredNorm())) return;
    // Far from the wanted volume the gradient says little: never more than a tenth at a time.
    g += (std::clamp(rest.determinant() - ratio, -0.1, 0.1) / response) * along;
  }
}

Vector3 PinFit::restOfPoint(std::size_t i, const Matrix3& shape) const { return shape * offsets_[i]; }

void PinFit::write(const formats::Cluster& cluster, const Matrix3& r, const Matrix3& shape, const Answer& g,
                   ClusterFrame& frame) const {
  const int modes = int(basis_.t.cols()), n = int(basis_.t.rows());
  Eigen::Matrix<double, 3, 9> f = Eigen::Matrix<double, 3, 9>::Zero();
  f.leftCols<3>() = shape.cast<double>();
  if (modes > 0) f.leftCols(n) += (basis_.t * g.bottomRows(modes)).transpose();
  frame.f = (r.cast<double>() * f).cast<float>();
  frame.center = moment_center_ + cluster.radius * (r * g.row(0).transpose().cast<float>());
}

float PinFit::response(const Basis& b, Monomials<9>& columns) const {
  const Basis answer = response_ * b;
  columns.setZero();
  columns.head(basis_.t.rows()) = (basis_.t * answer.tail(basis_.t.cols())).cast<float>();
  return float(answer[0]);
}

}  // namespace sinew::internal

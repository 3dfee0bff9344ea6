// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/cubature.h"
#include "runtime/geometry/symmetric_eigen.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace sinew::tools::field {
namespace {

// Candidates by wanted sample.
constexpr std::size_t kCandidates = 3;
// Of the largest eigenvalue of the rest Hessian: below are motions without resistance.
constexpr double kNoStiffness = 1e-10;
// What the sampled rest stiffness keeps of the full one, in every direction.
constexpr double kLeast = 0.7;
// Displacements as random forces make them, against all alike.
constexpr double kForces = 5;
// Those that known loads and pin sets' motions make, together, against the same.
constexpr double kKnown = 20;
// Samples by wanted one. Weights take time with the square of their number; a piece that needs more, a skin rough all
// over, has all of them.
constexpr std::size_t kMostSamples = 4;
// Uniform strains among the displacements that weights are fitted to, against all others together.
constexpr double kUniformStrain = 0.3;
// Pull of weights to 1, of the mean diagonal of the normal equations.
constexpr double kRegular = 1e-5;
// Least weight of a sample, of the volume that it stands for.
constexpr double kLeastWeight = 0.02;
// Weight of a direction that was too soft, of the mean one; and from one time to the next where so many samples by
// wanted one have not been enough: one that stayed the same can be outweighed for ever by what the others cost.
constexpr double kSoftWeight = 0.02, kSoftGrowth = 1.2;
constexpr std::size_t kSteadySamples = 2;

// The space in coordinates where the rest Hessian is 1.
struct Whitened {
  MatrixXd from;    // 3k x d
  MatrixXd metric;  // d x d: W, covariance of displacements that are to be right
  MatrixXd root;    // L^T with L L^T = W
};

MatrixXd byAxes(const MatrixXd& m) {
  MatrixXd result = MatrixXd::Zero(3 * m.rows(), 3 * m.cols());
  for (Index j = 0; j < m.cols(); ++j) {
    for (Index i = 0; i < m.rows(); ++i) result.block<3, 3>(3 * i, 3 * j).diagonal().setConstant(m(i, j));
  }
  return result;
}

// How many eigenvalues, at the end, are not of motions without resistance.
Index resisting(const VectorXd& lambda) {
  Index count = lambda.size();
  while (count > 0 && !(lambda[lambda.size() - count] > kNoStiffness * lambda[lambda.size() - 1])) --count;
  return count;
}

// Displacements y of known loads, and of each driven function moved alone where there are several pin sets.
MatrixXd knownMotions(const MatrixXd& held_by, const Acting& acting, Index driven) {
  const Index inside = held_by.rows() - 3 * driven, moved = driven > 4 ? 3 * driven : 0;
  MatrixXd result = MatrixXd::Zero(held_by.rows(), acting.loads.cols() + moved);
  if (inside == 0 || result.cols() == 0) return result;
  MatrixXd forces(inside, result.cols());
  forces << acting.loads, -held_by.bottomLeftCorner(inside, moved);
  MatrixXd matrix = held_by.bottomRightCorner(inside, inside);
  matrix.diagonal().array() += 1e-9 * matrix.diagonal().mean();
  result.bottomRows(inside) = Eigen::LLT<MatrixXd>(matrix).solve(forces);
  result.topRightCorner(moved, moved).setIdentity();
  return result;
}

// The covariance W of displacements y: all alike, as random forces on the functions that move freely make them, the six
// uniform strains, and what surely happens.
Whitened whiten(const MatrixXd& stiffness, const MatrixXd& orthonormal, const Eigen::MatrixX3d& rest, Index driven,
                const Acting& acting) {
  const MatrixXd axes = byAxes(orthonormal);
  const geometry::SymmetricEigen modes = geometry::symmetricEigen(axes.transpose() * stiffness * axes);
  const VectorXd& lambda = modes.values;
  const Index d = resisting(lambda);
  if (d == 0) return {};
  Whitened result;
  result.from = axes * modes.vectors.rightCols(d) * lambda.tail(d).cwiseSqrt().cwiseInverse().asDiagonal();
  result.metric = MatrixXd::Identity(d, d) / double(d);
  MatrixXd held_by = stiffness;
  if (acting.tethers.size() > 0) held_by += byAxes(acting.tethers);
  const Index inside = stiffness.rows() - 3 * driven;
  geometry::SymmetricEigen inner;
  if (inside > 0) inner = geometry::symmetricEigen(held_by.bottomRightCorner(inside, inside));
  const Index moving = inside > 0 ? resisting(inner.values) : 0;
  const auto add = [&](const MatrixXd& y) { result.metric.selfadjointView<Eigen::Lower>().rankUpdate(y); };
  if (moving > 0) {
    const VectorXd compliance = inner.values.tail(moving).cwiseInverse();
    const MatrixXd y = result.from.transpose() * stiffness.rightCols(inside) * inner.vectors.rightCols(moving);
    add(y * (compliance.cwiseProduct(compliance) * (kForces / compliance.sum())).cwiseSqrt().asDiagonal());
  }
  MatrixXd strained(stiffness.rows(), 6);
  for (int s = 0; s < 6; ++s) {
    Eigen::Matrix3d strain = Eigen::Matrix3d::Zero();
    if (s < 3) strain(s, s) = 1;
    if (s >= 3) strain(s - 3, (s - 2) % 3) = strain((s - 2) % 3, s - 3) = 1;
    const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> moved = rest * strain;
    strained.col(s) = Eigen::Map<const VectorXd>(moved.data(), moved.size());
  }
  const auto asEnergy = [&](const MatrixXd& motions) {
    return MatrixXd(result.from.transpose() * (stiffness * motions)).colwise().normalized().eval();
  };
  add(std::sqrt(kUniformStrain) * asEnergy(strained));
  const MatrixXd known = knownMotions(held_by, acting, driven);
  if (known.cols() > 0) add(std::sqrt(kKnown / double(known.cols())) * asEnergy(known));
  result.metric = MatrixXd(result.metric.selfadjointView<Eigen::Lower>());
  result.root = Eigen::LLT<MatrixXd>(result.metric).matrixU();
  return result;
}

// B with B B^T = the Hessian of unit volume: 3k x 6, strains by the root of the stiffness.
MatrixXd strainFactor(const Patch& patch, const MatrixXd& gradient) {
  const Index k = gradient.cols();
  const double shear = std::sqrt(2 * patch.mu);
  const double shared = (std::sqrt(2 * patch.mu + 3 * patch.lambda) - shear) / 3;
  MatrixXd b = MatrixXd::Zero(3 * k, 6);
  for (Index j = 0; j < k; ++j) {
    for (int i = 0; i < 3; ++i) {
      for (int s = 0; s < 3; ++s) b(3 * j + i, s) = gradient(i, j) * (shared + (s == i ? shear : 0));
      const int next = (i + 1) % 3;
      b(3 * j + i, 3 + i) += shear * std::sqrt(0.5) * gradient(next, j);
      b(3 * j + next, 3 + i) += shear * std::sqrt(0.5) * gradient(i, j);
    }
  }
  return b;
}

// What a patch counts when candidates are spread: half by volume, half by its share of the scalar energy of functions
// of equal energy, so that thin places have their part.
std::vector<double> importance(const Elastic& elastic, const MatrixXd& gradients) {
  const Index k = gradients.cols();
  const std::size_t count = elastic.patches.size();
  MatrixXd energy = MatrixXd::Zero(k, k);
  VectorXd density(gradients.rows());
  double volume = 0;
  for (std::size_t s = 0; s < count; ++s) {
    const Patch& p = elastic.patches[s];
    density.segment<3>(3 * Index(s)).setConstant(p.volume * (2 * p.mu + p.lambda));
    volume += p.volume;
  }
  energy = gradients.transpose() * density.asDiagonal() * gradients;
  energy.diagonal().array() += 1e-6 * energy.diagonal().mean();
  const MatrixXd white = Eigen::LLT<MatrixXd>(energy).matrixL().solve(gradients.transpose());
  std::vector<double> result(count);
  for (std::size_t s = 0; s < count; ++s) {
    const double share = density[3 * Index(s)] * white.middleCols(3 * Index(s), 3).squaredNorm();
    result[s] = elastic.patches[s].volume / volume + share / double(k);
  }
  return result;
}

struct Candidates {
  std::vector<std::size_t> patch;
  std::vector<double> volume;
};

// Splits the patches by planes into cells of like importance; the patch next to a cell's centre stands for it.
void split(const Elastic& elastic, const std::vector<double>& weight, std::vector<std::size_t> cell, std::size_t parts,
           Candidates& result) {
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low, centre = Vector3d::Zero();
  double total = 0, volume = 0;
  for (const auto s : cell) {
    low = low.cwiseMin(elastic.patches[s].at);
    high = high.cwiseMax(elastic.patches[s].at);
    centre += weight[s] * elastic.patches[s].at;
    total += weight[s];
    volume += elastic.patches[s].volume;
  }
  centre /= total;
  if (parts <= 1 || cell.size() <= 1) {
    const auto nearest = std::min_element(cell.begin(), cell.end(), [&](auto a, auto b) {
      return (elastic.patches[a].at - centre).squaredNorm() < (elastic.patches[b].at - centre).squaredNorm();
    });
    result.patch.push_back(*nearest);
    result.volume.push_back(volume);
    return;
  }
  Index axis = 0;
  (high - low).maxCoeff(&axis);
  std::stable_sort(cell.begin(), cell.end(),
                   [&](auto a, auto b) { return elastic.patches[a].at[axis] < elastic.patches[b].at[axis]; });
  const std::size_t first_parts = parts / 2;
  double sum = 0;
  std::size_t cut = 0;
  while (cut < cell.size() - 1 && (cut == 0 || sum < total * double(first_parts) / double(parts))) {
    sum += weight[cell[cut++]];
  }
  const std::vector<std::size_t> second(cell.begin() + std::ptrdiff_t(cut), cell.end());
  cell.resize(cut);
  split(elastic, weight, std::move(cell), first_parts, result);
  split(elastic, weight, second, parts - first_parts, result);
}

// Fits sum_s x_s A_s to 1, x >= 0: A_s = C_s C_s^T is the whitened Hessian of a patch with the volume it stands for.
// Least is |W^(1/2) (sum_s x_s A_s - 1) W^(1/2)|: forces that displacements of covariance W meet, as displacements.
class Fit {
 public:
  Fit(const Elastic& elastic, const MatrixXd& gradients, const Candidates& candidates, const Whitened& space)
      : elastic_(elastic), gradients_(gradients), space_(space), patch_(candidates.patch), volume_(candidates.volume) {
    const Index n = Index(patch_.size());
    weight_ = VectorXd::Ones(n);
    factor_.resize(space.from.cols(), 6 * n);
    for (Index s = 0; s < n; ++s)
      factor_.middleCols(6 * s, 6) = factorOf(patch_[std::size_t(s)], volume_[std::size_t(s)]);
    setNormal();
  }

  // Leaves the patches that carry most, weights fitted anew.
  void reduceTo(std::size_t wanted) {
    while (patch_.size() > wanted) {
      sweep(60, 0);
      std::vector<Index> order(patch_.size());
      std::iota(order.begin(), order.end(), Index{0});
      const auto carried = [&](Index s) { return weight_[s] * weight_[s] * normal_(s, s); };
      std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return carried(a) > carried(b); });
      order.resize(std::max(wanted, order.size() * 85 / 100));
      std::sort(order.begin(), order.end());
      keep(order);
    }
    sweep(400, kLeastWeight);
  }

  double leastEigenvalue() {
    MatrixXd sum = MatrixXd::Zero(factor_.rows(), factor_.rows());
    for (Index s = 0; s < weight_.size(); ++s) {
      sum.selfadjointView<Eigen::Lower>().rankUpdate(factor_.middleCols(6 * s, 6), weight_[s]);
    }
    const geometry::SymmetricEigen eigen = geometry::symmetricEigen(sum);
    Index soft = 1;
    while (soft < sum.rows() && eigen.values[soft] < kLeast + 0.05) ++soft;
    directions_ = eigen.vectors.leftCols(soft);
    return eigen.values[0];
  }

  // For each of the softest directions: one more patch, the one of all that resists it most, and more weight in the
  // fit.
  void grow(bool firmer) {
    const Index most = std::min(directions_.cols(), std::max<Index>(1, weight_.size() / 32));
    const double weight = soft_weight_ * space_.metric.trace() / double(space_.metric.rows());
    if (firmer) soft_weight_ *= kSoftGrowth;
    for (Index m = 0; m < most; ++m) {
      const VectorXd soft = directions_.col(m);
      add(strongest(soft));
      VectorXd energy(weight_.size());
      for (Index s = 0; s < energy.size(); ++s)
        energy[s] = (factor_.middleCols(6 * s, 6).transpose() * soft).squaredNorm();
      normal_ += weight * energy * energy.transpose();
      target_ += weight * energy;
    }
    sweep(200, kLeastWeight);
  }

  const std::vector<std::size_t>& patches() const { return patch_; }
  double volume(std::size_t s) const { return volume_[s] * weight_[Index(s)]; }

 private:
  MatrixXd factorOf(std::size_t patch, double volume) const {
    const MatrixXd strains = strainFactor(elastic_.patches[patch], gradients_.middleRows(3 * Index(patch), 3));
    return std::sqrt(volume) * (space_.from.transpose() * strains);
  }

  void keep(const std::vector<Index>& order) {
    std::vector<std::size_t> patches;
    std::vector<double> volumes;
    MatrixXd factor(factor_.rows(), 6 * Index(order.size()));
    for (std::size_t i = 0; i < order.size(); ++i) {
      patches.push_back(patch_[std::size_t(order[i])]);
      volumes.push_back(volume_[std::size_t(order[i])]);
      factor.middleCols(6 * Index(i), 6) = factor_.middleCols(6 * order[i], 6);
    }
    patch_ = patches;
    volume_ = volumes;
    factor_ = factor;
    weight_ = VectorXd(weight_(order));
    target_ = VectorXd(target_(order));
    normal_ = MatrixXd(normal_(order, order));
  }

  // <A_s, A_t> = tr(A_s W A_t W) = |C_s^T W C_t|^2; floats are enough for weights.
  void setNormal() {
    const Index n = weight_.size();
    const Eigen::MatrixXf c = (space_.root * factor_).cast<float>();
    normal_.resize(n, n);
    constexpr Index kRows = 32;
    for (Index first = 0; first < n; first += kRows) {
      const Index rows = std::min(kRows, n - first), columns = n - first;
      const Eigen::MatrixXf a = c.middleCols(6 * first, 6 * rows).transpose() * c.rightCols(6 * columns);
      for (Index t = 0; t < columns; ++t) {
        for (Index s = 0; s < rows; ++s) {
          normal_(first + s, first + t) = normal_(first + t, first + s) =
              double(a.block<6, 6>(6 * s, 6 * t).squaredNorm());
        }
      }
    }
    target_.resize(n);
    for (Index s = 0; s < n; ++s) target_[s] = (space_.metric * factor_.middleCols(6 * s, 6)).squaredNorm();
    regular_ = kRegular * normal_.diagonal().mean();
    normal_.diagonal().array() += regular_;
    target_.array() += regular_;
  }

  void add(std::size_t patch) {
    const Index n = weight_.size();
    const double volume = elastic_.patches[patch].volume * double(elastic_.patches.size()) / double(n);
    factor_.conservativeResize(Eigen::NoChange, 6 * n + 6);
    factor_.rightCols(6) = factorOf(patch, volume);
    const MatrixXd weighted = space_.metric * factor_.rightCols(6);
    const MatrixXd products = weighted.transpose() * factor_;
    normal_.conservativeResize(n + 1, n + 1);
    for (Index s = 0; s <= n; ++s) normal_(s, n) = normal_(n, s) = products.middleCols(6 * s, 6).squaredNorm();
    normal_(n, n) += regular_;
    target_.conservativeResize(n + 1);
    target_[n] = weighted.squaredNorm() + regular_;
    weight_.conservativeResize(n + 1);
    weight_[n] = 0;
    patch_.push_back(patch);
    volume_.push_back(volume);
  }

  // Not one that is chosen already: its weight grows by itself.
  std::size_t strongest(const VectorXd& soft) const {
    const VectorXd z = space_.from * soft;
    const MatrixXd strains = gradients_ * Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>(
                                              z.data(), z.size() / 3, 3);
    std::size_t best = 0;
    double most = -1;
    for (std::size_t s = 0; s < elastic_.patches.size(); ++s) {
      const Patch& p = elastic_.patches[s];
      const Eigen::Matrix3d f = strains.middleRows<3>(3 * Index(s)), e = 0.5 * (f + f.transpose());
      const double energy = p.volume * (2 * p.mu * e.squaredNorm() + p.lambda * e.trace() * e.trace());
      if (energy > most && std::find(patch_.begin(), patch_.end(), s) == patch_.end()) most = energy, best = s;
    }
    return best;
  }

  // Coordinate descent.
  void sweep(int count, double least) {
    for (int i = 0; i < count; ++i) {
      for (Index s = 0; s < weight_.size(); ++s) {
        const double sum = normal_.col(s).dot(weight_);
        weight_[s] = std::max(least, weight_[s] + (target_[s] - sum) / normal_(s, s));
      }
    }
  }

  const Elastic& elastic_;
  const MatrixXd& gradients_;
  const Whitened& space_;
  std::vector<std::size_t> patch_;
  std::vector<double> volume_;  // that it stands for, m^3
  MatrixXd factor_;             // d x 6n: C
  MatrixXd normal_;             // n x n
  VectorXd target_, weight_;
  double regular_ = 0, soft_weight_ = kSoftWeight;
  MatrixXd directions_;  // softest first
};

Cubature allPatches(const Elastic& elastic) {
  Cubature result;
  for (std::size_t s = 0; s < elastic.patches.size(); ++s) {
    result.patch.push_back(s);
    result.volume.push_back(elastic.patches[s].volume);
  }
  return result;
}

}  // namespace

MatrixXd reducedStiffness(const Elastic& elastic, const MatrixXd& functions) {
  const Index k = functions.cols(), f = functions.rows();
  MatrixXd result(3 * k, 3 * k);
  MatrixXd moved = MatrixXd::Zero(3 * f, k);
  for (int b = 0; b < 3; ++b) {
    moved.setZero();
    for (Index i = 0; i < f; ++i) moved.row(3 * i + b) = functions.row(i);
    const MatrixXd forces = elastic.stiffness * moved;
    for (int a = 0; a < 3; ++a) {
      const MatrixXd block = functions.transpose() * axisOf(forces, a);
      for (Index j = 0; j < k; ++j) {
        for (Index i = 0; i < k; ++i) result(3 * i + a, 3 * j + b) = block(i, j);
      }
    }
  }
  return 0.5 * (result + result.transpose());
}

Cubature chooseSamples(const Elastic& elastic, const MatrixXd& functions, const MatrixXd& orthonormal,
                       const Eigen::MatrixX3d& rest, Index driven, const Acting& acting, std::size_t wanted) {
  if (elastic.patches.size() <= wanted) return allPatches(elastic);
  const Whitened space = whiten(reducedStiffness(elastic, functions), orthonormal, rest, driven, acting);
  if (space.from.cols() == 0) return allPatches(elastic);
  const MatrixXd gradients = gradientsOf(elastic, functions, 0, elastic.patches.size());
  const auto weight = importance(elastic, gradients);
  Candidates candidates;
  std::vector<std::size_t> every(elastic.patches.size());
  std::iota(every.begin(), every.end(), std::size_t{0});
  split(elastic, weight, std::move(every), kCandidates * wanted, candidates);
  Fit fit(elastic, gradients, candidates, space);
  fit.reduceTo(wanted);
  double least = fit.leastEigenvalue();
  while (least < kLeast) {
    if (fit.patches().size() > std::min(elastic.patches.size() / 2, kMostSamples * wanted)) return allPatches(elastic);
    fit.grow(fit.patches().size() > kSteadySamples * wanted);
    least = fit.leastEigenvalue();
  }
  std::vector<std::pair<std::size_t, double>> chosen;
  for (std::size_t s = 0; s < fit.patches().size(); ++s) chosen.emplace_back(fit.patches()[s], fit.volume(s));
  std::sort(chosen.begin(), chosen.end());
  Cubature result;
  result.least_eigenvalue = least;
  for (const auto& [patch, volume] : chosen) {
    result.patch.push_back(patch);
    result.volume.push_back(volume);
  }
  return result;
}

}  // namespace sinew::tools::field

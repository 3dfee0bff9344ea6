// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/cubature.h"

#include "runtime/geometry/symmetric_eigen.h"
#include "tools/field/correction.h"
#include "tools/field/dense.h"
#include "tools/field/poses.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace sinew::tools::field {
namespace {

// Candidates by wanted sample.
constexpr std::size_t kCandidates = 3;
// Of the largest eigenvalue of the rest Hessian: below are motions without resistance.
constexpr double kNoStiffness = 1e-10;
// Uniform strains among the displacements that weights are fitted to, against all others together.
constexpr double kUniformStrain = 0.3;
// Pull of weights to 1, of the mean diagonal of the normal equations.
constexpr double kRegular = 1e-5;
// Least weight of a sample, of the volume that it stands for.
constexpr double kLeastWeight = 0.02;
// Weight of all poses together: kPoses / P sum_p |W^(1/2) (sum_s x_s f_s - f)|^2 / |W^(1/2) f|^2, f a pose's forces
// beyond linear ones. From 0.3 to 3 a face's expressions are alike (decision 30).
constexpr double kPoses = 3;

// The space in coordinates where the rest Hessian is 1.
struct Whitened {
  MatrixXd from;    // 3k x d
  MatrixXd metric;  // d x d: W, covariance of displacements that are to be right
  MatrixXd root;    // L^T with L L^T = W
};

// How many eigenvalues, at the end, are not of motions without resistance.
Index resisting(const VectorXd& lambda) {
  Index count = lambda.size();
  while (count > 0 && !(lambda[lambda.size() - count] > kNoStiffness * lambda[lambda.size() - 1])) --count;
  return count;
}

// W: all displacements alike, and uniform strains, which correct() leaves as they are.
Whitened whiten(const MatrixXd& stiffness, const Space& space) {
  const MatrixXd axes = byAxes(space.orthonormal);
  const geometry::SymmetricEigen modes = geometry::symmetricEigen(innerProducts(axes, product(stiffness, axes)));
  const Index d = resisting(modes.values);
  if (d == 0) return {};
  Whitened result;
  result.from =
      product(axes, modes.vectors.rightCols(d)) * modes.values.tail(d).cwiseSqrt().cwiseInverse().asDiagonal();
  MatrixXd strained(stiffness.rows(), 6);
  for (int s = 0; s < 6; ++s) {
    Eigen::Matrix3d strain = Eigen::Matrix3d::Zero();
    if (s < 3) strain(s, s) = 1;
    if (s >= 3) strain(s - 3, (s - 2) % 3) = strain((s - 2) % 3, s - 3) = 1;
    const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> moved = space.rest * strain;
    strained.col(s) = Eigen::Map<const VectorXd>(moved.data(), moved.size());
  }
  const MatrixXd strains = innerProducts(result.from, product(stiffness, strained)).colwise().normalized();
  result.metric = MatrixXd::Identity(d, d) / double(d) + kUniformStrain * product(strains, strains.transpose());
  result.root = DenseCholesky(result.metric).lower().transpose();
  return result;
}

// A patch's weight when candidates are spread: half by volume, half by its share of the scalar energy of functions
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
  energy = innerProducts(gradients, density, gradients);
  energy.diagonal().array() += 1e-6 * energy.diagonal().mean();
  MatrixXd white = gradients.transpose();
  DenseCholesky(std::move(energy)).solveLower(white);
  std::vector<double> result(count);
  for (std::size_t s = 0; s < count; ++s) {
    const double share = density[3 * Index(s)] * white.middleCols(3 * Index(s), 3).squaredNorm();
    result[s] = elastic.patches[s].volume / volume + share / double(k);
  }
  return result;
}

// Splits the patches by planes into cells of like importance; the patch next to a cell's centre stands for it.
void split(const Elastic& elastic, const std::vector<double>& weight, std::vector<std::size_t> cell, std::size_t parts,
           Samples& result) {
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
// Least is |W^(1/2) (sum_s x_s A_s - 1) W^(1/2)|^2 and the poses' sum (kPoses).
class Fit {
 public:
  Fit(const Elastic& elastic, const MatrixXd& gradients, const Samples& candidates, const Whitened& space)
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

  // Forces in poses, as energies of displacements, to be those of all patches too.
  void addPoses(const std::vector<MatrixXd>& poses) {
    std::vector<MatrixXd> met(poses.size());  // d x (n + 1): by candidate, and by all patches
    tbb::parallel_for(std::size_t{0}, poses.size(), [&](std::size_t p) { met[p] = forcesIn(poses[p]); });
    for (const MatrixXd& forces : met) {
      const auto by = forces.leftCols(weight_.size());
      const VectorXd all = forces.rightCols<1>();
      if (!(all.squaredNorm() > 0)) continue;
      const double weight = kPoses / double(poses.size()) / all.squaredNorm();
      normal_ += weight * innerProducts(by, by);
      target_ += weight * by.transpose() * all;
    }
  }

  const std::vector<std::size_t>& patches() const { return patch_; }
  double volume(std::size_t s) const { return volume_[s] * weight_[Index(s)]; }

 private:
  MatrixXd factorOf(std::size_t patch, double volume) const {
    const MatrixXd strains = strainFactor(elastic_.patches[patch], gradients_.middleRows(3 * Index(patch), 3));
    return std::sqrt(volume) * innerProducts(space_.from, strains);
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
    const Eigen::MatrixXf c = product(space_.root, factor_).cast<float>();
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
    for (Index s = 0; s < n; ++s) target_[s] = product(space_.metric, factor_.middleCols(6 * s, 6)).squaredNorm();
    const double regular = kRegular * normal_.diagonal().mean();
    normal_.diagonal().array() += regular;
    target_.array() += regular;
  }

  MatrixXd forcesIn(const MatrixXd& pose) const {
    using Coefficients = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
    const MatrixXd moved = product(gradients_, pose), back = product(space_.root, space_.from.transpose());
    MatrixXd stress(moved.rows(), 3);
    for (std::size_t s = 0; s < elastic_.patches.size(); ++s) {
      const Eigen::Matrix3d f = Eigen::Matrix3d::Identity() + moved.middleRows<3>(3 * Index(s)).transpose();
      stress.middleRows<3>(3 * Index(s)) = stressBeyondLinear(elastic_.patches[s], f).transpose();
    }
    const auto whitened = [&](const Coefficients& force) {
      return VectorXd(back * Eigen::Map<const VectorXd>(force.data(), force.size()));
    };
    MatrixXd result(back.rows(), Index(patch_.size()) + 1);
    for (std::size_t s = 0; s < patch_.size(); ++s) {
      const Index row = 3 * Index(patch_[s]);
      result.col(Index(s)) =
          whitened(volume_[s] * gradients_.middleRows<3>(row).transpose() * stress.middleRows<3>(row));
    }
    for (std::size_t s = 0; s < elastic_.patches.size(); ++s) {
      stress.middleRows<3>(3 * Index(s)) *= elastic_.patches[s].volume;
    }
    result.rightCols<1>() = whitened(innerProducts(gradients_, stress));
    return result;
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
};

}  // namespace

MatrixXd byAxes(const MatrixXd& m) {
  MatrixXd result = MatrixXd::Zero(3 * m.rows(), 3 * m.cols());
  for (Index j = 0; j < m.cols(); ++j) {
    for (Index i = 0; i < m.rows(); ++i) result.block<3, 3>(3 * i, 3 * j).diagonal().setConstant(m(i, j));
  }
  return result;
}

MatrixXd reducedStiffness(const Elastic& elastic, const MatrixXd& functions) {
  const Index k = functions.cols(), f = functions.rows();
  MatrixXd result(3 * k, 3 * k);
  MatrixXd moved = MatrixXd::Zero(3 * f, k);
  for (int b = 0; b < 3; ++b) {
    moved.setZero();
    for (Index i = 0; i < f; ++i) moved.row(3 * i + b) = functions.row(i);
    const MatrixXd forces = product(elastic.stiffness, moved);
    for (int a = 0; a < 3; ++a) {
      const MatrixXd block = innerProducts(functions, axisOf(forces, a));
      for (Index j = 0; j < k; ++j) {
        for (Index i = 0; i < k; ++i) result(3 * i + a, 3 * j + b) = block(i, j);
      }
    }
  }
  return symmetric(result);
}

Samples chooseSamples(const Elastic& elastic, const Space& space, std::size_t wanted) {
  const MatrixXd gradients = gradientsOf(elastic, space.functions, 0, elastic.patches.size());
  std::vector<std::size_t> every(elastic.patches.size());
  std::iota(every.begin(), every.end(), std::size_t{0});
  const MatrixXd stiffness = reducedStiffness(elastic, space.functions);
  const Whitened white = whiten(stiffness, space);
  if (every.size() <= wanted || white.from.cols() == 0) {
    Samples all = {every, {}, gradients};
    for (const Patch& patch : elastic.patches) all.volume.push_back(patch.volume);
    return all;
  }
  Samples candidates;
  split(elastic, importance(elastic, gradients), std::move(every), kCandidates * wanted, candidates);
  const auto slopesOf = [&](const std::vector<std::size_t>& patches) {
    MatrixXd result(3 * Index(patches.size()), gradients.cols());
    for (std::size_t s = 0; s < patches.size(); ++s)
      result.middleRows<3>(3 * Index(s)) = gradients.middleRows<3>(3 * Index(patches[s]));
    return result;
  };
  candidates.gradients = slopesOf(candidates.patch);
  Fit fit(elastic, gradients, candidates, white);
  fit.addPoses(findPoses(elastic, space, candidates));
  fit.reduceTo(wanted);
  std::vector<std::pair<std::size_t, double>> chosen;
  for (std::size_t s = 0; s < fit.patches().size(); ++s) chosen.emplace_back(fit.patches()[s], fit.volume(s));
  std::sort(chosen.begin(), chosen.end());
  // A uniform stretch has the energy that it has in all patches: correct() leaves affine displacements as they are.
  const auto modulus = [&](std::size_t patch) { return 2 * elastic.patches[patch].mu + elastic.patches[patch].lambda; };
  double whole = 0, sampled = 0;
  for (std::size_t s = 0; s < elastic.patches.size(); ++s) whole += elastic.patches[s].volume * modulus(s);
  for (const auto& [patch, volume] : chosen) sampled += volume * modulus(patch);
  Samples result;
  for (const auto& [patch, volume] : chosen) {
    result.patch.push_back(patch);
    result.volume.push_back(volume * whole / sampled);
  }
  result.gradients = slopesOf(result.patch);
  correct(elastic, space, white.from, result);
  return result;
}

}  // namespace sinew::tools::field

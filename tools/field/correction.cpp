// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/correction.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "runtime/geometry/symmetric_eigen.h"
#include "tools/field/dense.h"

namespace sinew::tools::field {
namespace {

// It ends where the rest Hessian is within so much of that of all patches, rms of its rows, or after so many steps.
constexpr double kExact = 5e-3;
constexpr int kMostSteps = 100;

using Eigen::MatrixXf;

// H = C C^T is the samples' rest Hessian in white displacements, C linear in the slopes S: gradients times the root of
// the volume and the modulus. Gradients change by S' = B X D. B spans slopes that affine displacements do not show,
// nor combinations of functions that are 0, those that white ones show alike; D is the fourth root of each sample's
// energy against the mean one. With its root a sample would change as its gradients alone say, and H of uneven samples
// take thousands of steps; with 1, as its energy says, and the smallest would show anything.
class Correction {
 public:
  Correction(const Elastic& elastic, const Space& space, const MatrixXd& white, Samples& samples)
      : samples_(samples), count_(Index(samples.patch.size())) {
    const Index k = space.functions.cols();
    MatrixXd seen = MatrixXd::Zero(k, k), affine(k, 4), slopes = samples.gradients.transpose();
    for (std::size_t i = 0; i < 3; ++i) {
      const MatrixXd by_axis = white(Eigen::seqN(Index(i), k, 3), Eigen::all);
      seen += product(by_axis, by_axis.transpose());
      white_[i] = by_axis.cast<float>();
    }
    affine << space.one, space.rest;
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(innerProducts(space.dual, affine));
    const MatrixXd q = qr.householderQ();
    basis_ = product(space.dual, q.rightCols(q.cols() - qr.rank()));
    if (basis_.cols() > 0) {
      seen = innerProducts(basis_, product(seen, basis_));
      seen.diagonal().array() += 1e-9 * seen.diagonal().mean();
      DenseCholesky(std::move(seen)).divide(basis_);
    }
    size_.resize(count_);
    stretch_.resize(count_);
    shear_.resize(count_);
    shared_.resize(count_);
    for (Index s = 0; s < count_; ++s) {
      const Patch& p = elastic.patches[samples.patch[std::size_t(s)]];
      const double modulus = 2 * p.mu + p.lambda;
      size_[s] = std::sqrt(samples.volume[std::size_t(s)] * modulus);
      stretch_[s] = float(std::sqrt(2 * p.mu / modulus));
      shear_[s] = float(std::sqrt(p.mu / modulus));
      shared_[s] = (float(std::sqrt((2 * p.mu + 3 * p.lambda) / modulus)) - stretch_[s]) / 3;
      slopes.middleCols<3>(3 * s) *= size_[s];
    }
    share_.resize(3 * count_);
    const double mean = std::sqrt(size_.squaredNorm() / double(count_));
    for (Index s = 0; s < count_; ++s) share_.segment<3>(3 * s).setConstant(std::sqrt(size_[s] / mean));
    narrow_ = basis_.cast<float>();
    strains_ = strainsOf(slopes.cast<float>());
    change_ = MatrixXf::Zero(basis_.cols(), 3 * count_);
  }

  // Conjugate gradients (Polak, Ribiere 1969) of |H - 1|^2, X in floats: affine displacements are B's.
  void run() {
    const Index d = strains_.rows();
    MatrixXf residual = product(strains_, strains_.transpose()) - MatrixXf::Identity(d, d), gradient, direction;
    const Eigen::VectorXf share = share_.cast<float>();
    for (int step = 0; step < kMostSteps && residual.norm() > kExact * std::sqrt(float(d)); ++step) {
      const MatrixXf next = innerProducts(narrow_, slopesOf(product(residual, strains_))) * share.asDiagonal();
      if (!(next.squaredNorm() > 0)) break;
      if (step == 0) {
        direction = -next;
      } else {
        const float turn = next.cwiseProduct(next - gradient).sum() / gradient.squaredNorm();
        direction = std::max(0.0F, turn) * direction - next;
      }
      gradient = next;
      const MatrixXf strained = strainsOf(product(narrow_, direction) * share.asDiagonal());
      const MatrixXf half = product(strains_, strained.transpose()), linear = half + half.transpose(),
                     square = product(strained, strained.transpose());
      const float length = lengthTo(residual, linear, square);
      change_ += length * direction;
      strains_ += length * strained;
      residual += length * linear + length * length * square;
    }
    samples_.least_eigenvalue = 1 + geometry::symmetricEigen(residual.cast<double>()).values[0];
    const MatrixXd changes = product(basis_, change_.cast<double>()) * share_.asDiagonal();
    for (Index s = 0; s < count_; ++s) {
      samples_.gradients.middleRows<3>(3 * s) += changes.middleCols<3>(3 * s).transpose() / size_[s];
    }
  }

 private:
  // Where |R + t L + t^2 Q|^2 has a minimum, by Newton's method from that without Q.
  static float lengthTo(const MatrixXf& r, const MatrixXf& l, const MatrixXf& q) {
    const float rl = r.cwiseProduct(l).sum(), ll = l.squaredNorm() + 2 * r.cwiseProduct(q).sum(),
                lq = l.cwiseProduct(q).sum(), qq = q.squaredNorm();
    float t = -rl / l.squaredNorm();
    for (int i = 0; i < 8; ++i) {
      const float curve = ll + t * (6 * lq + 6 * t * qq);
      if (!(curve > 0)) break;
      t -= (rl + t * (ll + t * (3 * lq + 2 * t * qq))) / curve;
    }
    return t;
  }

  // k x 3n -> d x 6n: C. Three stretches by the root of the stiffness, then three shears.
  MatrixXf strainsOf(const MatrixXf& slopes) const {
    MatrixXf result = MatrixXf::Zero(white_[0].cols(), 6 * count_);
    for (Index i = 0; i < 3; ++i) {
      const MatrixXf moved = innerProducts(white_[std::size_t(i)], slopes);
      for (Index s = 0; s < count_; ++s) {
        const Index next = (i + 1) % 3, last = (i + 2) % 3;
        result.middleCols<3>(6 * s).colwise() += shared_[s] * moved.col(3 * s + i);
        result.col(6 * s + i) += stretch_[s] * moved.col(3 * s + i);
        result.col(6 * s + 3 + i) += shear_[s] * moved.col(3 * s + next);
        result.col(6 * s + 3 + last) += shear_[s] * moved.col(3 * s + last);
      }
    }
    return result;
  }

  // Its transpose.
  MatrixXf slopesOf(const MatrixXf& strains) const {
    MatrixXf result = MatrixXf::Zero(basis_.rows(), 3 * count_), moved(strains.rows(), 3 * count_);
    for (Index i = 0; i < 3; ++i) {
      for (Index s = 0; s < count_; ++s) {
        const Index next = (i + 1) % 3, last = (i + 2) % 3;
        moved.col(3 * s + i) =
            shared_[s] * strains.middleCols<3>(6 * s).rowwise().sum() + stretch_[s] * strains.col(6 * s + i);
        moved.col(3 * s + next) = shear_[s] * strains.col(6 * s + 3 + i);
        moved.col(3 * s + last) = shear_[s] * strains.col(6 * s + 3 + last);
      }
      result += product(white_[std::size_t(i)], moved);
    }
    return result;
  }

  Samples& samples_;
  Index count_;
  std::array<MatrixXf, 3> white_;             // by axis, k x d
  MatrixXd basis_;                            // k x r: B
  MatrixXf narrow_, change_;                  // B, and X: r x 3n
  MatrixXf strains_;                          // d x 6n: C
  VectorXd size_, share_;                     // n: the root of volume and modulus; 3n: D
  Eigen::VectorXf stretch_, shear_, shared_;  // n: roots of the stiffnesses, against the modulus
};

}  // namespace

void correct(const Elastic& elastic, const Space& space, const MatrixXd& white, Samples& samples) {
  Correction(elastic, space, white, samples).run();
}

}  // namespace sinew::tools::field

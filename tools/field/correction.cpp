// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/correction.h"
#include "runtime/geometry/symmetric_eigen.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

namespace sinew::tools::field {
namespace {

// It ends where the rest Hessian is within so much of that of all patches, rms of its rows, or after so many steps.
constexpr double kExact = 1e-3;
constexpr int kMostSteps = 100;

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
    MatrixXd seen = MatrixXd::Zero(k, k), affine(k, 4);
    for (std::size_t i = 0; i < 3; ++i) {
      white_[i] = white(Eigen::seqN(Index(i), k, 3), Eigen::all);
      seen += white_[i] * white_[i].transpose();
    }
    affine << space.one, space.rest;
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(space.dual.transpose() * affine);
    const MatrixXd q = qr.householderQ();
    basis_ = space.dual * q.rightCols(q.cols() - qr.rank());
    if (basis_.cols() > 0) {
      seen = (basis_.transpose() * seen * basis_).eval();
      seen.diagonal().array() += 1e-9 * seen.diagonal().mean();
      Eigen::LLT<MatrixXd>(seen).matrixU().solveInPlace<Eigen::OnTheRight>(basis_);
    }
    size_.resize(count_);
    shear_.resize(count_);
    shared_.resize(count_);
    slopes_ = samples.gradients.transpose();
    for (Index s = 0; s < count_; ++s) {
      const Patch& p = elastic.patches[samples.patch[std::size_t(s)]];
      const double modulus = 2 * p.mu + p.lambda;
      size_[s] = std::sqrt(samples.volume[std::size_t(s)] * modulus);
      shear_[s] = std::sqrt(2 * p.mu / modulus);
      shared_[s] = (std::sqrt((2 * p.mu + 3 * p.lambda) / modulus) - shear_[s]) / 3;
      slopes_.middleCols<3>(3 * s) *= size_[s];
    }
    share_.resize(3 * count_);
    const double mean = std::sqrt(size_.squaredNorm() / double(count_));
    for (Index s = 0; s < count_; ++s) share_.segment<3>(3 * s).setConstant(std::sqrt(size_[s] / mean));
    strains_ = strainsOf(slopes_);
  }

  // Conjugate gradients (Polak, Ribiere 1969) of |H - 1|^2.
  void run() {
    const Index d = strains_.rows();
    MatrixXd residual = strains_ * strains_.transpose() - MatrixXd::Identity(d, d), gradient, direction;
    for (int step = 0; step < kMostSteps && residual.norm() > kExact * std::sqrt(double(d)); ++step) {
      const MatrixXd next = basis_.transpose() * slopesOf(residual * strains_) * share_.asDiagonal();
      if (!(next.squaredNorm() > 0)) break;
      if (step == 0) {
        direction = -next;
      } else {
        const double turn = next.cwiseProduct(next - gradient).sum() / gradient.squaredNorm();
        direction = std::max(0.0, turn) * direction - next;
      }
      gradient = next;
      const MatrixXd change = basis_ * direction * share_.asDiagonal(), strained = strainsOf(change);
      const MatrixXd half = strains_ * strained.transpose(), linear = half + half.transpose(),
                     square = strained * strained.transpose();
      const double length = lengthTo(residual, linear, square);
      slopes_ += length * change;
      strains_ += length * strained;
      residual += length * linear + length * length * square;
    }
    samples_.least_eigenvalue = 1 + geometry::symmetricEigen(residual).values[0];
    for (Index s = 0; s < count_; ++s) {
      samples_.gradients.middleRows<3>(3 * s) = slopes_.middleCols<3>(3 * s).transpose() / size_[s];
    }
  }

 private:
  // Where |R + t L + t^2 Q|^2 has a minimum, by Newton's method from that without Q.
  static double lengthTo(const MatrixXd& r, const MatrixXd& l, const MatrixXd& q) {
    const double rl = r.cwiseProduct(l).sum(), ll = l.squaredNorm() + 2 * r.cwiseProduct(q).sum(),
                 lq = l.cwiseProduct(q).sum(), qq = q.squaredNorm();
    double t = -rl / l.squaredNorm();
    for (int i = 0; i < 8; ++i) {
      const double curve = ll + t * (6 * lq + 6 * t * qq);
      if (!(curve > 0)) break;
      t -= (rl + t * (ll + t * (3 * lq + 2 * t * qq))) / curve;
    }
    return t;
  }

  // k x 3n -> d x 6n: C. Three stretches by the root of the stiffness, then three shears.
  MatrixXd strainsOf(const MatrixXd& slopes) const {
    MatrixXd result = MatrixXd::Zero(white_[0].cols(), 6 * count_);
    for (Index i = 0; i < 3; ++i) {
      const MatrixXd moved = white_[std::size_t(i)].transpose() * slopes;
      for (Index s = 0; s < count_; ++s) {
        const Index next = (i + 1) % 3, last = (i + 2) % 3;
        result.middleCols<3>(6 * s).colwise() += shared_[s] * moved.col(3 * s + i);
        result.col(6 * s + i) += shear_[s] * moved.col(3 * s + i);
        result.col(6 * s + 3 + i) += std::sqrt(0.5) * shear_[s] * moved.col(3 * s + next);
        result.col(6 * s + 3 + last) += std::sqrt(0.5) * shear_[s] * moved.col(3 * s + last);
      }
    }
    return result;
  }

  // Its transpose.
  MatrixXd slopesOf(const MatrixXd& strains) const {
    MatrixXd result = MatrixXd::Zero(slopes_.rows(), 3 * count_), moved(strains.rows(), 3 * count_);
    for (Index i = 0; i < 3; ++i) {
      for (Index s = 0; s < count_; ++s) {
        const Index next = (i + 1) % 3, last = (i + 2) % 3;
        moved.col(3 * s + i) =
            shared_[s] * strains.middleCols<3>(6 * s).rowwise().sum() + shear_[s] * strains.col(6 * s + i);
        moved.col(3 * s + next) = std::sqrt(0.5) * shear_[s] * strains.col(6 * s + 3 + i);
        moved.col(3 * s + last) = std::sqrt(0.5) * shear_[s] * strains.col(6 * s + 3 + last);
      }
      result += white_[std::size_t(i)] * moved;
    }
    return result;
  }

  Samples& samples_;
  Index count_;
  std::array<MatrixXd, 3> white_;   // by axis, k x d
  MatrixXd basis_;                  // k x r: B
  MatrixXd slopes_, strains_;       // k x 3n: S, and d x 6n: C
  VectorXd size_, shear_, shared_;  // n: the root of volume and modulus; of the stiffnesses, against the modulus
  VectorXd share_;                  // 3n: D
};

}  // namespace

void correct(const Elastic& elastic, const Space& space, const MatrixXd& white, Samples& samples) {
  Correction(elastic, space, white, samples).run();
}

}  // namespace sinew::tools::field

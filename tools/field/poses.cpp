// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/poses.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <cmath>
#include <utility>

#include "runtime/geometry/rotation.h"
#include "tools/field/dense.h"

namespace sinew::tools::field {
namespace {

using Eigen::Matrix3d;
// Function by function, axis by axis.
using Coefficients = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Newton's iterations with the stiffness at rest, so many at most; a step is halved until the energy descends.
constexpr int kIterations = 60;
// Of the first force: what is left where a pose has settled.
constexpr double kSettled = 0.05;

Matrix3d stress(const Patch& patch, const Matrix3d& gradient, const Matrix3d& rotation) {
  const double stretch = (rotation.transpose() * gradient).trace() - 3;
  return 2 * patch.mu * (gradient - rotation) + patch.lambda * stretch * rotation;
}

// Energy of the samples and tethers, J, and its slopes: the forces that it takes.
double energy(const Elastic& elastic, const Space& space, const Samples& samples, const Coefficients& moved,
              Coefficients& forces) {
  double result = 0;
  forces = Coefficients::Zero(moved.rows(), 3);
  for (std::size_t s = 0; s < samples.patch.size(); ++s) {
    const Patch& patch = elastic.patches[samples.patch[s]];
    const auto gradients = samples.gradients.middleRows<3>(3 * Index(s));
    const Matrix3d f = Matrix3d::Identity() + (gradients * moved).transpose(), r = geometry::nearestRotation(f);
    const Matrix3d p = stress(patch, f, r);
    result += 0.5 * samples.volume[s] * p.cwiseProduct(f - r).sum();
    forces += samples.volume[s] * gradients.transpose() * p.transpose();
  }
  if (space.tethers.size() > 0) {
    const Coefficients pulled = product(space.tethers, moved);
    result += 0.5 * pulled.cwiseProduct(moved).sum();
    forces += pulled;
  }
  return result;
}

}  // namespace

std::vector<MatrixXd> findPoses(const Elastic& elastic, const Space& space, const Samples& samples) {
  const Index k = space.functions.cols(), inside = 3 * (k - space.driven), loads = space.loads.cols();
  if (inside == 0 || loads == 0 || space.reaches.size() == 0) return {};
  MatrixXd stiffness = MatrixXd::Zero(3 * k, 3 * k);
  for (std::size_t s = 0; s < samples.patch.size(); ++s) {
    const MatrixXd b = strainFactor(elastic.patches[samples.patch[s]], samples.gradients.middleRows<3>(3 * Index(s)));
    stiffness.selfadjointView<Eigen::Lower>().rankUpdate(b, samples.volume[s]);
  }
  MatrixXd held = stiffness.selfadjointView<Eigen::Lower>();
  held = held.bottomRightCorner(inside, inside).eval();
  if (space.tethers.size() > 0) held += byAxes(space.tethers).bottomRightCorner(inside, inside);
  held.diagonal().array() += 1e-9 * held.diagonal().mean();
  const DenseCholesky factor(std::move(held));
  std::vector<MatrixXd> found(static_cast<std::size_t>(2 * loads));
  tbb::parallel_for(Index{0}, 2 * loads, [&](Index pose) {
    const Index l = pose / 2;
    const VectorXd load = space.loads.col(l);
    const double work = load.dot(VectorXd(factor.solve(load)));
    if (!(work > 0)) return;
    const VectorXd pull = (pose % 2 == 0 ? -1 : -0.5) * space.reaches[l] / work * load;
    const auto inner = [&](const Coefficients& all) {
      return VectorXd(Eigen::Map<const VectorXd>(all.data(), all.size()).tail(inside));
    };
    Coefficients moved = Coefficients::Zero(k, 3), met;
    double now = energy(elastic, space, samples, moved, met), first = 0, length = 1;
    for (int i = 0; i < kIterations; ++i) {
      const VectorXd force = pull - inner(met), step = factor.solve(force);
      const double left = force.dot(step);
      if (i == 0) first = left;
      if (left <= kSettled * kSettled * first) break;
      length = std::min(1.0, 2 * length);
      for (int half = 0; half < 8; ++half, length *= 0.5) {
        Coefficients next = moved, there;
        Eigen::Map<VectorXd>(next.data(), next.size()).tail(inside) += length * step;
        const double then = energy(elastic, space, samples, next, there) - pull.dot(inner(next));
        if (then > now - 0.1 * length * left) continue;
        moved = next, met = there, now = then;
        break;
      }
    }
    found[std::size_t(pose)] = moved;
  });
  std::erase_if(found, [](const MatrixXd& pose) { return pose.size() == 0; });
  return found;
}

Matrix3d stressBeyondLinear(const Patch& patch, const Matrix3d& gradient) {
  const Matrix3d slope = gradient - Matrix3d::Identity(), strain = 0.5 * (slope + slope.transpose());
  return stress(patch, gradient, geometry::nearestRotation(gradient)) - 2 * patch.mu * strain -
         patch.lambda * strain.trace() * Matrix3d::Identity();
}

}  // namespace sinew::tools::field

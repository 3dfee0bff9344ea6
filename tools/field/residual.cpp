// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/residual.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "runtime/geometry/symmetric_eigen.h"
#include "tools/field/dense.h"

namespace sinew::tools::field {
namespace {

/// Vectors beyond the modes that are asked for, and rounds: a subspace of random vectors converges to the largest
/// eigenvectors with the ratio of what is within to what is beyond it.
constexpr Index kBeyond = 16;
constexpr int kRounds = 2;
/// Vertices at which a vertex's own answer is measured. Its ratio to (K_vv)^-1 spreads by a fifth about its mean.
constexpr Index kMeasured = 48;

class Residual {
 public:
  Residual(const Elastic& elastic, const Answers& answers, const MatrixXd& functions)
      : elastic_(elastic),
        answers_(answers),
        mass_(byAxis(elastic.node_mass)),
        functions_(nodeRows(elastic, functions)) {
    const Index f = elastic.nodes(), k = functions_.cols();
    MatrixXd pulled(3 * f, 3 * k);  // K B
    for (Index a = 0; a < 3; ++a) {
      MatrixXd along = MatrixXd::Zero(3 * f, k);
      along(Eigen::seqN(a, f, 3), Eigen::all) = functions_;
      pulled.middleCols(a * k, k) = product(elastic.stiffness, along);
    }
    MatrixXd reduced(3 * k, 3 * k);
    for (Index a = 0; a < 3; ++a) reduced.middleRows(a * k, k) = innerProducts(functions_, axisOf(pulled, a));
    const geometry::SymmetricEigen eigen = geometry::symmetricEigen(symmetric(reduced));
    shapes_ = eigen.vectors;
    inverse_ = eigen.values;
    for (Index i = 0; i < inverse_.size(); ++i) {
      inverse_[i] = eigen.values[i] > kNothing * eigen.values[inverse_.size() - 1] ? 1 / eigen.values[i] : 0;
    }
  }

  /// G times forces, 3f x c.
  MatrixXd times(const MatrixXd& forces) const {
    return byColumns(forces, [this](const MatrixXd& some) { return timesSome(some); });
  }

  /// 3f x r, by the masses: eigenvectors of M^1/2 G M^1/2, which are modes.
  MatrixXd modes(Index count) const {
    const Index rows = mass_.size(), columns = std::min(count + kBeyond, rows);
    const VectorXd root = mass_.cwiseSqrt();
    Random random(5);
    MatrixXd basis(rows, columns);
    for (Index i = 0; i < basis.size(); ++i) basis.data()[i] = random.unit();
    for (int round = 0; round < kRounds; ++round) {
      basis = orthonormal(root.asDiagonal() * times(root.asDiagonal() * basis));
    }
    const MatrixXd answer = times(root.asDiagonal() * basis), core = innerProducts(basis, root, answer);
    const geometry::SymmetricEigen inner = geometry::symmetricEigen(symmetric(core));
    VectorXd scale = inner.values;
    for (Index i = 0; i < scale.size(); ++i) {
      scale[i] = scale[i] > kNothing * inner.values[scale.size() - 1] ? 1 / std::sqrt(scale[i]) : 0;
    }
    const MatrixXd factor = product(answer, inner.vectors * scale.asDiagonal());
    const geometry::SymmetricEigen found = geometry::symmetricEigen(innerProducts(factor, mass_, factor));
    // A mode softer than the functions' own lowest is no mode but a hinge, which nothing holds.
    const double most = answers_.lowestLambda() > 0 ? 1 / answers_.lowestLambda() : 0;
    Index end = columns, first = 0;
    while (end > 0 && found.values[end - 1] > most) --end;
    while (first < end && !(found.values[first] > kNothing * most)) ++first;
    const Index kept = std::min(count, end - first);
    return product(factor, found.vectors.middleCols(end - kept, kept));
  }

  /// f, m/N: what the modes leave of each node's own answer, mean of the directions.
  VectorXd locals(const MatrixXd& modes) const {
    const Index f = elastic_.nodes();
    VectorXd result(f);
    // A node of flat tetrahedra alone has no stiffness.
    const double least = kLeastStiffness * elastic_.stiffness.diagonal().mean();
    for (Index i = 0; i < f; ++i) {
      Eigen::Matrix3d own = least * Eigen::Matrix3d::Identity();
      for (Index a = 0; a < 3; ++a) {
        for (Index b = 0; b < 3; ++b) own(a, b) += elastic_.stiffness.coeff(3 * i + a, 3 * i + b);
      }
      result[i] = own.inverse().trace() / 3;
    }
    const Index count = std::min(kMeasured, f);
    MatrixXd forces = MatrixXd::Zero(3 * f, 3 * count);
    const auto nodeOf = [&](Index i) { return i * f / count; };
    for (Index i = 0; i < count; ++i) forces.block<3, 3>(3 * nodeOf(i), 3 * i).setIdentity();
    const MatrixXd moved = times(forces);
    std::vector<double> ratios;
    for (Index i = 0; i < count; ++i) {
      const double whole = moved.block<3, 3>(3 * nodeOf(i), 3 * i).trace() / 3;
      const double known = modes.middleRows<3>(3 * nodeOf(i)).squaredNorm() / 3;
      ratios.push_back(std::max(kLeast, (whole - known) / result[nodeOf(i)]));
    }
    // Of what hangs by an edge the answer is that of a hinge.
    std::nth_element(ratios.begin(), ratios.begin() + count / 2, ratios.end());
    return ratios[std::size_t(count / 2)] * result;
  }

 private:
  MatrixXd timesSome(const MatrixXd& forces) const {
    const Index k = functions_.cols();
    const MatrixXd& rigid = answers_.rigid();
    const MatrixXd balanced = forces - mass_.asDiagonal() * product(rigid, innerProducts(rigid, forces));
    MatrixXd loads(3 * k, forces.cols());
    for (Index a = 0; a < 3; ++a) loads.middleRows(a * k, k) = innerProducts(functions_, axisOf(balanced, a));
    const MatrixXd coefficients = product(shapes_, inverse_.asDiagonal() * innerProducts(shapes_, loads));
    MatrixXd moved(forces.rows(), forces.cols());
    for (Index a = 0; a < 3; ++a) {
      moved(Eigen::seqN(a, functions_.rows(), 3), Eigen::all) = product(functions_, coefficients.middleRows(a * k, k));
    }
    moved -= product(rigid, innerProducts(rigid, mass_, moved));
    return answers_.to(forces) - moved;
  }

  /// Of the largest eigenvalue: no more than rounding.
  static constexpr double kNothing = 1e-9;
  /// Of (K_vv)^-1, what is left of a vertex's own answer at least: where modes tell all, springs stay finite.
  static constexpr double kLeast = 0.01;
  /// Of the mean: what a node has at least.
  static constexpr double kLeastStiffness = 1e-6;

  const Elastic& elastic_;
  const Answers& answers_;
  const VectorXd mass_;
  const MatrixXd functions_;  // f x k
  MatrixXd shapes_;           // of the functions' own stiffness, 3k x 3k by axis
  VectorXd inverse_;
};

}  // namespace

void addResidual(const Elastic& elastic, const Answers& answers, Index count, FieldSpace& space) {
  if (count == 0 || elastic.nodes() <= space.values.cols()) return;
  const Residual residual(elastic, answers, space.values);
  const MatrixXd modes = residual.modes(count);
  if (modes.cols() == 0) return;
  space.residual_modes.resize(3 * elastic.mass.size(), modes.cols());
  for (Index a = 0; a < 3; ++a) {
    space.residual_modes(Eigen::seqN(a, elastic.mass.size(), 3), Eigen::all) =
        product(elastic.extend, axisOf(modes, a));
  }
  // Vertices that follow no node move with nothing.
  const VectorXd locals = residual.locals(modes);
  space.residual_locals = elastic.extend * locals;
  space.residual_locals = (space.residual_locals.array() > 0).select(space.residual_locals, locals.mean()).eval();
}

}  // namespace sinew::tools::field

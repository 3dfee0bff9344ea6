// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/modes.h"

#include <Eigen/Dense>
#include <algorithm>

namespace sinew::tools::field {
namespace {

constexpr Index kBlock = 8;

// Order of elimination by approximate minimum degree on nodes, so that a node's three unknowns stay together.
std::vector<Index> orderOf(const Elastic& elastic, const std::vector<bool>& fixed) {
  std::vector<Index> free_nodes, place(fixed.size(), -1);
  for (std::size_t i = 0; i < fixed.size(); ++i) {
    if (fixed[i]) continue;
    place[i] = Index(free_nodes.size());
    free_nodes.push_back(Index(i));
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (const Index j : free_nodes) {
    for (Sparse::InnerIterator it(elastic.scalar, j); it; ++it) {
      if (!fixed[std::size_t(it.row())]) entries.emplace_back(int(place[std::size_t(it.row())]), int(place[std::size_t(j)]), 1.0);
    }
  }
  Sparse graph(Index(free_nodes.size()), Index(free_nodes.size()));
  graph.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(graph, order);
  std::vector<Index> result;
  for (Index i = 0; i < order.size(); ++i) result.push_back(free_nodes[std::size_t(order.indices()[i])]);
  return result;
}

}  // namespace

Solver::Solver(const Elastic& elastic, const std::vector<bool>& fixed, double shift)
    : full_(3 * elastic.nodes()) {
  std::vector<Index> place(std::size_t(full_), -1);
  for (const Index node : orderOf(elastic, fixed)) {
    for (Index a = 0; a < 3; ++a) {
      place[std::size_t(3 * node + a)] = Index(row_.size());
      row_.push_back(3 * node + a);
    }
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t c = 0; c < row_.size(); ++c) {
    for (Sparse::InnerIterator it(elastic.stiffness, row_[c]); it; ++it) {
      const Index r = place[std::size_t(it.row())];
      if (r < Index(c)) continue;
      const double diagonal = r == Index(c) ? shift * elastic.node_mass[row_[c] / 3] : 0;
      entries.emplace_back(int(r), int(c), it.value() + diagonal);
    }
  }
  Sparse lower(Index(row_.size()), Index(row_.size()));
  lower.setFromTriplets(entries.begin(), entries.end());
  factor_.compute(lower);
}

MatrixXd Solver::solve(const MatrixXd& forces) const {
  MatrixXd permuted(Index(row_.size()), forces.cols());
  for (Index r = 0; r < permuted.rows(); ++r) permuted.row(r) = forces.row(row_[std::size_t(r)]);
  permuted = factor_.solve(permuted).eval();
  MatrixXd result = MatrixXd::Zero(full_, forces.cols());
  for (Index r = 0; r < permuted.rows(); ++r) result.row(row_[std::size_t(r)]) = permuted.row(r);
  return result;
}

VectorXd byAxis(const VectorXd& on_nodes) {
  VectorXd result(3 * on_nodes.size());
  for (Index i = 0; i < on_nodes.size(); ++i) result.segment<3>(3 * i).setConstant(on_nodes[i]);
  return result;
}

MatrixXd leading(const MatrixXd& columns, const VectorXd& mass, const MatrixXd& have, Index count) {
  const VectorXd root = mass.cwiseSqrt();
  const MatrixXd known = root.asDiagonal() * have;
  MatrixXd w = root.asDiagonal() * columns;
  for (int pass = 0; pass < 2; ++pass) w -= (known * (known.transpose() * w)).eval();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> gram(MatrixXd(w.transpose() * w));
  const VectorXd& energy = gram.eigenvalues();
  Index kept = 0;
  const Index all = w.cols();
  while (kept < std::min(count, all) && energy[all - 1 - kept] > 1e-12 * energy[all - 1]) ++kept;
  if (kept == 0 || !(energy[all - 1] > 0)) return MatrixXd(columns.rows(), 0);
  MatrixXd u = w * gram.eigenvectors().rightCols(kept).rowwise().reverse();
  // Twice is enough (Giraud et al. 2005): the first Gram matrix loses half of the digits.
  for (int pass = 0; pass < 2; ++pass) {
    u -= (known * (known.transpose() * u)).eval();
    u.colwise().normalize();
    const Eigen::LLT<MatrixXd> again(MatrixXd(u.transpose() * u));
    again.matrixU().solveInPlace<Eigen::OnTheRight>(u);
  }
  return root.cwiseInverse().asDiagonal() * u;
}

MatrixXd rigidMotions(const Elastic& elastic) {
  const Index f = elastic.nodes();
  MatrixXd motions = MatrixXd::Zero(3 * f, 6);
  Vector3d centre = Vector3d::Zero();
  for (Index i = 0; i < f; ++i) {
    centre += elastic.node_mass[i] / elastic.node_mass.sum() *
              elastic.positions.row(elastic.vertex_of[std::size_t(i)]).transpose();
  }
  double size = 1e-300;
  for (Index i = 0; i < f; ++i) {
    const Vector3d x = elastic.positions.row(elastic.vertex_of[std::size_t(i)]).transpose() - centre;
    size = std::max(size, x.norm());
    for (int a = 0; a < 3; ++a) {
      motions(3 * i + a, a) = 1;
      const Vector3d turn = Vector3d::Unit(a).cross(x);
      motions.block<3, 1>(3 * i, 3 + a) = turn;
    }
  }
  motions.rightCols(3) /= size;
  return leading(motions, byAxis(elastic.node_mass), MatrixXd(3 * f, 0), 6);
}

Modes lowestModes(const Elastic& elastic, const Solver& solver, const std::vector<bool>& fixed, const MatrixXd& without,
                  Index count) {
  const VectorXd mass = byAxis(elastic.node_mass);
  const Index unknowns = 3 * Index(std::count(fixed.begin(), fixed.end(), false)) - without.cols();
  count = std::min(count, unknowns);
  if (count <= 0) return {MatrixXd(mass.size(), 0), VectorXd()};
  const Index width = std::min(unknowns, std::max(3 * count, count + 4 * kBlock));
  Random random(1);
  MatrixXd block = MatrixXd::NullaryExpr(mass.size(), kBlock, [&] { return random.unit(); });
  MatrixXd space(mass.size(), without.cols() + width);
  space.leftCols(without.cols()) = without;
  Index filled = without.cols();
  while (filled < space.cols()) {
    block = leading(solver.solve(mass.asDiagonal() * block), mass, space.leftCols(filled),
                    std::min(kBlock, space.cols() - filled));
    if (block.cols() == 0) break;
    space.middleCols(filled, block.cols()) = block;
    filled += block.cols();
  }
  const MatrixXd q = space.middleCols(without.cols(), filled - without.cols());
  MatrixXd projected = q.transpose() * (elastic.stiffness * q);
  projected = (0.5 * (projected + projected.transpose())).eval();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> ritz(projected);
  count = std::min(count, q.cols());
  return {q * ritz.eigenvectors().leftCols(count), ritz.eigenvalues().head(count).cwiseMax(0.0)};
}

}  // namespace sinew::tools::field

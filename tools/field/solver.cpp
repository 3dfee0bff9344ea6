// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/solver.h"

namespace sinew::tools::field {

Solver::Solver(const Elastic& elastic, const std::vector<bool>& fixed, double shift) {
  std::vector<Index> place(fixed.size(), -1);
  for (std::size_t i = 0; i < fixed.size(); ++i) {
    if (fixed[i]) continue;
    place[i] = Index(nodes_.size());
    nodes_.push_back(Index(i));
  }
  if (nodes_.empty()) return;
  const Index unknowns = 3 * Index(nodes_.size());
  Sparse lower(unknowns, unknowns);
  lower.reserve((elastic.stiffness.nonZeros() + unknowns) / 2);
  for (Index column = 0; column < unknowns; ++column) {
    const Index node = nodes_[std::size_t(column / 3)];
    lower.startVec(column);
    for (Sparse::InnerIterator it(elastic.stiffness, 3 * node + column % 3); it; ++it) {
      const Index row = 3 * place[std::size_t(it.row() / 3)] + it.row() % 3;
      if (row < column) continue;
      lower.insertBack(row, column) = it.value() + (row == column ? shift * elastic.node_mass[node] : 0);
    }
  }
  lower.finalize();
  factor_ = firmFactor(lower);
}

MatrixXd Solver::solve(const MatrixXd& forces) const {
  MatrixXd x = MatrixXd::Zero(forces.rows(), forces.cols());
  if (nodes_.empty()) return x;
  MatrixXd right(3 * Index(nodes_.size()), forces.cols());
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    right.middleRows<3>(3 * Index(i)) = forces.middleRows<3>(3 * nodes_[i]);
  }
  right = factor_->solve(right);
  for (std::size_t i = 0; i < nodes_.size(); ++i) x.middleRows<3>(3 * nodes_[i]) = right.middleRows<3>(3 * Index(i));
  return x;
}

}  // namespace sinew::tools::field

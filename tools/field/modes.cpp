// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/modes.h"

#include <Eigen/Dense>
#include <algorithm>
#include <utility>

#include "runtime/geometry/symmetric_eigen.h"
#include "tools/field/answers.h"
#include "tools/field/dense.h"

namespace sinew::tools::field {
namespace {

constexpr Index kBlock = 8;

}  // namespace

MatrixXd leading(const MatrixXd& columns, const VectorXd& mass, const MatrixXd& have, Index count) {
  if (columns.cols() == 0 || count <= 0) return MatrixXd(columns.rows(), 0);
  const VectorXd root = mass.cwiseSqrt();
  const MatrixXd known = root.asDiagonal() * have;
  MatrixXd w = root.asDiagonal() * columns;
  // Eigen reads nothing from a product with an empty matrix, but sanitizers mind its null pointer.
  const auto takeOut = [&](MatrixXd& columns_left) {
    if (known.cols() > 0) columns_left -= product(known, innerProducts(known, columns_left));
  };
  for (int pass = 0; pass < 2; ++pass) takeOut(w);
  const geometry::SymmetricEigen gram = geometry::symmetricEigen(innerProducts(w, w));
  const VectorXd& energy = gram.values;
  Index kept = 0;
  const Index all = w.cols();
  while (kept < std::min(count, all) && energy[all - 1 - kept] > 1e-12 * energy[all - 1]) ++kept;
  if (kept == 0 || !(energy[all - 1] > 0)) return MatrixXd(columns.rows(), 0);
  MatrixXd u = product(w, gram.vectors.rightCols(kept).rowwise().reverse());
  // Twice is enough (Giraud et al. 2005): the first Gram matrix loses half of the digits.
  for (int pass = 0; pass < 2; ++pass) {
    takeOut(u);
    u.colwise().normalize();
    DenseCholesky(innerProducts(u, u)).divide(u);
  }
  return root.cwiseInverse().asDiagonal() * u;
}

MatrixXd inOrder(const MatrixXd& columns, const VectorXd& mass) {
  const VectorXd root = mass.cwiseSqrt();
  MatrixXd u = root.asDiagonal() * columns;
  for (int pass = 0; pass < 2 && u.cols() > 0; ++pass) {
    u.colwise().normalize();
    MatrixXd gram = innerProducts(u, u);
    gram.diagonal().array() += 1e-14;
    DenseCholesky(std::move(gram)).divide(u);
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
  const geometry::SymmetricEigen ritz =
      geometry::symmetricEigen(symmetric(innerProducts(q, product(elastic.stiffness, q))));
  count = std::min(count, q.cols());
  return {product(q, ritz.vectors.leftCols(count)), ritz.values.head(count).cwiseMax(0.0)};
}

}  // namespace sinew::tools::field

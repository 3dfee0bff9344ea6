// SPDX-License-Identifier: MIT
#include "runtime/cut/functions.h"
#include "runtime/geometry/symmetric_eigen.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace sinew::cutting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of the mean: combinations of functions of less squared norm on the part are none, for the parent's values are
/// floats. Moments of less are those of a flat piece.
constexpr double kIndependent = 1e-6, kFlat = 1e-12;

/// Which of the parent's functions pin sets of the part drive, and which are free there.
struct Split {
  std::vector<Index> driven, others;
};

Split splitFunctions(const ParentField& parent, const std::vector<std::uint32_t>& pin_sets) {
  Split split;
  for (Index j = 0; j < parent.count(); ++j) {
    const std::uint32_t set = parent.function(j).pin_set;
    (set != formats::kNone && pin_sets[set] != formats::kNone ? split.driven : split.others).push_back(j);
  }
  return split;
}

/// Places x 4: 1, (X - center) / size.
MatrixXd monomialsAt(const Eigen::MatrixX3d& places, const Vector3d& center, double size) {
  MatrixXd monomials(places.rows(), 4);
  monomials << VectorXd::Ones(places.rows()), (places.rowwise() - center.transpose()) / size;
  return monomials;
}

/// 4 x driven: what the sets make of 1, (X - center) / size.
MatrixXd drivenMonomials(const ParentField& parent, const std::vector<Index>& driven, const Vector3d& center,
                         double size) {
  MatrixXd by = MatrixXd::Zero(4, Index(driven.size()));
  for (Index d = 0; d < by.cols(); ++d) {
    const std::uint32_t monomial = parent.function(driven[std::size_t(d)]).monomial;
    if (monomial == 0) {
      by(0, d) = 1;
      by.col(d).tail<3>() = -center / size;
    } else {
      by(Index(monomial), d) = 1 / size;
    }
  }
  return by;
}

}  // namespace

double ParentField::valueAt(std::uint32_t vertex, Index j) const {
  const std::uint32_t i = vertex - package_.pieces()[field_.piece].first_vertex;
  const std::size_t block = field_.first_value + std::size_t(field_.function_count) * (i / 8) + std::size_t(j);
  return double(package_.fieldValues()[block][i % 8]);
}

VectorXd ParentField::valuesAt(std::uint32_t point) const {
  VectorXd values = VectorXd::Zero(count());
  const std::size_t block = field_.first_point_value + std::size_t(field_.function_count) * (point / 8);
  for (Index j = 0; j < own(); ++j) {
    values[j] = double(package_.fieldPointValues()[block + std::size_t(j)][point % 8]);
  }
  return values;
}

MatrixXd ParentField::gradientsAt(std::uint32_t pack, std::size_t lane) const {
  MatrixXd gradients = MatrixXd::Zero(count(), 3);
  const std::size_t first = field_.first_gradient + 3 * std::size_t(field_.function_count) * pack;
  for (Index j = 0; j < own(); ++j) {
    for (Index a = 0; a < 3; ++a) {
      gradients(j, a) = double(package_.fieldGradients()[first + 3 * std::size_t(j) + std::size_t(a)][lane]);
    }
  }
  return gradients;
}

MatrixXd PartFunctions::gradientsFrom(const MatrixXd& of_parent_here) const {
  return (of_monomials.rightCols<3>() / size).replicate(1, of_parent_here.cols() / 3) + of_parent * of_parent_here;
}

MatrixXd PartFunctions::valuesFrom(const Eigen::MatrixX3d& at, const MatrixXd& of_parent_here) const {
  return monomialsAt(at, center, size) * of_monomials.transpose() + of_parent_here * of_parent.transpose();
}

void PartFunctions::turn(const MatrixXd& by) {
  const Index n = free(), left = driven + by.cols();
  const auto turnRows = [&](auto& all) {
    all.middleRows(driven, by.cols()) = (by.transpose() * all.bottomRows(n)).eval();
    all.conservativeResize(left, all.cols());
  };
  turnRows(of_monomials);
  turnRows(of_parent);
  turnRows(one);
  turnRows(rest);
}

PartFunctions restrictFunctions(const ParentField& parent, const MatrixXd& parent_values,
                                const Eigen::MatrixX3d& rest_places, const VectorXd& masses,
                                const std::vector<std::uint32_t>& pin_sets) {
  const Index vertices = rest_places.rows(), k = parent.count();
  const Split split = splitFunctions(parent, pin_sets);
  const double all = masses.sum();
  PartFunctions made;
  made.driven = Index(split.driven.size());
  made.center = rest_places.transpose() * masses / all;
  const VectorXd squares = (rest_places.rowwise() - made.center.transpose()).rowwise().squaredNorm();
  const double spread = std::sqrt(masses.dot(squares) / all);
  made.size = spread > 0 ? spread : 1;
  const MatrixXd monomials = monomialsAt(rest_places, made.center, made.size);

  // Affine motion of what is not held.
  const MatrixXd by_sets = drivenMonomials(parent, split.driven, made.center, made.size);
  const MatrixXd driven = parent_values(Eigen::all, split.driven);
  const MatrixXd left = monomials - driven * by_sets.transpose();
  const Eigen::Matrix4d moment = left.transpose() * masses.asDiagonal() * left;
  const geometry::SymmetricEigen eigen = geometry::symmetricEigen(moment);
  Index rank = 0;
  while (rank < 4 && eigen.values[3 - rank] > kFlat * all) ++rank;
  const MatrixXd affine =
      eigen.vectors.rightCols(rank) * eigen.values.tail(rank).cwiseSqrt().cwiseInverse().asDiagonal();
  const MatrixXd coordinates = affine.transpose() * moment;  // rank x 4: of 1, (X - center) / size
  const MatrixXd affine_values = left * affine;

  // The parent's functions beyond it, each of its length on the whole: driven ones of sets that went count
  // as long as they are here.
  MatrixXd others = parent_values(Eigen::all, split.others);
  VectorXd scale = VectorXd::Ones(others.cols());
  for (Index j = 0; j < others.cols(); ++j) {
    if (parent.function(split.others[std::size_t(j)]).pin_set == formats::kNone) continue;
    const double length = std::sqrt(masses.dot(others.col(j).cwiseAbs2()));
    scale[j] = length > 0 ? 1 / length : 0;
  }
  others *= scale.asDiagonal();
  const MatrixXd weighed = masses.asDiagonal() * others;
  const MatrixXd overlap = affine_values.transpose() * weighed;
  MatrixXd gram = MatrixXd::Zero(others.cols(), others.cols());  // its lower triangle
  gram.triangularView<Eigen::Lower>() = others.transpose() * weighed;
  const double mean = others.cols() > 0 ? gram.trace() / double(others.cols()) : 0;
  gram.selfadjointView<Eigen::Lower>().rankUpdate(overlap.transpose(), -1);
  const geometry::SymmetricEigen beyond = geometry::symmetricEigen(gram);
  Index kept = 0;
  const Index most = std::clamp<Index>(vertices - rank, 0, others.cols() - std::min(rank, others.cols()));
  while (kept < most && beyond.values[others.cols() - 1 - kept] > kIndependent * mean) ++kept;
  const MatrixXd combine =
      beyond.vectors.rightCols(kept) * beyond.values.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();

  made.affine = rank;
  const Index count = made.driven + rank + kept;
  made.of_monomials = MatrixXd::Zero(count, 4);
  made.of_monomials.middleRows(made.driven, rank) = affine.transpose();
  made.of_monomials.bottomRows(kept) = -(overlap * combine).transpose() * affine.transpose();
  made.of_parent = MatrixXd::Zero(count, k);
  const MatrixXd of_driven = -made.of_monomials * by_sets;
  for (Index d = 0; d < made.driven; ++d) {
    made.of_parent.col(split.driven[std::size_t(d)]) = of_driven.col(d);
    made.of_parent(d, split.driven[std::size_t(d)]) = 1;
  }
  for (Index j = 0; j < others.cols(); ++j) {
    made.of_parent.col(split.others[std::size_t(j)]).tail(kept) = scale[j] * combine.row(j).transpose();
  }
  made.one = VectorXd::Zero(count);
  made.rest = MatrixXd::Zero(count, 3);
  for (Index d = 0; d < made.driven; ++d) {
    formats::FieldFunction function = parent.function(split.driven[std::size_t(d)]);
    made.one[d] = double(function.one);
    made.rest.row(d) = asVector(function.rest).transpose();
    function.pin_set = pin_sets[function.pin_set];
    made.driver.push_back(function);
  }
  made.one.segment(made.driven, rank) = coordinates.col(0);
  for (Index a = 0; a < 3; ++a) {
    made.rest.col(a).segment(made.driven, rank) =
        made.center[a] * coordinates.col(0) + made.size * coordinates.col(1 + a);
  }
  return made;
}

}  // namespace sinew::cutting

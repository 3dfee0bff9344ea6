// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/answers.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "tools/field/dense.h"

namespace sinew::tools::field {
namespace {

// Of the highest of the lowest modes: below are motions without resistance.
constexpr double kNoResistance = 1e-6;
// Shift of the first factor, of the mean stiffness over mass; of a later one, of the lowest mode.
constexpr double kFirstShift = 1e-10, kShift = 0.01;
// A shift above so much of the lowest mode is too large.
constexpr double kLargeShift = 0.2;
// Most change of an answer by the shift, of its size.
constexpr double kShiftError = 1e-4;
// Five rounds suffice below kLargeShift; of a shift that stays above, so many are work enough.
constexpr double kMostRefinements = 20;
constexpr int kPlaces = 12;
constexpr int kTests = 8;
// Radius of a load, of the piece's diagonal. Half of it loses ends' own bending, twice of it the ends.
constexpr double kPlaceRadius = 0.12, kTestRadius = 0.25;

double diagonalOf(const Elastic& elastic) {
  return (elastic.positions.colwise().maxCoeff() - elastic.positions.colwise().minCoeff()).norm();
}

// Mass around a place, with a Gaussian window: what unit acceleration takes.
VectorXd windowAt(const Elastic& elastic, std::uint32_t place, double radius) {
  VectorXd result(elastic.mass.size());
  for (Index v = 0; v < result.size(); ++v) {
    const double far = (elastic.positions.row(v) - elastic.positions.row(place)).norm() / radius;
    result[v] = elastic.mass[v] * std::exp(-far * far);
  }
  return result;
}

// The first is the farthest from the centre, each other the farthest from those before.
std::vector<std::uint32_t> farPlaces(const Elastic& elastic) {
  std::vector<std::uint32_t> places;
  std::vector<double> distance(elastic.surface.size());
  const Eigen::RowVector3d centre = (elastic.mass.transpose() * elastic.positions) / elastic.mass.sum();
  while (places.size() < std::min<std::size_t>(kPlaces, elastic.surface.size())) {
    for (std::size_t i = 0; i < distance.size(); ++i) {
      const Eigen::RowVector3d at = elastic.positions.row(elastic.surface[i]);
      const double d = (at - (places.empty() ? centre : elastic.positions.row(places.back()))).norm();
      distance[i] = places.size() <= 1 ? d : std::min(distance[i], d);
    }
    places.push_back(
        elastic.surface[std::size_t(std::max_element(distance.begin(), distance.end()) - distance.begin())]);
  }
  return places;
}

}  // namespace

// The shift keeps the factor regular and must be small against the lowest mode, which is not known before.
Answers::Answers(const Elastic& elastic, const std::vector<bool>& fixed, Index count)
    : elastic_(elastic), mass_(byAxis(elastic.node_mass)), movable_(mass_.size()) {
  for (Index i = 0; i < movable_.size(); ++i) movable_[i] = fixed[std::size_t(i / 3)] ? 0 : 1;
  const bool free = std::find(fixed.begin(), fixed.end(), true) == fixed.end();
  rigid_ = free ? rigidMotions(elastic) : MatrixXd(mass_.size(), 0);
  double shift = kFirstShift * elastic.stiffness.diagonal().sum() / mass_.sum();
  for (int round = 0; round < 3; ++round) {
    solver_ = std::make_unique<Solver>(elastic, fixed, shift);
    modes_ = lowestModes(elastic, *solver_, fixed, rigid_, count);
    const double lowest = lowestLambda();
    if (lowest == 0) break;
    // (H + s M)^-1 leaves s / (s + lambda) of a mode's answer, and each refinement that part of what the last one left.
    const double rounds = std::log(kShiftError) / std::log(shift / (shift + lowest));
    refinements_ = int(std::min(rounds, kMostRefinements));
    if (shift < kLargeShift * lowest) break;
    shift = kShift * lowest;
  }
}

Index Answers::first() const {
  const VectorXd& lambda = modes_.lambda;
  Index result = 0;
  while (result < lambda.size() && !(lambda[result] > kNoResistance * lambda[lambda.size() - 1])) ++result;
  return result;
}

double Answers::lowestLambda() const { return first() < modes_.lambda.size() ? modes_.lambda[first()] : 0; }

MatrixXd Answers::to(const MatrixXd& forces) const {
  return byColumns(forces, [this](const MatrixXd& some) { return toSome(some); });
}

MatrixXd Answers::toSome(const MatrixXd& forces) const {
  MatrixXd f = movable_.asDiagonal() * forces;
  if (f.cols() == 0) return f;
  const bool free = rigid_.cols() > 0;
  if (free) f -= mass_.asDiagonal() * product(rigid_, innerProducts(rigid_, f));
  MatrixXd u = solver_->solve(f);
  for (int i = 0; i < refinements_; ++i) u += solver_->solve(f - product(elastic_.stiffness, u));
  if (free) u -= product(rigid_, innerProducts(rigid_, mass_, u));
  return u;
}

MatrixXd Answers::weighedModes() const {
  const double lowest = lowestLambda();
  VectorXd weight(modes_.lambda.size());
  for (Index j = 0; j < weight.size(); ++j) weight[j] = modes_.lambda[j] > lowest ? lowest / modes_.lambda[j] : 1;
  return modes_.vectors * weight.asDiagonal();
}

MatrixXd Answers::weighedAnswers(const MatrixXd& forces) const {
  const double lowest = lowestLambda();
  VectorXd weight(forces.cols());
  for (Index j = 0; j < weight.size(); ++j) {
    const double size = forces.col(j).cwiseQuotient(mass_.cwiseSqrt()).norm();
    weight[j] = size > 0 ? lowest / size : 0;
  }
  return to(forces) * weight.asDiagonal();
}

MatrixXd Answers::equal(const MatrixXd& answers) const {
  MatrixXd u = answers;
  for (Index j = 0; j < u.cols(); ++j) {
    const double size = u.col(j).cwiseProduct(mass_.cwiseSqrt()).norm();
    u.col(j) *= size > 0 ? 1 / size : 0;
  }
  return u;
}

VectorXd byAxis(const VectorXd& on_nodes) {
  VectorXd result(3 * on_nodes.size());
  for (Index i = 0; i < on_nodes.size(); ++i) result.segment<3>(3 * i).setConstant(on_nodes[i]);
  return result;
}

MatrixXd splitByAxis(const MatrixXd& motions) {
  MatrixXd result(motions.rows() / 3, 3 * motions.cols());
  for (Index j = 0; j < motions.cols(); ++j) {
    for (Index i = 0; i < motions.rows(); ++i) result(i / 3, 3 * j + i % 3) = motions(i, j);
  }
  return result;
}

MatrixXd onNodes(const Elastic& elastic, const MatrixXd& forces) {
  MatrixXd result = MatrixXd::Zero(3 * elastic.nodes(), forces.cols());
  for (Index v = 0; v < elastic.mass.size(); ++v) {
    for (decltype(elastic.extend)::InnerIterator it(elastic.extend, v); it; ++it) {
      result.middleRows(3 * it.col(), 3) += it.value() * forces.middleRows(3 * v, 3);
    }
  }
  return result;
}

MatrixXd nodeRows(const Elastic& elastic, const MatrixXd& values) {
  MatrixXd result(elastic.nodes(), values.cols());
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = values.row(elastic.vertex_of[std::size_t(i)]);
  return result;
}

MatrixXd gravityLoads(const Elastic& elastic) {
  MatrixXd forces(3 * elastic.mass.size(), 3);
  for (Index v = 0; v < elastic.mass.size(); ++v)
    forces.middleRows<3>(3 * v) = elastic.mass[v] * Eigen::Matrix3d::Identity();
  return forces;
}

MatrixXd placeLoads(const Elastic& elastic) {
  const auto places = farPlaces(elastic);
  MatrixXd forces = MatrixXd::Zero(3 * elastic.mass.size(), 3 * Index(places.size()));
  for (std::size_t p = 0; p < places.size(); ++p) {
    const VectorXd window = windowAt(elastic, places[p], kPlaceRadius * diagonalOf(elastic));
    for (Index v = 0; v < window.size(); ++v) forces.block<3, 3>(3 * v, 3 * Index(p)).diagonal().setConstant(window[v]);
  }
  return forces;
}

MatrixXd testLoads(const Elastic& elastic) {
  Random random(7);
  MatrixXd forces(3 * elastic.mass.size(), kTests);
  for (Index l = 0; l < kTests; ++l) {
    const auto place = elastic.surface[std::size_t(random.below(elastic.surface.size()))];
    const VectorXd window = windowAt(elastic, place, kTestRadius * diagonalOf(elastic));
    Vector3d direction;
    for (Index a = 0; a < 3; ++a) direction[a] = random.unit();
    for (Index v = 0; v < window.size(); ++v) forces.block<3, 1>(3 * v, l) = window[v] * direction.normalized();
  }
  return forces;
}

}  // namespace sinew::tools::field

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "tools/field/elastic.h"
#include "tools/field/modes.h"

namespace sinew::tools::field {

/// The piece with some nodes fixed: its lowest modes, and its answers to forces. A piece of which nothing is fixed
/// answers to forces without their rigid part (inertia relief).
class Answers {
 public:
  /// @param fixed f
  /// @param count of modes, at most
  Answers(const Elastic& elastic, const std::vector<bool>& fixed, Index count);

  const Modes& modes() const { return modes_; }
  const MatrixXd& rigid() const { return rigid_; }  ///< 3f x 6 where nothing is fixed, else 3f x 0
  double lowestLambda() const;                      ///< of the lowest mode with resistance, 1/s^2; 0: there is none

  /// @param forces 3f x c on nodes, N @return 3f x c, metres
  MatrixXd to(const MatrixXd& forces) const;

  /// Modes times lambda_1 / lambda: answers to loads of one size. 3f x m.
  MatrixXd weighedModes() const;
  /// Answers to loads scaled to that size, |f| = 1 under the inverse masses; times lambda_1.
  MatrixXd weighedAnswers(const MatrixXd& forces) const;
  /// Answers scaled so that each weighs as the lowest mode. @param answers 3f x c
  MatrixXd equal(const MatrixXd& answers) const;

 private:
  Index first() const;  // mode with resistance
  MatrixXd toSome(const MatrixXd& forces) const;

  const Elastic& elastic_;
  VectorXd mass_;     // 3f
  VectorXd movable_;  // 3f: 0 or 1
  MatrixXd rigid_;
  std::unique_ptr<Solver> solver_;
  int refinements_ = 0;  // of an answer, which take the shift out of it
  Modes modes_;
};

/// Repeats each entry for x, y, z.
VectorXd byAxis(const VectorXd& on_nodes);
/// Vector fields as scalar ones: 3f x m -> f x 3m.
MatrixXd splitByAxis(const MatrixXd& motions);

/// Forces on vertices (3n) as forces on nodes (3f).
MatrixXd onNodes(const Elastic& elastic, const MatrixXd& forces);
/// Rows of the vertices that are nodes: n x k -> f x k.
MatrixXd nodeRows(const Elastic& elastic, const MatrixXd& values);

/// Weight of all vertices along x, y, z: 3n x 3, for 1 m/s^2.
MatrixXd gravityLoads(const Elastic& elastic);
/// Accelerations of 1 m/s^2 along x, y, z around places far from each other on the surface: 3n x 3 places.
MatrixXd placeLoads(const Elastic& elastic);
/// Accelerations in random directions around random places of the surface, wider than those of placeLoads: 3n x 8.
MatrixXd testLoads(const Elastic& elastic);

}  // namespace sinew::tools::field

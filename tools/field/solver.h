// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <tbb/parallel_for.h>

#include <memory>
#include <vector>

#include "tools/field/cholesky.h"
#include "tools/field/elastic.h"

namespace sinew::tools::field {

/// `part` of a matrix, some columns at a time, on all cores. The runs of columns are those of the matrix
/// alone, so that results do not depend on the number of cores.
/// @param part const MatrixXd& (n x c) -> MatrixXd (m x c)
template <class Part>
MatrixXd byColumns(const MatrixXd& matrix, const Part& part) {
  constexpr Index kMost = 32;
  const Index runs = (matrix.cols() + kMost - 1) / kMost;
  if (runs <= 1) return part(matrix);
  const auto first = [&](Index run) { return run * matrix.cols() / runs; };
  std::vector<MatrixXd> made;
  made.resize(std::size_t(runs));
  tbb::parallel_for(Index{0}, runs, [&](Index run) {
    made[std::size_t(run)] = part(MatrixXd(matrix.middleCols(first(run), first(run + 1) - first(run))));
  });
  MatrixXd result(made[0].rows(), matrix.cols());
  for (Index run = 0; run < runs; ++run) {
    result.middleCols(first(run), first(run + 1) - first(run)) = made[std::size_t(run)];
  }
  return result;
}

/// Answers of the piece to forces, with some nodes fixed: (H + shift M)^-1 on the others.
class Solver {
 public:
  /// @param fixed f: nodes that do not move
  /// @param shift 1/s^2, > 0 where nothing holds the piece
  Solver(const Elastic& elastic, const std::vector<bool>& fixed, double shift);

  /// @param forces 3f x c, N @return 3f x c, metres; 0 at fixed nodes
  MatrixXd solve(const MatrixXd& forces) const;

 private:
  std::vector<Index> nodes_;  // that are not fixed
  std::unique_ptr<Cholesky> factor_;
};

}  // namespace sinew::tools::field

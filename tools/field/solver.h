// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <tbb/parallel_for.h>

#include <vector>

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

/// Answers of the piece to forces, with some nodes fixed: (H + shift M)^-1 on the others. A multifrontal Cholesky
/// factor (Duff and Reid 1983) in an order by nested dissection (George 1973): nodes are cut in about halves by planes
/// or by distances along the mesh, and the nodes on a cut are eliminated after both halves, so that nearly all work is
/// on dense blocks.
class Solver {
 public:
  /// @param fixed f: nodes that do not move
  /// @param shift 1/s^2, > 0 where nothing holds the piece
  Solver(const Elastic& elastic, const std::vector<bool>& fixed, double shift);

  /// @param forces 3f x c, N @return 3f x c, metres; 0 at fixed nodes
  MatrixXd solve(const MatrixXd& forces) const;

  /// Numbers in the factor.
  double entries() const;

 private:
  // Nodes that are eliminated together, and the later ones that they touch then.
  struct Front {
    std::vector<std::uint32_t> own, later;
    std::vector<std::size_t> children;  // into fronts_, all before this one
    MatrixXd diagonal, below;           // L of own x own, later x own
  };

  // among: f, all 0 before and after.
  std::size_t dissect(const Elastic& elastic, std::vector<std::uint32_t> nodes, std::vector<char>& among);
  void setLater(const Elastic& elastic, const std::vector<bool>& fixed);
  void factorize(const Elastic& elastic, double shift);

  std::vector<Front> fronts_;       // children first
  std::vector<std::size_t> place_;  // of each node in the order of elimination
};

}  // namespace sinew::tools::field

// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "tools/field/elastic.h"

namespace sinew::tools::field {

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

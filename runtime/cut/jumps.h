// SPDX-License-Identifier: MIT
//
// Functions that jump across a slit, for motion of its sides apart.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/cut/fields.h"
#include "runtime/cut/functions.h"

namespace sinew::cutting {

/// Tetrahedra of a part's piece by their corners. Rows are vertices of the piece.
class Around {
 public:
  explicit Around(const FieldInput& input);

  /// Tetrahedra of PartMesh that have a vertex. \param row of it.
  std::span<const std::uint32_t> of(std::size_t row) const {
    return {list_.data() + first_[row], list_.data() + first_[row + 1]};
  }
  /// The tetrahedron around a vertex in which a place lies, or nearest to that, on its side of a slit.
  /// \param vertex of the package, which the piece has. \param at m, at rest.
  std::uint32_t at(std::uint32_t vertex, const Vector3d& at) const;

 private:
  const FieldInput& input_;
  std::vector<std::uint32_t> first_, list_;
};

/// Functions psi phi_j: phi_j the softest of the parent's, psi what forces of equal size that pull the two sides of the
/// slit apart make of a membrane on the opened tetrahedra (the harmonic function of their net). Like sqrt(r) at the
/// slit's end and constant on either side far from it, as the terms that open a crack are (Belytschko, Black 1999); of
/// a slit that leaves nothing it tends to the step between the parts.
struct Jumps {
  Eigen::VectorXd psi;            ///< by row; of size 0: there is no slit. Its largest jump is 1
  double size = 0;                ///< m: root of the slit's area
  std::vector<Eigen::Index> phi;  ///< of the parent

  /// Mean in what the part has of a tetrahedron.
  double at(const FieldInput& input, std::uint32_t tetrahedron) const;
};
Jumps findJumps(const FieldInput& input, const ParentField& parent);

}  // namespace sinew::cutting

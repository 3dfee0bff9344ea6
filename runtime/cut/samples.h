// SPDX-License-Identifier: MIT
//
// Where a part's elastic energy is evaluated.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "runtime/cut/fields.h"
#include "runtime/cut/functions.h"
#include "runtime/cut/jumps.h"

namespace sinew::cutting {

struct Sample {
  Vector3d at;                             ///< m, at rest
  double volume = 0, mu = 0, lambda = 0;   ///< m^3; Pa
  std::uint32_t cluster = formats::kNone;  ///< of the part
};

struct Samples {
  std::vector<Sample> list;
  Eigen::MatrixXd gradients;  ///< of the part's functions, k x 3 for each sample
};

/// Slopes of the parent's functions in the tetrahedra of a part's piece.
class Slopes {
 public:
  /// \param parent_values vertices of the part's piece x functions of the parent.
  Slopes(const FieldInput& input, const Eigen::MatrixXd& parent_values) : input_(input), values_(parent_values) {}

  /// Adds a tetrahedron's gradients, k x 3, times its volume. \return that volume, 0 of a flat one.
  double add(const PartTetrahedron& tetrahedron, Eigen::MatrixXd& to) const;
  /// The mean around the longest edge of a tetrahedron (Liu, Nguyen 2010, as the bake's samples); 0 where all are flat.
  /// \param[out] volume of these.
  Eigen::MatrixXd meanAt(const PartTetrahedron& tetrahedron, const Around& around, double& volume) const;

 private:
  const FieldInput& input_;
  const Eigen::MatrixXd& values_;
};

/// The parent's samples that lie on the part, then places as far as can be from those before, until there are enough
/// for the functions. Each stands for the tetrahedra that are nearest to it: volumes and uniform strains are exact.
/// Distances across a slit grow by its size times the jump of psi; where psi is steep samples are denser.
Samples findSamples(const FieldInput& input, const ParentField& parent, const Nearest& nearest,
                    const PartFunctions& functions, const Slopes& slopes, const Around& around, const Jumps& jumps);

/// Sum V (2 mu + lambda) grad grad^T, k x k.
Eigen::MatrixXd stiffnessOf(const Samples& samples);

/// Vibrations of the samples' elasticity at rest, and of tethers.
struct Modes {
  Eigen::MatrixXd shapes;   ///< columns: 3n numbers, function by function
  Eigen::VectorXd squares;  ///< angular frequencies squared, 1/s^2, ascending
};
/// \param first function that may move. \param tethers k x k, 1/s^2, of each axis; of size 0: none.
Modes findModes(const Samples& samples, const Eigen::MatrixXd& tethers, Eigen::Index first);

}  // namespace sinew::cutting

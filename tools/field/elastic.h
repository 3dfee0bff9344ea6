// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

#include "tools/field/field.h"

namespace sinew::tools::field {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Sparse = Eigen::SparseMatrix<double>;

/// A constant deformation gradient: F = sum_i x_i gradient_i^T over the patch's nodes.
struct Patch {
  double volume = 0, mu = 0, lambda = 0;  ///< m^3, Pa
  Vector3d at;                            ///< metres
  std::uint32_t first = 0, count = 0;     ///< into Elastic::node and gradient
  std::uint32_t number = 0;               ///< among those of the whole piece
};

/// The elastic piece on its nodes: the vertices that move by themselves. The others follow nodes (see follow.h).
struct Elastic {
  std::vector<std::uint32_t> vertex_of;                 ///< vertex of each of the f nodes
  Eigen::SparseMatrix<double, Eigen::RowMajor> extend;  ///< n x f: values on vertices from values on nodes
  VectorXd mass;                                        ///< n, kg, of the vertices
  VectorXd node_mass;                                   ///< f, kg: followers' masses joined to their hosts'
  Eigen::MatrixX3d positions;                           ///< n x 3, metres
  std::vector<Patch> patches;
  std::vector<std::uint32_t> node;
  std::vector<Vector3d> gradient;      ///< 1/m
  Sparse stiffness;                    ///< 3f x 3f, N/m: of all patches at rest
  Sparse scalar;                       ///< f x f, N/m: K_s
  std::vector<std::uint32_t> surface;  ///< vertices of faces that one tetrahedron has

  Index nodes() const { return Index(vertex_of.size()); }
};

Elastic assemble(const FieldInput& input, FieldElement element);
/// The same without stiffness.
Elastic assemblePatches(const FieldInput& input, FieldElement element);

/// Makes the stiffness of the patches anew. Corotated energy at rest: K_ij = V (mu (g_i.g_j) 1 + mu g_j g_i^T +
/// lambda g_i g_j^T); K_s has V (2 mu + lambda) g_i.g_j.
void addStiffness(Elastic& elastic);

/// Gradients of functions at a run of patches: 3 rows a patch.
/// @param on_nodes f x k
MatrixXd gradientsOf(const Elastic& elastic, const MatrixXd& on_nodes, std::size_t first, std::size_t count);

/// B with B B^T = the rest Hessian of unit volume, function by function, axis by axis: 3k x 6, strains by the root of
/// the stiffness.
/// @param gradient 3 x k
MatrixXd strainFactor(const Patch& patch, const MatrixXd& gradient);

/// The rows of one axis: a, a + 3, ...
inline MatrixXd axisOf(const Eigen::Ref<const MatrixXd>& m, Index a) {
  return m(Eigen::seqN(a, m.rows() / 3, 3), Eigen::all);
}

/// Numbers that look random: the same on every machine (SplitMix64, Steele et al. 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15U);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
    return z ^ (z >> 31);
  }
  double unit() { return double(next() >> 11) * 0x1p-52 - 1; }  ///< -1..1
  std::uint64_t below(std::uint64_t count) { return next() % count; }

 private:
  std::uint64_t state_;
};

}  // namespace sinew::tools::field

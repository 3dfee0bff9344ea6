// SPDX-License-Identifier: MIT
//
// What couples the pieces of an island as if each were rigid (docs/method.md §4): the coarse level of their first
// matrix.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "runtime/memory/array.h"
#include "runtime/solver/piece.h"

namespace sinew::internal {

struct Minimand;

/// The first matrices B of the pieces do not know of each other: a stack sways and is pressed as a whole by forces that
/// iterations would carry from piece to piece. R are the rigid motions of the pieces, A the matrix of all of them with
/// what couples them, D its blocks, R^T B R. Added to B^-1, R (A^-1 - D^-1) R^T makes of it what knows both, and keeps
/// it positive: g^T B^-1 g >= (R^T g)^T D^-1 (R^T g) (additive Schwarz with a coarse space, Toselli and Widlund 2005,
/// ch. 2). A is taken apart as L S L^T without fill: of a chain that is exact.
class RigidCoupling {
 public:
  explicit RigidCoupling(std::pmr::memory_resource* memory);

  /// \param order of the pieces, what hangs on others or lies on them first. \pre frames and systems are made
  void make(const Minimand& minimand, std::span<const std::uint32_t> order);
  /// R^T g of all pieces. \param g size() floats of the minimand.
  void take(const Minimand& minimand, const float* g);
  /// Adds R (A^-1 - D^-1) of what was taken.
  void give(const Minimand& minimand, float* direction);

 private:
  using Block = Eigen::Matrix<double, 6, 6>;
  using Six = Eigen::Matrix<double, 6, 1>;
  struct Node {
    std::uint32_t piece;
    std::uint32_t first, count;  ///< couplings to later nodes
    Block own, inverse;          ///< D^-1, S^-1
    Six load, way;
  };
  struct Coupling {
    std::uint64_t key;  ///< earlier node << 32 | later one
    Block block;        ///< of A, later row; then of L
  };
  /// A coefficient's parts of a translation and a turn.
  Eigen::Vector4d* arms(std::uint32_t piece) { return arms_.data() + first_arm_[piece]; }

  void findArms(const Minimand& minimand);
  /// Null where there is none.
  Coupling* find(std::uint64_t key);
  void takeApart();

  Array<Node> nodes_;
  Array<Coupling> couplings_;  ///< by their keys
  Array<std::uint64_t> keys_;
  Array<std::uint32_t> node_of_, first_arm_;
  Array<Eigen::Vector4d> arms_;  ///< phi's: 1 and the place in the world, about the centre
};

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// The coarse level of an island's first matrix: its pieces coupled as if each were rigid (docs/method.md §4).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "runtime/memory/array.h"
#include "runtime/solver/piece.h"

namespace sinew::internal {

struct Minimand;
struct Objective;

/// The first matrices B of pieces are not coupled: alone they leave it to iterations to carry forces through a stack,
/// piece by piece. With R the rigid motions of all pieces, A their matrix with the couplings and D = R^T B R, blocks on
/// a diagonal, the first matrix has the inverse B^-1 + R (A^-1 - D^-1) R^T. It is positive, whatever A is: g^T B^-1 g
/// >= (R^T g)^T D^-1 (R^T g) (additive Schwarz with a coarse space, Toselli and Widlund 2005, ch. 2). B counts all that
/// is near; A may know better. A is factored as L S L^T without fill, which is exact for a chain.
class RigidCoupling {
 public:
  explicit RigidCoupling(std::pmr::memory_resource* memory);

  /// Memory for so many pieces.
  void reserve(std::size_t pieces, std::size_t touches);
  /// \param pushing_only A has the touches and contacts that push at the prediction or did where last evaluated: what
  /// only passes by holds nothing. Else it has those that B has. \pre frames and systems are made
  void make(const Minimand& minimand, bool pushing_only);
  /// Whether only what pushes holds a piece as a whole. \pre made with `pushing_only`
  bool frees(std::uint32_t piece) const { return node_of_[piece] != formats::kNone; }
  /// R^T g of all pieces. \param g size() floats of the minimand.
  void take(const Minimand& minimand, const float* g);
  /// Adds R (A^-1 - D^-1) times the result of take().
  void give(const Minimand& minimand, float* direction);
  /// Adds R A^-1 times the result of take(): the answer of pieces that are rigid.
  void giveAlone(const Minimand& minimand, float* direction);

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
  /// Blocks of D and A, and the moments of the piece's rows.
  void findBlocks(const Minimand& minimand, const Objective& objective, Block& d, Block& a);
  /// Null where there is none.
  Coupling* find(std::uint64_t key);
  void takeApart();
  /// A^-1 times the loads, into the nodes' ways.
  void substitute();
  void add(const Minimand& minimand, const Node& node, const Six& motion, float* direction);

  Array<Node> nodes_;
  Array<Coupling> couplings_;  ///< by their keys
  Array<std::uint64_t> keys_;
  Array<std::uint32_t> node_of_;
  Array<Eigen::Vector4d> moments_;  ///< of touches, both sides, in the world
  Array<Block> blocks_;             ///< scratch of takeApart()
};

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// Bodies that may touch: pairs whose boxes meet, their contacts, and islands of pieces that are minimized as one
// (docs/method.md §4).
#pragma once

#include "runtime/contact/touch.h"
#include "runtime/solver/rigid_coupling.h"
#include "runtime/step/piece_step.h"
#include "runtime/world/body.h"

namespace sinew::internal {

/// A box around a piece's contact points over a step, metres, world.
struct PieceBox {
  std::uint32_t body, piece;  ///< places in BodyList and Body::pieces
  std::array<double, 3> low, high;
};

/// What stays from step to step (touching), and memory that steps use again.
struct TogetherScratch {
  explicit TogetherScratch(std::pmr::memory_resource* memory)
      : touching(memory),
        boxes(memory),
        order(memory),
        pairs(memory),
        busy(memory),
        places(memory),
        pieces(memory),
        vectors(memory),
        rigid(memory),
        found(memory),
        before(memory),
        points(memory),
        rows(memory),
        parent(memory),
        next_touching(memory) {}

  Array<TouchMemory> touching;  ///< sorted

  Array<PieceBox> boxes;
  Array<std::uint64_t> order, pairs;
  Array<std::uint8_t> busy;          ///< by body: its box meets another's
  Array<std::uint32_t> places;       ///< of boxes among what is stepped together
  OwningArray<PieceScratch> pieces;  ///< one for each of these
  MinimizeScratch vectors;
  RigidCoupling rigid;
  TouchList found;
  Array<float> before, points;
  Array<TouchRow> rows;
  Array<std::uint32_t> parent;
  Array<TouchMemory> next_touching;
};

/// Box around a piece's contact points now and, as it moves, after h seconds; world. \param heights scratch, grown.
Eigen::AlignedBox3d boxOf(const Body& body, const Piece& piece, const Vector3d& gravity, double h,
                          Array<float>& heights);
/// Root of a tree in a forest of parents.
std::uint32_t rootOf(Array<std::uint32_t>& parent, std::uint32_t i);
/// Place of a BodyId in the list. \pre it is there
std::uint32_t placeOf(const BodyList& bodies, std::uint32_t id);

/// Finds the bodies whose boxes meet those of others in a step: TogetherScratch::busy, boxes and pairs. What moves
/// wakes what it meets.
void findPairs(BodyList& bodies, const WorldSettings& settings, double seconds, TogetherScratch& scratch);

/// Adds the touches between bodies that are asleep to TogetherScratch::next_touching.
void keepSleeping(const BodyList& bodies, TogetherScratch& scratch);

/// Advances the bodies that findPairs() found. \pre their holds have moved.
void stepTogether(BodyList& bodies, const StepWorld& world, double seconds, TogetherScratch& scratch, JobSystem* jobs);

}  // namespace sinew::internal

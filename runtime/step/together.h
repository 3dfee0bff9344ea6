// SPDX-License-Identifier: MIT
//
// Bodies that may touch: pairs whose boxes meet, their contacts, and islands of pieces that are minimized as one
// (docs/method.md §4).
#pragma once

#include "runtime/contact/touch.h"
#include "runtime/step/island.h"
#include "runtime/step/piece_step.h"
#include "runtime/world/body.h"

namespace sinew::internal {

/// Meetings of a body's boxes: none (0), its own, others' or what it touched itself before, its own
/// surface that it has not touched before.
inline constexpr std::uint8_t kBusyWithItself = 1, kBusyWithOthers = 2, kBusyAnew = 3;

/// A box around a piece's surface over a step, metres, world.
struct PieceBox {
  std::uint32_t body, piece;  ///< places in BodyList and Body::pieces
  std::array<double, 3> low, high;
};

/// An island: places in TogetherScratch::ids and own.
struct IslandRange {
  std::uint32_t first_member, members, first_touch, touches;
  std::uint32_t pairs;
  std::size_t packs, rows;  ///< IslandSize
};

/// Touches, which stay from step to step, and memory that steps use again.
struct TogetherScratch {
  explicit TogetherScratch(std::pmr::memory_resource* memory)
      : touching(memory),
        boxes(memory),
        order(memory),
        pairs(memory),
        busy(memory),
        places(memory),
        pieces(memory),
        found(memory),
        pair_touches(memory),
        lanes(memory),
        before(memory),
        points(memory),
        own_order(memory),
        own_normals(memory),
        parent(memory),
        before_at(memory),
        body_of(memory),
        steps(memory),
        seen(memory),
        alone(memory),
        members(memory),
        touching_pairs(memory),
        ids(memory),
        own(memory),
        rows_of(memory),
        islands(memory),
        small(memory),
        island(memory),
        island_lanes(memory),
        next_touching(memory),
        runs(memory) {}

  Array<TouchMemory> touching;  ///< sorted

  Array<PieceBox> boxes;
  Array<std::uint64_t> order, pairs;
  Array<std::uint8_t> busy;          ///< by body: what its boxes meet
  Array<std::uint32_t> places;       ///< of boxes in the list of pieces that are stepped together
  OwningArray<PieceScratch> pieces;  ///< one for each of these
  TouchList found;                   ///< of one pair after the other, pairs in any order
  Array<Range> pair_touches;         ///< of each pair
  OwningArray<TouchList> lanes;      ///< of threads that look at pairs
  Array<float> before, points;
  Array<std::uint64_t> own_order;  ///< TouchingPiece::order, normals
  Array<Eigen::Vector3f> own_normals;
  Array<std::uint32_t> parent, before_at;
  Array<std::uint32_t> body_of;  ///< of each step, its place in BodyList
  OwningArray<PieceStep> steps;
  Array<TouchingPiece> seen;                     ///< of each step
  Array<std::uint8_t> alone;                     ///< of each step: nothing touches it
  Array<std::uint64_t> members, touching_pairs;  ///< root << 32 | step or pair
  Array<std::uint32_t> ids;                      ///< steps, by island
  Array<const FoundTouch*> own;                  ///< by island
  Array<std::uint32_t> rows_of;                  ///< of each step: touches that it has
  Array<IslandRange> islands;
  Array<std::uint32_t> small;  ///< islands that are solved side by side
  IslandScratch island;
  OwningArray<IslandScratch> island_lanes;  ///< of threads that solve small ones
  Array<TouchMemory> next_touching;
  Array<Range> runs;  ///< of it, by pair
};

/// Box around a piece's surface now and, as it moves, after h seconds; world. Empty without contact points.
Eigen::AlignedBox3d boxOf(const Body& body, const Piece& piece, const Vector3d& gravity, double h);
/// Root of a tree in a forest of parents.
std::uint32_t rootOf(Array<std::uint32_t>& parent, std::uint32_t i);
/// Place of a BodyId in the list. \pre it is there
std::uint32_t placeOf(const BodyList& bodies, std::uint32_t id);

/// Finds the bodies whose boxes meet those of others in a step: TogetherScratch::busy, boxes and pairs. Moving
/// bodies wake neighbours.
void findPairs(BodyList& bodies, const WorldSettings& settings, double seconds, TogetherScratch& scratch,
               JobSystem* jobs);

/// Adds the touches between bodies that are asleep to TogetherScratch::next_touching.
void keepSleeping(const BodyList& bodies, TogetherScratch& scratch);

/// Advances the bodies that findPairs() found. \pre their holds have moved.
void stepTogether(BodyList& bodies, const StepWorld& world, double seconds, TogetherScratch& scratch, JobSystem* jobs);

}  // namespace sinew::internal

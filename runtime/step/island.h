// SPDX-License-Identifier: MIT
//
// Pieces that touch each other, minimized as one (docs/method.md §4).
#pragma once

#include <span>

#include "runtime/contact/touch.h"
#include "runtime/step/piece_step.h"

namespace sinew::internal {

/// How many an island has of all, and floats of its pairs' rows (TouchLanes).
struct IslandSize {
  std::size_t members = 0, functions = 0, touches = 0, pairs = 0, packs = 0, rows = 0;

  /// The larger of each.
  void include(const IslandSize& other);
};

/// Memory that islands use one after the other.
struct IslandScratch {
  explicit IslandScratch(std::pmr::memory_resource* memory)
      : vectors(memory),
        first(memory),
        order(memory),
        near_order(memory),
        place(memory),
        arranged(memory),
        hops(memory),
        next_row(memory),
        objectives(memory),
        systems(memory),
        own_pairs(memory),
        touches(memory),
        lanes(memory),
        rows(memory),
        values(memory),
        elastic(memory),
        predicted(memory) {}
  /// Room for islands of at most this size, among so many steps.
  void reserve(std::size_t steps, const IslandSize& size);

  MinimizeScratch vectors;
  Array<std::uint32_t> first, order, near_order, place, arranged, hops, next_row;
  Array<Objective*> objectives;
  Array<SystemFactor*> systems;
  Array<Pairs*> own_pairs;
  Array<TouchLink> touches;
  TouchLanes lanes;
  Array<TouchRow> rows;
  Array<Objective::Value> values;
  Array<double> elastic, predicted;  ///< J: that the shapes store, as Minimand has it and at the prediction
};

/// The pieces of an island.
class Island {
 public:
  /// \pre PieceStep::reserveSystem(). \param members of `steps` and of `seen`, ascending. \param found touches between
  /// them. \param rows that their places are of.
  Island(std::span<const std::uint32_t> members, OwningArray<PieceStep>& steps, std::span<const TouchingPiece> seen,
         std::span<const FoundTouch* const> found, std::span<const float> rows, IslandScratch& scratch, JobSystem* jobs)
      : members_(members), steps_(steps), seen_(seen), found_(found), all_rows_(rows), scratch_(scratch), jobs_(jobs) {}

  /// Advances them. \param[out] remembered as many as were found.
  void run(double h, const WorldSettings& settings, std::span<TouchMemory> remembered);

 private:
  /// Puts pieces near impacts first.
  void arrange();
  void gather();
  /// Rows by piece: each touch is one of both its sides.
  void gatherRows();
  /// Touches by pairs of pieces. \pre those of a pair come together
  void gatherPairs();
  /// Orders pieces from top to bottom, so that RigidCoupling eliminates each before those it rests on.
  void couple(const Vector3d& gravity);
  /// Minimizes from the lowest of three starts: the prediction, the old places of all, those of pieces that leaned.
  void solve(std::uint32_t iterations);
  /// The pieces near impacts, while the others stay.
  Minimand nearImpacts();
  /// Bodies of an impact may start where rigid ones would be stopped, those of `near` after the prediction. \param
  /// near_value of these there. \param[in,out] value of all. \return whether they do; the gradients of others are then
  /// those of before
  bool startRigid(const Minimand& near, Objective::Value near_value, Objective::Value& value);
  /// Support damping of the island, the mean of its pieces by mass: their rotation about its centre decays.
  void dampSwing(double h);
  /// Puts back the momentum that minimizing has lost: all forces were between the pieces.
  void keepMomentum(double h, const WorldSettings& settings);
  /// By its place in the minimand.
  PieceStep& piece(std::size_t i) { return steps_[scratch_.arranged[i]]; }

  std::span<const std::uint32_t> members_;
  OwningArray<PieceStep>& steps_;
  std::span<const TouchingPiece> seen_;
  std::span<const FoundTouch* const> found_;
  std::span<const float> all_rows_;
  IslandScratch& scratch_;
  JobSystem* jobs_;
  Minimand minimand_;
  std::uint32_t near_ = 0;        ///< pieces near impacts
  std::uint32_t near_pairs_ = 0;  ///< of TouchLanes: those that these are among
};

}  // namespace sinew::internal

// SPDX-License-Identifier: MIT
//
// The touches of an island, eight between the same two pieces at once (runtime/kernels/push.h).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "runtime/kernels/push_layout.h"
#include "runtime/memory/array.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

struct Push;

/// Some of a list.
struct Range {
  std::uint32_t first, count;
};

/// One piece of a Minimand that touches another.
struct TouchSide {
  std::uint32_t piece, functions;
  const float* rotation;  ///< of its frame, column-major
};

/// Two pieces that touch, or one that touches itself: then b has no functions.
struct TouchPair {
  TouchSide a, b;
  Range touches;  ///< of Minimand::touches
  Range packs;
  std::size_t first_row;  ///< floats
  bool pulls;             ///< whether any of its pulls is not 0
  double energy;          ///< at the last evaluation; of rub() how much it has changed, J
};

class TouchLanes {
 public:
  explicit TouchLanes(std::pmr::memory_resource* memory)
      : pairs_(memory), packs_(memory), rows_(memory), sides_(memory), first_side_(memory) {}

  /// Packs that touches of one pair fill, and floats of so many packs' rows.
  static std::uint32_t packsOf(std::uint32_t touches) { return (touches + 7) / 8; }
  static std::size_t rowsOf(std::uint32_t packs, std::uint32_t functions_a, std::uint32_t functions_b) {
    return std::size_t(8) * packs * (functions_a + functions_b);
  }
  /// Memory for so many pieces, pairs, packs and floats of rows.
  void reserve(std::size_t pieces, std::size_t pairs, std::size_t packs, std::size_t rows);

  void clear();
  /// \return the slot of its first touch; the others' follow
  std::uint32_t addPair(const TouchSide& a, const TouchSide& b, Range touches);
  /// \param phi_a, phi_b rows of the piece whose point it is and of the one that it goes out of. \param turned that the
  /// pair has these the other way round.
  void set(std::uint32_t slot, const TouchPair& pair, const Push& push, const float* phi_a, const float* phi_b,
           bool turned);
  /// \pre all are set
  void finish(std::uint32_t pieces);
  /// From now on the first pairs alone count: the pieces of the others are where they were last evaluated.
  void useFirst(std::uint32_t pairs);

  std::span<const TouchPair> pairs() const { return {pairs_.data(), pairs_.size()}; }
  /// Height of a touch above its floor at the last evaluation, m.
  float gap(std::uint32_t slot) const;
  /// The same at the prediction.
  float predictedGap(std::uint32_t slot) const { return packs_[slot / 8].gap[slot % 8]; }
  /// sinew::internal::heldAcross() of a touch, and its normal.
  float heldAcross(std::uint32_t slot) const;
  Eigen::Vector3d normal(std::uint32_t slot) const;
  bool hasFriction() const { return has_friction_; }

  /// The touches' energy at coefficients of all. \param first of each piece's in d. \return joule
  double evaluate(const float* d, std::span<const std::uint32_t> first, JobSystem* jobs);
  /// Their ways alone. \param press that friction takes the load there.
  void place(const float* d, std::span<const std::uint32_t> first, bool press, JobSystem* jobs);
  /// Friction takes the load at the last evaluation. \return change of the energy, J
  double rub(JobSystem* jobs);
  /// Pulls count as those where the minimization has come to.
  void pullOn(JobSystem* jobs);
  /// Adds a piece's part of the gradient, or of its change by rub(). \param gradient of the piece
  void addPulls(std::uint32_t piece, float* gradient) const;
  /// Adds kappa of what pushes times the way of the piece's `offset`, less the change of pulls since pullOn().
  void addBends(std::uint32_t piece, const float* offset, float* change) const;

 private:
  struct Side {
    std::uint32_t pair;
    bool is_b;
  };
  PushArguments argumentsOf(TouchPair& pair, const float* d, std::span<const std::uint32_t> first);
  PushSideArguments sideOf(const Side& side, const float* offset, float* to) const;
  double energy() const;
  /// \pre finish()
  std::span<const Side> sidesOf(std::uint32_t piece) const {
    return {sides_.data() + first_side_[piece], first_side_[piece + 1] - first_side_[piece]};
  }

  Array<TouchPair> pairs_;
  Array<PushPack> packs_;
  Array<float> rows_;
  Array<Side> sides_;  ///< by piece
  Array<std::uint32_t> first_side_;
  std::uint32_t used_pairs_ = 0, used_packs_ = 0;
  bool has_friction_ = false;
};

}  // namespace sinew::internal

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Moments of a scene that has played, to go back to.
#pragma once

#include <cstddef>
#include <deque>
#include <vector>

#include "tools/scene/scene_state.h"
#include "tools/studio/placed_solids.h"

namespace sinew::tools {

/// Keeps the newest moments within a bound on memory.
class Timeline {
 public:
  static constexpr std::size_t kMostBytes = std::size_t(128) << 20U;

  struct Moment {
    SceneState state;
    PickId hand;      ///< what the hand pulled with then; unknown: nothing
    ColliderId ball;  ///< what it pushed with
    std::vector<PlacedSolids::Mark> placed;
  };

  explicit Timeline(std::size_t most_bytes = kMostBytes) : most_bytes_(most_bytes) {}
  void clear();
  /// After the moment where it is: later ones are gone.
  void add(Moment moment);
  void goTo(std::size_t moment) { at_ = moment; }

  std::size_t size() const { return moments_.size(); }
  std::size_t at() const { return at_; }  ///< of the moment where it is
  const Moment& operator[](std::size_t moment) const { return moments_[moment]; }
  std::size_t bytes() const { return bytes_; }

 private:
  std::size_t most_bytes_, bytes_ = 0, at_ = 0;
  std::deque<Moment> moments_;
};

}  // namespace sinew::tools

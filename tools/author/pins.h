// SPDX-License-Identifier: GPL-3.0-or-later
//
// Who holds what: sets of pins that meet, and rigid clusters that they hold. A bake decides it at physical vertices;
// what is said before a bake goes by visual ones.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tools/core/finding.h"

namespace sinew::tools {

/// A vertex that a set holds less than this is not held by it.
inline constexpr double kMinimumPin = 0.02;
/// Shares below this are none.
inline constexpr double kNoShare = 0.004;

/// How firmly a set holds each vertex, 0..1.
struct PinWeights {
  std::string name;
  std::vector<double> weights;
  bool rides = false;  ///< whether all that it selects rides along with others (parts) and cannot be held
};

/// A rigid cluster's share of each vertex, 0..1.
struct RigidShares {
  std::string name;
  std::vector<double> shares;
};

/// The set that holds each vertex: the one that holds it firmest, of equals the first; formats::kNone where none does.
std::vector<std::uint32_t> pinHolders(std::span<const PinWeights> sets);

/// The sets that hold vertices which belong to a rigid cluster alone, ascending; falloffs (weights below one half)
/// count only where no set holds firmer. One: the cluster moves with it. \param holders per vertex, formats::kNone for
/// none. \param weights per vertex, of its holder.
std::vector<std::uint32_t> rigidHolders(std::span<const double> shares, std::span<const std::uint32_t> holders,
                                        std::span<const double> weights);

/// Vertices that pins select and do not move, rigid clusters that several sets pull at.
/// \param vertices what is counted: "physical" or "visual".
std::vector<Finding> judgePins(std::span<const PinWeights> sets, std::span<const RigidShares> clusters,
                               const std::string& vertices);

}  // namespace sinew::tools

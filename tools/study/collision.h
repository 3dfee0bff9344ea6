// SPDX-License-Identifier: GPL-3.0-or-later
//
// Two bent bodies by chance near or in one another: does each way of looking for contacts see that they overlap, and
// lead apart? The chosen one is what a World does; the others are those of the report's appendix B, written as it
// gives them.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/study/steps_bodies.h"

namespace sinew::tools {

struct CollisionOptions {
  std::uint32_t pairs = 200;
  std::uint32_t seed = 1;
  std::function<void(double)> progress;  ///< part that is done
};

/// How deep two bodies lie in one another: the shortest way that parts them, of 48 directions, in diagonals of the
/// smaller one.
inline constexpr std::size_t kDepthBins = 10;
inline constexpr double kDepthBin = 0.05;

struct CollisionMethod {
  std::string name;
  std::uint32_t missed = 0;          ///< overlapping pairs that it does not see
  std::uint32_t false_contacts = 0;  ///< pairs apart in which it sees something
  std::uint32_t wrong = 0;  ///< overlapping ones that it sees and leads apart on a way of more than twice the shortest
  std::array<std::uint32_t, kDepthBins> right = {};  ///< by depth
  double microseconds = 0;                           ///< a pair, median
};

struct CollisionResult {
  std::vector<CollisionMethod> methods;
  std::uint32_t overlapping = 0, apart = 0;             ///< pairs that count: not those within 0.2 % of a diagonal
  std::array<std::uint32_t, kDepthBins> at_depth = {};  ///< overlapping ones

  /// Largest depth up to which a method leads nine of ten apart, diagonals.
  double deepest(const CollisionMethod& method) const;
};

/// \param bodies closed surfaces with distance grids.
CollisionResult measureCollisions(const std::vector<StepsBody>& bodies, const CollisionOptions& options);

nlohmann::ordered_json collisionJson(const CollisionResult& result, const CollisionOptions& options);
std::string collisionText(const CollisionResult& result);

}  // namespace sinew::tools

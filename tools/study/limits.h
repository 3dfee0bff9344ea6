// SPDX-License-Identifier: GPL-3.0-or-later
//
// The report's figure 3, "a cube pushed into a wall": how far it spreads under each limit and volume method
// (docs/method.md §9).
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sinew/formats/sections.h"

namespace sinew::tools {

/// A cube of 1 m, 125 vertices, one cluster of 2 Hz, pressed against a wall by 200 m/s² for 4 s.
struct LimitsCase {
  formats::ClusterMode mode = formats::ClusterMode::linear;
  formats::LimitMethod limit = formats::LimitMethod::none;
  formats::VolumeMethod volume = formats::VolumeMethod::none;
};

/// Over all steps; each is relative to the cube at rest.
struct LimitsResult {
  LimitsCase cube;
  double largest_area = 0;  ///< of the surface
  double least_volume = 0;  ///< signed: below 0 it is inside out
  double largest_volume = 0;
  bool finite = true;
};

LimitsResult measureLimits(const LimitsCase& cube);

/// Linear and quadratic, every limit but `curve` (which is what its points make of it) with every volume method.
std::vector<LimitsCase> limitsCases();

nlohmann::ordered_json limitsJson(const std::vector<LimitsResult>& results);
/// The table of docs/method.md §9. \param results of limitsCases().
std::string limitsText(const std::vector<LimitsResult>& results);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Covering designs: few cells in which every combination of levels of any few factors occurs.
#pragma once

#include <cstdint>
#include <vector>

namespace sinew::tools {

/// A list of cells (a level of each factor) such that for any `strength` factors every combination of their levels
/// occurs in a cell. Greedy, one cell at a time (after Cohen et al. 1997, "The AETG system"); deterministic.
/// \param levels number of levels of each factor, each 1..255. \param strength 1..factors.
/// \param given cells that count as already there; the result does not repeat them.
std::vector<std::vector<std::uint8_t>> coveringDesign(const std::vector<std::uint8_t>& levels, std::size_t strength,
                                                      const std::vector<std::vector<std::uint8_t>>& given = {});

}  // namespace sinew::tools

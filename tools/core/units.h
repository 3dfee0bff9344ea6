// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <string>
#include <string_view>

namespace sinew::tools {

/// A unit of length that a source may be in.
struct LengthUnit {
  std::string_view name;
  double metres;
};

inline constexpr std::array<LengthUnit, 6> kLengthUnits = {
    {{"m", 1}, {"dm", 0.1}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}, {"ft", 0.3048}}};

/// Metres that a unit may have, both excluded.
inline constexpr double kLeastUnit = 1e-12, kMostUnit = 1e9;

/// The units' names between separators: "m, dm, ...".
inline std::string lengthUnitNames(std::string_view separator) {
  std::string text;
  for (const LengthUnit& unit : kLengthUnits) text.append(text.empty() ? "" : separator).append(unit.name);
  return text;
}

}  // namespace sinew::tools

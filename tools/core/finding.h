// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace sinew::tools {

enum class Severity { info, warning, error };

/// One result of the doctor: what, how often, where in the artist's own numbering, and the cure.
struct Finding {
  std::string id;  ///< stable, kebab-case, e.g. "open-boundary"
  Severity severity = Severity::warning;
  std::string message;  ///< one plain sentence with the count in it
  std::uint64_t count = 0;
  std::string place_kind;  ///< what `places` number: "face", "vertex" (source numbering, from 0), or "" for none
  std::vector<std::uint32_t> places;  ///< the first ones, at most kMaxPlaces
  std::string place;                  ///< in words: mesh and node names, file names, coordinates
  std::string cure;                   ///< one sentence: what the artist, or a setting, can do

  static constexpr std::size_t kMaxPlaces = 64;

  bool operator==(const Finding&) const = default;
};

}  // namespace sinew::tools

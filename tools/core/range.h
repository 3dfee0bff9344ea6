// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace sinew::tools {

/// The legal values of an option, declared beside it.
template <class Number>
struct Range {
  Number least, most;
  /// False of NaN.
  constexpr bool holds(Number value) const { return value >= least && value <= most; }
};

}  // namespace sinew::tools

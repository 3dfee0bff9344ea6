// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/readers.h"

#include <algorithm>

namespace sinew::tools {

ReadError noNumber(const std::string& of, std::string_view word, const std::string& place) {
  const std::size_t comma = word.find(',');
  const bool decimal = comma != word.npos && comma > 0 && comma + 1 < word.size();
  return ReadError(
      (of.empty() ? "" : of + " ") + "has \"" + std::string(word.substr(0, 40)) + "\" where a number belongs" + place,
      decimal ? "Export it with decimal points, 1.5 in place of 1,5." : "");
}

void colorsFromBytes(std::vector<std::array<float, 4>>& colors) {
  const auto beyond = [](const std::array<float, 4>& c) { return *std::max_element(c.begin(), c.end()) >= 2; };
  if (std::none_of(colors.begin(), colors.end(), beyond)) return;
  for (std::array<float, 4>& color : colors) {
    // An alpha that is not written is 1.
    for (std::size_t k = 0; k < 4; ++k) color[k] = k == 3 && color[k] <= 1 ? color[k] : color[k] / 255;
  }
}

}  // namespace sinew::tools

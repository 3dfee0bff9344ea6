// SPDX-License-Identifier: GPL-3.0-or-later
//
// Numbers, lengths and lists as messages and files have them.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <span>
#include <string>
#include <string_view>

namespace sinew::tools {

/// A number with so many digits, for people.
inline std::string rounded(double value, int digits = 3) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.*g", digits, value);
  return text.data();
}

/// The shortest text that is read back as the same number.
inline std::string exactText(double value) {
  std::array<char, 32> text{};
  const auto result = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), result.ptr};
}

/// A length in the unit that suits its size: um, mm, cm, m or km.
inline std::string lengthText(double metres) {
  const double size = std::abs(metres);
  if (size >= 999.5) return rounded(metres / 1e3) + " km";
  if (size >= 1 || size == 0) return rounded(metres) + " m";
  if (size >= 0.01) return rounded(metres * 100) + " cm";
  if (size >= 1e-4) return rounded(metres * 1e3) + " mm";
  return rounded(metres * 1e6) + " um";
}

/// Latin letters A to Z as small ones, all else as it is.
inline std::string lowerCase(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
  return lower;
}

/// "1 face", "3 faces".
inline std::string counted(std::uint64_t n, const std::string& one, const std::string& many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

/// The first names of a list, "a, b, ..." where there are more than `most`.
inline std::string listed(std::span<const std::string> names, std::size_t most = 8) {
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), most); ++i) text += (i == 0 ? "" : ", ") + names[i];
  return text + (names.size() > most ? ", ..." : "");
}

}  // namespace sinew::tools

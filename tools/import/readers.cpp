// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/readers.h"

#include <algorithm>

#include "tools/core/text.h"
#include "tools/import/text_cursor.h"

namespace sinew::tools {

ReadError noNumber(const std::string& of, std::string_view word, const std::string& place) {
  const std::size_t comma = word.find(',');
  const bool decimal = comma != word.npos && comma > 0 && comma + 1 < word.size();
  return ReadError(
      (of.empty() ? "" : of + " ") + "has \"" + std::string(word.substr(0, 40)) + "\" where a number belongs" + place,
      decimal ? "Export it with decimal points, 1.5 in place of 1,5." : "");
}

std::string formatOfText(std::string_view text) {
  if (text.starts_with("ply\n") || text.starts_with("ply\r")) return "PLY";
  TextCursor cursor(text.substr(0, 65536));
  for (std::size_t points = 0; !cursor.atEnd(); cursor.nextLine()) {
    const std::string_view key = cursor.word();
    if (key == "OFF" || key == "COFF" || key == "NOFF") return "OFF";
    if (key == "v" && parseNumber(cursor.word()) && ++points == 3) return "OBJ";
    if (lowerCase(key) == "facet" && lowerCase(cursor.word()) == "normal") return "STL";
  }
  return "";
}

ReadError looksLike(const std::string& other, const std::string& named) {
  return ReadError("is no " + named + ": it looks like " + other + " text",
                   "Rename it to end in ." + lowerCase(other) + ".");
}

std::string quotable(std::string_view text) {
  constexpr std::size_t kMost = 40;
  std::size_t size = std::min(text.size(), kMost);
  while (size > 0 && size < text.size() && (static_cast<unsigned char>(text[size]) & 0xC0U) == 0x80) --size;
  std::string out;
  for (const char c : text.substr(0, size)) out += static_cast<unsigned char>(c) < 32 || c == 127 ? '?' : c;
  return asUtf8(out);
}

Finding skippedLines(const char* id, std::uint64_t count, const std::string& of, const std::string& whose,
                     const std::string& first, const std::string& remark) {
  return {id,
          Severity::warning,
          std::to_string(count) + (count == 1 ? " line" + of + " says" : " lines" + of + " say") + " nothing that " +
              whose + " and " + (count == 1 ? "was" : "were") + " skipped: " + first,
          count,
          "",
          {},
          "",
          "Begin it with \"" + remark + "\" if it is a remark, or mend its first word."};
}

Finding trailingBytes(std::uint64_t count, const std::string& last, const std::string& things) {
  return {"trailing-bytes",
          Severity::warning,
          std::to_string(count) + " bytes after the last " + last + " were ignored",
          count,
          "",
          {},
          "",
          "Export the file again if " + things + " are missing."};
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

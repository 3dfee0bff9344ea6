// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/text.h"

#include <stb_truetype.h>

#include <cmath>
#include <cstdint>
#include <vector>

namespace sinew::tools {

namespace {

const stbtt_fontinfo& font() {
  static const stbtt_fontinfo loaded = [] {
    stbtt_fontinfo info{};
    stbtt_InitFont(&info, fontBytes().data(), 0);
    return info;
  }();
  return loaded;
}

// The next code point of UTF-8 text; a broken sequence gives the replacement sign and moves on by one byte.
std::uint32_t nextCodepoint(std::string_view text, std::size_t& at) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t first = byte(at);
  const std::size_t length = first < 0x80         ? 1
                             : (first >> 5) == 6  ? 2
                             : (first >> 4) == 14 ? 3
                             : (first >> 3) == 30 ? 4
                                                  : 0;
  if (length == 0 || at + length > text.size()) {
    ++at;
    return 0xfffd;
  }
  std::uint32_t code = length == 1 ? first : first & (0xffU >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xc0U) != 0x80U) {
      ++at;
      return 0xfffd;
    }
    code = code << 6 | (byte(at + i) & 0x3fU);
  }
  at += length;
  return code;
}

struct Line {
  float scale = 0;
  float ascent = 0;  // pixels
};

Line lineMetrics(float size) {
  int ascent = 0;
  int descent = 0;
  int gap = 0;
  stbtt_GetFontVMetrics(&font(), &ascent, &descent, &gap);
  Line line;
  line.scale = stbtt_ScaleForPixelHeight(&font(), size);
  line.ascent = std::round(static_cast<float>(ascent) * line.scale);
  return line;
}

float advance(std::uint32_t code, float scale) {
  int width = 0;
  int bearing = 0;
  stbtt_GetCodepointHMetrics(&font(), static_cast<int>(code), &width, &bearing);
  return static_cast<float>(width) * scale;
}

}  // namespace

float textWidth(std::string_view text, float size) {
  const float scale = lineMetrics(size).scale;
  float width = 0;
  for (std::size_t at = 0; at < text.size();) width += advance(nextCodepoint(text, at), scale);
  return width;
}

void drawText(Image& image, float x, float y, float size, Rgb8 color, std::string_view text) {
  const Line line = lineMetrics(size);
  float pen = x;
  std::vector<unsigned char> coverage;
  for (std::size_t at = 0; at < text.size();) {
    const std::uint32_t code = nextCodepoint(text, at);
    const float base = std::floor(pen);
    int x0 = 0;
    int y0 = 0;
    int x1 = 0;
    int y1 = 0;
    stbtt_GetCodepointBitmapBoxSubpixel(&font(), static_cast<int>(code), line.scale, line.scale, pen - base, 0, &x0,
                                        &y0, &x1, &y1);
    const int width = x1 - x0;
    const int height = y1 - y0;
    if (width > 0 && height > 0) {
      coverage.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
      stbtt_MakeCodepointBitmapSubpixel(&font(), coverage.data(), width, height, width, line.scale, line.scale,
                                        pen - base, 0, static_cast<int>(code));
      const int left = static_cast<int>(base) + x0;
      const int top = static_cast<int>(std::round(y) + line.ascent) + y0;
      for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
          const unsigned char value = coverage[std::size_t(row) * std::size_t(width) + std::size_t(column)];
          if (value != 0) image.blend(left + column, top + row, color, static_cast<float>(value) / 255.0F);
        }
      }
    }
    pen += advance(code, line.scale);
  }
}

std::string fitText(std::string_view text, float size, float width) {
  if (textWidth(text, size) <= width) return std::string(text);
  const float scale = lineMetrics(size).scale;
  const float room = width - textWidth("…", size);
  float used = 0;
  std::size_t end = 0;
  for (std::size_t at = 0; at < text.size();) {
    used += advance(nextCodepoint(text, at), scale);
    if (used > room) break;
    end = at;
  }
  return std::string(text.substr(0, end)) + "…";
}

}  // namespace sinew::tools

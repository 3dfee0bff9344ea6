// SPDX-License-Identifier: GPL-3.0-or-later
//
// Anti-aliased text on pictures, with the font that is built into the program (so that pictures do not depend on the
// machine).
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "tools/render/image.h"

namespace sinew::tools {

/// The TrueType file of the built-in font: Latin, Greek, Cyrillic and a few signs.
std::span<const unsigned char> fontBytes();

/// Width in pixels of one line of UTF-8 text at `size` pixels (height of the line).
float textWidth(std::string_view text, float size);

/// Draws one line. \param x,y left end of the line and its top, pixels. \param size height of the line, pixels, 6 ..
/// 200.
void drawText(Image& image, float x, float y, float size, Rgb8 color, std::string_view text);

/// The text cut to fit `width` pixels, with an ellipsis where something was cut.
std::string fitText(std::string_view text, float size, float width);

}  // namespace sinew::tools

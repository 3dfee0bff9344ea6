// SPDX-License-Identifier: GPL-3.0-or-later
//
// Pictures in memory and on disk. image.cpp and video.cpp are the only files here that include OpenCV.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace sinew::tools {

using Rgb8 = std::array<std::uint8_t, 3>;

/// An 8-bit sRGB picture, rows from top to bottom.
struct Image {
  int width = 0;                  ///< pixels
  int height = 0;                 ///< pixels
  std::vector<std::uint8_t> rgb;  ///< 3 bytes a pixel, no padding

  Image() = default;
  Image(int image_width, int image_height, Rgb8 fill = {255, 255, 255});

  Rgb8 at(int x, int y) const;
  /// Mixes `color` over the pixel; opacity 0..1. Pixels outside are ignored.
  void blend(int x, int y, Rgb8 color, float opacity);
  void fillRectangle(int x, int y, int rectangle_width, int rectangle_height, Rgb8 color);
  /// Copies `other` so that its top left corner lands on (x, y); what lies outside is cut off.
  void paste(const Image& other, int x, int y);
};

/// A decoded texture: 4 bytes a texel (RGBA, sRGB encoded, straight alpha), rows from top to bottom.
struct TexturePixels {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgba;
};

/// Decodes PNG, JPEG and whatever else OpenCV reads, TGA and GIF; 16-bit pictures reduced to 8, larger than `max_size`
/// texels a side shrunk. \return width 0 where the bytes are no picture. Never throws for bad bytes.
TexturePixels decodeTexture(std::span<const std::byte> bytes, int max_size);

std::vector<std::uint8_t> encodedPng(const Image& image);

/// Writes a PNG beside its place, syncs it, and renames it: a reader sees the old file or the whole new one.
/// Throws ToolError(system), with nothing left behind, where that fails.
void writePng(const Image& image, const std::filesystem::path& file);

/// Reads a picture back (tests). Width 0 where it is none.
Image readImage(const std::filesystem::path& file);

}  // namespace sinew::tools

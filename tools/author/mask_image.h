// SPDX-License-Identifier: GPL-3.0-or-later
//
// Pictures that were painted as masks. mask_image.cpp is the only file of tools/author that includes OpenCV.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace sinew::tools {

struct MaskImageOptions {
  std::string channel = "luminance";  ///< luminance, r, g, b, a
  std::optional<std::array<double, 3>> key =
      std::nullopt;                                ///< instead of a channel: a colour 0..1, as the picture stores it
  double tolerance = 0.25;                         ///< furthest distance from `key` that counts, 0..2
  std::optional<double> threshold = std::nullopt;  ///< 1 from here on, else 0
  int close = 0;                                   ///< texels, radius of a morphological closing
  int specks = 0;                                  ///< spots of fewer texels go
  double feather = 0;                              ///< texels, width over which edges are softened
};

/// Weights 0..1, rows from the top of the picture down.
struct MaskImage {
  int width = 0, height = 0;
  std::vector<float> values;

  /// Bilinear, between centres of texels, repeated outside 0..1. \param u,v (0, 0) is the bottom left of the picture.
  double sample(double u, double v) const;
};

/// Reads what textures are read from (PNG, EXR, TIFF, JPEG, TGA, ...; 8, 16 bit or float; 1 to 4 channels) and makes
/// weights of it. The picture is taken to repeat: closing and feathering go on at the opposite side. Throws
/// ToolError(bad_input) naming the file where it is missing, no picture, too large (16384 a side), or lacks the
/// channel.
MaskImage readMaskImage(const std::filesystem::path& file, const MaskImageOptions& options);

}  // namespace sinew::tools

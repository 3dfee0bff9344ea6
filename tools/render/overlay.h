// SPDX-License-Identifier: GPL-3.0-or-later
//
// Overlay of a drawn model: captions that can be read on any colour, axes, a scale.
#pragma once

#include <string>
#include <string_view>

#include "tools/render/camera.h"
#include "tools/render/image.h"

namespace sinew::tools {

/// One line of text on a light plate, cut to the picture's width. \param x,y of the text, pixels. \param size height of
/// the line, pixels.
void drawCaption(Image& image, int x, int y, float size, std::string_view text);

/// The axes x (red), y (green) and z (blue) as the camera sees them, in the lower left corner.
void drawAxes(Image& image, const Camera& camera);

/// A round number of metres and what it takes of a picture, at the camera's target.
struct ScaleBar {
  double metres = 0, pixels = 0;
  std::string text;
};
/// At most a third of the width. \param metres_per_unit of the drawing, whose diagonal is 1
ScaleBar scaleBarOf(const Camera& camera, int width, int height, double metres_per_unit);

/// A bar of a round number of metres in the lower right corner, as long as it is at the camera's target.
/// \param metres_per_unit of the drawing, whose diagonal is 1. \return its length, m.
double drawScaleBar(Image& image, const Camera& camera, double metres_per_unit);

}  // namespace sinew::tools

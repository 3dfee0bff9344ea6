// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "tools/render/page.h"
#include "tools/render/text.h"

namespace sinew::tools {
namespace {

constexpr float kPlate = 0.82F;  // opacity: the picture under a text shows through without competing with it
constexpr float kScaleText = 14;
constexpr double kLongestBar = 0.35;  // of the picture's width
constexpr float kAxis = 14;           // pixels

void plate(Image& image, int x, int y, int width, int height) {
  for (int row = y; row < y + height; ++row) {
    for (int column = x; column < x + width; ++column) image.blend(column, row, kPaper, kPlate);
  }
}

}  // namespace

void drawCaption(Image& image, int x, int y, float size, std::string_view text) {
  const std::string line = fitText(text, size, float(image.width - 2 * x));
  plate(image, x - 4, y - 2, int(std::ceil(textWidth(line, size))) + 8, int(std::ceil(size)) + 4);
  drawText(image, float(x), float(y), size, kInk, line);
}

void drawAxes(Image& image, const Camera& camera) {
  constexpr std::array<Rgb8, 3> kColors = {{{200, 40, 30}, {20, 130, 50}, {40, 80, 200}}};
  constexpr std::array<const char*, 3> kNames = {"x", "y", "z"};
  const int size = int(2 * kAxis) + 26;
  plate(image, 4, image.height - size - 4, size, size);
  const float cx = 4 + float(size) / 2, cy = float(image.height) - 4 - float(size) / 2;
  // Axes that point away first.
  std::array<int, 3> order = {0, 1, 2};
  std::sort(order.begin(), order.end(), [&](int a, int b) { return camera.back()[a] < camera.back()[b]; });
  for (const int axis : order) {
    const float dx = kAxis * camera.right()[axis], dy = -kAxis * camera.up()[axis];
    const auto a = std::size_t(axis);
    const int steps = std::max(1, int(4 * std::max(std::abs(dx), std::abs(dy))));
    for (int i = 0; i <= steps; ++i) {
      const float t = float(i) / float(steps);
      image.fillRectangle(int(std::round(cx + t * dx)), int(std::round(cy + t * dy)), 2, 2, kColors[a]);
    }
    const float reach = (kAxis + 7) / kAxis;
    drawText(image, cx + reach * dx - textWidth(kNames[a], 13) / 2, cy + reach * dy - 8, 13, kColors[a], kNames[a]);
  }
}

ScaleBar scaleBarOf(const Camera& camera, int width, int height, double metres_per_unit) {
  const double pixels_per_metre =
      height / (2 * double(camera.distance) * std::tan(double(camera.fov_y) / 2)) / metres_per_unit;
  const double most = kLongestBar * width / pixels_per_metre;
  const double power = std::pow(10, std::floor(std::log10(most)));
  const double length = most >= 5 * power ? 5 * power : most >= 2 * power ? 2 * power : power;
  char text[40];
  std::snprintf(text, sizeof text, "%.3g m", length);
  return {length, length * pixels_per_metre, text};
}

double drawScaleBar(Image& image, const Camera& camera, double metres_per_unit) {
  const auto [length, pixels, text] = scaleBarOf(camera, image.width, image.height, metres_per_unit);
  const int bar = std::max(1, int(std::lround(pixels)));
  const float wide = textWidth(text, kScaleText);
  const int width = std::max(bar, int(std::ceil(wide))) + 12;
  const int left = image.width - 4 - width, top = image.height - 4 - 28;
  plate(image, left, top, width, 28);
  drawText(image, float(left) + (float(width) - wide) / 2, float(top) + 1, kScaleText, kInk, text);
  const int x = left + (width - bar) / 2;
  image.fillRectangle(x, top + 20, bar, 2, kInk);
  image.fillRectangle(x, top + 17, 2, 8, kInk);
  image.fillRectangle(x + bar - 2, top + 17, 2, 8, kInk);
  return length;
}

}  // namespace sinew::tools

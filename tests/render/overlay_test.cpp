// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/overlay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace sinew::tools {
namespace {

// Relative luminance of sRGB and the contrast of two of them (WCAG 2).
double luminance(Rgb8 c) {
  const auto linear = [](std::uint8_t v) {
    const double s = v / 255.0;
    return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
  };
  return 0.2126 * linear(c[0]) + 0.7152 * linear(c[1]) + 0.0722 * linear(c[2]);
}

TEST(Overlay, ACaptionCanBeReadOnAnyColour) {
  for (const Rgb8 ground : {Rgb8{0, 0, 0}, Rgb8{120, 0, 0}, Rgb8{128, 128, 128}, Rgb8{255, 255, 255}}) {
    Image image(200, 40, ground);
    drawCaption(image, 8, 8, 17, "HHHH");
    double darkest = 1, lightest = 0;
    for (int y = 8; y < 25; ++y) {
      for (int x = 8; x < 30; ++x) {
        darkest = std::min(darkest, luminance(image.at(x, y)));
        lightest = std::max(lightest, luminance(image.at(x, y)));
      }
    }
    EXPECT_GT((lightest + 0.05) / (darkest + 0.05), 4.5) << int(ground[0]);
  }
}

TEST(Overlay, TheScaleBarIsAsLongAsItSays) {
  for (const double diagonal : {0.003, 0.27, 1.6, 40.0}) {
    Camera camera;
    Image image(300, 300, {200, 200, 200});
    const double metres = drawScaleBar(image, camera, diagonal);
    const double leading = metres / std::pow(10, std::floor(std::log10(metres) + 1e-9));
    EXPECT_TRUE(std::abs(leading - 1) < 1e-6 || std::abs(leading - 2) < 1e-6 || std::abs(leading - 5) < 1e-6) << metres;
    // Two points so far apart at the target, as the projection draws them.
    const Eigen::Vector4f end =
        camera.projection(1) * camera.view() * Eigen::Vector4f(float(metres / diagonal), 0, 0, 1);
    const double wanted = 150 * double(end.x() / end.w());
    int longest = 0;
    for (int y = 0; y < 300; ++y) {
      int run = 0;
      for (int x = 0; x < 300; ++x) {
        run = luminance(image.at(x, y)) < 0.03 ? run + 1 : 0;
        longest = std::max(longest, run);
      }
    }
    EXPECT_NEAR(longest, wanted, 1.5) << metres;
  }
}

}  // namespace
}  // namespace sinew::tools

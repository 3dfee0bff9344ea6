// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include "tests/support/box_package.h"

namespace sinew::test {

/// A box with the distance grid of its own sides.
inline std::shared_ptr<const Asset> touchingBox(const std::array<double, 3>& size, std::uint32_t cells = 3) {
  BoxOptions options;
  options.cells = {cells, cells, cells};
  options.size = size;
  formats::PackageContent content = boxContent(options);
  formats::DistanceGrid grid = {};
  const double longest = *std::max_element(size.begin(), size.end());
  grid.spacing = float(longest / 16);
  grid.unit = float(longest / 30000);
  for (std::size_t a = 0; a < 3; ++a) {
    grid.nodes[a] = std::uint32_t(std::ceil(size[a] / double(grid.spacing))) + 5;
    grid.origin[a] = -0.5F * float(grid.nodes[a] - 1) * grid.spacing;
  }
  for (std::uint32_t z = 0; z < grid.nodes[2]; ++z) {
    for (std::uint32_t y = 0; y < grid.nodes[1]; ++y) {
      for (std::uint32_t x = 0; x < grid.nodes[0]; ++x) {
        const std::array<std::uint32_t, 3> node = {x, y, z};
        std::array<double, 3> beyond;
        for (std::size_t a = 0; a < 3; ++a) {
          const double at = double(grid.origin[a]) + node[a] * double(grid.spacing);
          beyond[a] = std::abs(at) - 0.5 * size[a];
        }
        const double inside = std::min(0.0, *std::max_element(beyond.begin(), beyond.end()));
        const double outside = std::hypot(std::max(beyond[0], 0.0), std::max(beyond[1], 0.0), std::max(beyond[2], 0.0));
        const double distance = outside + inside;
        content.distance_values.push_back(std::int16_t(std::lround(distance / double(grid.unit))));
      }
    }
  }
  content.distance_grids.push_back(grid);
  return makeAsset(std::move(content));
}

}  // namespace sinew::test

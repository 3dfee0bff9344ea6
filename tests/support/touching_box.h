// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include "tests/support/box_package.h"

namespace sinew::test {

/// Signed distance to the surface of a box about a place, negative inside.
inline double boxDistance(const std::array<double, 3>& at, const std::array<double, 3>& center,
                          const std::array<double, 3>& size) {
  std::array<double, 3> beyond;
  for (std::size_t a = 0; a < 3; ++a) beyond[a] = std::abs(at[a] - center[a]) - 0.5 * size[a];
  const double inside = std::min(0.0, *std::max_element(beyond.begin(), beyond.end()));
  return inside + std::hypot(std::max(beyond[0], 0.0), std::max(beyond[1], 0.0), std::max(beyond[2], 0.0));
}

/// Gives a piece within a box of this size about `center` its distance grid.
inline void addDistances(formats::PackageContent& content, std::uint32_t piece, const std::array<double, 3>& center,
                         const std::array<double, 3>& size,
                         const std::function<double(const std::array<double, 3>&)>& distance, double cells = 16) {
  formats::DistanceGrid grid = {};
  const double longest = *std::max_element(size.begin(), size.end());
  grid.piece = piece;
  grid.first_value = std::uint32_t(content.distance_values.size());
  grid.spacing = float(longest / cells);
  grid.unit = float(longest / 30000);
  for (std::size_t a = 0; a < 3; ++a) {
    grid.nodes[a] = std::uint32_t(std::ceil(size[a] / double(grid.spacing))) + 5;
    grid.origin[a] = float(center[a]) - 0.5F * float(grid.nodes[a] - 1) * grid.spacing;
  }
  for (std::uint32_t z = 0; z < grid.nodes[2]; ++z) {
    for (std::uint32_t y = 0; y < grid.nodes[1]; ++y) {
      for (std::uint32_t x = 0; x < grid.nodes[0]; ++x) {
        const std::array<std::uint32_t, 3> node = {x, y, z};
        std::array<double, 3> at;
        for (std::size_t a = 0; a < 3; ++a) at[a] = double(grid.origin[a]) + node[a] * double(grid.spacing);
        content.distance_values.push_back(std::int16_t(std::lround(distance(at) / double(grid.unit))));
      }
    }
  }
  content.distance_grids.push_back(grid);
}

/// A box with the distance grid of its own sides.
inline std::shared_ptr<const Asset> touchingBox(const std::array<double, 3>& size, std::uint32_t cells = 3) {
  BoxOptions options;
  options.cells = {cells, cells, cells};
  options.size = size;
  formats::PackageContent content = boxContent(options);
  addDistances(content, 0, {0, 0, 0}, size, [&](const auto& at) { return boxDistance(at, {0, 0, 0}, size); });
  return makeAsset(std::move(content));
}

}  // namespace sinew::test

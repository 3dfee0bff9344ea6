// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/distances.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace sinew::tools {
namespace {

/// A cup: a box with few triangles, one of whose sides is missing.
formats::PackageContent cup(float width = 1, float height = 0.5F, float depth = 0.4F) {
  formats::PackageContent content;
  for (const float x : {0.0F, width}) {
    for (const float y : {0.0F, height}) {
      for (const float z : {0.0F, depth}) content.visual_positions.push_back({x, y, z});
    }
  }
  content.visual_triangles = {{0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}, {0, 4, 5},
                              {0, 5, 1}, {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
  content.barycentric.resize(content.visual_positions.size());
  content.pieces.resize(1);
  content.pieces[0].tetrahedron_count = 1;
  content.field_points.resize(1);
  content.info.diagonal = std::hypot(width, height, depth);
  return content;
}

// A board or a rope has an inside, of about its depth: others lie on it.
TEST(Distances, WhatIsThinHasAnInside) {
  for (const auto& [width, depth, height] :
       {std::array{2.4F, 0.3F, 0.02F}, {2.4F, 0.3F, 0.06F}, {3.0F, 0.09F, 0.09F}, {1.0F, 0.8F, 0.03F}}) {
    formats::PackageContent content = cup(width, height, depth);
    content.visual_triangles.push_back({2, 3, 7});
    content.visual_triangles.push_back({2, 7, 6});
    StageCache no_cache{{}};
    addDistances(32, content, no_cache);
    ASSERT_EQ(content.distance_grids.size(), 1U);
    const formats::DistanceGrid& grid = content.distance_grids[0];
    const auto deepest = *std::min_element(content.distance_values.begin(), content.distance_values.end());
    EXPECT_LT(grid.unit * float(deepest), -0.3F * height) << width << ' ' << height;
    EXPECT_LE(content.distance_values.size(), 37U * 37U * 37U) << width << ' ' << height;
  }
}

// Sides that lie on one another have a thickness of rounding.
TEST(Distances, AGridIsBoundedHoweverThin) {
  formats::PackageContent content = cup(1, 1e-11F, 0.8F);
  content.visual_triangles.push_back({2, 3, 7});
  content.visual_triangles.push_back({2, 7, 6});
  StageCache no_cache{{}};
  addDistances(32, content, no_cache);
  ASSERT_EQ(content.distance_grids.size(), 1U);
  EXPECT_LE(content.distance_values.size(), 37U * 37U * 37U);
}

// Steps out of a surface are as long as the surface is far: distances that jumped at an opening would lead past it.
TEST(Distances, DoNotJumpAtOpenings) {
  formats::PackageContent content = cup();
  StageCache no_cache{{}};
  addDistances(24, content, no_cache);
  ASSERT_EQ(content.distance_grids.size(), 1U);
  const formats::DistanceGrid& grid = content.distance_grids[0];
  const std::size_t nodes[] = {grid.nodes[0], grid.nodes[1], grid.nodes[2]};
  const std::size_t steps[] = {1, nodes[0], nodes[0] * nodes[1]};
  ASSERT_EQ(content.distance_values.size(), nodes[0] * nodes[1] * nodes[2]);
  int inside = 0, leave = 0;
  for (std::size_t i = 0; i < content.distance_values.size(); ++i) {
    const float here = grid.unit * float(content.distance_values[i]);
    inside += here < 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (i / steps[axis] % nodes[axis] + 1 == nodes[axis]) continue;
      const float next = grid.unit * float(content.distance_values[i + steps[axis]]);
      EXPECT_LE(std::abs(next - here), grid.spacing + grid.unit) << i << ' ' << axis;
      leave += here < 0 && next >= 0 && axis == 1;
    }
  }
  EXPECT_GT(inside, 24 * 6 * 8);
  EXPECT_GT(leave, 24 * 8 / 2);  // through the opening
}

}  // namespace
}  // namespace sinew::tools

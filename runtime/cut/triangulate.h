// SPDX-License-Identifier: MIT
//
// Triangles of a polygon with holes on a grid of integers: every decision is exact.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace sinew::cutting {

/// A place on the grid: each coordinate 0 .. kGrid.
struct GridPoint {
  std::int64_t x = 0, y = 0;
  bool operator==(const GridPoint&) const = default;
};
inline constexpr std::int64_t kGrid = std::int64_t(1) << 24;

/// Indices of points, counter-clockwise.
using Corners = std::array<std::uint32_t, 3>;

/// Twice the area of a b c: positive where they turn counter-clockwise.
inline std::int64_t turnOf(const GridPoint& a, const GridPoint& b, const GridPoint& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Constrained Delaunay triangulation of what lies to the left of directed edges (Lawson 1977; constraints by flips as
/// in Sloan 1993), all points in it used that lie there.
/// \param points all different. \param edges pairs of points: closed loops that touch in points at most.
/// \param[out] triangles all edges are sides of theirs. \return false where edges cross or points lie on them.
bool triangulate(std::span<const GridPoint> points, std::span<const std::array<std::uint32_t, 2>> edges,
                 std::vector<Corners>& triangles);

/// Triangles whose border is one loop, whatever its shape: ears, the sound ones first. For loops that cross themselves
/// the triangles overlap, but their border is the loop all the same.
/// \param loop points in order; counter-clockwise where `sign` is 1, clockwise where it is -1.
/// \param[out] triangles appended, indices into `points`, turned as the loop.
void clipEars(std::span<const GridPoint> points, std::span<const std::uint32_t> loop, int sign,
              std::vector<Corners>& triangles);

}  // namespace sinew::cutting

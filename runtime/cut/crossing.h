// SPDX-License-Identifier: MIT
//
// The tetrahedra that the plane passes through.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "runtime/cut/section.h"

namespace sinew::cutting {

using Corners4 = std::array<std::uint32_t, 4>;

/// From the last corner to the others, a column each.
template <class Place>
Eigen::Matrix3d edgesOf(const Corners4& corners, const Place& place) {
  Eigen::Matrix3d edges;
  const Vector3d last = place(corners[3]);
  for (int k = 0; k < 3; ++k) edges.col(k) = place(corners[std::size_t(k)]) - last;
  return edges;
}

/// The piece that has a tetrahedron.
std::uint32_t pieceOf(const formats::PackageView& package, std::uint32_t tetrahedron);

/// The tetrahedra that the plane passes through, by where they meet it.
class Crossing {
 public:
  Crossing(const formats::PackageView& package, const Sides& sides);
  ~Crossing();
  Crossing(const Crossing&) = delete;
  Crossing& operator=(const Crossing&) = delete;

  /// Interior at a place of the plane; none where no tetrahedron of the piece, or of any (kNone), has it.
  std::optional<Interior> at(const Vector3d& place, std::uint32_t piece) const;
  /// Where each node hangs.
  std::vector<Hung> hang(const Surface& surface) const;

 private:
  struct Grid;
  const formats::PackageView& package_;
  const Sides& sides_;
  std::unique_ptr<Grid> grid_;
};

}  // namespace sinew::cutting

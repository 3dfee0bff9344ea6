// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "runtime/geometry/tet_mesh.h"
#include "tools/tetrahedralize/pieces.h"

namespace sinew::tools {

/// The face opposite to each corner.
inline constexpr std::array<std::array<std::size_t, 3>, 4> kTetrahedronFaces = {
    {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}}};
inline constexpr std::size_t kFaceSamples = 10;

/// Winding numbers: of solid, and where two solids overlap.
inline constexpr double kSolid = 0.5, kTwice = 1.5;

struct InnerFace {
  std::uint32_t first, second;           ///< tetrahedra
  std::uint8_t first_face, second_face;  ///< of each
};

/// The faces of a lattice, and what of the solid is at their samples: a face is asked from both of its sides, and a
/// winding number costs more than all else about it. May be asked by several threads.
class LatticeFaces {
 public:
  /// \param lattice stays.
  LatticeFaces(const SolidPiece& piece, const geometry::TetMesh& lattice);

  const std::vector<InnerFace>& inner() const { return inner_; }
  /// Samples of a face: the same ones from both sides.
  std::array<Eigen::Vector3d, kFaceSamples> points(std::uint32_t tetrahedron, std::size_t face) const;
  /// Bits of the samples around which the surface winds more than half a time, and `most` times at most.
  std::uint32_t solid(std::uint32_t tetrahedron, std::size_t face, double most,
                      geometry::WindingNumber::Walk& walk) const;

 private:
  static constexpr std::uint32_t kKnown = 1U << 31;
  geometry::Triangle corners(std::uint32_t tetrahedron, std::size_t face) const;

  const SolidPiece& piece_;
  const geometry::TetMesh& lattice_;
  std::vector<InnerFace> inner_;
  std::vector<std::array<std::uint32_t, 4>> number_;         // of the faces of each tetrahedron
  mutable std::vector<std::atomic<std::uint32_t>> answers_;  // of each face; 0 where not asked yet
};

}  // namespace sinew::tools

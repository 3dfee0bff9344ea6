// SPDX-License-Identifier: MIT
//
// The visual triangles, clipped at the plane.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/cut/sides.h"

namespace sinew::cutting {

/// New vertices stay so far from the ends of their edge, of its length: what lies nearer is on the plane.
inline constexpr double kLeastOfEdge = 1e-7;

inline std::uint64_t pairKey(std::uint32_t a, std::uint32_t b) { return std::uint64_t(a) << 32 | b; }

/// Where a material point hangs.
struct Hung {
  std::uint32_t tetrahedron = formats::kNone;
  std::array<double, 3> weight = {};  ///< as formats::BarycentricAttachment
};

/// A point of the surface on the plane: a welded point that lies there (a = b), or where a welded edge crosses it; of a
/// plane that ends also a point within a triangle (c), or of its end within the body (a is none).
struct Node {
  std::uint32_t a = 0, b = 0;  ///< visual vertices
  double t = 0;                ///< from a to b, 0..1
  Vector3d rest, at;           ///< m, at rest; m, world
  std::uint32_t c = formats::kNone;
  double s = 0;      ///< from a to c, 0..1
  bool tip = false;  ///< the plane ends here: both sides share it
  Hung hung = {};    ///< where a is none
};

/// A visual vertex that the cut makes, at a node: on the edge from a to b. One for each pair, so that it is shared
/// where a and b are, and split where they are (seams, sharp edges).
struct NewVertex {
  std::uint32_t a = 0, b = 0;  ///< visual vertices
  double t = 0;
  std::uint32_t node = 0;
  std::uint32_t c = formats::kNone;  ///< as of its node
  double s = 0;
};

/// Remnant of a triangle. Corners from the number of visual vertices on are new ones, of the fragment's side.
struct Fragment {
  std::array<std::uint32_t, 3> corner;
  std::uint32_t triangle = 0;
  Side side = 0;
};

struct Surface {
  std::vector<Node> nodes;
  std::vector<NewVertex> vertices;
  std::vector<Fragment> fragments;  ///< in the order of their triangles
  /// Pairs of nodes: where the surface below ends at the plane, turned so that what closes it lies to the left, seen
  /// from above. The surface above ends there the other way round.
  std::vector<std::array<std::uint32_t, 2>> rim;
  /// Other edges of the surface that lie in the plane: pairs of nodes, the lower first, ascending. The section
  /// must not have them again, or four triangles would share an edge.
  std::vector<std::array<std::uint32_t, 2>> touching;
  std::vector<std::array<Vector2d, 2>> whole_rim;  ///< of a plane that ends: all that it meets, also beyond its end
};

/// Leaves of directed edges what does not run both ways, in the order of their pairs.
void cancelOpposite(std::vector<std::array<std::uint32_t, 2>>& edges);

/// A triangle that lies in the plane goes to the side on which what it bounds is: below where its front looks up.
Surface clipSurface(const formats::PackageView& package, const Sides& sides);

}  // namespace sinew::cutting

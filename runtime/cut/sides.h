// SPDX-License-Identifier: MIT
//
// Where everything of a body lies against the plane, and which parts that makes of its physical mesh.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "sinew/formats/package.h"
#include "sinew/runtime/cut.h"

namespace sinew::cutting {

using Eigen::Vector3d;

inline Vector3d asVector(const std::array<float, 3>& v) { return {double(v[0]), double(v[1]), double(v[2])}; }
inline std::array<float, 3> asFloats(const Vector3d& v) { return {float(v[0]), float(v[1]), float(v[2])}; }

/// Against the plane: below -1, on it 0, above 1.
using Side = std::int8_t;
inline constexpr std::array<Side, 2> kSides = {-1, 1};
/// 0 of below, 1 of above.
inline std::size_t placeOf(Side side) { return side > 0 ? 1 : 0; }

using Eigen::Vector2d;

/// A convex quadrilateral, counter-clockwise.
using Outline = std::array<Vector2d, 4>;

/// The plane, with axes in it: right-handed, `normal` points above.
struct PlaneFrame {
  Vector3d point, normal, right, up;
  std::optional<Outline> outline;  ///< where it ends, along `right` and `up`, m

  Vector2d flat(const Vector3d& at) const { return {(at - point).dot(right), (at - point).dot(up)}; }
  Vector3d lifted(const Vector2d& p) const { return point + p[0] * right + p[1] * up; }
};
/// \return nothing where corners are of no convex quadrilateral.
std::optional<PlaneFrame> frameOf(const CutPlane& plane);
/// Strictly within.
bool isWithin(const Outline& outline, const Vector2d& p);

/// A body as it is when it is cut. Against a plane that ends nothing is on it: what lies there counts as just above.
struct Sides {
  PlaneFrame plane;
  double near = 0;                    ///< m: what is nearer to the plane is on it
  std::vector<Vector3d> at;           ///< of physical vertices, m, world
  std::vector<double> height;         ///< over the plane, m; 0 of what is on it
  std::vector<Side> side;             ///< of them
  std::vector<Vector3d> visual_at;    ///< of visual vertices
  std::vector<double> visual_height;  ///< alike where vertices are welded
  std::vector<Side> visual_side;
  std::vector<std::uint32_t> weld;   ///< of visual vertices: point that vertices of one place share
  std::vector<std::uint32_t> face;   ///< of points: the first visual vertex
  std::vector<std::uint32_t> rider;  ///< of physical vertices: the rigid accessory (PART) that they carry; else none
  std::vector<std::uint32_t> visual_rider;

  /// Over the plane, m. A vertex gone to the other side with too small a part counts as just there.
  double heightOf(std::uint32_t vertex) const {
    return height[vertex] * side[vertex] < 0 ? side[vertex] * near : height[vertex];
  }
};

/// \param positions of the physical vertices, world.
Sides findSides(const formats::PackageView& package, std::span<const Vec3> positions, const PlaneFrame& plane);

/// Fractions of a tetrahedron above and below a plane: parts of its volume, and of that the mean barycentric
/// coordinates, multiplied. They sum to 1/4 for each corner.
struct Fraction {
  std::array<double, 2> volume = {};                  ///< below, above
  std::array<std::array<double, 4>, 2> moments = {};  ///< below, above: volume times the fragment's centre
};
/// \param height of the corners.
Fraction fractionOf(const std::array<double, 4>& height, const std::array<Side, 4>& side);

}  // namespace sinew::cutting

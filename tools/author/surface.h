// SPDX-License-Identifier: GPL-3.0-or-later
//
// Distances along a surface, and its plane of symmetry. Works on welded points, so seams do not count as edges.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "runtime/geometry/triangle_bvh.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

struct SurfacePoint {
  std::uint32_t triangle = kNoIndex;  ///< of VisualMesh::triangles
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double distance = 0;  ///< metres from what was asked for
};

struct MirrorPlane {
  Eigen::Vector3d point;   ///< metres
  Eigen::Vector3d normal;  ///< unit
  /// Root mean square distance of the mirrored points from the surface, of the diagonal.
  double error = 0;
};

/// What distances spread from: places, whose fronts are round, or lines, whose fronts are straight.
enum class Front { point, line };

/// The welded surface of a mesh, which must outlive it.
class Surface {
 public:
  explicit Surface(const VisualMesh& mesh);

  /// Geodesic distance from given points at given start distances to every welded point, by fast marching: from its two
  /// known corners a triangle infers the point that they see (Front::point; exact on flat pieces from a vertex) or the
  /// straight front that has passed them (Front::line; Kimmel and Sethian 1998). On finely divided curved surfaces
  /// about 2 % off at most. Infinite where no path leads. \param start start distances by welded point, infinite where
  /// there is none; m.
  std::vector<double> distances(std::vector<double> start, Front front = Front::point) const;
  /// The same from a place on the surface, up to `radius` (beyond: infinite).
  std::vector<double> distancesFrom(std::span<const SurfacePoint> places) const;
  /// Signed distance to the line where `weight` (per welded point) crosses one half, negative where it is larger.
  /// Infinite where there is none in the same part.
  std::vector<double> signedDistances(std::span<const double> weight) const;

  SurfacePoint nearest(const Eigen::Vector3d& place) const;
  /// Weight (per welded point) at a place of the surface.
  double interpolate(const SurfacePoint& at, std::span<const double> weight) const;
  Eigen::Vector3d normal(std::uint32_t triangle) const;

  /// The plane that maps the surface onto itself best: starts from the three axes and the principal axes, refines by
  /// matching each mirrored point with the nearest surface point. nullopt where the best one's error is above 0.03.
  std::optional<MirrorPlane> symmetryPlane() const;
  /// Error of a given plane.
  double mirrorError(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const;

 private:
  const VisualMesh& mesh_;
  std::vector<Triangle> triangles_;   // welded
  std::vector<std::uint32_t> first_;  // triangles of each welded point
  std::vector<std::uint32_t> around_;
  geometry::TriangleBvh tree_;
};

/// Mirror image of a point.
Eigen::Vector3d mirrored(const Eigen::Vector3d& x, const Eigen::Vector3d& point, const Eigen::Vector3d& normal);

}  // namespace sinew::tools

// SPDX-License-Identifier: GPL-3.0-or-later
//
// Distances along a surface, and its plane of symmetry. Works on welded points, so seams do not count as edges.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "runtime/geometry/triangle_bvh.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// How far away is what is not reached.
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct SurfacePoint {
  std::uint32_t triangle = formats::kNone;  ///< of VisualMesh::triangles
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double distance = 0;  ///< metres from what was asked for
};

struct MirrorPlane {
  Eigen::Vector3d point;   ///< metres
  Eigen::Vector3d normal;  ///< unit
  /// Root mean square distance of the mirrored points from the surface, of the diagonal.
  double error = 0;
};

/// Sources of distances: places, whose fronts are round, or lines, whose fronts are straight.
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
  /// The nearest triangle on a ray, from either side; its distance is along the ray. Nothing where it meets none. Below
  /// 0.1 ms for 400,000 triangles. \param direction unit
  SurfacePoint along(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;
  /// Corner of its triangle (welded point) that is nearest to a place of the surface.
  std::uint32_t nearestCorner(const SurfacePoint& at) const;
  /// Welded points from one place to another, along edges by the shortest way that distances() knows; both ends
  /// included, as places. Empty where no path leads.
  std::vector<Eigen::Vector3d> path(const SurfacePoint& from, const SurfacePoint& to) const;
  /// Weight (per welded point) at a place of the surface.
  double interpolate(const SurfacePoint& at, std::span<const double> weight) const;
  Eigen::Vector3d normal(std::uint32_t triangle) const;
  /// Of welded points, by area; unit, or zero where no triangle has an area.
  std::vector<Eigen::Vector3d> pointNormals() const;
  const VisualMesh& mesh() const { return mesh_; }

  /// The plane that maps the surface onto itself best: starts from the three axes and the principal axes, refines by
  /// matching each mirrored point with the nearest surface point. nullopt where the best one's error is above 0.03.
  std::optional<MirrorPlane> symmetryPlane() const;
  /// Error of a given plane.
  double mirrorError(const Eigen::Vector3d& point, const Eigen::Vector3d& normal) const;

 private:
  friend class SurfaceFront;
  const VisualMesh& mesh_;
  std::vector<Triangle> triangles_;   // welded
  std::vector<std::uint32_t> first_;  // triangles of each welded point
  std::vector<std::uint32_t> around_;
  geometry::TriangleBvh tree_;
};

/// Distances from places that come one after the other, for a brush: each costs only what it changes, and the work can
/// be spread over frames. As Surface::distances() (Front::point), but a point that is done may come nearer still.
class SurfaceFront {
 public:
  /// \param surface must outlive it
  explicit SurfaceFront(const Surface& surface);

  /// Forgets all places. Costs what was reached.
  void clear();
  /// Lets distances spread from a place too. \param from m, the distance there. \param limit m; what is farther is
  /// never reached
  void add(const SurfacePoint& place, double from, double limit);
  /// Spreads on. \param most points that are looked at. \return whether all is done
  bool spread(std::size_t most);

  /// By welded point, m; infinite where not reached.
  const std::vector<double>& distances() const { return distance_; }
  /// Welded points that were reached since clear(), in that order.
  const std::vector<std::uint32_t>& reached() const { return reached_; }
  /// Those that have come nearer since takeChanged() was last called; each may occur several times.
  std::vector<std::uint32_t> takeChanged();

 private:
  void offer(std::uint32_t point, double distance);

  const Surface& surface_;
  std::vector<double> distance_;
  std::vector<std::uint32_t> reached_, changed_;
  std::vector<std::pair<double, std::uint32_t>> queue_;  // a heap, the nearest first
  double limit_ = 0;
};

/// Mirror image of a point.
Eigen::Vector3d mirrored(const Eigen::Vector3d& x, const Eigen::Vector3d& point, const Eigen::Vector3d& normal);

}  // namespace sinew::tools

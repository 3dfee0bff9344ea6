// SPDX-License-Identifier: MIT
//
// Places of a piece at rest: their depth under its drawn surface, and their tetrahedron. Touches are looked up at rest,
// so that depth and direction do not depend on how the piece is bent (docs/method.md §4).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>

#include "runtime/memory/array.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

/// A material point: vertices of its tetrahedron and their weights, which add up to 1; negative ones outside.
struct MaterialPoint {
  std::array<std::uint32_t, 4> vertex;
  std::array<float, 4> weight;
  std::uint32_t tetrahedron = formats::kNone;  ///< of its DepthMap, where that found it
};

/// One piece's distances (DIST), tetrahedra (TETS) and contact points (FPNT).
class DepthMap {
 public:
  DepthMap() = default;
  explicit DepthMap(const formats::PackageView& package, const formats::DistanceGrid& grid);

  /// Distance to the drawn surface, metres, negative inside; beyond the grid at least that to the grid.
  float distance(const Eigen::Vector3f& place) const;
  /// Unit way along which distances grow, or 0 where they do not: differences across nodes, interpolated like the
  /// distances, so that the way is continuous in the place.
  Eigen::Vector3f outward(const Eigen::Vector3f& place) const;
  /// outward() at a contact point of one of the piece's fields. \pre the package's own record
  const Eigen::Vector3f& pointNormal(const formats::FieldPoint& point) const {
    return point_normals_[std::size_t(&point - first_point_)];
  }
  /// The tetrahedron that has a place, or of those near it the one that it is least outside of. \param[in,out] at that
  /// of a place near by is looked at first. \return false where none is near.
  bool locate(const Eigen::Vector3f& place, MaterialPoint& at) const;

  /// Inverse of the sides of a tetrahedron, from its last corner to the others. \pre it was located
  const Eigen::Matrix3f& restSidesInverse(const MaterialPoint& at) const { return frames_[at.tetrahedron].inverse; }

  /// How far the surface at rest bulges beyond the contact points around each of its places, metres: a box around the
  /// points has to grow by so much to hold it.
  float bulge() const { return bulge_; }
  std::uint32_t piece() const { return grid_->piece; }
  /// Thinner parts may not be seen, metres.
  float spacing() const { return grid_->spacing; }

 private:
  /// Where in the grid a place is: the lowest node of its cell, its parts of the way to the next ones, and how far
  /// beyond the grid it lies, nodes.
  struct GridPlace {
    const std::int16_t* value;  ///< of the node
    Eigen::Vector3f part, beyond;
    bool is_inner;  ///< the cell has neighbours on all sides
  };
  GridPlace gridPlace(const Eigen::Vector3f& place) const;
  std::uint32_t cellOf(const Eigen::Vector3f& place) const;
  void findBulge(std::span<const formats::FieldPoint> points);

  const formats::PackageView* package_ = nullptr;
  const formats::DistanceGrid* grid_ = nullptr;
  std::span<const std::int16_t> values_;
  float nodes_a_metre_ = 0;
  std::array<float, 3> last_node_ = {};
  std::array<std::size_t, 3> apart_ = {};  ///< values to the next node along each axis
  // A regular grid over the tetrahedra: those of cell i are list_[first_[i] .. first_[i + 1]).
  Eigen::Vector3f low_ = Eigen::Vector3f::Zero();
  float cell_ = 1;
  std::array<std::uint32_t, 3> cells_ = {1, 1, 1};
  Array<std::uint32_t> first_, list_;
  std::uint32_t first_tetrahedron_ = 0;
  const formats::FieldPoint* first_point_ = nullptr;  ///< of the free field; the held one's follow
  Array<Eigen::Vector3f> point_normals_;
  float bulge_ = 0;
  struct Frame {
    Eigen::Matrix3f inverse;  ///< of the sides from the last corner
    Eigen::Vector3f last;
  };
  Array<Frame> frames_;  ///< of each tetrahedron
};

}  // namespace sinew::internal

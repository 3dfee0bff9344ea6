// SPDX-License-Identifier: MIT
//
// Shapes of colliders in their own coordinates: distances, paths, bounds. Exact but for rounding.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <memory_resource>

#include "runtime/memory/array.h"
#include "sinew/runtime/collider.h"

namespace sinew::internal {

using Vector3d = Eigen::Vector3d;

/// The place of a surface that is nearest to a point p: it lies at p - distance normal.
struct NearPlace {
  double distance;  ///< m, negative inside
  Vector3d normal;  ///< unit, the way out
};

/// Where a path meets a surface from outside.
struct PathHit {
  double part;      ///< of the path, 0..1
  Vector3d normal;  ///< unit, of the surface there
};

/// Corners of a triangle, counter-clockwise from outside.
struct Corners {
  Vector3d at[3];
};

/// Part of the path from `from` along `way` at which it goes through a triangle from the front; infinity where it does
/// not. No path leaks through where two triangles meet.
double entryOf(const Vector3d& from, const Vector3d& way, const Corners& triangle);

class Shape {
 public:
  /// Why a shape cannot be made; null if it can.
  static const char* faultOf(const ColliderShape& shape);
  /// \pre faultOf() is null. May throw std::bad_alloc.
  Shape(const ColliderShape& shape, std::pmr::memory_resource* memory);

  /// Its source: makes it again, bit for bit. \pre outlived by the shape.
  ColliderShape source() const;

  /// Whether it has an inside: all but meshes with a border.
  bool isSolid() const { return solid_; }
  bool isConvex() const { return convex_; }
  /// Infinite for a plane.
  const Eigen::AlignedBox3d& bounds() const { return bounds_; }

  /// \param reach how far a mesh's surface is looked for, m; beyond it the distance is infinity. Nothing lies behind a
  /// sheet but what is nearest to a place within its border.
  NearPlace near(const Vector3d& p, double reach) const;
  /// Whether a path crosses the surface from outside, and where it does first.
  bool enters(const Vector3d& from, const Vector3d& to, PathHit& hit) const;

  bool isBox() const { return kind_ == Kind::box; }
  bool isPlane() const { return kind_ == Kind::plane; }
  /// Half of a box's sides, and of a capsule's segment; a plane's normal. The capsule's radius; a plane's offset.
  const Vector3d& half() const { return size_; }
  double radius() const { return radius_; }
  bool hasTriangles() const { return kind_ >= Kind::mesh; }
  bool isHeightField() const { return kind_ == Kind::grid; }
  /// Side of a height field's cells, m.
  double cell() const { return size_.x(); }
  /// Calls visit(Corners, triangle) for the triangles of a hull, mesh or height field whose boxes meet a box.
  template <class Visit>
  void forEachTriangle(const Eigen::AlignedBox3d& box, const Visit& visit) const {
    if (kind_ == Kind::grid) {
      forEachCell(box, [&](std::uint32_t cell) {
        visit(cornersOf(2 * cell), 2 * cell);
        visit(cornersOf(2 * cell + 1), 2 * cell + 1);
      });
      return;
    }
    const Eigen::AlignedBox3f wanted(box.min().cast<float>().array() - slack_,
                                     box.max().cast<float>().array() + slack_);
    descend([&](const Node& node) { return boxOf(node).intersects(wanted); },
            [&](std::uint32_t triangle) { visit(cornersOf(triangle), triangle); });
  }
  /// Calls visit(Corners, triangle, edge) for the convex edges of these triangles across which the surface turns by
  /// more, tan(turn / 2) > least; edges from a corner to the next, in the first of their two triangles.
  template <class Visit>
  void forEachRidge(const Eigen::AlignedBox3d& box, double least, const Visit& visit) const {
    const auto look = [&](std::uint32_t triangle) {
      for (std::uint32_t edge = 0; edge < 3; ++edge) {
        const double turn = kind_ == Kind::grid ? ridgeOf(triangle, edge) : double(ridges_[triangle][edge]);
        if (turn > least) visit(cornersOf(triangle), triangle, edge);
      }
    };
    if (kind_ == Kind::grid) {
      if (steepest_ > least) forEachCell(box, [&](std::uint32_t cell) { look(2 * cell), look(2 * cell + 1); });
      return;
    }
    const Eigen::AlignedBox3f wanted(box.min().cast<float>().array() - slack_,
                                     box.max().cast<float>().array() + slack_);
    descend([&](const Node& node) { return double(node.ridge) > least && boxOf(node).intersects(wanted); }, look);
  }

 private:
  enum class Kind : std::uint8_t {
    plane,
    round,
    box,
    mesh,
    grid
  };  // round: a capsule, or a sphere, which has no length
  struct Node {
    Eigen::Vector3f low, high;   // corners of its box
    std::uint32_t first, count;  // run of triangles below it
    std::uint32_t right;         // 0 for a leaf; the left child is the next node
    float ridge;                 // of those triangles, at most
  };

  static Eigen::AlignedBox3f boxOf(const Node& node) { return {node.low, node.high}; }
  void makeMesh(std::span<const Vec3> positions);
  void makeTree();
  void findNeighbours();
  Corners cornersOf(std::uint32_t triangle) const;
  std::uint32_t neighbourOf(std::uint32_t triangle, std::uint32_t edge) const;
  double ridgeOf(std::uint32_t triangle, std::uint32_t edge) const;
  void findRidges();
  Vector3d pseudoNormal(std::uint32_t triangle, std::uint32_t part, bool& border) const;
  NearPlace nearTriangles(const Vector3d& p, double reach) const;
  bool isBelow(const Vector3d& p, double& depth) const;

  template <class Visit>
  void forEachCell(const Eigen::AlignedBox3d& box, const Visit& visit) const {
    const auto place = [](double x, double least, double most) { return std::uint32_t(std::clamp(x, least, most)); };
    const double cell = size_.x();
    if (box.max().x() < 0 || box.max().z() < 0 || box.min().x() > bounds_.max().x() ||
        box.min().z() > bounds_.max().z()) {
      return;
    }
    const std::uint32_t first = place(box.min().x() / cell, 0, columns_ - 2),
                        last_row = place(box.max().z() / cell, 0, rows_ - 2);
    const std::uint32_t last = place(box.max().x() / cell, 0, columns_ - 2);
    for (std::uint32_t row = place(box.min().z() / cell, 0, rows_ - 2); row <= last_row; ++row) {
      for (std::uint32_t column = first; column <= last; ++column) visit(row * (columns_ - 1) + column);
    }
  }
  template <class Enter, class Visit>
  void descend(const Enter& enter, const Visit& visit) const {
    std::uint32_t stack[kDeepest], depth = 0;
    if (!nodes_.empty()) stack[depth++] = 0;
    while (depth > 0) {
      const std::uint32_t index = stack[--depth];
      const Node& node = nodes_[index];
      if (!enter(node)) continue;
      if (node.right == 0) {
        for (std::uint32_t t = node.first; t < node.first + node.count; ++t) visit(t);
      } else {
        stack[depth++] = node.right;
        stack[depth++] = index + 1;
      }
    }
  }

  /// The same of those whose boxes lie within a squared distance of a place, the nearer half first. `visit` may lower
  /// it.
  template <class Visit>
  void descendNear(const Vector3d& place, const double& bound2, const Visit& visit) const {
    const Eigen::Vector3f p = place.cast<float>();
    struct Waiting {
      std::uint32_t node;
      float distance2;
    };
    const auto waiting = [&](std::uint32_t node) {
      return Waiting{node, boxOf(nodes_[node]).squaredExteriorDistance(p)};
    };
    Waiting stack[kDeepest];
    std::uint32_t depth = 0;
    if (!nodes_.empty()) stack[depth++] = waiting(0);
    while (depth > 0) {
      const Waiting next = stack[--depth];
      const double room = double(slack_) * (double(slack_) + 2 * std::sqrt(bound2));
      if (double(next.distance2) * (1 - 1e-6) > bound2 + room) continue;
      const Node& node = nodes_[next.node];
      if (node.right == 0) {
        for (std::uint32_t t = node.first; t < node.first + node.count; ++t) visit(t);
        continue;
      }
      const Waiting left = waiting(next.node + 1), right = waiting(node.right);
      const bool left_first = left.distance2 <= right.distance2;
      stack[depth++] = left_first ? right : left;
      stack[depth++] = left_first ? left : right;
    }
  }

  // Halves of at most 2^24 triangles, one waiting on each level.
  static constexpr std::uint32_t kDeepest = 64;

  Kind kind_ = Kind::plane;
  bool solid_ = true, convex_ = false;
  double radius_ = 0;  ///< of a capsule; a plane's offset
  Vector3d size_ =
      Vector3d::Zero();  ///< half of a box's sides and of a capsule's segment; a plane's normal; a cell's side
  float slack_ = 0;      ///< what floats round of the boxes, m
  std::uint32_t columns_ = 0, rows_ = 0;
  Eigen::AlignedBox3d bounds_;
  Array<float> heights_;
  Array<Vec3> positions_;                // welded where they are the same
  Array<formats::Triangle> triangles_;   // in the tree's order
  Array<formats::Triangle> neighbours_;  // the triangle behind the edge from each corner to the next; kNone at a border
  Array<Node> nodes_;
  Array<std::array<float, 3>>
      ridges_;           // tan(turn / 2) of a mesh's convex edges, in the first of their triangles; else 0
  double steepest_ = 0;  ///< slope of a height field: no edge of it turns by more
};

}  // namespace sinew::internal
